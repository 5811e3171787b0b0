"""The exported surface as functions of points, and the projection of points onto it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

CHUNK = 1 << 15  # points evaluated at a time
STEPS = 4  # steps along a line, each with one evaluation of the field
TOLERANCE = 1e-4  # share of the reach below which a value counts as zero
MIN_SLOPE = 0.2  # least slope of the field along a line; below it the point stops


@dataclass(frozen=True)
class Surface:
    """A signed distance field with materials, in one frame: functions of points [n, 3] that give signed distances [n],
    negative inside; the same and their gradients [n, 3]; and albedo [n, 3] linear, roughness [n, 1], metallic [n, 1]
    and unit normals [n, 3]."""

    sdf: Callable[[Tensor], Tensor]
    gradient: Callable[[Tensor], tuple[Tensor, Tensor]]
    materials: Callable[[Tensor], tuple[Tensor, Tensor, Tensor, Tensor]]


@torch.no_grad()
def surface_materials(surface: Surface, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """albedo [n, 3], roughness [n], metallic [n] and normals [n, 3] float32 at [n, 3] points. Raises RuntimeError where
    one of them is not finite."""
    table = torch.cat([torch.cat(surface.materials(chunk), dim=1) for chunk in torch.from_numpy(points).split(CHUNK)])
    if not table.isfinite().all():
        raise RuntimeError("the materials are not finite: the training diverged")
    table = table.numpy()
    return table[:, :3], table[:, 3], table[:, 4], table[:, 5:]


@torch.no_grad()
def to_level_set(
    surface: Surface, points: np.ndarray, reach: float, directions: np.ndarray | None = None
) -> np.ndarray:
    """Moves points [n, 3] float32 along lines onto the zero level set where it is within reach, in the points' units;
    unit directions [n, 3], None for the field's gradients.

    The first step treats the field's value as a distance; the others are secant steps. Each step is clamped to the
    reach. A point stops where the field hardly rises along the line. The result is the visited position with the
    smallest absolute value, so that no point ends farther from the surface than it began.
    """
    moved = []
    for rows in (slice(start, start + CHUNK) for start in range(0, len(points), CHUNK)):
        chunk = torch.from_numpy(points[rows])
        given = None if directions is None else torch.from_numpy(directions[rows])
        along = F.normalize(surface.gradient(chunk)[1], dim=1) if given is None else given
        moved.append(_along_lines(surface.sdf, chunk, along, reach))
    return torch.cat(moved).numpy()


def _along_lines(sdf: Callable[[Tensor], Tensor], points: Tensor, directions: Tensor, reach: float) -> Tensor:
    f_last = best_f = sdf(points)
    t_last = best_t = torch.zeros_like(f_last)
    t = (-f_last).clamp(-reach, reach)
    for _ in range(STEPS):
        moving = ((t != t_last) & (best_f.abs() > TOLERANCE * reach)).nonzero().squeeze(1)
        if len(moving) == 0:
            break
        f = f_last.clone()
        f[moving] = sdf(points[moving] + t[moving, None] * directions[moving])
        slope = (f - f_last) / torch.where(t == t_last, 1.0, t - t_last)
        closer = (f.abs() < best_f.abs()) & (slope > MIN_SLOPE)
        best_t, best_f = torch.where(closer, t, best_t), torch.where(closer, f, best_f)
        t_next = (t - f / slope.clamp(min=MIN_SLOPE)).clamp(-reach, reach)
        t_last, f_last, t = t, f, torch.where(slope > MIN_SLOPE, t_next, t)
    return points + best_t[:, None] * directions
