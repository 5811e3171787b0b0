"""The object's hull by the masks of most photos, and each mask beside what the others make of it.

Source: Laurentini 1994 (the visual hull).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from splitnerf.data.normalisation import MaskView, cell_centres

from splitnerf_tools.inspection.reduced_views import ReducedView

REACH = 3.0  # half edge of the box that is searched, in the internal frame, where the object's radius is about 1
COARSE, MIDDLE, SPLIT = 32, 24, 3  # cells along the box, then along what is left of it, then along each of these cells
CANDIDATE = 0.35  # share of the photos that must put a cell on the object for it to be looked at
MOST, NEARLY_ALL = 0.75, 0.95  # of the photos that agree, for a first hull and for the last one
SEEN = 0.5  # of the photos that see the best seen cell, how many must see a cell of the hull
LEAST_DROP, DROP_DEVIATIONS = 0.15, 5.0  # of an intersection over union below the median that is an outlier
BETTER_HALF = 0.05  # by which half of the photos must agree better among themselves than all
ENOUGH = 12  # photos whose halves are looked at


@dataclass
class Fit:
    """How the masks fit one object.

    Attributes:
        cells: [k, 3] centres of the hull's cells, internal frame.
        cell: A cell's width.
        agreement: [n] the intersection over union of each mask and the outline of the hull that the others make.
        outlines: [n] of [h, w] bool, that outline, filled.
        outliers: Numbers of the views whose mask disagrees with the others.
        inside: Numbers of the views whose camera stands in the hull of the others.
    """

    cells: np.ndarray
    cell: float
    agreement: np.ndarray
    outlines: list[np.ndarray]
    outliers: list[int]
    inside: list[int]

    @property
    def centre(self) -> np.ndarray:
        """[3] the middle of the hull's bounding box."""
        return (self.cells.min(0) + self.cells.max(0)) / 2

    @property
    def radius(self) -> float:
        """The distance of the hull's farthest cell from its centre."""
        return float(np.linalg.norm(self.cells - self.centre, axis=1).max() + self.cell / 2)


def fit_masks(views: Sequence[ReducedView]) -> Fit | None:
    """Compares masks and poses; None where the masks have no hull.

    A first hull is where three quarters of the photos see the object: of all photos, or of the first or second half
    where those agree much better among themselves, as when the object moved in between. The photos that agree with it
    make the hull, each mask being compared with that of the others.
    """
    votes = _Votes(views)
    if len(votes.cells) == 0:
        return None
    everyone, n = np.arange(len(views)), len(views)
    best = votes.agreement(everyone, MOST)
    members, quality = everyone, np.median(best)
    for half in (everyone[: n // 2], everyone[n // 2 :]) if n >= ENOUGH else ():
        values = votes.agreement(half, MOST)
        if np.median(values[half]) > quality + BETTER_HALF:
            best, members, quality = values, half, np.median(values[half])
    members = everyone[best >= _least(best[members])]
    outlines = [votes.outline(i, votes.hull(members, NEARLY_ALL, without=i)) for i in everyone]
    agreement = np.array([_overlap(view, outline) for view, outline in zip(views, outlines)])
    cells = votes.cells[votes.hull(members, NEARLY_ALL)]
    if len(cells) == 0:
        return None
    least = _least(agreement[members])
    outliers = [int(i) for i in np.argsort(agreement) if agreement[i] < least]
    return Fit(cells, votes.cell, agreement, outlines, outliers, _cameras_inside(votes, members))


class _Votes:
    """What each mask says of each cell near the object."""

    def __init__(self, views: Sequence[ReducedView]):
        self.views = views
        self.masks = [MaskView.of(view.mask, view.pose, view.intrinsics, view.known) for view in views]
        half, centre = np.full(3, REACH), np.zeros(3)
        for resolution in (COARSE, MIDDLE):
            self.cell = 2 * half.max() / resolution
            cells = self._candidates(cell_centres(centre, half, self.cell))
            if len(cells) == 0:
                break
            centre, half = (cells.min(0) + cells.max(0)) / 2, np.ptp(cells, axis=0) / 2 + self.cell
        self.cell /= SPLIT
        steps = (np.arange(SPLIT) - (SPLIT - 1) / 2) * self.cell
        parts = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        self.cells = (cells[:, None] + parts).reshape(-1, 3)
        judged = [mask.judge(self.cells, 0.0) for mask in self.masks]
        self.seen = np.array([visible for visible, _ in judged])
        self.inside = np.array([visible & foreground for visible, foreground in judged])

    def _candidates(self, cells: np.ndarray) -> np.ndarray:
        """Those of cells [m, 3] that enough masks may contain."""
        seen, inside = np.zeros(len(cells), np.int32), np.zeros(len(cells), np.int32)
        for mask in self.masks:
            visible, foreground = mask.judge(cells, self.cell)
            seen += visible
            inside += visible & foreground
        return cells[(inside > 0) & (inside >= CANDIDATE * seen) & (seen >= CANDIDATE * seen.max())]

    def hull(self, members: np.ndarray, share: float, without: int | None = None) -> np.ndarray:
        """[k] bool, the cells that this share of the members that see them put on the object, one aside."""
        chosen = members[members != without]
        seen, inside = self.seen[chosen].sum(0, dtype=np.int32), self.inside[chosen].sum(0, dtype=np.int32)
        return (seen > 0) & (inside >= share * seen) & (seen >= SEEN * seen.max(initial=0))

    def outline(self, index: int, chosen: np.ndarray) -> np.ndarray:
        """[h, w] bool, what a view shows of chosen cells."""
        view = self.views[index]
        filled = np.zeros(view.mask.shape, bool)
        _, y, x, depth = view.shown(self.cells[chosen], self.cell)
        if len(depth) == 0:
            return filled
        filled[y, x] = True
        # Odd, about a cell's width.
        footprint = 2 * round(view.intrinsics[0] * self.cell / float(np.median(depth)) / 2) + 1
        return ndimage.binary_dilation(filled, np.ones((footprint, footprint))) & view.known

    def agreement(self, members: np.ndarray, share: float) -> np.ndarray:
        """[n] the intersection over union of each mask and the outline of the hull by these members."""
        chosen = self.hull(members, share)
        return np.array([_overlap(view, self.outline(i, chosen)) for i, view in enumerate(self.views)])


def _overlap(view: ReducedView, outline: np.ndarray) -> float:
    """The intersection over union of a view's mask and an outline; 1 where both are empty."""
    union = (view.mask | outline).sum()
    return float((view.mask & outline).sum() / union) if union else 1.0


def _least(values: np.ndarray) -> float:
    """The agreement below which a view is an outlier among these."""
    median = np.median(values)
    deviation = 1.4826 * np.median(np.abs(values - median))
    return float(median - max(LEAST_DROP, DROP_DEVIATIONS * deviation))


def _cameras_inside(votes: _Votes, members: np.ndarray) -> list[int]:
    """The views whose camera stands where nearly all others see the object."""
    places = np.stack([view.place for view in votes.views])
    judged = [mask.judge(places, 0.0) for mask in votes.masks]
    seen = np.array([visible for visible, _ in judged])[members]
    inside = np.array([visible & foreground for visible, foreground in judged])[members].sum(0)
    seen = seen.sum(0)  # a camera does not see its own place
    enclosed = (seen > 0) & (seen >= SEEN * (len(members) - 1)) & (inside >= NEARLY_ALL * seen)
    return [int(i) for i in np.flatnonzero(enclosed)]
