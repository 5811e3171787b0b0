"""Photos with which relit images are compared: linear radiance as their files state it, and the object's mask."""

from __future__ import annotations

import numpy as np

from splitnerf.data.images import HDR_SUFFIXES, LDR_SUFFIXES, area_average, read_image, srgb_to_linear
from splitnerf.data.layouts.frame import Frame
from splitnerf.errors import InputError


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
