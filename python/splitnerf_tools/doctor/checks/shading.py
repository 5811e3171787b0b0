"""Checks of shading: the sRGB curve, the split sum, and sums over directions."""

from __future__ import annotations

import math

import torch

from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, axis, check, column, lut, pattern, sphere

LINEAR, SRGB = (0.001, 0.2140411, 1.0), (0.01292, 0.5, 1.0)  # the same colours


@check
def srgb_to_linear():
    """The curve of IEC 61966-2-1 at three points."""
    yield lib.srgb_to_linear(torch.tensor(SRGB).repeat(N)), torch.tensor(LINEAR).repeat(N)


@check
def linear_to_srgb():
    """The curve of IEC 61966-2-1 at three points."""
    yield lib.linear_to_srgb(torch.tensor(LINEAR).repeat(N)), torch.tensor(SRGB).repeat(N)


def up() -> torch.Tensor:
    return axis(0.0, 0.0, 1.0)


def views() -> torch.Tensor:
    """Directions above the horizon of :func:`up`."""
    return sphere(2 * N)[:N]


@check
def query_direction():
    """Below a roughness of 0.3 it is the mirror direction."""
    yield lib.query_direction(up(), views(), column(0.2), lut(), True), views() * torch.tensor([-1.0, -1.0, 1.0])


@check
def light_queries():
    """The mirror directions, then the normals turned to the viewer, who stands below every second one."""
    side = 1.0 - 2.0 * (torch.arange(N)[:, None] % 2)
    directions, asked = lib.light_queries(side * up(), views(), column(0.2), lut(), True)
    yield directions, torch.cat([views() * torch.tensor([-1.0, -1.0, 1.0]), up()])
    yield asked, torch.cat([column(0.2), column(1.0)])


@check
def split_sum_shade():
    """A white furnace: white of any roughness and metallic under white light is white."""
    white, even = torch.ones(N, 3), torch.linspace(0, 1, N)[:, None]
    yield lib.split_sum_shade(up(), views(), white, even, even, white, white, white, white, lut(), 0, True, None, None), white


N_DOT_V = (16 / 31) ** 2  # at a column of the split sum's table


def slanted() -> torch.Tensor:
    return axis((1 - N_DOT_V**2) ** 0.5, 0.0, N_DOT_V)


def furnace_sums() -> torch.Tensor:
    """The four integrals of white light at roughness 1 from the view :func:`slanted`, by the split sum's table."""
    f1, f2, _, dielectric = lut()[-1, 16]
    return torch.stack([f1 + f2, f2, torch.ones(()), dielectric])


@check
def shade_sums():
    """A white furnace: white of any metallic under white light is white."""
    sums = furnace_sums()[None, :, None].repeat(N, 1, 3)
    metallic = torch.linspace(0, 1, N)[:, None]
    yield lib.shade_sums(up(), slanted(), torch.ones(N, 3), column(1.0), metallic, sums, lut(), True, None, None), torch.ones(N, 3)


@check
def material_network():
    """Two rectified units whose sum is |x|, and sigmoids of multiples of it; the roughness above .2."""
    x = torch.linspace(-2, 2, N)[:, None]
    weights = [torch.tensor([[1.0], [-1.0]]), torch.arange(5.0)[:, None].repeat(1, 2)]
    albedo, roughness, metallic = lib.material_network([x], weights, [torch.zeros(2), torch.full((5,), -1.0)], 0.2)
    share = 1 / (1 + torch.exp(1 - x.abs() * torch.arange(5.0)))
    yield albedo, share[:, :3]
    yield roughness, 0.2 + 0.8 * share[:, 3:4]
    yield metallic, share[:, 4:]


@check
def wide_lobes():
    """t^2 (3 - 2 t) from a roughness of .25 to .75, but for the last point, which does not count."""
    at, share = lib.wide_lobes(torch.arange(N), torch.linspace(0, 1, N)[:, None], 0.25, 0.75, torch.tensor(N - 1))
    t = (2 * torch.linspace(0, 1, N) - 0.5).clamp(0, 1)
    yield at, torch.arange(N)
    yield share, (t * t * (3 - 2 * t)) * (torch.arange(N) < N - 1)


@check
def add_corrections():
    """Each ray has a sample in front with a quarter of its opacity, which is corrected, and one behind."""
    every = torch.arange(2 * N)
    weights, opacity = torch.tensor([0.2, 0.6]).repeat(N), torch.full((N,), 0.8)
    found = lib.add_corrections(
        torch.ones(N, 3), pattern(N, 3), every[::2], every, every // 2, every, weights, opacity, 1e-4
    )
    yield found, 1 + 0.25 * pattern(N, 3)


@check
def specular_share():
    """A white metal reflects by single scattering what the split sum's table says."""
    yield lib.specular_share(up(), slanted(), torch.ones(N, 3), column(1.0), column(1.0), lut()), furnace_sums()[0]


@check
def sample_bsdf():
    """Without specular share the density is the cosine over pi, and the mean cosine 2 / 3."""
    normals = sphere(N)
    directions, density = lib.sample_bsdf(normals, normals, column(0.5), column(0.0), 512, 0)
    cosines = (directions * normals[:, None]).sum(2)
    yield directions.norm(dim=2), torch.ones(N, 512)
    yield density, cosines / math.pi
    yield cosines.mean(1), torch.full((N,), 2 / 3), 3e-3


@check
def monte_carlo_light():
    """View and light at 60 degrees on both sides of the normal, at roughness 1: D V n.l = 1 / (4 pi)."""
    view, light = axis(0.75**0.5, 0.0, 0.5), axis(-(0.75**0.5), 0.0, 0.5)[:, None].repeat(1, 16, 1)
    sums = lib.monte_carlo_light(up(), view, column(1.0), light, torch.full((N, 16), 0.25), torch.ones(N, 16, 3))
    refracted = (1 - 0.75 / 1.5**2) ** 0.5
    fresnel = sum(((a - b) / (a + b)) ** 2 / 2 for a, b in ((0.5, 1.5 * refracted), (1.5 * 0.5, refracted)))
    lobe = 4 / (4 * math.pi)
    for i, integral in enumerate((lobe, lobe * 0.5**5, 4 * 0.5 / math.pi, lobe * fresnel)):
        yield sums[:, i], torch.full((N, 3), integral)


@check
def summed_light():
    """A white furnace: of white light, a quarter seen and three quarters sent, the split sum's table."""
    k = 2048
    white = torch.full((k,), 4 * math.pi / k), torch.ones(k, 3), torch.full((N, k), 0.25), torch.full((N, k, 3), 0.75)
    sums = lib.summed_light(up(), slanted(), column(1.0), sphere(k), *white)
    yield from ((sums[:, i], integral, 3e-3) for i, integral in enumerate(furnace_sums()))
