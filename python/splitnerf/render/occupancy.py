"""The occupancy grid: which cells a ray must sample, may skip, or ends in."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from splitnerf.ops import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE

DENSITY_CUTOFF = 7.0  # beyond |f| = cutoff / s the NeuS density is below e^-7 of its peak
LIPSCHITZ = 1.25  # bound of |grad f| that the eikonal loss keeps in practice


class OccupancyGrid:
    """Cells of the box, classed by the signed distance at their centres.

    With |grad f| <= L a cell of half diagonal h holds no point with |f| < cutoff/s if |f(centre)| > L h +
    cutoff/s: outside it is empty, inside it is opaque (the transmittance there is below e^-cutoff).
    A visual hull, while given, stays occupied whatever the field says.

    Args:
        resolution: Cells along an edge.
        box: Half size of the cube.
        hull: [r, r, r] bool or None.
    """

    def __init__(self, resolution: int, box: float, hull: Tensor | None = None):
        self.resolution, self.box, self.hull = resolution, box, hull
        self.half_diagonal = math.sqrt(3.0) * box / resolution
        self.sdf = torch.zeros(resolution**3)
        self.cells = torch.full((resolution,) * 3, CELL_OCCUPIED, dtype=torch.uint8)

    def centres(self) -> Tensor:
        """[r^3, 3] cell centres, scene units."""
        axis = (torch.arange(self.resolution) + 0.5) * (2 * self.box / self.resolution) - self.box
        return torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1).reshape(-1, 3)

    @torch.no_grad()
    def update(self, sdf: Callable[[Tensor], Tensor], s: float, share: float = 1.0, use_hull: bool = False) -> None:
        """Re-evaluates the cells near the surface and a random share of the rest, and classes all cells anew."""
        bound = LIPSCHITZ * self.half_diagonal + DENSITY_CUTOFF / s
        due = torch.ones_like(self.sdf, dtype=torch.bool)
        if share < 1.0:
            due = (self.sdf.abs() < 2.0 * bound) | (torch.rand_like(self.sdf) < share)
        index = due.nonzero().squeeze(1)
        centres = self.centres()[index]
        self.sdf[index] = torch.cat([sdf(chunk) for chunk in centres.split(1 << 16)]) if len(index) else self.sdf[index]
        cells = torch.full_like(self.sdf, CELL_OCCUPIED, dtype=torch.uint8)
        cells[self.sdf > bound] = CELL_EMPTY
        cells[self.sdf < -bound] = CELL_OPAQUE
        if use_hull and self.hull is not None:
            cells[self.hull.reshape(-1)] = CELL_OCCUPIED
        self.cells = cells.view((self.resolution,) * 3)


def visual_hull(resolution: int, box: float, masks: Tensor, poses: Tensor, intrinsics: Tensor) -> Tensor:
    """[r, r, r] bool: cells whose centre, give or take a cell, falls into every mask that sees it.

    Args:
        resolution: Cells along an edge.
        box: Half size of the cube.
        masks: [n, H, W] in [0, 1].
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        intrinsics: [n, 4] fx, fy, cx, cy in pixels.
    """
    grid = OccupancyGrid(resolution, box)
    centres, cell = grid.centres(), 2 * box / resolution
    inside = torch.ones(len(centres), dtype=torch.bool)
    n, height, width = masks.shape
    for i in range(n):
        fx, fy, cx, cy = intrinsics[i].tolist()
        camera = (centres[inside] - poses[i, :3, 3]) @ poses[i, :3, :3]
        depth = -camera[:, 2]
        x, y = cx + fx * camera[:, 0] / depth, cy - fy * camera[:, 1] / depth
        # One cell's size in pixels widens the mask, so that thin parts keep their cells.
        radius = int(math.ceil(fx * cell / max(1e-3, float(depth.median())))) if len(depth) else 0
        wide = torch.nn.functional.max_pool2d(masks[i : i + 1, None], 2 * radius + 1, stride=1, padding=radius)[0, 0]
        column, row = x.floor().long(), y.floor().long()
        seen = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        keep = ~seen
        keep[seen] = wide[row[seen], column[seen]] > 0
        inside[inside.clone()] = keep
    return inside.view((resolution,) * 3)
