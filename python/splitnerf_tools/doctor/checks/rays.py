"""Checks of marching, NeuS weights and compositing."""

from __future__ import annotations

import math

import torch

from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, axis, check, pattern

SHARPNESS = 8.0


def offsets() -> torch.Tensor:
    """Two rays of 16 and 22 samples, and one without between them."""
    return torch.tensor([0, 16, 16, N])


def plane() -> tuple[torch.Tensor, torch.Tensor]:
    """Distances at both ends of the samples of rays that cross a flat surface at a right angle."""
    ahead = torch.cat([0.8 - 0.1 * torch.arange(16), 1.0 - 0.1 * torch.arange(22)])
    return ahead, ahead - 0.1


def plane_weights() -> tuple[torch.Tensor, torch.Tensor]:
    """Weights and opacities, (Phi(f_prev) - Phi(f_next)) / Phi(f_0) with Phi(f) = sigmoid(s f), as sums telescope."""
    ahead, behind = (torch.sigmoid(SHARPNESS * f.double()) for f in plane())
    first = torch.cat([ahead[:1].expand(16), ahead[16:17].expand(22)])
    weights = (ahead - behind) / first
    return weights, torch.stack([weights[:16].sum(), torch.zeros(()).double(), weights[16:].sum()])


def plane_inputs() -> tuple:
    return *plane(), torch.tensor(SHARPNESS), offsets(), 0.0


@check
def neus_weights():
    """A flat surface, where the products of transmittances telescope."""
    yield from zip(lib.neus_weights(*plane_inputs()), plane_weights())


def surface_inputs(gradient: torch.Tensor) -> tuple:
    numbers = torch.tensor(SHARPNESS), offsets(), torch.tensor(0.1), torch.tensor(1.0)
    return plane()[0] - 0.05, gradient, axis(0.0, 0.0, -1.0, 3), *numbers, 0.0


@check
def surface_weights():
    """The same flat surface, given by the distances at the samples' midpoints."""
    normals, *rest = lib.surface_weights(*surface_inputs(axis(0.0, 0.0, 2.0)))
    yield normals, axis(0.0, 0.0, 1.0)
    yield from zip(rest, plane_weights())


@check
def sharpness():
    """exp(10 v) of v from 0.05 to 0.85, and the bounds 1 and e^9."""
    v = torch.linspace(0.05, 0.85, N)
    yield lib.sharpness(v), torch.exp(10 * v)
    yield lib.sharpness(torch.tensor([-1.0, 2.0])), torch.tensor([1.0, math.exp(9.0)])


@check
def composite():
    """Sums of half of 0 ... 15, of nothing, and of half of 16 ... 37; and divided by opacities, the last one too small."""
    values = torch.arange(float(N))[:, None] * torch.tensor([1.0, 2.0, 3.0])
    sums = torch.tensor([60.0, 0.0, 291.5])[:, None] * torch.tensor([1.0, 2.0, 3.0])
    inputs = torch.full((N,), 0.5), values, offsets()
    yield lib.composite(*inputs), sums
    means = sums / torch.tensor([0.8, 0.8, 0.5])[:, None]
    yield lib.composite(*inputs, torch.tensor([0.8, 0.8, 0.1]), 0.5), means


