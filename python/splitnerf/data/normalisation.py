"""Where the object stands: the masks' visual hull, and the similarity that brings it into the scene box."""

from __future__ import annotations

import numpy as np

FITS_RADIUS = (0.4, 1.4)
TARGET_RADIUS = 1.0
COARSE, FINE = 32, 48


def estimate_box(silhouettes: np.ndarray, poses: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
    """Estimates the similarity from the data's world to the frame where the object fits the box [-1.5, 1.5]^3.

    A grid around the point nearest to all optical axes is carved by the masks, then a finer one around what is left.
    Where the hull's bounding sphere about the origin has a radius in (0.4, 1.4] the data's frame is kept.

    Args:
        silhouettes: [n, H, W] bool, true on the object.
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        intrinsics: [n, 4], (fx, fy, cx, cy) in pixels of `silhouettes`.

    Returns:
        [4, 4] float64, uniform scale and translation, or the identity.

    Raises:
        ValueError: No point of space projects into the masks.
    """
    n, height, width = silhouettes.shape
    poses, intrinsics = poses.astype(np.float64), intrinsics.astype(np.float64)
    tables = np.zeros((n, height + 1, width + 1), dtype=np.int32)
    np.cumsum(np.cumsum(silhouettes, axis=1, dtype=np.int32), axis=2, out=tables[:, 1:, 1:])
    centre = nearest_to_axes(poses)
    depth = np.linalg.norm(poses[:, :3, 3] - centre, axis=1)
    half = np.full(3, (depth * 0.5 * np.hypot(width / intrinsics[:, 0], height / intrinsics[:, 1])).max())
    for resolution in (COARSE, FINE):
        cell = 2 * half.max() / resolution
        points = _grid(centre, half, cell)
        points = points[_inside(points, cell, tables, poses, intrinsics)]
        if len(points) == 0:
            raise ValueError("masks and poses contradict each other, no point lies in all masks; check the poses")
        low, high = points.min(axis=0), points.max(axis=0)
        centre, half = (low + high) / 2, (high - low) / 2 + cell
    if FITS_RADIUS[0] < np.linalg.norm(points, axis=1).max() <= FITS_RADIUS[1]:
        return np.eye(4)
    radius = np.linalg.norm(points - centre, axis=1).max() + cell / 2
    box_from_world = np.diag([TARGET_RADIUS / radius] * 3 + [1.0])
    box_from_world[:3, 3] = -centre * TARGET_RADIUS / radius
    return box_from_world


def transform_points(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Applies a [4, 4] similarity to points [..., 3]; the result has their dtype."""
    points = np.asarray(points)
    return (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(points.dtype)


def nearest_to_axes(poses: np.ndarray) -> np.ndarray:
    """The point with the least sum of squared distances to all optical axes.

    It solves sum (I - d d^T) x = sum (I - d d^T) o; a trace of the identity keeps parallel axes solvable.

    Args:
        poses: [n, 4, 4] camera-to-world.

    Returns:
        [3] point.
    """
    axes, origins = poses[:, :3, 2], poses[:, :3, 3]
    projections = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    right = np.einsum("nij,nj->i", projections, origins)
    return np.linalg.solve(projections.sum(axis=0) + 1e-9 * len(poses) * np.eye(3), right)


def _grid(centre: np.ndarray, half: np.ndarray, cell: float) -> np.ndarray:
    axes = [c + (np.arange(int(np.ceil(2 * h / cell))) + 0.5) * cell - h for c, h in zip(centre, half)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _inside(
    points: np.ndarray, cell: float, tables: np.ndarray, poses: np.ndarray, intrinsics: np.ndarray
) -> np.ndarray:
    """Indices of the points that at most one view in twenty puts on background.

    Points that few views see, far in front of or behind the object, are dropped: what stays is seen by at least three
    quarters as many views as the best seen point.

    A point stands for its cell: it counts as foreground where any mask pixel within the projected half cell is one,
    counted with a summed-area table.
    """
    n, height, width = tables.shape[0], tables.shape[1] - 1, tables.shape[2] - 1
    alive = np.arange(len(points))
    misses, seen = np.zeros(len(points), dtype=np.int32), np.zeros(len(points), dtype=np.int32)
    for table, pose, (fx, fy, cx, cy) in zip(tables, poses, intrinsics):
        local = (points[alive] - pose[:3, 3]) @ pose[:3, :3]
        ahead = -local[:, 2] > 1e-6
        depth = np.where(ahead, -local[:, 2], 1.0)
        x, y = cx + fx * local[:, 0] / depth, cy - fy * local[:, 1] / depth
        visible = ahead & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        reach = 0.5 * cell * max(fx, fy) / depth
        x0, x1 = np.clip(x - reach, 0, width - 1).astype(int), np.clip(x + reach, 0, width - 1).astype(int) + 1
        y0, y1 = np.clip(y - reach, 0, height - 1).astype(int), np.clip(y + reach, 0, height - 1).astype(int) + 1
        foreground = table[y1, x1] - table[y0, x1] - table[y1, x0] + table[y0, x0] > 0
        misses[alive] += visible & ~foreground
        seen[alive] += visible & foreground
        alive = alive[misses[alive] <= n // 20]
    return alive[seen[alive] * 4 >= 3 * seen[alive].max(initial=1)]
