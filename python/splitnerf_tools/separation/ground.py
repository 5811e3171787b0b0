"""The plane that an object stands on, by points that photos show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

LEAST_HEIGHT, LARGEST_HEIGHT = 0.006, 0.06  # over the table, at which single points stand out, scene units
ON_TABLE = 0.05  # height within which points are the table's, scene units
TABLE_TOLERANCE = 0.006  # distance of the table's points from their plane, in the cameras' distances
TABLE_TILT = 40.0  # degrees between the table's normal and the mean of the cameras' upward axes
TABLE_SHARE = 0.15  # of the points near the object that a plane needs to count as a table
TRIALS = 2000
CENTRE_BELOW = 0.15  # depth of the centre below a table at most, in the cameras' distances: photos may aim at its foot
FEW_BELOW = 0.02  # share of the points near the object that may lie below such a table: nothing shows there, but under a lid much
NOISE = 2.5  # standard deviations of the table's points by which things stand out


@dataclass(frozen=True)
class Table:
    """A plane: its unit normal [3], upward, the product of the normal with the plane's points, and the height over it at which
    a single point is no longer the table's, scene units."""

    normal: np.ndarray
    offset: float
    height: float = LARGEST_HEIGHT

    @classmethod
    def through(cls, normal: np.ndarray, offset: float, points: np.ndarray) -> Table:
        """The table at the height, near this plane, at which photos show it by points [n, 3], with a height by how far they
        scatter around it."""
        apart = points @ normal - offset
        near = apart[np.abs(apart) < ON_TABLE]
        middle = float(np.median(near)) if len(near) else 0.0
        deviation = 1.4826 * float(np.median(np.abs(near - middle))) if len(near) else ON_TABLE
        return cls(normal, offset + middle, min(max(NOISE * deviation, LEAST_HEIGHT), LARGEST_HEIGHT))

    def heights(self, points: np.ndarray | Tensor) -> np.ndarray | Tensor:
        """Heights [...] of points [..., 3] over the table."""
        return points @ (self.normal if isinstance(points, np.ndarray) else self.upward) - self.offset

    @cached_property
    def upward(self) -> Tensor:
        """[3] float32, the normal."""
        return torch.from_numpy(self.normal.astype(np.float32))

    @cached_property
    def axes(self) -> np.ndarray:
        """[2, 3] unit vectors along the table, at right angles."""
        side = np.eye(3)[np.abs(self.normal).argmin()]
        first = side - (side @ self.normal) * self.normal
        first = first / np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])


def find_table(
    points: np.ndarray, centre: np.ndarray, up: np.ndarray, distance: float, random: np.random.Generator
) -> tuple[np.ndarray, float] | None:
    """The plane below the centre, or a little above it with nothing to be seen underneath, on which most points lie: its unit
    normal, upward, and the normal's product with the plane's points; None where no plane has enough points.

    Args:
        points: [n, 3] sparse points.
        centre: [3] the centre of the object.
        up: [3] roughly upward, a unit vector.
        distance: The cameras' distance from the centre.
    """
    if len(points) < 10:
        return None
    tolerance, best, most = TABLE_TOLERANCE * distance, None, TABLE_SHARE * len(points)
    corners = points[random.integers(0, len(points), (TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-20)[:, None] * np.sign(normals @ up)[:, None]
    above = ((centre - corners[:, 0]) * normals).sum(1)  # height of the centre
    upright = (lengths > 0) & (normals @ up > np.cos(np.radians(TABLE_TILT)))
    for k in np.flatnonzero(upright & (above > -CENTRE_BELOW * distance)):
        heights = (points - corners[k, 0]) @ normals[k]
        on = np.abs(heights) < tolerance
        lowest = above[k] > -tolerance or np.mean(heights < -2 * tolerance) < FEW_BELOW
        if on.sum() > most and lowest:
            best, most = on, on.sum()
    if best is None:
        return None
    for _ in range(5):
        middle = points[best].mean(0)
        normal = np.linalg.svd(points[best] - middle, full_matrices=False)[2][2]
        normal *= np.sign(normal @ up)
        best = np.abs((points - middle) @ normal) < tolerance
    return normal, float(normal @ middle)
