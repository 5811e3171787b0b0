"""Which part of space is the object: what stands in the middle, above the table if there is one."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor

from splitnerf_tools.separation.foot import LOW, Foot, find_foot
from splitnerf_tools.separation.ground import Table

CELLS = 96  # along an edge of the cube
HALF = 1.6  # of that edge, scene units; parts that reach out of the ball of radius 1 may reach so far above a table
LEAST_POINTS = 2  # seen in a cell that is taken
LARGEST_SHARE = 0.05  # of the largest part's cells that another part needs
STANDS_OVER = 1.0  # horizontal distance of another part's middle from the largest one's, in the latter's radii
SEVERAL = 2  # photos that show a surface in a cell that is solid
REACH = 1.0  # distance from a ray's point next to the origin within which solid cells block it, scene units
GROWN = 2  # cells by which the region is larger than what was seen


class Region:
    """Cells of the cube [-HALF, HALF]^3 that hold the object; near a table, its foot in place of cells.

    Args:
        cells: [CELLS, CELLS, CELLS] bool.
        foot: The object's foot; None where the cells go down to the table.
        solid: [CELLS, CELLS, CELLS] bool, the cells in which several photos show the object's surface; None: none are known.
    """

    def __init__(
        self, cells: np.ndarray, table: Table | None, foot: Foot | None = None, solid: np.ndarray | None = None
    ):
        self.cells, self.table, self.foot = torch.from_numpy(cells), table, foot
        self.solid = torch.from_numpy(np.zeros_like(cells) if solid is None else solid)

    def middle(self) -> Tensor:
        """[3] the middle of the cells."""
        return self.centres().mean(0)

    def centres(self) -> Tensor:
        """[n, 3] the centres of the cells, scene units."""
        return ((self.cells.nonzero().float() + 0.5) * (2 / CELLS) - 1) * HALF

    def holds(self, points: Tensor) -> Tensor:
        """[...] bool, whether points [..., 3] lie in the region."""
        inside = _at(self.cells, points)
        if self.table is None:
            return inside
        heights = self.table.heights(points)
        if self.foot is None:
            return inside & (heights > 0.5 * self.table.height)
        return torch.where(heights > LOW, inside, self.foot.holds(points) & (heights > -LOW))

    def blocks(self, rays_o: Tensor, rays_d: Tensor) -> Tensor:
        """[n] bool, whether rays [n, 3] pass through a solid cell above the table's foot: an object that mirrors its surroundings
        looks as if one saw through it, but photos from elsewhere show its surface."""
        blocked, cells = torch.zeros(len(rays_o), dtype=torch.bool), self.solid.nonzero()
        if len(cells) == 0:
            return blocked
        low, high = ((x * (2 / CELLS) - 1) * HALF for x in (cells.amin(0), cells.amax(0) + 1))
        enters, leaves = torch.sort(torch.stack([(x - rays_o) / rays_d for x in (low, high)]), dim=0).values
        near = (enters.amax(1) <= leaves.amin(1)).nonzero().squeeze(1)  # the others miss the box of all solid cells
        rays_o, rays_d = rays_o[near], rays_d[near]
        distances = -(rays_o * rays_d).sum(1, keepdim=True) + torch.arange(-REACH, REACH, HALF / CELLS)
        points = rays_o[:, None] + distances[..., None] * rays_d[:, None]
        solid = _at(self.solid, points) & (distances > 0)
        if self.table is not None:
            solid &= self.table.heights(points) > LOW
        blocked[near] = solid.any(1)
        return blocked

    def cell_pixels(self, size: tuple[int, int], rays_o: Tensor, rays_d: Tensor) -> float:
        """The edge of a cell in the middle of the object, in pixels of an image [h, w] with rays [h w, 3]."""
        row = slice((size[0] // 2) * size[1], (size[0] // 2 + 1) * size[1])
        o, d = rays_o[row], rays_d[row]
        across = o + ((self.middle() - o) * d).sum(1, keepdim=True) * d
        return 2 * HALF / CELLS / max(float(across.diff(dim=0).norm(dim=1).median()), 1e-9) if size[1] > 1 else 0.0

    def above_table(self, rays_o: Tensor, rays_d: Tensor, distances: Tensor) -> Tensor:
        """Distances [n, k] along rays [n, 3], at most those of the table: what seems to lie below it is on it, vague or mirrored."""
        if self.table is None:
            return distances
        height, fall = self.table.heights(rays_o), -(rays_d @ self.table.upward)
        table = torch.where((fall > 0) & (height > 0), height / fall.clamp(min=1e-6), math.inf)
        return torch.minimum(distances, table[:, None])

    def stands_at(self, rays_o: Tensor, rays_d: Tensor) -> Tensor:
        """[n] bool, whether rays [n, 3] meet the table where the object stands on it."""
        if self.table is None:
            return torch.zeros(len(rays_o), dtype=torch.bool)
        distance = self.above_table(rays_o, rays_d, torch.full((len(rays_o), 1), math.inf))
        meets = distance.isfinite()[:, 0]
        return meets & self.holds(rays_o + distance.nan_to_num(posinf=0.0) * rays_d)

    def with_foot(self, points: np.ndarray, colours: np.ndarray) -> Region:
        """The region, near its table by points [n, 3] that photos show there and their colours [n, 3]."""
        held = self.holds(torch.from_numpy(points)).numpy() & (self.table.heights(points) > LOW)
        foot = find_foot(self.table, points, colours, points[held])
        return Region(self.cells.numpy(), self.table, foot, self.solid.numpy())


def _at(cells: Tensor, points: Tensor) -> Tensor:
    """[...] the values of cells [CELLS, CELLS, CELLS] bool at points [..., 3]; false beside them."""
    index = ((points * (0.5 / HALF) + 0.5) * CELLS).floor().long()
    within = ((index >= 0) & (index < CELLS)).all(-1)
    x, y, z = index.clamp(0, CELLS - 1).unbind(-1)
    return within & cells[x, y, z]


def find_region(points: np.ndarray, table: Table | None, n_photos: int = 1) -> Region | None:
    """The object's region; None where nothing stands in the middle. `points` are the surface points [n, 3] that photos show, scene
    units, as many of each photo, photo by photo."""
    if table is None:
        chosen = np.linalg.norm(points, axis=1) < 1
    else:
        chosen = (np.abs(points).max(axis=1) < HALF) & (table.heights(points) > table.height)
    index = ((points[chosen] * (0.5 / HALF) + 0.5) * CELLS).astype(int).clip(0, CELLS - 1)
    counts = np.zeros((CELLS,) * 3, np.int32)
    np.add.at(counts, tuple(index.T), 1)
    shown = counts >= LEAST_POINTS
    parts, n_parts = ndimage.label(ndimage.binary_dilation(shown), np.ones((3, 3, 3)))  # gaps of two cells part nothing
    parts[~shown] = 0
    if n_parts == 0:
        return None
    centres = ((np.argwhere(parts > 0) + 0.5) * (2 / CELLS) - 1) * HALF
    near = np.linalg.norm(centres, axis=1) < 1
    sizes = np.bincount(parts[parts > 0][near], minlength=n_parts + 1)[1:]  # what stands in the middle counts
    if not sizes.any():
        return None
    places = [np.argwhere(parts == k + 1) for k in np.flatnonzero(sizes >= LARGEST_SHARE * sizes.max())]
    main = np.argwhere(parts == sizes.argmax() + 1)
    up = np.array([0.0, 0, 1]) if table is None else table.normal

    def across(cells: np.ndarray) -> np.ndarray:
        return cells - np.outer(cells @ up, up)

    middle = np.median(across(main), axis=0)
    reach = STANDS_OVER * np.quantile(np.linalg.norm(across(main) - middle, axis=1), 0.9)
    taken = np.zeros_like(counts, bool)
    for cells in places:
        if np.linalg.norm(np.median(across(cells), axis=0) - middle) <= reach:
            taken[tuple(cells.T)] = True
    taken = filled(taken) if table is None else down_to(table, filled(taken))
    grown = ndimage.binary_dilation(taken, np.ones((3, 3, 3)), iterations=GROWN)
    photo = np.repeat(np.arange(n_photos), -(-len(points) // n_photos))[: len(points)][chosen]
    # Each photo once in a cell.
    sights = np.unique(np.ravel_multi_index(tuple(index.T), taken.shape) * n_photos + photo)
    seen_by = np.bincount(sights // n_photos, minlength=taken.size)
    return Region(grown, table, None, (seen_by.reshape(taken.shape) >= SEVERAL) & grown)


def down_to(table: Table, cells: np.ndarray) -> np.ndarray:
    """Cells [r, r, r] and those below them, as far as the table: photos from above show little of an object's lower sides."""
    places = (np.argwhere(np.ones_like(cells)) + 0.5).astype(np.float32)
    result, step = cells.copy().ravel(), table.normal.astype(np.float32)
    open_ = np.flatnonzero(table.heights((places * (2 / CELLS) - 1) * HALF) > 0)
    for k in range(1, CELLS):
        index = (places[open_] + k * step).astype(int)
        within = ((index >= 0) & (index < CELLS)).all(1)
        open_, index = open_[within], index[within]
        found = cells[tuple(index.T)]
        result[open_[found]] = True
        open_ = open_[~found]
    return result.reshape(cells.shape)


def filled(cells: np.ndarray) -> np.ndarray:
    """Cells [r, r, r] and those between two of them along at least two axes: photos show surfaces alone."""
    between = np.zeros(cells.shape, np.int8)
    for axis in range(3):
        before = np.maximum.accumulate(cells, axis)
        between += before & np.flip(np.maximum.accumulate(np.flip(cells, axis), axis), axis)
    return cells | (between >= 2)
