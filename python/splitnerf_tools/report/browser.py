"""Data for the scripts of pages: JSON, packed bytes, pictures of 16-bit floats, and the first camera."""

from __future__ import annotations

import base64
import gzip
import json
import math
from functools import partial

import numpy as np
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup

from splitnerf.data.asset import Asset
from splitnerf.relight.cameras import HALF_FIELD, bounding_sphere, turntable

BRIGHTEST_HALF = float(np.finfo(np.float16).max)


def script_json(content: object) -> Markup:
    """JSON that is safe in an element of a page: no text in it ends the element, and numbers that are not finite are
    null."""
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
    return {"position": front.pose[:3, 3].tolist(), "target": centre.tolist(), "radius": radius, "half_field": float(HALF_FIELD)}


def _finite(content: object) -> object:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    if isinstance(content, (float, np.floating)):
        return float(content) if math.isfinite(content) else None
    return content
