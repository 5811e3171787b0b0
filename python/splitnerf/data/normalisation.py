"""Where the object stands: the masks' visual hull, and the similarity that brings it into the scene box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from splitnerf.errors import note_once

FITS_RADIUS = (0.4, 1.4)
TARGET_RADIUS = 1.0
COARSE, FINE = 32, 48
IN_VIEW = 0.8  # radius of what all cameras look at, as a share of what the narrower side of a photo shows
POOR = 0.9  # median share of the masks that the hull covers, below which masks and poses are not of one object
SAME_PLACE = 1e-9  # distance of cameras, as a share of that from the origin
PARALLEL = 1e-4  # mean squared sine below which optical axes do not say where they meet
AHEAD = 0.5  # mean cosine between the axes and the ways to where they meet, below which poses are of another form
LOOKS_AWAY = (
    "the cameras look away from what they have in common; poses must be camera-to-world (not its inverse), with OpenGL's "
    "axes (-z forward)"
)


class MasksContradict(ValueError):
    """No point of space projects into the masks. `views` are the few views whose masks miss the point that the most other masks
    contain; none where many do."""

    def __init__(self, views: list[int]):
        super().__init__("masks and poses contradict each other, no point lies in all masks")
        self.views = views


def estimate_box(
    silhouettes: Sequence[np.ndarray],
    poses: np.ndarray,
    intrinsics: np.ndarray,
    known: Sequence[np.ndarray | None] | None = None,
) -> np.ndarray:
    """The similarity [4, 4] float64 (uniform scale and translation) from the data's world to the frame where the object fits the
    box [-1.5, 1.5]^3. Raises MasksContradict where no point of space projects into the masks, and ValueError where all cameras
    stand at one place.

    A grid around the point nearest to all optical axes is carved by the masks, then a finer one around what is left.
    Where the hull's bounding sphere about the origin has a radius in (0.4, 1.4] the data's frame is kept: the identity.
    Notes where the hull covers little of the masks, as with a wrong lens or masks that are inverted.

    Args:
        silhouettes: n arrays [H, W] bool, true on the object, each of its own size.
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        intrinsics: [n, 4], (fx, fy, cx, cy) in pixels of `silhouettes`.
        known: n arrays [H, W] bool, the pixels that say something; None for all.
    """
    n, sizes = len(silhouettes), np.array([silhouette.shape for silhouette in silhouettes])
    poses, intrinsics = poses.astype(np.float64), intrinsics.astype(np.float64)
    _check_places(poses)
    views = [MaskView.of(*view) for view in zip(silhouettes, poses, intrinsics, [None] * n if known is None else known)]
    centre = first_centre(silhouettes, poses, intrinsics)
    depth = np.linalg.norm(poses[:, :3, 3] - centre, axis=1)
    half = np.full(3, (depth * 0.5 * np.hypot(*(sizes[:, ::-1] / intrinsics[:, :2]).T)).max())
    for resolution in (COARSE, FINE):
        cell = 2 * half.max() / resolution
        grid = cell_centres(centre, half, cell)
        alive, n_seen = _inside(grid, cell, views)
        if 2 * n_seen < n:
            _check_agreement(grid, cell, views, n_seen)
        points = grid[alive]
        low, high = points.min(axis=0), points.max(axis=0)
        centre, half = (low + high) / 2, (high - low) / 2 + cell
    if (share := np.median([view.covered(points, cell) for view in views])) < POOR:
        if looks_away(poses):
            raise MasksContradict([])
        found = f"what all masks hold covers {share:.0%} of them"
        note_once(f"masks and poses fit badly: {found}; check masks, poses and lens, `splitnerf inspect` shows them")
    if FITS_RADIUS[0] < np.linalg.norm(points, axis=1).max() <= FITS_RADIUS[1]:
        return np.eye(4)
    return _similarity(centre, np.linalg.norm(points - centre, axis=1).max() + cell / 2)


def box_of_views(poses: np.ndarray, intrinsics: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The similarity [4, 4] float64 that brings the middle of what all cameras look at to the origin, with a radius of 1. Raises
    ValueError where all cameras stand at one place, or they look away from what they have in common.

    Args:
        poses, intrinsics: See :func:`estimate_box`.
        sizes: [n, 2] height and width of the photos in pixels.
    """
    poses = poses.astype(np.float64)
    _check_places(poses)
    if looks_away(poses):
        raise ValueError(LOOKS_AWAY)
    centre = nearest_to_rays(poses[:, :3, 3], poses[:, :3, 2])
    distances = np.linalg.norm(poses[:, :3, 3] - centre, axis=1)
    half = 0.5 * (sizes[:, ::-1] / intrinsics[:, :2]).min(axis=1)  # tangent of half the narrower angle
    return _similarity(centre, IN_VIEW * np.median(distances * half))


