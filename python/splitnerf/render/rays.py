"""Pinhole rays."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F


def pixel_rays(pose: Tensor, intrinsics: Tensor, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """World rays through image points.

    Args:
        pose: [n, 4, 4] or [4, 4] camera-to-world, OpenGL axes (x right, y up, looking along -z).
        intrinsics: [n, 4] or [4], fx, fy, cx, cy in pixels.
        x, y: [n] pixels; the centre of pixel (column, row) is (column + 0.5, row + 0.5).

    Returns:
        origins and unit directions, [n, 3] each.
    """
    fx, fy, cx, cy = intrinsics.unbind(-1)
    camera = torch.stack([(x - cx) / fx, (cy - y) / fy, -torch.ones_like(x)], dim=-1)
    directions = F.normalize((pose[..., :3, :3] @ camera[..., None])[..., 0], dim=-1)
    return pose[..., :3, 3].expand_as(directions).contiguous(), directions.contiguous()


def image_rays(pose: Tensor, intrinsics: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Rays through all pixel centres of an image, row by row, [H * W, 3] each."""
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    return pixel_rays(pose, intrinsics, x.reshape(-1), y.reshape(-1))