@check
def draw_rays():
    """A ray to each pixel of one row of a photo, by a camera whose directions are the image points; half of them listed."""
    listed = torch.tensor([N // 2]), torch.tensor([0]), N // 2
    rest = torch.tensor([N - N // 2]), torch.tensor([N // 2]), N - N // 2
    camera = torch.eye(3)[None], torch.tensor([[1.0, 2.0, 3.0]])
    rays_o, rays_d, view, index = lib.draw_rays(torch.full((N,), 0.5), N // 2, *listed, *rest, *camera, 1, N)
    points = torch.stack([torch.arange(N) + 0.5, torch.full((N,), 0.5), torch.ones(N)], 1)
    yield rays_o, camera[1].expand(N, 3)
    yield rays_d, points / points.norm(dim=1, keepdim=True)
    yield view, torch.zeros(N, dtype=torch.int64)
    yield index, torch.arange(N)


@check
def read_pixels():
    """Bytes of one value a pixel, of two photos in turn; every pixel from the fifth on has a colour of its own behind it."""
    codes, view = torch.arange(N, dtype=torch.uint8)[:, None].repeat(1, 4), torch.arange(N) % 2
    edges = torch.tensor([4]), torch.tensor([N]), torch.tensor([-4]), (codes[4:, :3] + 100).contiguous()
    exposures = torch.tensor([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    values = torch.arange(float(N))[:, None]
    pixels, exposure, behind, whole = lib.read_pixels(codes, torch.arange(N), view, exposures, torch.ones(N, 3), *edges)
    yield pixels, values.repeat(1, 4) / 255
    yield exposure, exposures[view]
    yield behind, torch.where(values < 4, 1.0, (values + 100) / 255).repeat(1, 3)
    yield whole, values[:, 0] >= 4


@check
def probe_points():
    """A point in the middle of each part of the cube's diagonal; vectors as long as ln 16 makes them, in four directions."""
    shares = (torch.arange(float(N)) + 0.5) / N
    turns = torch.arange(4) / 4
    numbers = torch.stack([torch.full((4,), 0.75), turns, torch.full((4,), 0.75), turns], 1)
    anywhere, shifts = lib.probe_points(torch.cat([shares.repeat_interleave(3), numbers.flatten()]), N, 2.0, 0.5)
    yield anywhere, (4 * shares - 2)[:, None].repeat(1, 3)
    unit = torch.tensor([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, -1.0], [0.0, -1.0, 0.0]])
    yield shifts, 0.5 * math.log(16.0) ** 0.5 * unit


@check
def place_samples():
    """Samples from 0 to 2 along the axes x and y, the first of them again, and points above the second."""
    rays_d = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).repeat(N // 2, 1)
    ends = torch.zeros(N), torch.full((N,), 2.0)
    above, beside = torch.tensor([[0.0, 0.0, 1.0]]).repeat(4, 1), torch.full((4,), 1.5 / N)
    placed = lib.place_samples(torch.zeros(N, 3), rays_d, torch.arange(N), *ends, torch.arange(N + 1), above, beside, above, N + 1)
    yield placed[0], torch.cat([rays_d, rays_d[:1], above, above + rays_d[1]])
    yield placed[1], torch.cat([rays_d, torch.zeros(1, 3)])
    yield placed[2], torch.ones(4, dtype=torch.int64)


@check
def take_rows():
    """Rows of two arrays from the last to the first, the first row of each three times."""
    index = torch.cat([torch.arange(N - 1, -1, -1), torch.zeros(2, dtype=torch.int64)])
    numbers = torch.arange(float(N))[:, None]
    taken = lib.take_rows([numbers * torch.tensor([1.0, 10.0]), numbers + 0.5], index)
    yield torch.cat(list(taken), dim=1), index[:, None] * torch.tensor([1.0, 10.0, 1.0]) + torch.tensor([0.0, 0.0, 0.5])


@check
def put_rows():
    """Every second number once and the first three times more, in arrays of different lengths."""
    index = torch.cat([torch.arange(0, N, 2), torch.zeros(3, dtype=torch.int64)])
    sums = lib.put_rows([torch.ones(len(index), 2), torch.full((len(index), 1), 3.0)], index, [N, N + 5])
    counts = torch.zeros(N + 5, 1)
    counts[0:N:2], counts[0] = 1.0, 4.0
    yield torch.cat([sums[0].flatten(), sums[1].flatten()]), torch.cat([counts[:N].expand(N, 2).flatten(), 3 * counts[:, 0]])


@check
def march_rays():
    """Rays through a box whose first third is empty, the second occupied and the last opaque: ten samples each."""
    rays_o = torch.cat([torch.full((N, 1), -3.0), pattern(N, 2) - 1], 1)
    cells = torch.zeros(3, 3, 3, dtype=torch.uint8)
    cells[1], cells[2] = 1, 2
    rays, starts, ends, of_rays = lib.march_rays(rays_o, axis(1.0, 0.0, 0.0), torch.zeros(N), cells, 1.5, 0.1, 64)
    yield rays, torch.arange(N).repeat_interleave(10)
    yield starts, (2.5 + 0.1 * torch.arange(10)).repeat(N)
    yield ends, (2.6 + 0.1 * torch.arange(10)).repeat(N)
    yield of_rays, 10 * torch.arange(N + 1)


@check
def spread_samples():
    """Rays of four samples with weights 2, 0, 0, 1 at 0, 1, 2, 4, and two marks: the outer ones are drawn."""
    weights, t = torch.tensor([2.0, 0.0, 0.0, 1.0]).repeat(N), torch.tensor([0.0, 1.0, 2.0, 4.0]).repeat(N)
    drawn = lib.spread_samples(weights, t, 4 * torch.arange(N + 1), torch.full((N,), 0.5), 10.0, 2)
    rays = torch.arange(N)[:, None]
    known = (
        4 * rays + torch.tensor([0, 3]), 2 * rays + torch.tensor([0, 0, 0, 1]), 2 * rays + torch.tensor([0, 1, 1, 1]),
        torch.tensor([0.0, 0.25, 0.5, 0.0]).repeat(N), 2 * rays, 2 * rays, rays.repeat(1, 2),
        torch.tensor([2 * N, N, N]),
    )  # fmt: skip
    yield from ((found, expected.flatten()) for found, expected in zip(drawn, known))


def between() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    first = torch.arange(N) % 4
    return first, first + 1, pattern(N) - 0.5


@check
def interpolate():
    """Values that grow evenly from row to row."""
    first, second, share = between()
    slope = torch.tensor([1.0, 2.0, 3.0])
    yield lib.interpolate(torch.arange(5.0)[:, None] * slope, first, second, share), (first + share)[:, None] * slope
