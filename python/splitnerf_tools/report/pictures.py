"""Pictures within the page."""

from __future__ import annotations

import base64
import io

import numpy as np
from markupsafe import Markup
from PIL import Image, features

from splitnerf.data.images import encode_png, linear_to_srgb, to_uint8

WHITE_PER_MEAN = 3
JPEG_QUALITY = 85
SMALL = 200 * 200  # pixels
WEBP_EFFORT = 30  # of 100


def data_uri(pixels: np.ndarray) -> Markup:
    """Encodes an image [H, W, 1 | 3 | 4] as a data URI: PNG, or lossless WebP above 200 x 200 pixels, a third of its
    size."""
    if pixels.shape[0] * pixels.shape[1] <= SMALL or not features.check("webp"):
        return _uri("png", encode_png(pixels))
    codes, file = to_uint8(pixels), io.BytesIO()
    Image.fromarray(codes[..., 0] if codes.shape[2] == 1 else codes).save(file, "WEBP", lossless=True, quality=WEBP_EFFORT, method=1)
    return _uri("webp", file.getvalue())


def photo_uri(pixels: np.ndarray) -> Markup:
    """The photo [H, W, 3], sRGB in [0, 1], as a JPEG within the page: a sixth of a PNG's size."""
    file = io.BytesIO()
    Image.fromarray(to_uint8(pixels)).save(file, "JPEG", quality=JPEG_QUALITY)
    return _uri("jpeg", file.getvalue())


def white_of(radiance: np.ndarray) -> float:
    """The radiance that is shown as white."""
    return max(WHITE_PER_MEAN * float(np.mean(radiance)), 1e-6)


def tonemapped(radiance: np.ndarray, white: float) -> Markup:
    """A map of linear radiance as a picture: divided by `white`, clipped, sRGB."""
    return data_uri(linear_to_srgb(np.clip(np.nan_to_num(np.asarray(radiance, np.float32)) / white, 0, 1)))


def _uri(kind: str, content: bytes) -> Markup:
    return Markup(f"data:image/{kind};base64," + base64.b64encode(content).decode())
