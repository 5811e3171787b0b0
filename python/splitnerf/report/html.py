"""Builds the report: maps of the test views, the light, curves and tables on one page without outside references."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from splitnerf.data.images import linear_to_srgb, over_background
from splitnerf.evaluate.metrics import psnr
from splitnerf.report.curves import line_chart
from splitnerf.report.last_stage import last_stage_section
from splitnerf.report.page import write_html
from splitnerf.report.pictures import WHITE_PER_MEAN, data_uri, tonemapped, white_of

COLUMNS = {
    "rgb": "image",
    "albedo": "albedo",
    "roughness": "roughness",
    "metallic": "metallic",
    "normal": "normals",
    "occlusion_diffuse": "occlusion, diffuse",
    "occlusion_specular": "occlusion, specular",
}
FOLD_ROWS = 14


def write_report(
    path: str | os.PathLike,
    *,
    title: str,
    summary: Mapping[str, Mapping],
    views: Sequence[Mapping],
    lights: Sequence[Mapping],
    light_truth: np.ndarray | None,
    history: Sequence[Mapping],
    timings: Mapping[str, float],
    last_stage: Mapping | None = None,
) -> None:
    """Writes a self-contained HTML page, atomically.

    Args:
        path: The file to write.
        title: Heading, for example the scene's name.
        summary: Tables by name, each row name -> value; nested mappings become dotted rows. The first is shown as
            tiles, so it should hold a few key numbers; long ones (the configuration) are folded.
        views: Per test view `name`, `truth` and `prediction`; both map names of float arrays, each optional: `rgb`
            [H, W, 3] sRGB straight, `alpha` [H, W], `albedo` [H, W, 3] linear, `roughness` [H, W], `metallic` [H, W],
            `normal` [H, W, 3] unit world, `occlusion_diffuse` and `occlusion_specular` [H, W] or [H, W, 1 | 3];
            in a truth also `normal_mask` [H, W] bool. None counts as absent.
        lights: Per roughness `roughness`, `g` [h, w, 3] linear, and `g_bar` [h, w, 3], its Monte Carlo estimate, or
            None.
        light_truth: [h, w, 3] linear radiance, or None.
        history: Lines of `metrics.jsonl`: `step`, `loss`, `psnr`, `loss_*`; each but `step` optional.
        timings: Seconds by part of the run.
        last_stage: What the last stage changed, see :func:`splitnerf.report.last_stage.last_stage_section`; None without one.

    Raises:
        OSError: The page cannot be written.
    """
    tables = [{"name": name, "rows": _rows(table)} for name, table in summary.items()]
    total = sum(timings.values())
    write_html(
        path,
        "splitnerf.report",
        "report.html.j2",
        title=title,
        tiles=tables[0] if tables else None,
        tables=tables[1:],
        fold_rows=FOLD_ROWS,
        views=[_view(view) for view in views],
        last_stage=None if last_stage is None else last_stage_section(last_stage),
        lights=_lights(lights, light_truth),
        charts=_charts(history),
        timings=[
            {"name": name, "value": f"{seconds:.4g} s", "share": 100 * seconds / total if total > 0 else 0}
            for name, seconds in timings.items()
        ],
    )


def _rows(table: Mapping, prefix: str = "") -> list[tuple[str, str]]:
    rows = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            rows += _rows(value, f"{prefix}{key}.")
        else:
            rows.append((f"{prefix}{key}", _text(value)))
    return rows


def _text(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(item) for item in value)
    return str(value)


def _view(view: Mapping) -> dict:
    truth = {key: value for key, value in view["truth"].items() if value is not None}
    prediction = {key: value for key, value in view["prediction"].items() if value is not None}
    columns = [key for key in COLUMNS if key in truth or key in prediction]
    score = None
    if "rgb" in truth and "rgb" in prediction:
        whites = [over_background(m["rgb"], m["alpha"]) if "alpha" in m else m["rgb"] for m in (prediction, truth)]
        score = f"{psnr(*whites):.2f} dB"
    rows = [
        {"name": name, "cells": [_map_picture(maps, key) if key in maps else None for key in columns]}
        for name, maps in (("truth", truth), ("SplitNeRF", prediction))
    ]
    return {"name": view["name"], "score": score, "columns": [COLUMNS[key] for key in columns], "rows": rows}


def _map_picture(maps: Mapping, key: str) -> Markup:
    """One map as a transparent PNG: linear colours encoded, normals mapped from [-1, 1] to [0, 1]."""
    values = np.asarray(maps[key], dtype=np.float32)
    if key == "albedo":
        values = linear_to_srgb(np.clip(values, 0, 1))
    elif key == "normal":
        values = values * 0.5 + 0.5
    values = values[..., None] if values.ndim == 2 else values
    values = np.nan_to_num(np.repeat(values, 3, axis=2) if values.shape[2] == 1 else values)
    alpha = np.asarray(maps.get("alpha", np.ones(values.shape[:2])), dtype=np.float32)
    if key == "normal" and "normal_mask" in maps:
        alpha = alpha * maps["normal_mask"]
    return data_uri(np.concatenate([values, alpha[..., None]], axis=2))


def _lights(lights: Sequence[Mapping], light_truth: np.ndarray | None) -> dict | None:
    """Tonemapped by one exposure for all predictions and one for the truth, as their overall scale is free."""
    if not lights and light_truth is None:
        return None
    columns, notes = [], []
    if lights:
        sharpest = min(lights, key=lambda light: light["roughness"])
        white = white_of(sharpest["g"])
        notes.append(f"recovered light divided by {white:.3g}")
        for light in lights:
            estimate = light.get("g_bar")
            columns.append(
                {
                    "name": f"ρ = {light['roughness']:g}",
                    "g": tonemapped(light["g"], white),
                    "g_bar": None if estimate is None else tonemapped(estimate, white),
                }
            )
    if light_truth is not None:
        white = white_of(light_truth)
        notes.append(f"true light divided by {white:.3g}")
        columns.append({"name": "true light", "g": tonemapped(light_truth, white), "g_bar": None})
    note = f"Exposure: {', '.join(notes)} ({WHITE_PER_MEAN} times the mean radiance), clipped to [0, 1], sRGB."
    return {"columns": columns, "note": note}


def _charts(history: Sequence[Mapping]) -> list[Markup]:
    def series(key: str) -> list[tuple[float, float]]:
        return [(float(line["step"]), float(line[key])) for line in history if _number(line.get(key))]

    parts = sorted({key for line in history for key in line if key.startswith("loss_")})
    charts = [
        line_chart("PSNR (dB)", {"psnr": series("psnr")}),
        line_chart("Loss", {"loss": series("loss")}, log=True),
        line_chart("Terms of the loss", {key.removeprefix("loss_"): series(key) for key in parts}, log=True),
    ]
    return [chart for chart in charts if chart]


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
