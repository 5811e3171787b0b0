"""The cameras of a rendered data set: they are on a sphere around the origin and look at the origin."""

from __future__ import annotations

import numpy as np
from splitnerf.relight.cameras import look_at


def spiral(n: int, distance: float, elevations: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    """Cameras spread evenly over a band of the sphere, on a golden spiral.

    Args:
        n: Number of cameras.
        distance: From the origin.
        elevations: Lowest and highest, in degrees from the horizon.
        turn: Azimuth of the first, in degrees.

    Returns:
        [n, 4, 4] float64 camera-to-world, OpenGL axes.
    """
    golden_turn = 360 / ((1 + np.sqrt(5)) / 2)
    heights = np.linspace(*np.sin(np.radians(elevations)), n)
    return _poses(turn + np.arange(n) * golden_turn, np.degrees(np.arcsin(heights)), distance)


def orbit(n: int, distance: float, elevation: float, swing: float = 0.0, start: float = 0.5) -> np.ndarray:
    """Cameras on one turn about the vertical.

    Args:
        n: Number of cameras.
        distance: From the origin.
        elevation: Mean elevation in degrees.
        swing: Amplitude in degrees with which the elevation goes up and down, twice a turn.
        start: Azimuth of the first, in steps of 360 / n degrees.

    Returns:
        [n, 4, 4] float64 camera-to-world, OpenGL axes.
    """
    share = np.arange(n) / n
    return _poses(360 * (share + start / n), elevation + swing * np.sin(4 * np.pi * share), distance)


def _poses(azimuths: np.ndarray, elevations: np.ndarray, distance: float) -> np.ndarray:
    angles = np.radians([azimuths, elevations]).T
    return np.array([look_at(np.zeros(3), *pair, distance) for pair in angles]).reshape(-1, 4, 4)
