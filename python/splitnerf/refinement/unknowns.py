"""The unknowns of a texel, in which Gauss-Newton steps are taken, and the texture values that they stand for."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

N_UNKNOWNS = 7  # albedo (3) to the power 1 / 2.2, roughness, metallic, x and y of the tangent-space normal
ROUGHNESS, METALLIC, GLOSS = 3, 4, slice(3, 5)  # their places among them
GROUPS = (3, 1, 1, 2)  # unknowns that have their edges in common
GAMMA = 2.2  # equal steps of albedo^(1 / 2.2) look about equal
MIN_ALBEDO, MIN_ROUGHNESS, MAX_TILT = 0.01, 0.03, 0.9
# Largest steps: beyond them the photos are no linear function of the unknowns.
STEP_LIMITS = (0.15, 0.15, 0.15, 0.15, 0.3, 0.15, 0.15)


def per_unknown(albedo: float, gloss: float, normal: float) -> Tensor:
    """[7] one number for the albedo's unknowns, one for roughness and metallic, one for the normal's."""
    return torch.tensor([albedo] * 3 + [gloss] * 2 + [normal] * 2)


def to_unknowns(values: Tensor) -> Tensor:
    """The unknowns [n, 7] of texture values [n, 8]: albedo (3), roughness, metallic, tangent-space normal (3)."""
    albedo = values[:, :3].clamp(min=MIN_ALBEDO**GAMMA) ** (1 / GAMMA)
    return torch.cat([albedo, values[:, 3:5], F.normalize(values[:, 5:], dim=1)[:, :2]], dim=1)


def to_values(unknowns: Tensor) -> Tensor:
    """The texture values [n, 8] of unknowns [n, 7], all within their ranges; differentiable."""
    albedo, roughness, metallic, xy = unknowns.split([3, 1, 1, 2], dim=1)
    z = (1.0 - xy.square().sum(1, keepdim=True)).clamp(min=1.0 - MAX_TILT**2).sqrt()
    albedo = albedo.clamp(MIN_ALBEDO, 1.0) ** GAMMA
    return torch.cat([albedo, roughness.clamp(MIN_ROUGHNESS, 1.0), metallic.clamp(0.0, 1.0), xy, z], dim=1)


def into_range(unknowns: Tensor) -> Tensor:
    """The nearest unknowns [n, 7] whose values are within their ranges."""
    albedo, roughness, metallic, xy = unknowns.split([3, 1, 1, 2], dim=1)
    length = xy.norm(dim=1, keepdim=True).clamp(min=1e-6)
    xy = xy * (length.clamp(max=MAX_TILT) / length)
    return torch.cat(
        [albedo.clamp(MIN_ALBEDO, 1.0), roughness.clamp(MIN_ROUGHNESS, 1.0), metallic.clamp(0.0, 1.0), xy], dim=1
    )
