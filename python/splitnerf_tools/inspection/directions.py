"""From which sides the cameras see the object."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from splitnerf_tools.inspection.reduced_views import ReducedView

LEVEL = 0.1  # mean square of the sideways axes along upward, beyond which cameras are rolled and do not tell upward
POLE = 75.0  # degrees of elevation, up or down, from which on a camera is on no side
NEAR_AXIS = 10.0  # degrees between upward and the data's z axis that count as none


def angles(views: Sequence[ReducedView], centre: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Azimuths [n] in (-180, 180] and elevations [n] of the cameras seen from a point [3], degrees, and upward [3]."""
    upward = find_upward(np.stack([view.pose for view in views]))
    x, y = horizontal_axes(upward)
    away = np.stack([view.place - centre for view in views])
    azimuth = np.degrees(np.arctan2(away @ y, away @ x))
    return azimuth, np.degrees(np.arctan2(away @ upward, np.hypot(away @ x, away @ y))), upward


def find_upward(poses: np.ndarray) -> np.ndarray:
    """[3] the unit vector to which the cameras' sideways axes are perpendicular, on the side of their upward axes; z
    where they have no such vector or it is nearly z.

    Args:
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
    """
    z = np.array([0.0, 0.0, 1.0])
    sideways = poses[:, :3, 0]
    if (sideways @ z).std() == 0 and np.abs(sideways @ z).max() < 1e-6:
        return z if poses[:, 2, 1].mean() >= 0 else -z
    values, vectors = np.linalg.eigh(sideways.T @ sideways / len(poses))
    upward = vectors[:, 0] * (1 if poses[:, :3, 1].mean(0) @ vectors[:, 0] >= 0 else -1)
    return z if values[0] > LEVEL or upward @ z > np.cos(np.radians(NEAR_AXIS)) else upward


def horizontal_axes(upward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that make a right-handed frame with upward; x and y where that is z."""
    x = np.array([1.0, 0.0, 0.0]) if abs(upward[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = x - (x @ upward) * upward
    x /= np.linalg.norm(x)
    return x, np.cross(upward, x)


def largest_gap(azimuth: np.ndarray, elevation: np.ndarray) -> tuple[float, float]:
    """The widest range of azimuths without a camera, and where it begins, degrees; cameras at the poles do not count."""
    sorted_azimuths = np.sort(azimuth[np.abs(elevation) < POLE])
    if len(sorted_azimuths) == 0:
        return 360.0, -180.0
    gaps = np.diff(np.append(sorted_azimuths, sorted_azimuths[0] + 360))
    return float(gaps.max()), float(sorted_azimuths[gaps.argmax()])
