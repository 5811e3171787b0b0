"""Pictures as they stand in the page."""

from __future__ import annotations

import base64
import io

import numpy as np
from markupsafe import Markup
from PIL import Image

from splitnerf.data.images import encode_png, linear_to_srgb, to_uint8

WHITE_PER_MEAN = 3
JPEG_QUALITY = 85


def data_uri(pixels: np.ndarray) -> Markup:
    """The picture [H, W, 1 | 3 | 4] as a PNG within the page."""
    return Markup("data:image/png;base64," + base64.b64encode(encode_png(pixels)).decode())


def photo_uri(pixels: np.ndarray) -> Markup:
    """The photo [H, W, 3], sRGB in [0, 1], as a JPEG within the page: a sixth of a PNG's size."""
    file = io.BytesIO()
    Image.fromarray(to_uint8(pixels)).save(file, "JPEG", quality=JPEG_QUALITY)
    return Markup("data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode())


def white_of(radiance: np.ndarray) -> float:
    """The radiance that is shown as white."""
    return max(WHITE_PER_MEAN * float(np.mean(radiance)), 1e-6)


def tonemapped(radiance: np.ndarray, white: float) -> Markup:
    """A map of linear radiance as a picture: divided by `white`, clipped, sRGB."""
    return data_uri(linear_to_srgb(np.clip(np.nan_to_num(np.asarray(radiance, np.float32)) / white, 0, 1)))
