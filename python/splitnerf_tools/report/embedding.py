"""Pages of one file, from templates, and what they carry: JSON, packed bytes, pictures, and the first camera."""

from __future__ import annotations

import base64
import gzip
import io
import json
import math
import os
from functools import partial

import jinja2
import numpy as np
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from PIL import Image, features
from splitnerf.data.asset import Asset
from splitnerf.data.images import encode_image, linear_to_srgb, to_uint8
from splitnerf.files import atomic_path
from splitnerf.relight.cameras import HALF_FIELD, bounding_sphere, turntable

WHITE_PER_MEAN = 3
JPEG_QUALITY = 85
SMALL = 200 * 200  # pixels
WEBP_EFFORT = 30  # of 100
BRIGHTEST_HALF = float(np.finfo(np.float16).max)


def write_html(path: str | os.PathLike, package: str, template: str, **values: object) -> None:
    """Fills a template with `values` and writes the page, atomically; the `package` that holds the template may include those of
    :mod:`splitnerf_tools.report`. Raises OSError where the page cannot be written."""
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader(name, ".") for name in (package, "splitnerf_tools.report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.get_template(template).render(**values)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="backslashreplace")


def script_json(content: object) -> Markup:
    """JSON that is safe in an element of a page: no text in it ends the element, and numbers that are not finite are null."""
    return htmlsafe_json_dumps(_finite(content), dumps=partial(json.dumps, allow_nan=False, separators=(",", ":")))


def packed(content: bytes) -> str:
    """Bytes as base64 of their gzip."""
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode()


def as_halves(pixels: np.ndarray) -> tuple[int, int, bytes]:
    """(width, height, float16 RGBA, row by row from the top) of [h, w, 3 | 4]; a fourth channel that is missing is 1,
    and what halves cannot hold becomes their largest number, 65504."""
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=2)
    return pixels.shape[1], pixels.shape[0], np.minimum(pixels, BRIGHTEST_HALF).astype("<f2").tobytes()


def camera_of(asset: Asset) -> dict:
    """The camera that a page starts with, that of `splitnerf relight`; lengths are the data's, z is up."""
    centre, radius = bounding_sphere(asset)
    front = turntable(asset, 1, size=None)[0]
    return {
        "position": front.pose[:3, 3].tolist(),
        "target": centre.tolist(),
        "radius": radius,
        "half_field": float(HALF_FIELD),
    }


def _finite(content: object) -> object:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    if isinstance(content, (float, np.floating)):
        return float(content) if math.isfinite(content) else None
    return content


def data_uri(pixels: np.ndarray) -> Markup:
    """Encodes an image [H, W, 1 | 3 | 4] as a data URI: PNG, or lossless WebP above 200 x 200 pixels, a third of its size."""
    if pixels.shape[0] * pixels.shape[1] <= SMALL or not features.check("webp"):
        return _uri("png", encode_image(pixels, ".png"))
    codes, file = to_uint8(pixels), io.BytesIO()
    Image.fromarray(codes[..., 0] if codes.shape[2] == 1 else codes).save(
        file, "WEBP", lossless=True, quality=WEBP_EFFORT, method=1
    )
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
