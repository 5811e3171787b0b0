"""Photos compared in pairs: those that are there twice, and how bright each is beside photos from nearby directions."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree
from splitnerf.data.images import srgb_to_linear

from splitnerf_tools.inspection.hull import Fit
from splitnerf_tools.inspection.reduced_views import ReducedView

SAME_ANGLE, SAME_PLACE = 0.05, 1e-3  # degrees and object's radii by which one pose differs
COPIES, OTHER_POSES, ONE_POSE = "one photo twice", "one photo, two poses", "two photos, one pose"
NEIGHBOURS, NEAR = 4, 40.0  # photos that one is compared with, and degrees between their directions at most
LEAST_SHARED = 20  # cells that two photos must both show
BEHIND = 2.0  # cells by which a cell may lie behind the first in its pixel and be seen
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
DARKEST = 1e-3  # of the linear values that count


def duplicates(views: Sequence[ReducedView], radius: float) -> list[tuple[int, int, str]]:
    """Pairs of photos, i < j, of which at most one can be right, and what they are: one file, or one pose.

    Args:
        views: The photos.
        radius: The object's radius.
    """
    poses = np.stack([view.pose for view in views])
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1) / radius
    turn = (np.einsum("iab,jab->ij", poses[:, :3, :3], poses[:, :3, :3]) - 1) / 2
    one_pose = (apart < SAME_PLACE) & (np.degrees(np.arccos(np.clip(turn, -1, 1))) < SAME_ANGLE)
    files = np.array([hashlib.sha256(view.path.read_bytes()).hexdigest() for view in views])
    one_file = files[:, None] == files
    kinds = {(True, True): COPIES, (True, False): OTHER_POSES, (False, True): ONE_POSE}
    pairs = np.argwhere(np.triu(one_file | one_pose, 1)).tolist()
    return [(i, j, kinds[bool(one_file[i, j]), bool(one_pose[i, j])]) for i, j in pairs]


def differences(views: Sequence[ReducedView], fit: Fit) -> np.ndarray:
    """[n] by how many powers of two each photo is brighter than its neighbours in direction, NaN where it has none.

    Two photos are compared where both show a cell of the hull's surface, by the median of the ratios there; a photo's
    difference is the median over its neighbours.
    """
    surface = _surface(fit)
    values = np.stack([_seen_values(view, surface, fit.cell) for view in views])
    directions = np.stack([view.place - fit.centre for view in views])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosines = directions @ directions.T
    np.fill_diagonal(cosines, -2)
    result = np.full(len(views), np.nan)
    for i, row in enumerate(cosines):
        ratios = [values[i] - values[j] for j in np.argsort(-row)[:NEIGHBOURS] if row[j] > np.cos(np.radians(NEAR))]
        medians = [np.nanmedian(ratio) for ratio in ratios if np.isfinite(ratio).sum() >= LEAST_SHARED]
        if medians:
            result[i] = np.median(medians)
    return result


def _surface(fit: Fit) -> np.ndarray:
    """[m, 3] the cells of the hull that have fewer than six neighbours."""
    tree = cKDTree(fit.cells)
    return fit.cells[tree.query_ball_point(fit.cells, 1.1 * fit.cell, return_length=True) < 7]


def _seen_values(view: ReducedView, cells: np.ndarray, cell: float) -> np.ndarray:
    """[m] the logarithm, base 2, of the luminance at which a view shows cells; NaN where it does not."""
    values = np.full(len(cells), np.nan)
    numbers, y, x, depth = view.shown(cells, cell)
    step = max(1, round(1.5 * view.intrinsics[0] * cell / float(np.median(depth)))) if len(numbers) else 1
    height, width = view.mask.shape
    first = np.full((height // step + 1, width // step + 1), np.inf)
    np.minimum.at(first, (y // step, x // step), depth)
    visible = (depth <= first[y // step, x // step] + BEHIND * cell) & view.mask[y, x]
    luminance = srgb_to_linear(view.colour[y[visible], x[visible]]) @ LUMINANCE
    values[numbers[visible]] = np.where(luminance > DARKEST, np.log2(np.maximum(luminance, DARKEST)), np.nan)
    return values
