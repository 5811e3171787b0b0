"""The surface that is exported, as functions of points, and how points are brought onto it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

CHUNK = 1 << 15  # points that the fields are asked at a time
STEPS = 2  # secant steps after the first Newton step
MIN_SLOPE = 0.2  # of the field along a line, below which a point stays where it is


@dataclass(frozen=True)
class Surface:
    """A signed distance field with materials, in one frame. All functions take points [n, 3].

    Attributes:
        sdf: -> [n], negative inside.
        gradient: -> sdf [n] and its gradient [n, 3].
        materials: -> albedo [n, 3] linear, roughness [n, 1], metallic [n, 1] and unit normals [n, 3].
    """

    sdf: Callable[[Tensor], Tensor]
    gradient: Callable[[Tensor], tuple[Tensor, Tensor]]
    materials: Callable[[Tensor], tuple[Tensor, Tensor, Tensor, Tensor]]


@torch.no_grad()
def surface_normals(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Unit gradients [n, 3] float32 of the field at [n, 3] points; 0 where it has none."""
    rows = [_unit(surface.gradient(chunk)[1]) for chunk in torch.from_numpy(points).split(CHUNK)]
    return torch.cat(rows).numpy()


@torch.no_grad()
def surface_materials(
    surface: Surface, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """albedo [n, 3], roughness [n], metallic [n] and normals [n, 3] float32 at [n, 3] points.

    Raises:
        RuntimeError: One of them is not finite.
    """
    table = torch.cat([torch.cat(surface.materials(chunk), dim=1) for chunk in torch.from_numpy(points).split(CHUNK)])
    if not table.isfinite().all():
        raise RuntimeError("the materials are not finite: the training diverged")
    table = table.numpy()
    return table[:, :3], table[:, 3], table[:, 4], table[:, 5:]


@torch.no_grad()
def to_level_set(
    surface: Surface, points: np.ndarray, reach: float, directions: np.ndarray | None = None
) -> np.ndarray:
    """Moves points along lines onto the zero level set, as far as it lies within reach.

    A Newton step, then secant steps, each cut off at the reach; of all places tried the one nearest to zero stands,
    so that no point ends farther from the surface than it began.

    Args:
        surface: The field.
        points: [n, 3] float32.
        reach: How far a point may move, in the points' units.
        directions: [n, 3] unit; the field's own gradients if None.

    Returns:
        [n, 3] float32.
    """
    moved = [
        _along_lines(surface, chunk, reach, None if directions is None else torch.from_numpy(directions[rows]))
        for rows, chunk in ((slice(i, i + CHUNK), torch.from_numpy(points[i : i + CHUNK])) for i in range(0, len(points), CHUNK))
    ]
    return torch.cat(moved).numpy()


def _along_lines(surface: Surface, points: Tensor, reach: float, directions: Tensor | None) -> Tensor:
    distance, gradient = surface.gradient(points)
    directions = _unit(gradient) if directions is None else directions
    slope = (gradient * directions).sum(dim=1)
    t_last, f_last = torch.zeros_like(distance), distance
    best_t, best_f = t_last, f_last
    t = torch.where(slope > MIN_SLOPE, -distance / slope.clamp(min=MIN_SLOPE), 0.0).clamp(-reach, reach)
    for step in range(STEPS + 1):
        f = surface.sdf(points + t[:, None] * directions)
        closer = f.abs() < best_f.abs()
        best_t, best_f = torch.where(closer, t, best_t), torch.where(closer, f, best_f)
        if step < STEPS:
            rise = f - f_last
            secant = t - f * (t - t_last) / torch.where(rise == 0, 1.0, rise)
            t_last, f_last, t = t, f, torch.where(rise == 0, t, secant).clamp(-reach, reach)
    return points + best_t[:, None] * directions


def _unit(vectors: Tensor) -> Tensor:
    return torch.nn.functional.normalize(vectors, dim=1)
