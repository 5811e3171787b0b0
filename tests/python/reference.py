"""Obvious, slow references of the operators, in NumPy float64 and in torch."""

from __future__ import annotations

import itertools
import math

import numpy as np
import torch

PRIMES = (1, 2654435761, 805459861)


def hash_encode(positions: np.ndarray, table: np.ndarray, spec, n_active: int) -> np.ndarray:
    """Trilinear interpolation, point by point, level by level, corner by corner."""
    out = np.zeros((len(positions), spec.n_outputs))
    for level in range(n_active):
        resolution = math.floor(spec.base_resolution * spec.growth**level + 1e-6)
        nodes = resolution + 1
        dense = nodes**3 <= 2**spec.log2_table_size
        offset = sum(
            min((math.floor(spec.base_resolution * spec.growth**k + 1e-6) + 1) ** 3, 2**spec.log2_table_size)
            for k in range(level)
        )
        for i, position in enumerate(positions):
            x = np.clip(position, 0.0, 1.0) * resolution
            cell = np.minimum(x.astype(int), resolution - 1)
            for corner in itertools.product((0, 1), repeat=3):
                node = [int(c + k) for c, k in zip(cell, corner)]
                if dense:
                    index = (node[0] * nodes + node[1]) * nodes + node[2]
                else:
                    index = 0
                    for n, prime in zip(node, PRIMES):
                        index ^= n * prime % 2**32
                    index %= 2**spec.log2_table_size
                weight = np.prod([f if k else 1 - f for f, k in zip(x - cell, corner)])
                columns = slice(level * spec.n_features, (level + 1) * spec.n_features)
                out[i, columns] += weight * table[offset + index]
    return out


def brdf(lut: np.ndarray, n_dot_v: np.ndarray, roughness: np.ndarray) -> np.ndarray:
    """F1, F2, chi of the table, bilinear in (roughness, sqrt(n.v))."""
    n = len(lut) - 1
    x, y = np.sqrt(np.clip(n_dot_v, 1e-4, 1)) * n, np.clip(roughness, 0, 1) * n
    x0, y0 = np.clip(x.astype(int), 0, n - 1), np.clip(y.astype(int), 0, n - 1)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    top = lut[y0, x0] * (1 - fx) + lut[y0, x0 + 1] * fx
    bottom = lut[y0 + 1, x0] * (1 - fx) + lut[y0 + 1, x0 + 1] * fx
    return top * (1 - fy) + bottom * fy


def query_direction(normals, view_dirs, roughness, lut, mean: bool) -> np.ndarray:
    n_dot_v = (normals * view_dirs).sum(1, keepdims=True)
    normals = np.where(n_dot_v < 0, -normals, normals)
    n_dot_v = np.abs(n_dot_v)
    mirror = 2 * n_dot_v * normals - view_dirs
    if not mean:
        return mirror
    t = np.clip((roughness - 0.3) / 0.1, 0, 1)
    k = 1 + t * t * (3 - 2 * t) * (brdf(lut, n_dot_v[:, 0], roughness[:, 0])[:, 2:] - 1)
    direction = (1 - k) * normals + k * mirror
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def split_sum_shade(
    normals, view_dirs, albedo, roughness, metallic, specular, diffuse, occlusion_s, occlusion_d, lut, mode, compensate
) -> np.ndarray:
    n_dot_v = np.abs((normals * view_dirs).sum(1, keepdims=True))
    f1, f2, _ = np.split(brdf(lut, n_dot_v[:, 0], roughness[:, 0]), 3, axis=1)
    f0 = 0.04 * (1 - metallic) + metallic * albedo
    fresnel = {
        "exact": f0,
        "paper": f0 + (1 - roughness - f0) * (1 - n_dot_v) ** 5,
        "code": f0 + (np.maximum(1 - roughness, f0) - f0) * (1 - n_dot_v) ** 5,
    }[mode]
    energy = fresnel * f1 + f2
    if compensate:
        energy = energy * (1 + fresnel * (1 / (f1 + f2) - 1))
    diffuse_share = (1 - metallic) * (1 - (energy if mode == "exact" else fresnel))
    return occlusion_d * diffuse_share * albedo * diffuse + occlusion_s * energy * specular


