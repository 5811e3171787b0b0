"""Operators in plain torch, as one would write them without this library: what benchmarks hold the operators against."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.ops import HashGridSpec

PRIMES = (1, 2654435761, 805459861)


def hash_encode(
    x: Tensor, table: Tensor, n_levels: int, base: int, growth: float, log2_size: int, n_active: int
) -> Tensor:
    """All levels and corners at once: one gather, and so one gradient of the table's size.

    Args:
        x: [n, 3] in the unit cube.
        table: [n_entries, F].
        n_levels, base, growth, log2_size, n_active: As of :func:`splitnerf.ops.hash_encode`.

    Returns:
        [n, n_levels F].
    """
    spec = HashGridSpec(n_levels, table.shape[1], base, growth, log2_size)
    levels = spec.levels()[:n_active]
    resolution, offset, size = (torch.tensor([level[k] for level in levels]) for k in range(3))
    dense = torch.tensor([bool(level[3]) for level in levels])
    scaled = x.clamp(0, 1)[:, None, :] * resolution[None, :, None].to(x.dtype)
    node = torch.minimum(scaled.detach().floor().long(), resolution[None, :, None] - 1)
    corners = torch.tensor([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
    f = (scaled - node)[:, :, None, :]
    weight = torch.where(corners.bool(), f, 1 - f).prod(-1, keepdim=True)  # [n, levels, 8, 1]
    i, j, k = (node[:, :, None, :] + corners).unbind(-1)
    side = (resolution + 1)[:, None]
    row_major, hashed = (i * side + j) * side + k, (i ^ j * PRIMES[1] ^ k * PRIMES[2]) % size[:, None]
    index = offset[:, None] + torch.where(dense[:, None], row_major, hashed)
    features = (weight * F.embedding(index, table)).sum(2).flatten(1)
    return F.pad(features, (0, (n_levels - n_active) * table.shape[1]))


def brdf_table(lut: Tensor, n_dot_v: Tensor, roughness: Tensor) -> Tensor:
    n = len(lut) - 1
    x, y = n_dot_v.clamp(1e-4, 1).sqrt() * n, roughness.clamp(0, 1) * n
    x0, y0 = x.detach().long().clamp(max=n - 1), y.detach().long().clamp(max=n - 1)
    fx, fy = x - x0, y - y0
    x0, y0 = x0[:, 0], y0[:, 0]
    return torch.lerp(
        torch.lerp(lut[y0, x0], lut[y0, x0 + 1], fx), torch.lerp(lut[y0 + 1, x0], lut[y0 + 1, x0 + 1], fx), fy
    )


def turned(normals: Tensor, view_dirs: Tensor) -> tuple[Tensor, Tensor]:
    cosine = (normals * view_dirs).sum(1, keepdim=True)
    return torch.where(cosine < 0, -normals, normals), cosine.abs()


def query_direction(normals, view_dirs, roughness, lut, mean):
    normals, cosine = turned(normals, view_dirs)
    mirror = 2 * cosine * normals - view_dirs
    t = ((roughness - 0.3) / 0.1).clamp(0, 1)
    k = 1 + t * t * (3 - 2 * t) * (brdf_table(lut, cosine, roughness)[:, 2:] - 1)
    return F.normalize((1 - k) * normals + k * mirror, dim=1)


def lobe_terms(normals, view_dirs, albedo, roughness, metallic, lut, compensate):
    _, cosine = turned(normals, view_dirs)
    f1, f2, _ = brdf_table(lut, cosine, roughness).split(1, 1)
    f0 = 0.04 * (1 - metallic) + metallic * albedo
    gain = 1 + f0 * (1 / (f1 + f2) - 1) if compensate else torch.ones_like(f0)
    return f0, gain, (f0 * f1 + f2) * gain


def split_sum_shade(
    normals, view_dirs, albedo, roughness, metallic, specular, diffuse, occlusion_s, occlusion_d, lut, mode, compensate
):
    _, _, energy = lobe_terms(normals, view_dirs, albedo, roughness, metallic, lut, compensate)
    return occlusion_d * (1 - metallic) * (1 - energy) * albedo * diffuse + occlusion_s * energy * specular


def prefilter_light(query_dirs: Tensor, roughness: Tensor, light_dirs: Tensor, light: Tensor) -> Tensor:
    """The whole matrix of weights D (w.w_s)+ at once."""
    cosine = query_dirs @ light_dirs.T
    a2 = roughness.square().clamp(min=1e-4).square()
    weight = a2 / (math.pi * ((1 + cosine) / 2 * (a2 - 1) + 1).square()) * cosine.clamp(min=0)
    return weight @ light / weight.sum(1, keepdim=True)
