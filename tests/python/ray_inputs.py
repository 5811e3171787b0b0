"""Inputs of the operators of rays: drawn pixels, samples along rays, their weights and colours."""

import torch
from op_checks import generator, rand, unit
from splitnerf.ops.rays import CELL_OCCUPIED, CELL_OPAQUE, PackedSamples

OFFSETS = [0, 9, 9, 10, 24]  # one ray without samples


def composite_inputs(device, dtype) -> tuple:
    weights = torch.rand(OFFSETS[-1], generator=generator(1), dtype=torch.float64)
    values = torch.randn(OFFSETS[-1], 4, generator=generator(2), dtype=torch.float64)
    return weights.to(device, dtype), values.to(device, dtype), torch.tensor(OFFSETS, device=device)


def march_inputs(device, dtype, n: int = 40) -> tuple:
    """Arguments of ``march_rays``: cameras inside and outside the box, some rays parallel to an axis."""
    draw = generator(3)
    origins = unit(torch.randn(n, 3, generator=draw, dtype=torch.float64))
    origins *= 1 + 2 * torch.rand(n, 1, generator=draw, dtype=torch.float64)
    directions = unit(torch.randn(n, 3, generator=draw, dtype=torch.float64) * 0.4 - origins)
    directions[::8] = torch.tensor([0.0, 0.0, -1.0], dtype=torch.float64)
    jitter = torch.rand(n, generator=draw, dtype=torch.float64)
    cells = torch.randint(0, 12, (7, 7, 7), generator=draw)
    cells = torch.where(cells == 11, CELL_OPAQUE, torch.where(cells > 5, CELL_OCCUPIED, 0)).to(torch.uint8)
    return *(x.to(device, dtype) for x in (origins, directions, jitter)), cells.to(device), 1.5, 0.03, 64


def draw_inputs(dtype, n: int = 300) -> tuple:
    """Arguments of ``draw_rays``: a third of the rays near the runs of two of three photos of 8 x 11 pixels."""
    last, shift = torch.tensor([4, 5, 40]), torch.tensor([10, 30, 200])
    matrices = torch.randn(3, 3, 3, generator=generator(1), dtype=torch.float64)
    none = torch.empty(0, dtype=torch.int64)
    cameras = matrices.to(dtype), torch.arange(9.0, dtype=dtype).view(3, 3)
    return rand(n, dtype=dtype), n // 3, last, shift, 40, none, none, 3 * 8 * 11, *cameras, 8, 11


def read_inputs(dtype, n: int = 300) -> tuple:
    """Arguments of ``read_pixels``: three photos of 40 pixels as words, and two runs of pixels at edges."""
    draw = generator(8)
    codes = torch.randint(-(2**15), 2**15, (120, 4), generator=draw).to(torch.int16)
    index = torch.randint(120, (n,), generator=draw)
    behind = torch.randint(256, (46, 3), generator=draw).to(torch.uint8)
    edges = torch.tensor([3, 60]), torch.tensor([9, 100]), torch.tensor([-3, -54]), behind
    return codes, index, index // 40, rand(3, 3, seed=9, dtype=dtype), rand(n, 3, seed=10, dtype=dtype), *edges


def composite_case(dtype) -> tuple:
    """Arguments of ``composite`` with the rays' opacities, of which one is less than the least."""
    return *composite_inputs("cpu", dtype), torch.tensor([0.9, 0.5, 0.01, 0.7], dtype=dtype), 0.1


def surface_inputs(dtype=torch.float64) -> tuple:
    """Samples of 50 rays around a surface, some seen from behind, one with next to no gradient."""
    _, samples, _ = packed_samples()
    n, g = int(samples.offsets[-1]), generator(8)
    sdf = 0.2 * torch.randn(n, generator=g, dtype=torch.float64)
    gradient = torch.randn(n, 3, generator=g, dtype=torch.float64)
    gradient[5] *= 1e-5
    rays_d = unit(torch.randn(50, 3, generator=g, dtype=torch.float64))
    s = torch.tensor(12.0, dtype=torch.float64)
    return *(x.to(dtype) for x in (sdf, gradient, rays_d, s)), samples.offsets


def surface_case(dtype) -> tuple:
    """Arguments of ``surface_weights``: the distances are the first of three columns, and behind the samples there are others."""
    sdf, gradient, rays_d, s, offsets = surface_inputs(dtype)
    n = len(sdf)
    outputs = torch.cat([torch.stack([sdf, sdf + 1, sdf + 2], 1), rand(70, 3, seed=11, dtype=dtype)])
    gradient = torch.cat([gradient, rand(70, 3, seed=12, dtype=dtype)])
    return outputs, gradient, rays_d, s, offsets, *torch.tensor([0.1, 0.4], dtype=dtype).unbind(), 1e-3, n


def packed_samples(dtype=torch.float64, seed: int = 4) -> tuple:
    """Weights and samples of 50 rays, the third without samples and the fifth without weight."""
    g = generator(seed)
    counts = torch.randint(1, 12, (50,), generator=g)
    counts[2] = 0
    offsets = torch.cat([torch.zeros(1, dtype=torch.int64), counts.cumsum(0)])
    n = int(offsets[-1])
    rays = torch.repeat_interleave(torch.arange(50), counts)
    starts = torch.rand(n, generator=g, dtype=torch.float64).cumsum(0)
    weights = torch.rand(n, generator=g, dtype=torch.float64) ** 4
    weights[rays == 4] = 0
    phase = torch.rand(50, generator=g, dtype=torch.float64)
    samples = PackedSamples(rays, starts.to(dtype), (starts + 0.1).to(dtype), offsets)
    return weights.to(dtype), samples, phase.to(dtype)
