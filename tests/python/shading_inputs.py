"""Inputs of the operators that shade: split sum and sums over light."""

import torch
from op_checks import generator, rand, unit
from splitnerf.ops.shading import brdf_lut


def sums_inputs(n: int = 6, dtype=torch.float64, seed: int = 0) -> tuple:
    g = generator(seed)

    def rand(columns: int, lo: float, hi: float) -> torch.Tensor:
        return lo + (hi - lo) * torch.rand(n, columns, generator=g, dtype=dtype)

    normals = unit(torch.randn(n, 3, generator=g, dtype=dtype))
    view_dirs = unit(normals + 0.7 * unit(torch.randn(n, 3, generator=g, dtype=dtype)))
    normals[1::4] *= -1  # which face away from the viewer
    sums = [rand(3, 0.5, 2.0), rand(3, 0.0, 0.3), rand(3, 0.1, 2.0), rand(3, 0.02, 0.5)]
    return normals, view_dirs, rand(3, 0.05, 0.9), rand(1, 0.1, 0.9), rand(1, 0.1, 0.9), torch.stack(sums, 1)


def mixed_sums_inputs(n: int, dtype, compensate: bool = True) -> tuple:
    """Arguments of ``shade_sums`` with another radiance and a share."""
    return *sums_inputs(n, dtype), brdf_lut(), compensate, rand(n, 3, seed=7, dtype=dtype), rand(n, seed=8, dtype=dtype)


# ---- shading by the split sum ----


def query_inputs(device, dtype, mean: bool = True, n: int = 7) -> tuple:
    """Arguments of ``light_queries``; some normals face away from the viewer."""
    normals, views = (unit(torch.randn(n, 3, generator=generator(i), dtype=torch.float64)) for i in (0, 1))
    roughness = torch.rand(n, 1, generator=generator(2), dtype=torch.float64) * 0.8 + 0.1
    return *(x.to(device, dtype) for x in (normals, views, roughness)), brdf_lut(device), mean


def split_sum_inputs(device, dtype, mode: int = 0, compensate: bool = False, channels: int = 1, n: int = 7) -> tuple:
    """Arguments of ``split_sum_shade`` without indirect light."""
    normals, views, roughness, lut, _ = query_inputs(device, dtype, n=n)
    draw = generator(3)
    rest = [torch.rand(n, k, generator=draw, dtype=torch.float64) for k in (3, 1, 3, 3, channels, channels)]
    albedo, metallic, specular, diffuse, occlusion_s, occlusion_d = (x.to(device, dtype) for x in rest)
    points = normals, views, albedo, roughness, metallic
    return *points, 3 * specular, 2 * diffuse, occlusion_s, occlusion_d, lut, mode, compensate, None, None


def indirect_inputs(dtype, mode: int = 0, channels: int = 3, n: int = 300, stacked: bool = False) -> tuple:
    """Arguments of ``split_sum_shade`` with indirect light; `stacked`: the light's answers in one tensor."""
    inputs = split_sum_inputs("cpu", dtype, mode, True, channels, n)
    points, (specular, diffuse), rest = inputs[:5], inputs[5:7], inputs[7:12]
    light = (torch.cat([specular, diffuse]), None) if stacked else (specular, diffuse)
    indirect = (rand(n, 3, seed=seed, dtype=dtype) for seed in (11, 12))
    return *points, *light, *rest, *indirect
