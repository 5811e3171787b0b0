"""Line charts as inline SVG that take the page's colours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from markupsafe import Markup, escape

WIDTH, HEIGHT = 460, 250
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 12, 34
PALETTE = (
    "#3b82c4", "#d9822b", "#3f9d63", "#b5539a", "#8a7ad1", "#c2524a", "#2c9c9c", "#98863a", "#8d9298", "#6aa84f", "#d46a9f", "#5c6bc0",
)  # fmt: skip
MAX_POINTS = 400

Series = Sequence[tuple[float, float]]


def line_chart(title: str, series: Mapping[str, Series], *, log: bool = False, across: str = "step") -> Markup:
    """Draws lines, by default over training steps.

    Args:
        title: Heading of the chart.
        series: Points (x, value) by name, x >= 0; points that are not finite, or not positive where `log`,
            are left out.
        log: Whether the vertical axis is logarithmic.
        across: What x is.

    Returns:
        A `<figure>` with an SVG and a legend; empty where no point is left.
    """
    kept = {name: _thinned([p for p in points if _drawable(p, log)]) for name, points in series.items()}
    kept = {name: points for name, points in kept.items() if points}
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
    kept = {name: {x: y for x, y in points if _drawable((x, y), False)} for name, points in series.items()}
    xs = sorted(set().union(*kept.values()))
    if not xs:
        return None
    stride = math.ceil(len(xs) / MAX_POINTS)
    groups = [xs[i : min(i + stride, len(xs) - 1)] for i in range(0, len(xs) - 1, stride)] + [xs[-1:]]
    found = {name: [[points[x] for x in group if x in points] for group in groups] for name, points in kept.items() if points}
    lines = [{"name": name, "values": [_mean(values) if values else None for values in rows]} for name, rows in found.items()]
    return {"title": title, "log": log, "x": [_mean(group) for group in groups], "series": lines}


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _drawable(point: tuple[float, float], log: bool) -> bool:
    return all(math.isfinite(value) for value in point) and (point[1] > 0 or not log)


def _thinned(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """At most about MAX_POINTS means of neighbours, the last point as it is."""
    stride = math.ceil(len(points) / MAX_POINTS)
    if stride <= 1:
        return points
    groups = [points[i : i + stride] for i in range(0, len(points), stride)]
    means = [(_mean([x for x, _ in g]), _mean([y for _, y in g])) for g in groups]
    return means[:-1] + [points[-1]]


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
