"""Photos of the object in another light than that of the training photos, with that light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from splitnerf.data.environment import MAP_ROWS, read_environment, resize_environment, turn_environment
from splitnerf.data.layouts.frame import Frame


@dataclass(frozen=True)
class LitView:
    """One photo in a known light.

    Attributes:
        frame: The photo.
        light: The light's name.
        radiance: Reads the light: [h, w, 3] linear radiance, equirectangular, in the data's world as
            :func:`splitnerf.data.environment.read_environment` has it.
    """

    frame: Frame
    light: str
    radiance: Callable[[], np.ndarray]


def map_in_world(path: Path, turn: np.ndarray | None = None) -> Callable[[], np.ndarray]:
    """Reads a map, at most 512 rows of it, when it is called.

    Args:
        path: The file.
        turn: [3, 3] the rotation from the data's world to the world of the map; None where they are the same.
    """
    return partial(_read, path, turn)


def _read(path: Path, turn: np.ndarray | None) -> np.ndarray:
    radiance = read_environment(path)
    if radiance.shape[0] > MAP_ROWS:
        radiance = resize_environment(radiance, MAP_ROWS, 2 * MAP_ROWS)
    return radiance if turn is None else turn_environment(radiance, turn)