def _similarity(centre: np.ndarray, radius: float) -> np.ndarray:
    """[4, 4] that brings a ball to the origin, with a radius of TARGET_RADIUS."""
    matrix = np.diag([TARGET_RADIUS / radius] * 3 + [1.0])
    matrix[:3, 3] = -centre * TARGET_RADIUS / radius
    return matrix


def _check_places(poses: np.ndarray) -> None:
    """Raises ValueError where all cameras stand at one place."""
    places = poses[:, :3, 3]
    if np.ptp(places, axis=0).max() <= SAME_PLACE * np.abs(places).max():
        many = (
            f"all {len(poses)} cameras stand at one place; estimate poses, or invert them if they are world-to-camera"
        )
        raise ValueError(
            many if len(poses) > 1 else "one view does not show the object's shape; add views from other sides"
        )


def looks_away(poses: np.ndarray) -> bool:
    """Whether cameras do not look at what their axes have in common."""
    places, axes = poses[:, :3, 3], poses[:, :3, 2]
    back = places - nearest_to_rays(places, axes)
    cosines = (back * axes).sum(axis=1) / np.maximum(np.linalg.norm(back, axis=1), 1e-300)
    return bool(spread_of(axes) > PARALLEL and cosines.mean() < AHEAD)


def transform_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Applies a [4, 4] similarity to points [..., 3]; the result has their dtype."""
    points = np.asarray(points)
    return (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(points.dtype)


def transform_plane(matrix: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """A plane [4], its unit normal and that one's product with the plane's points, where a [4, 4] similarity without a rotation
    brings it."""
    return np.append(plane[:3], matrix[0, 0] * plane[3] + plane[:3] @ matrix[:3, 3])


def first_centre(silhouettes: Sequence[np.ndarray], poses: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
    """The point [3] nearest to all optical axes or, where these are about parallel, to the rays through the middles of
    the silhouettes; arguments as for `estimate_box`, float64."""
    origins, axes = poses[:, :3, 3], poses[:, :3, 2]
    if spread_of(axes) > PARALLEL:
        return nearest_to_rays(origins, axes)
    filled = np.array([silhouette.any() for silhouette in silhouettes])
    middles = [np.argwhere(silhouette).mean(axis=0) if silhouette.any() else (0, 0) for silhouette in silhouettes]
    y, x = np.add(middles, 0.5).T
    fx, fy, cx, cy = intrinsics.T
    local = np.stack([(x - cx) / fx, (cy - y) / fy, -np.ones_like(x)], axis=-1)
    rays = np.einsum("nij,nj->ni", poses[:, :3, :3], local)
    return nearest_to_rays(origins[filled], rays[filled]) if filled.any() else nearest_to_rays(origins, axes)


def spread_of(directions: np.ndarray) -> float:
    """How far lines of directions [n, 3] are from parallel: the mean squared sine of their angles to their mean."""
    d = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return float(np.linalg.eigvalsh(np.eye(3) - d.T @ d / len(d))[0])


def nearest_to_rays(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The point [3] with the least sum of squared distances to lines through origins [n, 3] along directions [n, 3]:
    sum (I - d d^T) x = sum (I - d d^T) o; a trace of the identity keeps parallel lines solvable."""
    d = directions / np.linalg.norm(directions, axis=1, keepdims=True)  # rounded ones outweigh the trace
    projections = np.eye(3) - d[:, :, None] * d[:, None, :]
    right = np.einsum("nij,nj->i", projections, origins)
    return np.linalg.solve(projections.sum(axis=0) + 1e-9 * len(d) * np.eye(3), right)


