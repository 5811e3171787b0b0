"""Mask files: what is the object, in whatever form it is stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from splitnerf.data.images import read_codes
from splitnerf.errors import InputError

MOST_LABELS = 32  # values up to which a mask of more than two of them is taken for one of labels


def read_mask(path: Path) -> np.ndarray:
    """A mask, white where it is set.

    Where the alpha channel varies it is the mask; else the colours are, which must be grey, or of two palette entries in colour. Of two
    values the larger one is white and the other one black, whatever they are.

    Returns:
        [H, W, 1] uint8, uint16, or float32 in [0, 1].

    Raises:
        InputError: The file cannot be read, is coloured, holds labels of more than one object, or floats out of bounds.
    """
    pixels = read_codes(path)
    if pixels.dtype.kind == "f" and not (pixels.min() >= 0 and pixels.max() <= 1):  # false for NaN
        raise InputError(f"{path}: has NaN, infinite or negative pixels or such above 1; save it as 8 or 16 bit PNG")
    alpha = pixels[..., -1:] if pixels.shape[2] in (2, 4) else None
    if alpha is not None and alpha.min() != alpha.max():
        return alpha
    if (entries := _palette_entries(path)) is not None:
        mask = entries[..., None]
    elif pixels.shape[2] >= 3 and (pixels[..., :3] != pixels[..., :1]).any():
        raise InputError(f"{path}: is coloured, which no mask is; save the object as white on black")
    else:
        mask = pixels[..., :1]
    if mask.dtype.kind == "f" or path.suffix.lower() in (".jpg", ".jpeg"):  # whose values are not exact
        return mask
    values, most = np.flatnonzero(np.bincount(mask.ravel())), np.iinfo(mask.dtype).max
    if len(values) == 2:
        return np.where(mask == values[1], most, 0).astype(mask.dtype)
    if len(values) > 2 and values[-1] < MOST_LABELS:
        raise InputError(
            f"{path}: holds the labels {', '.join(map(str, values))}; save the object's alone, as white on black"
        )
    return mask if values[0] == 0 or len(values) > 2 else np.full_like(mask, most)


def _palette_entries(path: Path) -> np.ndarray | None:
    """[H, W] the numbers of the entries of a PNG file's palette; None where it has none, or those in use are grey: programs that
    make files small order black and white as they like."""
    with open(path, "rb") as file:
        if file.read(26)[25:26] != b"\3":  # the colour type, in the header of a PNG
            return None
    with Image.open(path) as image:
        entries, colours = np.asarray(image), np.asarray(image.getpalette("RGB")).reshape(-1, 3)
        used = colours[np.flatnonzero(np.bincount(entries.ravel()))]
        return None if (used == used[:, :1]).all() else entries
