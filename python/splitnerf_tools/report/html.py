"""Builds the report: maps of the test views, the light, curves and tables on one page without outside references."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np
from markupsafe import Markup
from splitnerf.relight.studio import STUDIO_LIGHTS, studio_light

from splitnerf_tools.report.drawings import PALETTE, curve_data, line_chart
from splitnerf_tools.report.embedding import photo_uri, script_json, write_html
from splitnerf_tools.report.sections import (
    asset_section,
    embedded_light,
    panels_section,
    refinement_section,
    views_section,
)


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
    refinement: Mapping | None = None,
    light: np.ndarray | None = None,
    asset: Path | None = None,
    albedo_scale: Sequence[float] | None = None,
    grades: Sequence[Mapping] = (),
    relit: Sequence[tuple[str, np.ndarray]] = (),
) -> None:
    """Writes a self-contained HTML page, atomically: pictures and tables, and a script that makes them answer. Raises OSError where
    the page cannot be written.

    Args:
        title: Heading, for example the scene's name.
        summary: Folded tables by name, each row name -> value; nested mappings become dotted rows.
        views: Per test view `name`, `truth` and `prediction`; both map names of float arrays, each optional: `rgb`
            [H, W, 3] sRGB straight, `alpha` [H, W], `albedo` [H, W, 3] linear, `roughness` [H, W], `metallic` [H, W],
            `normal` [H, W, 3] unit world, `occlusion_diffuse` and `occlusion_specular` [H, W] or [H, W, 1 | 3];
            in a truth also `normal_mask` [H, W] bool. None counts as absent.
        lights: Per roughness `roughness`, `g` [h, w, 3] linear, and `g_bar` [h, w, 3], its Monte Carlo estimate, or
            None.
        light_truth: [h, w, 3] linear radiance, or None.
        history: Lines of `metrics.jsonl`: `step`, `loss`, `psnr`, `loss_*`; each but `step` optional.
        timings: Seconds by part of the run.
        refinement: What the refinement changed, see :func:`splitnerf_tools.report.sections.refinement_section`; None without one.
        light: [h, w, 3] linear radiance that is delivered, or None.
        asset: The GLB that is delivered; None, or one that is not there, for a page without a 3D view.
        albedo_scale: [3] the factor of the albedo under which it is scored, see `evaluation.json`; None for 1.
        grades: Scores in words, see :func:`splitnerf.evaluate.score_table.graded`.
        relit: The asset under other lights: their names, and pictures [h, w, 3], sRGB in [0, 1].
    """
    tables = [{"name": name, "rows": _rows(table)} for name, table in summary.items()]
    total = sum(timings.values())
    before = None if refinement is None else refinement["lights"][0]
    named = (("recovered light", light), ("true light", light_truth), ("before the refinement", before))
    embedded = [embedded_light(name, radiance) for name, radiance in named if radiance is not None]
    glb, charts = asset_section(asset), _charts(history)
    write_html(
        path,
        "splitnerf_tools.report",
        "report.html.j2",
        title=title,
        tables=tables,
        grades=grades,
        relit=[{"name": name, "picture": photo_uri(picture)} for name, picture in relit],
        views=views_section(views, albedo_scale) if views else None,
        refinement=None if refinement is None else refinement_section(refinement),
        lights=embedded,
        panels=panels_section(lights),
        charts=[line_chart(title, series, log=log) for title, series, log in charts],
        asset=glb,
        timings=[
            {
                "name": name,
                "value": f"{seconds:.{0 if seconds >= 10 else 1}f} s",
                "share": 100 * seconds / total if total > 0 else 0,
            }
            for name, seconds in timings.items()
        ],
        data=script_json(
            {
                "name": title,
                "lights": [unpictured(one) for one in embedded],
                "studio": [unpictured(embedded_light(name, studio_light(name))) for name in STUDIO_LIGHTS if glb],
                "charts": [curve_data(title, series, log=log) for title, series, log in charts],
                "colours": PALETTE,
                "camera": glb and glb["camera"],
            }
        ),
        script=Markup(files("splitnerf_tools.report").joinpath("pages.js").read_text(encoding="utf-8")),
    )


def unpictured(light: Mapping) -> dict:
    """What the page's script reads of a light."""
    return {key: value for key, value in light.items() if key != "picture"}


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
        return f"{value:.3g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(item) for item in value)
    return str(value)


def _charts(history: Sequence[Mapping]) -> list[tuple[str, dict, bool]]:
    """Title, lines by name, and whether the axis is logarithmic, of each chart that has a number."""

    def series(key: str) -> list[tuple[float, float]]:
        return [(float(line["step"]), float(line[key])) for line in history if _number(line.get(key))]

    parts = sorted({key for line in history for key in line if key.startswith("loss_")})
    charts = [
        ("Photos while training, PSNR (dB)", {"psnr": series("psnr")}, False),
        ("Loss", {"loss": series("loss")}, True),
        ("Terms of the loss", {key.removeprefix("loss_"): series(key) for key in parts}, True),
    ]
    return [chart for chart in charts if any(chart[1].values())]


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
