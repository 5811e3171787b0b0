"""The report's section on the test views: pictures of the maps, and which of them the page compares."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from splitnerf.data.images import area_average, linear_to_srgb, over_background
from splitnerf.evaluate.metrics import psnr
from splitnerf_tools.report.pictures import data_uri

MAPS = {
    "rgb": "image",
    "albedo": "albedo",
    "roughness": "roughness",
    "metallic": "metallic",
    "normal": "normals",
    "occlusion_diffuse": "occlusion, diffuse",
    "occlusion_specular": "occlusion, specular",
}
KINDS = {"rgb": "colour", "albedo": "colour", "normal": "normal"}  # of the others: "number"
LARGEST_ERRORS = {"colour": 0.25, "number": 0.5, "normal": 45.0}  # where the scale of error maps ends
MOST_PIXELS = 512  # of a picture's longer side


def comparison(left: str, right: str, kind: str) -> dict:
    """The page's data to compare two pictures, by their names."""
    return {"left": left, "right": right, "kind": kind, "largest": LARGEST_ERRORS[kind]}


def views_section(views: Sequence[Mapping], albedo_scale: Sequence[float] | None) -> dict:
    """The contents of the section for the template.

    Args:
        views: See :func:`splitnerf_tools.report.write_report`.
        albedo_scale: The factor [3] of the predicted albedo under which it is scored, and shown here; None for 1.
    """
    maps = [key for key in MAPS if any(view[side].get(key) is not None for view in views for side in ("truth", "prediction"))]
    return {
        "maps": [MAPS[key] for key in maps],
        "pairs": [comparison(f"truth {key}", key, KINDS.get(key, "number")) | {"name": MAPS[key]} for key in maps],
        "sides": ["truth", "SplitNeRF"],
        "views": [_view(view, maps, np.ones(3) if albedo_scale is None else np.asarray(albedo_scale)) for view in views],
        "scale": None if albedo_scale is None else ", ".join(f"{factor:.3g}" for factor in albedo_scale),
    }


def _view(view: Mapping, keys: Sequence[str], scale: np.ndarray) -> dict:
    truth = {key: value for key, value in view["truth"].items() if value is not None}
    prediction = {key: value for key, value in view["prediction"].items() if value is not None}
    score = None
    if "rgb" in truth and "rgb" in prediction:
        whites = [over_background(m["rgb"], m["alpha"]) if "alpha" in m else m["rgb"] for m in (prediction, truth)]
        score = f"{psnr(*whites):.2f} dB"
    if "albedo" in prediction:
        prediction["albedo"] = prediction["albedo"] * scale
    rows = [
        {"name": name, "cells": [_map_picture(maps, key) if key in maps else None for key in keys], "keys": [f"{prefix}{k}" for k in keys]}
        for name, prefix, maps in (("truth", "truth ", truth), ("SplitNeRF", "", prediction))
    ]
    return {"name": view["name"], "score": score, "rows": rows}


def _map_picture(maps: Mapping, key: str) -> Markup:
    """One map as a transparent PNG: linear colours encoded, normals mapped from [-1, 1] to [0, 1]."""
    values = np.asarray(maps[key], dtype=np.float32)
    values = np.nan_to_num(values[..., None] if values.ndim == 2 else values)
    alpha = np.asarray(maps.get("alpha", np.ones(values.shape[:2])), dtype=np.float32)
    if key == "normal" and "normal_mask" in maps:
        alpha = alpha * maps["normal_mask"]
    values, alpha = averaged(values, alpha)
    if key == "albedo":
        values = linear_to_srgb(np.clip(values, 0, 1))
    elif key == "normal":
        values = values * 0.5 + 0.5
    values = np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values
    return data_uri(np.concatenate([values, alpha[..., None]], axis=2))


def averaged(values: np.ndarray, alpha: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A map [H, W, C] and its coverage [H, W], None for 1, averaged down by the least whole factor after which no side has more
    than 512 pixels; values count by their coverage."""
    alpha = np.ones(values.shape[:2], np.float32) if alpha is None else alpha
    factor = math.ceil(max(values.shape[:2]) / MOST_PIXELS)
    factor = min(factor, *values.shape[:2])
    if factor == 1:
        return values, alpha
    coverage = area_average(alpha, factor)
    return area_average(values * alpha[..., None], factor) / np.maximum(coverage, 1e-6)[..., None], coverage