def prefilter_light(query_dirs, roughness, light_dirs, light) -> np.ndarray:
    """The whole [queries, lights] matrix of D (w.w_s)+, D with the angle between w_s and the half vector."""
    cosine = query_dirs @ light_dirs.T
    a2 = np.maximum(roughness**2, 1e-4) ** 2
    cos2_h = (1 + cosine) / 2
    weight = a2 / (np.pi * (cos2_h * (a2 - 1) + 1) ** 2) * np.maximum(cosine, 0)
    return weight @ light / weight.sum(1, keepdims=True)


def neus_weights(f_prev: torch.Tensor, f_next: torch.Tensor, s: torch.Tensor, offsets: list[int]):
    """w_i = alpha_i prod_{j < i} (1 - alpha_j), differentiable by torch (all orders). For float64."""
    alphas = torch.clamp((torch.sigmoid(s * f_prev) - torch.sigmoid(s * f_next)) / torch.sigmoid(s * f_prev), min=0)
    weights = []
    for begin, end in zip(offsets[:-1], offsets[1:]):
        transmittance = torch.ones((), dtype=f_prev.dtype)
        for alpha in alphas[begin:end]:
            weights.append(alpha * transmittance)
            transmittance = transmittance * (1 - alpha)
    packed = torch.stack(weights) if weights else f_prev * 0
    opacity = torch.stack([packed[b:e].sum() for b, e in zip(offsets[:-1], offsets[1:])])
    return packed, opacity


def composite(weights: torch.Tensor, values: torch.Tensor, offsets: list[int]) -> torch.Tensor:
    return torch.stack([(weights[b:e, None] * values[b:e]).sum(0) for b, e in zip(offsets[:-1], offsets[1:])])


def march_ray(origin, direction, jitter, cells, box, step, max_samples) -> list[float]:
    """Starts of one ray's samples, lattice point by lattice point."""
    t_near, t_far = 0.0, math.inf
    for o, d in zip(origin, direction):
        if d == 0:
            if abs(o) > box:
                return []
            continue
        a, b = (-box - o) / d, (box - o) / d
        t_near, t_far = max(t_near, min(a, b)), min(t_far, max(a, b))
    starts: list[float] = []
    k = 0
    while len(starts) < max_samples:
        start = t_near + (k + jitter - 1) * step
        middle = start + step / 2
        k += 1
        if middle <= t_near:
            continue
        if not middle < t_far:
            break
        cell = tuple(
            np.clip(((origin + middle * direction + box) / (2 * box) * len(cells)).astype(int), 0, len(cells) - 1)
        )
        if cells[cell] == 2:
            break
        if cells[cell] == 1:
            starts.append(start)
    return starts


def srgb(linear: torch.Tensor) -> torch.Tensor:
    power = 1.055 * linear.clamp(min=0.0031308) ** (1 / 2.4) - 0.055
    return torch.where(linear <= 0.0031308, 12.92 * linear.clamp(min=0), power)


def pixel_losses(mean, opacity, target, background, linear: bool = True) -> tuple[torch.Tensor, torch.Tensor]:
    colour = srgb(mean) if linear else mean
    colour = torch.where(target[:, :3] >= 254 / 255, colour.clamp(max=1), colour)
    o, a = opacity[:, None], target[:, 3:]
    error = colour * o + background * (1 - o) - (target[:, :3] * a + background * (1 - a))
    mask = torch.nn.functional.binary_cross_entropy(opacity.clamp(1e-3, 1 - 1e-3), target[:, 3])
    return error.square().mean(), mask


def gradient_losses(gradients, weights, beside) -> tuple[torch.Tensor, torch.Tensor]:
    m = len(beside)
    eikonal = (torch.sqrt(gradients.square().sum(-1) + 1e-24) - 1).square().mean()
    here, there = (
        torch.nn.functional.normalize(g, dim=1) for g in (gradients[beside], gradients[len(gradients) - m :])
    )
    apart = (there - here).square().sum(1)
    counts = weights[beside] * (apart.detach() < 2)
    return eikonal, (counts * torch.sqrt(apart + 1e-24)).sum() / counts.sum().clamp(min=1e-8)


def material_losses(
    albedo, metallic, shares, smooth_l1: bool = False
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    m, shares = metallic[:, 0], shares / shares.sum()
    metal = torch.nn.functional.smooth_l1_loss(m, torch.zeros_like(m), reduction="none") if smooth_l1 else m.square()
    darkness = (1 - albedo.detach().amax(1) / 0.4).clamp(min=0)
    return shares @ metal, shares @ (m * (1 - m)), shares @ (m * darkness)
