"""The plane on which the object stands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

LEAST_HEIGHT, LARGEST_HEIGHT = 0.006, 0.06  # over the table, at which single points stand out, scene units
ON_TABLE = 0.05  # height within which points are the table's, scene units
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
        """The table on this plane, with a height by how far the points [n, 3] that photos show of it scatter."""
        apart = np.abs(points @ normal - offset)
        near = apart[apart < ON_TABLE]
        deviation = 1.4826 * float(np.median(near)) if len(near) else ON_TABLE
        return cls(normal, offset, min(max(NOISE * deviation, LEAST_HEIGHT), LARGEST_HEIGHT))

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Heights [...] of points [..., 3] over the table."""
        return points @ self.normal - self.offset

    @cached_property
    def axes(self) -> np.ndarray:
        """[2, 3] unit vectors along the table, at right angles."""
        side = np.eye(3)[np.abs(self.normal).argmin()]
        first = side - (side @ self.normal) * self.normal
        first = first / np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])
