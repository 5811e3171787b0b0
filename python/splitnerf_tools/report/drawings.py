"""Drawings as inline SVG that take the page's colours: line charts, and plans of cameras and points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean

import numpy as np
from markupsafe import Markup, escape

WIDTH, HEIGHT = 460, 250
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 34
PALETTE = "#3b82c4 #d9822b #3f9d63 #b5539a #8a7ad1 #c2524a #2c9c9c #98863a #8d9298 #6aa84f #d46a9f #5c6bc0".split()
MAX_POINTS = 400
SIDE = 400  # of a plan, in its own units
AHEAD = 0.04  # length of the line that shows where a camera looks, in the plan's edge
SHOWN_POINTS = 4000

Series = Sequence[tuple[float, float]]


def line_chart(title: str, series: Mapping[str, Series], *, log: bool = False, across: str = "step") -> Markup:
    """Draws lines, by default over training steps: a `<figure>` with an SVG and a legend; empty where no point is left.

    Args:
        series: Points (x, value) by name, x >= 0; points that are not finite, or not positive where `log`,
            are left out.
        log: Whether the vertical axis is logarithmic.
        across: What x is.
    """
    data = curve_data(title, series, log=log) or {"x": [], "series": []}
    lines = {
        line["name"]: [(x, y) for x, y in zip(data["x"], line["values"]) if y is not None and (y > 0 or not log)]
        for line in data["series"]
    }
    kept = {name: points for name, points in lines.items() if points}
    if not kept:
        return Markup("")
    scale = math.log10 if log else float
    xs = [x for points in kept.values() for x, _ in points]
    ys = [scale(y) for points in kept.values() for _, y in points]
    y_ticks = _log_ticks(min(ys), max(ys)) if log else _linear_ticks(min(ys), max(ys), 5)
    x_ticks = _linear_ticks(0, max(xs), 5)
    x_high = max(max(xs), 1e-9)
    y_low, y_high = min(min(ys), y_ticks[0]), max(max(ys), y_ticks[-1])
    y_high = y_high if y_high > y_low else y_low + 1

    def place_x(x: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * x / x_high

    def place_y(y: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (y - y_low) / (y_high - y_low)

    parts = []
    for tick in y_ticks:
        y = place_y(tick)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        label = f"{10**tick:.3g}" if log else f"{tick:.4g}"
        parts.append(f'<text x="{LEFT - 7}" y="{y + 3.5:.1f}" text-anchor="end">{label}</text>')
    for tick in x_ticks:
        if tick <= x_high:
            label = f"{tick / 1000:g}k" if tick >= 1000 else f"{tick:g}"
            x, y = place_x(tick), HEIGHT - BOTTOM + 16
            parts.append(f'<text x="{x:.1f}" y="{y}" text-anchor="middle">{label}</text>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 3}" text-anchor="end">{across}</text>')
    legend = []
    for index, (name, points) in enumerate(kept.items()):
        colour = PALETTE[index % len(PALETTE)]
        path = " ".join(f"{place_x(x):.1f},{place_y(scale(y)):.1f}" for x, y in points)
        parts.append(f'<polyline class="curve" points="{path}" stroke="{colour}"/>')
        x, y = points[-1]
        parts.append(f'<circle cx="{place_x(x):.1f}" cy="{place_y(scale(y)):.1f}" r="2.6" fill="{colour}"/>')
        legend.append(f'<li><i style="background:{colour}"></i>{escape(name)} <b>{y:.4g}</b></li>')
    return Markup(
        f'<figure class="chart"><figcaption>{escape(title)}</figcaption>'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">{"".join(parts)}</svg>'
        f'<ul class="legend">{"".join(legend)}</ul></figure>'
    )


def curve_data(title: str, series: Mapping[str, Series], *, log: bool = False) -> dict | None:
    """The same lines for the page's script: `x`, and `series` of `name` and `values`, None where a line has no number; None
    where no line has any. Of more than about MAX_POINTS steps there are means of neighbours, the same for all lines, the last
    step as it is. `log` says how the page starts: it may draw zeros and below on a linear axis."""
    kept = {name: {x: y for x, y in points if math.isfinite(x) and math.isfinite(y)} for name, points in series.items()}
    xs = sorted(set().union(*kept.values()))
    if not xs:
        return None
    stride = math.ceil(len(xs) / MAX_POINTS)
    groups = [xs[i : min(i + stride, len(xs) - 1)] for i in range(0, len(xs) - 1, stride)] + [xs[-1:]]
    found = {
        name: [[points[x] for x in group if x in points] for group in groups] for name, points in kept.items() if points
    }
    lines = [
        {"name": name, "values": [fmean(values) if values else None for values in rows]} for name, rows in found.items()
    ]
    return {"title": title, "log": log, "x": [fmean(group) for group in groups], "series": lines}


def _linear_ticks(low: float, high: float, count: int) -> list[float]:
    """Round numbers at a step of 1, 2 or 5 times a power of ten, around [low, high]."""
    span = max(high - low, 1e-9 * max(abs(high), 1))
    raw = span / count
    power = 10 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= raw * 0.999)
    return [i * step for i in range(math.floor(low / step + 1e-6), math.ceil(high / step - 1e-6) + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    """Exponents of powers of ten around [low, high], thinned to at most seven."""
    first, last = math.floor(low + 1e-9), math.ceil(high - 1e-9)
    last = max(last, first + 1)
    return [float(e) for e in range(first, last + 1, max(1, math.ceil((last - first) / 6)))]


def plan(
    axes: tuple[int, int],
    poses: np.ndarray,
    points: np.ndarray,
    kinds: tuple[Iterable[str], Iterable[str]],
    middle: np.ndarray,
    reach: float,
) -> Markup:
    """Cameras and points as an SVG.

    Args:
        axes: The numbers of the axes that point to the right and up.
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        points: [m, 3]; of more than 4000 some are drawn.
        kinds: The CSS class of each camera, and that of each point.
        middle: [3] the point in the middle of the plan.
        reach: Half of the plan's edge, in the world's units.
    """
    place = lambda p: [SIDE / 2 * (1 + s * (p[i] - middle[i]) / reach) for i, s in zip(axes, (1, -1))]  # noqa: E731
    parts, (camera_kinds, point_kinds) = [], (list(kind) for kind in kinds)
    for index in np.random.default_rng(0).permutation(len(points))[:SHOWN_POINTS]:
        x, y = place(points[index])
        if 0 <= x <= SIDE and 0 <= y <= SIDE:
            parts.append(f'<circle class="{point_kinds[index]}" cx="{x:.1f}" cy="{y:.1f}" r="0.8"/>')
    for pose, kind in zip(poses, camera_kinds):
        tip, ahead = pose[:3, 3], -pose[:3, 2]
        (x0, y0), (x1, y1) = place(tip), place(tip + 2 * AHEAD * reach * ahead)
        parts.append(f'<circle class="{kind}" cx="{x0:.1f}" cy="{y0:.1f}" r="3"/>')
        parts.append(f'<path class="{kind}" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>')
    return Markup(f'<svg viewBox="0 0 {SIDE} {SIDE}" role="img" aria-label="cameras and points">{"".join(parts)}</svg>')
