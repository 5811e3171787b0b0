"""Photos of the object in another light than that of the training photos: that light, linear radiance and mask."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.data.environment import MAP_ROWS, read_environment, resize_environment, turn_environment
from splitnerf.data.images import HDR_SUFFIXES, LDR_SUFFIXES, area_average, read_image, srgb_to_linear
from splitnerf.data.layouts.frame import Frame
from splitnerf.errors import InputError


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

    def read() -> np.ndarray:
        radiance = read_environment(path)
        if radiance.shape[0] > MAP_ROWS:
            radiance = resize_environment(radiance, MAP_ROWS, 2 * MAP_ROWS)
        return radiance if turn is None else turn_environment(radiance, turn)

    return read


def read_lit_photo(frame: Frame, factor: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Reads a frame's photo at an exposure of 1.

    Args:
        frame: The frame; its photo must be a pinhole's.
        factor: Linear values and masks are averaged down by this integer.

    Returns:
        [H, W, 3] float32 linear radiance as the file has it (not multiplied by coverage), and [H, W] float32 the mask in
        [0, 1]: of the mask's file, else alpha, else 1.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    path = frame.image_path
    if path.suffix.lower() not in LDR_SUFFIXES + HDR_SUFFIXES:
        raise InputError(f"{path}: must be PNG, JPEG, EXR or HDR; convert it")
    pixels = read_image(path)
    if not np.isfinite(pixels).all():
        raise InputError(f"{path}: has NaN or infinite pixels; re-export it")
    colour, mask = pixels[..., :3], np.ones(pixels.shape[:2], np.float32)
    if path.suffix.lower() not in HDR_SUFFIXES:
        colour = colour ** np.float32(frame.gamma) if frame.gamma else srgb_to_linear(colour)
    if frame.mask_path is not None:
        mask = read_image(frame.mask_path)[..., 0]
        if mask.shape != pixels.shape[:2]:
            raise InputError(f"{frame.mask_path}: has another size than {path.name}; make them the same size")
    elif pixels.shape[2] == 4:
        mask = pixels[..., 3]
    return area_average(colour / np.float32(frame.exposure), factor), area_average(mask, factor)
