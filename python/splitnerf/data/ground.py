"""The plane that an object stands on, by points that photos show."""

from __future__ import annotations

import numpy as np

TABLE_TOLERANCE = 0.006  # distance of the table's points from their plane, in the cameras' distances
TABLE_TILT = 40.0  # degrees between the table's normal and the mean of the cameras' upward axes
TABLE_SHARE = 0.15  # of the points near the object that a plane needs to count as a table
TRIALS = 2000


def find_table(
    points: np.ndarray, centre: np.ndarray, up: np.ndarray, distance: float, random: np.random.Generator
) -> tuple[np.ndarray, float] | None:
    """The plane below the centre on which most points lie.

    Args:
        points: [n, 3] sparse points.
        centre: [3] the centre of the object.
        up: [3] roughly upward, a unit vector.
        distance: The cameras' distance from the centre.
        random: The source of random numbers.

    Returns:
        The unit normal, upward, and its product with the plane's points; None where no plane has enough points.
    """
    if len(points) < 10:
        return None
    tolerance, best, most = TABLE_TOLERANCE * distance, None, TABLE_SHARE * len(points)
    corners = points[random.integers(0, len(points), (TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-20)[:, None] * np.sign(normals @ up)[:, None]
    below = ((centre - corners[:, 0]) * normals).sum(1) > -tolerance
    for k in np.flatnonzero((lengths > 0) & (normals @ up > np.cos(np.radians(TABLE_TILT))) & below):
        on = np.abs((points - corners[k, 0]) @ normals[k]) < tolerance
        if on.sum() > most:
            best, most = on, on.sum()
    if best is None:
        return None
    for _ in range(5):
        middle = points[best].mean(0)
        normal = np.linalg.svd(points[best] - middle, full_matrices=False)[2][2]
        normal *= np.sign(normal @ up)
        best = np.abs((points - middle) @ normal) < tolerance
    return normal, float(normal @ middle)