def cell_centres(centre: np.ndarray, half: np.ndarray, cell: float) -> np.ndarray:
    """[m, 3] the centres of cubic cells, `cell` wide, in the box around `centre` [3] with half edges `half` [3]."""
    axes = [c + (np.arange(int(np.ceil(2 * h / cell))) + 0.5) * cell - h for c, h in zip(centre, half)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class MaskView:
    """A mask as a summed-area table [H + 1, W + 1], its camera, and its known pixels [H, W] or None for all."""

    table: np.ndarray
    pose: np.ndarray
    intrinsics: np.ndarray
    known: np.ndarray | None

    @classmethod
    def of(cls, silhouette: np.ndarray, pose: np.ndarray, intrinsics: np.ndarray, known: np.ndarray | None) -> MaskView:
        """The view of a mask [H, W] bool; the other arguments are those of `estimate_box` for one view."""
        height, width = silhouette.shape
        table = np.zeros((height + 1, width + 1), dtype=np.int32)
        np.cumsum(np.cumsum(silhouette, axis=0, dtype=np.int32), axis=1, out=table[1:, 1:])
        return cls(table, pose, intrinsics, known)

    def judge(self, points: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
        """Whether the view shows points [m, 3], and whether on foreground, [m] bool each. A point stands for its cell: it counts as
        foreground where any mask pixel within the projected half cell is one, counted with the summed-area table."""
        visible, (x0, x1, y0, y1) = self._shown(points, cell)
        table = self.table
        return visible, table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0] > 0

    def covered(self, points: np.ndarray, cell: float) -> float:
        """The share of the mask that cells around points [m, 3] cover; 1 where the mask is empty."""
        visible, (x0, x1, y0, y1) = self._shown(points, cell)
        marks = np.zeros(self.table.shape, np.int32)
        for y, x, sign in ((y0, x0, 1), (y1, x1, 1), (y0, x1, -1), (y1, x0, -1)):
            np.add.at(marks, (y[visible], x[visible]), sign)
        mask = np.diff(np.diff(self.table, axis=0), axis=1) > 0
        return float((marks.cumsum(0).cumsum(1)[:-1, :-1] > 0)[mask].mean()) if mask.any() else 1.0

    def _shown(self, points: np.ndarray, cell: float) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        """Whether the view shows points [m, 3], and what pixels their cells cover: first and last column + 1, then rows."""
        height, width = self.table.shape[0] - 1, self.table.shape[1] - 1
        fx, fy, cx, cy = self.intrinsics
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        ahead = -local[:, 2] > 1e-6 * np.linalg.norm(local, axis=1)
        depth = np.where(ahead, -local[:, 2], 1.0)
        x, y = cx + fx * local[:, 0] / depth, cy - fy * local[:, 1] / depth
        visible = ahead & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        if self.known is not None:
            visible[visible] = self.known[y[visible].astype(int), x[visible].astype(int)]
        reach = 0.5 * cell * max(fx, fy) / depth
        x0, x1 = np.clip(x - reach, 0, width - 1).astype(int), np.clip(x + reach, 0, width - 1).astype(int) + 1
        y0, y1 = np.clip(y - reach, 0, height - 1).astype(int), np.clip(y + reach, 0, height - 1).astype(int) + 1
        return visible, (x0, x1, y0, y1)


def _inside(points: np.ndarray, cell: float, views: list[MaskView]) -> tuple[np.ndarray, int]:
    """Indices of the points that at most one view in twenty puts on background, without those that few views see, far
    from the object; and how many views put the best of them on foreground."""
    alive = np.arange(len(points))
    misses, seen = np.zeros(len(points), dtype=np.int32), np.zeros(len(points), dtype=np.int32)
    for view in views:
        visible, foreground = view.judge(points[alive], cell)
        misses[alive] += visible & ~foreground
        seen[alive] += visible & foreground
        alive = alive[misses[alive] <= len(views) // 20]
    n_seen = int(seen[alive].max(initial=0))
    return alive[seen[alive] * 4 >= 3 * max(1, n_seen)], n_seen


def _check_agreement(points: np.ndarray, cell: float, views: list[MaskView], n_seen: int) -> None:
    """Raises MasksContradict where the points that the masks leave, which `n_seen` views at most show, are not the
    object: where none is left, or twice as many views put another point on foreground, which few others carved away."""
    judged = [view.judge(points, cell) for view in views]
    seen = np.sum([visible & foreground for visible, foreground in judged], axis=0)
    best = seen.argmax()
    if n_seen == 0 or 2 * n_seen < seen[best]:
        missing = [i for i, (visible, foreground) in enumerate(judged) if visible[best] and not foreground[best]]
        raise MasksContradict(missing if 3 * len(missing) < len(views) else [])
