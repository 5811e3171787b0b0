"""Masks of the object in photographs, without a trained network: GrabCut in each photo, held together by a visual hull.

Source: Rother, Kolmogorov and Blake 2004 (GrabCut); Laurentini 1994 (the visual hull).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from splitnerf.capture.world import World

WIDEN = 0.6  # share of the object's width by which the first region is wider than the convex hull of its points
DOT = 0.0015  # radius around a seen point that is certain, in the photo's width
CELLS = 112  # of the hull's grid along its longest edge
AGREE = 0.85  # share of the photos whose masks a cell of the hull must lie in
ROUNDS = 3
ITERATIONS = 4  # of GrabCut in a round
BAND = 0.02  # half the width of the band around the hull's outline that a photo decides on, in the photo's width
LAST_BAND = 0.005  # the same after the last round: what a mask has beyond it is dropped
MARGIN = 4  # cells around a hull in which the next one is looked for


@dataclass
class View:
    """One undistorted photo, reduced to the size at which masks are found.

    Attributes:
        photo: [h, w, 3] uint8.
        camera: [3, 4] float64, from world points to homogeneous pixels.
        object_dots, other_dots: [k, 2] places of the points that it sees, of the object and of what is around it.
    """

    photo: np.ndarray
    camera: np.ndarray
    object_dots: np.ndarray
    other_dots: np.ndarray

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places [n, 2] of world points [n, 3] in pixels, and their depths [n]."""
        homogeneous = points @ self.camera[:, :3].T + self.camera[:, 3]
        return homogeneous[:, :2] / np.where(homogeneous[:, 2:] > 0, homogeneous[:, 2:], np.nan), homogeneous[:, 2]


def find_masks(views: list[View], world: World, report: Callable[[float], None]) -> list[np.ndarray]:
    """[h, w] bool masks, one for each view.

    The first region in a photo is the convex hull of the object's points, wider by a share, above the table. GrabCut finds
    what in it looks unlike the rest; cells of space that lie in nearly all masks are the hull, whose outline is the next
    region's middle. In the end, what is far from the hull is dropped.

    Args:
        views: The photos.
        world: The cameras' world.
        report: Called with the share done.
    """
    points = world.scene.points[world.object_points]
    corners = _widened(points, world.table)
    regions = [_filled(view, corners) for view in views]
    certain = [np.zeros_like(region) for region in regions]
    space = np.stack([corners.min(0), corners.max(0)])
    for number in range(ROUNDS):
        masks = []
        for i, view in enumerate(views):
            masks.append(_grab(view, regions[i], certain[i]))
            report((number * len(views) + i + 1) / (ROUNDS * len(views)))
        cells, size = hull_of(views, masks, space)
        if len(cells) == 0:
            return masks
        space = np.stack([cells.min(0) - MARGIN * size, cells.max(0) + MARGIN * size])
        band = BAND if number + 1 < ROUNDS else LAST_BAND
        regions, certain = zip(*(_around(view, cells, size, band) for view in views))
    return [mask & region for mask, region in zip(masks, regions)]


def _widened(points: np.ndarray, table: bool) -> np.ndarray:
    """The corners of a convex body around points, wider than they are and down to the table."""
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        corners = points
    middle = np.median(points, axis=0)
    wider = middle + (1 + WIDEN) * (corners - middle)
    if not table:
        return wider
    wider[:, 2] = middle[2] + (1 + 0.2 * WIDEN) * (corners[:, 2] - middle[2])
    foot = wider * [1, 1, 0]
    return np.concatenate([wider[wider[:, 2] > 0], foot])


def _filled(view: View, corners: np.ndarray) -> np.ndarray:
    """[h, w] bool, the convex outline of corners."""
    places, depths = view.project(corners)
    region = np.zeros(view.photo.shape[:2], np.uint8)
    if (depths > 0).any():
        outline = cv2.convexHull(places[depths > 0].astype(np.float32).clip(-(10**4), 10**4))
        cv2.fillConvexPoly(region, outline.round().astype(np.int32), 1)
    return region.astype(bool)


def _grab(view: View, region: np.ndarray, certain: np.ndarray) -> np.ndarray:
    """[h, w] bool, what GrabCut finds in a region; `certain` is in it without question."""
    trimap = np.where(region, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    radius = max(1, round(DOT * view.photo.shape[1]))
    for dots, kind in ((view.other_dots, cv2.GC_BGD), (view.object_dots, cv2.GC_FGD)):
        for x, y in dots:
            cv2.circle(trimap, (int(x), int(y)), radius, int(kind), -1)
    trimap[certain] = cv2.GC_FGD
    known = np.isin(trimap, (cv2.GC_BGD, cv2.GC_PR_BGD))
    if known.all() or not known.any():
        return region
    models = np.zeros((1, 65)), np.zeros((1, 65))
    bgr = np.ascontiguousarray(view.photo[..., ::-1])
    cv2.setRNGSeed(0)
    cv2.grabCut(bgr, trimap, None, *models, ITERATIONS, cv2.GC_INIT_WITH_MASK)
    return np.isin(trimap, (cv2.GC_FGD, cv2.GC_PR_FGD))


def hull_of(views: list[View], masks: list[np.ndarray], space: np.ndarray) -> tuple[np.ndarray, float]:
    """The cells of a box [2, 3] (its lowest and highest corner) that lie in nearly all masks: their centres [k, 3], and a
    cell's width."""
    low, high = space
    size = float((high - low).max() / CELLS)
    axes = [np.arange(a + size / 2, b, size) for a, b in zip(low, high)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    seen, inside = np.zeros(len(cells)), np.zeros(len(cells))
    for view, mask in zip(views, masks):
        places, depths = view.project(cells)
        x, y = np.nan_to_num(places, nan=-1).clip(-1, 10**6).astype(int).T
        h, w = mask.shape
        within = (depths > 0) & (x >= 0) & (y >= 0) & (x < w) & (y < h)
        seen += within
        inside[within] += mask[y[within], x[within]]
    return cells[(inside >= AGREE * seen) & (seen >= 3)], size


def _around(view: View, cells: np.ndarray, size: float, band: float) -> tuple[np.ndarray, np.ndarray]:
    """The region that may be the object, and that which certainly is: a hull's outline moved by a band's half width."""
    h, w = view.photo.shape[:2]
    places, depths = view.project(cells)
    front = depths > 0
    width = np.linalg.norm(view.camera[0, :3]) * size / np.median(depths[front]) if front.any() else 1.0
    outline = np.zeros((h, w), np.uint8)
    x, y = places[front].round().astype(int).T
    within = (x >= 0) & (y >= 0) & (x < w) & (y < h)
    outline[y[within], x[within]] = 1
    grow = lambda image, radius: cv2.dilate(image, _disc(radius))  # noqa: E731
    outline = cv2.morphologyEx(outline, cv2.MORPH_CLOSE, _disc(width))
    return grow(outline, band * w).astype(bool), cv2.erode(outline, _disc(band * w)).astype(bool)


def _disc(radius: float) -> np.ndarray:
    size = 2 * max(1, round(radius)) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
