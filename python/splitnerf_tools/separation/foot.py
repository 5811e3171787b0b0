"""Where an object meets its table: told from many points that photos show, and by colour at the edge.

One point near the table says little, as its height is less certain than a thin foot is high. The median height of all points
over one cell of the table is more certain: a plinth of three millimetres stands out, but its edge has notches. So the height of a
cell is only a hint, and neighbouring cells of one colour belong together.
Below an overhang, cameras see the table at a grazing angle alone, and what they see there is vague: single points decide.
"""

from __future__ import annotations

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor

from splitnerf_tools.separation.ground import Table
from splitnerf_tools.separation.walker import random_walk

HALF = 1.6  # half the edge of the map, scene units
FEWEST, MOST = 40, 320  # cells along that edge
LOW = 0.06  # height over the table up to which the map decides, scene units
BLUR = 1.5  # standard deviation of the weights with which neighbouring cells count, in cells
ENOUGH = 10  # points in a cell that tell it fully; the cells are so large that most have as many
LEAST_HEIGHT = 0.004  # over the table, at which cells stand out, scene units
NOISE = 3.0  # standard deviations of the table's cells by which cells stand out
SPARSE = 0.1  # smoothed weight of a cell below which nothing is known of it
VAGUE = 0.03  # height over the table from which a point below an overhang is the object's, scene units
GAP = 3  # cells that close holes in what stands over the foot
# What the height of a cell counts beside a neighbour of its own colour, on a map of MOST cells along the edge.
HINT = 0.02
UNDER = 10.0  # how much more it counts where the cell is high and the object is over it
# Of the logarithms of colours, which differ by as much in a shadow as beside it, see `walker.random_walk`.
CONTRAST, DARKEST = 20.0, 0.05


class Foot:
    """The part of a table that an object stands on, and that over which it hangs.

    Args:
        inside: [r, r] float32, positive where the object stands; rows along the first of `table.axes`.
        below: [r, r] float32, positive where the object hides the table from above.
    """

    def __init__(self, table: Table, inside: np.ndarray, below: np.ndarray):
        self._maps = torch.from_numpy(np.stack([inside, below]))
        self._table, self._axes = table, torch.from_numpy(table.axes.astype(np.float32))

    def holds(self, points: Tensor) -> Tensor:
        """[...] bool, whether points [..., 3] near the table, scene units, belong to the object."""
        places = (points @ self._axes.T) * (1 / HALF)
        asked = places.reshape(1, -1, 1, 2).flip(-1)
        maps = torch.nn.functional.grid_sample(self._maps[None], asked, align_corners=False)[0]
        inside, below = maps.view(2, *points.shape[:-1]) > 0
        return (inside | (below & (self._table.heights(points) > VAGUE))) & (places.abs() < 1).all(-1)


def find_foot(table: Table, points: np.ndarray, colours: np.ndarray, standing: np.ndarray) -> Foot:
    """The foot of an object.

    Args:
        points: [n, 3] what photos show near the table from above, scene units.
        colours: [n, 3] the photos' colours there.
        standing: [m, 3] points of the object above its foot.
    """
    heights = table.heights(points)
    chosen = (np.abs(heights) < LOW) & (np.abs(points @ table.axes.T) < HALF).all(1)
    heights, places, colours = heights[chosen], points[chosen] @ table.axes.T, colours[chosen]
    n = _cells_for(places)
    index = _index(places, n)
    medians, counts = _medians(index, heights, n)
    over = np.zeros(n * n, bool)
    over[_index(standing @ table.axes.T, n)] = True
    over = ndimage.binary_closing(np.pad(over.reshape(n, n), GAP + 1), iterations=GAP)[
        GAP + 1 : -GAP - 1, GAP + 1 : -GAP - 1
    ]
    colour = np.stack([_medians(index, channel, n)[0] for channel in colours.T], axis=-1)
    weights = np.minimum(counts, 1.0)
    around = np.stack([_smoothed(channel, weights) for channel in np.moveaxis(colour, -1, 0)], axis=-1)
    colour = np.where(counts[..., None] > 0, colour, around)
    hidden = over & (counts == 0)
    weights = _smoothed(weights, np.ones_like(weights))
    known = (weights > SPARSE) & ~hidden
    hints = HINT * (MOST / n) ** 2 * _by_height(medians, counts, over)
    inside = random_walk(hints, np.log(colour + DARKEST), known, CONTRAST) - 0.5
    # What no photo shows is within the foot.
    inside[ndimage.binary_fill_holes((inside > 0) | hidden) & ~known & ~hidden] = 0.5
    return Foot(table, inside, np.where(hidden, 1.0, -1.0).astype(np.float32))


def _by_height(medians: np.ndarray, counts: np.ndarray, over: np.ndarray) -> np.ndarray:
    """[r, r] how clearly cells are higher than the table and connected to what is under the object; negative where they are not."""
    weights = np.minimum(counts / ENOUGH, 1.0)
    others = (weights > 0) & ~over
    deviation = 1.4826 * np.median(np.abs(_smoothed(medians, weights)[others])) if others.any() else 0.0
    least = max(LEAST_HEIGHT, NOISE * deviation)
    # The edge is half of the way up, however high the object is there.
    heights = _smoothed(medians.clip(0.0, 2 * least), weights)
    told = _smoothed(weights, np.ones_like(weights)) > SPARSE
    parts, _ = ndimage.label(((heights > least) & told) | (over & (counts == 0)))
    own = np.unique(parts[over & (parts > 0)])
    clearly = (heights - least) / least
    hints = np.where(np.isin(parts, own[own > 0]), clearly, np.where(told, -np.abs(clearly), np.minimum(clearly, 0.0)))
    return np.where(over & (hints > 0), UNDER * hints, hints)


def _cells_for(places: np.ndarray) -> int:
    """The number of cells along the map's edge for points [n, 2] of the table."""
    coarse = np.bincount(_index(places, FEWEST), minlength=FEWEST**2)
    density = np.median(coarse[coarse > 0]) if len(places) else 0.0
    return int(np.clip(FEWEST * np.sqrt(density / ENOUGH), FEWEST, MOST))


def _index(places: np.ndarray, n: int) -> np.ndarray:
    """The cells [k] of a map of n x n that hold places [k, 2] of the table."""
    row, column = np.floor((places / HALF + 1) * (0.5 * n)).astype(int).clip(0, n - 1).T
    return row * n + column


def _medians(index: np.ndarray, values: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """[n, n] the medians of values [k] in their cells [k], 0 in cells without one, and the numbers of values."""
    counts = np.bincount(index, minlength=n * n)
    ordered = np.append(values[np.lexsort((values, index))], 0.0)
    middle = np.cumsum(counts) - counts + counts // 2
    medians = np.where(counts > 0, ordered[middle.clip(0, len(values))], 0.0)
    return medians.reshape(n, n), counts.reshape(n, n)


def _smoothed(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """[r, r] the weighted means around each cell; 0 where nothing near it has a weight."""
    total = ndimage.gaussian_filter(weights, BLUR)
    return np.where(total > 1e-3, ndimage.gaussian_filter(values * weights, BLUR) / np.maximum(total, 1e-3), 0.0)
