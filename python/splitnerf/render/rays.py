"""Pinhole rays: through image points and of whole images, and the projection of points."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.devices import tensor_cores


def pixel_rays(pose: Tensor, intrinsics: Tensor, x: Tensor, y: Tensor) -> tuple[Tensor, Tensor]:
    """World rays through image points x, y [n]: origins and unit directions, [n, 3] each. `pose` [n, 4, 4] or [4, 4] is
    camera-to-world, OpenGL axes (x right, y up, looking along -z), `intrinsics` [n, 4] or [4] are fx, fy, cx, cy in pixels; the
    centre of pixel (column, row) is (column + 0.5, row + 0.5)."""
    points = torch.stack([x, y, torch.ones_like(x)], dim=-1)
    directions = F.normalize((pixel_matrix(pose, intrinsics) * points[..., None, :]).sum(-1), dim=-1)
    return pose[..., :3, 3].expand_as(directions).contiguous(), directions


def pixel_matrix(pose: Tensor, intrinsics: Tensor) -> Tensor:
    """[..., 3, 3] matrices that map an image point (x, y, 1) to its world direction, not normalised; for pose and intrinsics see
    :func:`pixel_rays`."""
    fx, fy, cx, cy = intrinsics.unbind(-1)
    zero, one = torch.zeros_like(fx), torch.ones_like(fx)
    rows = [1 / fx, zero, -cx / fx, zero, -1 / fy, cy / fy, zero, zero, -one]
    with tensor_cores(False):
        return pose[..., :3, :3] @ torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def projected(points: Tensor, intrinsics: Tensor) -> Tensor:
    """[..., 2] image points of points [..., 3] in the camera's axes; those behind the camera have no meaning."""
    fx, fy, cx, cy = intrinsics.unbind()
    depth = (-points[..., 2]).clamp(min=1e-6)
    return torch.stack([cx + fx * points[..., 0] / depth, cy - fy * points[..., 1] / depth], -1)


def image_rays(pose: Tensor, intrinsics: Tensor, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Rays through all pixel centres of an image, row by row, [H * W, 3] each."""
    rows, columns = (torch.arange(n, device=pose.device) + 0.5 for n in (height, width))
    y, x = torch.meshgrid(rows, columns, indexing="ij")
    return pixel_rays(pose, intrinsics, x.reshape(-1), y.reshape(-1))
