"""Charts of cost against error: points, Pareto front, and their files."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from splitnerf.files import atomic_path

from splitnerf_tools.bench.provenance import header, provenance

COLUMNS = 3  # charts in a row of a picture
MARGIN = 1.3  # factor by which the error axis extends beyond its points
COLOURS = ("#1f6fb4", "#d9822b", "#3f9d63", "#b5539a", "#6f5fc0", "#c2524a", "#1f9c9c", "#8a7a2a", "#555555", "#a0522d")


@dataclass(frozen=True)
class Point:
    """One method's cost and error.

    Attributes:
        series: The method or the library.
        variant: The method's setting, such as ``n = 64``; may be empty.
        cost: The cost, in the chart's unit.
        error: The error, in the chart's unit.
        low, high: The quartiles of the cost; equal to the cost where it is exact.
        default: Whether this is the library's default.
    """

    series: str
    variant: str
    cost: float
    error: float
    low: float
    high: float
    default: bool = False


@dataclass(frozen=True)
class Chart:
    """Points that do the same work.

    Attributes:
        title: What is measured, and on what.
        cost: Name and unit of the horizontal axis.
        error: Name and unit of the vertical axis.
        points: In the order of the CSV file.
    """

    title: str
    cost: str
    error: str
    points: list[Point]

    def front(self) -> list[Point]:
        """The points that no other beats in both cost and error, by cost."""
        best, front = math.inf, []
        for point in sorted(self.points, key=lambda p: (p.cost, p.error)):
            if point.error < best:
                best = point.error
                front.append(point)
        return front


@dataclass(frozen=True)
class Result:
    """The result of one benchmark.

    Attributes:
        name: The name of the result's files.
        title: The heading.
        sources: Git patterns of the measured source files.
        findings: Sentences with ratios, which summarise the result.
        charts: The charts of cost against error.
        tables: Further tables, each with title, heads and rows.
    """

    name: str
    title: str
    sources: tuple[str, ...]
    findings: list[str]
    charts: list[Chart] = field(default_factory=list)
    tables: list[tuple[str, Sequence[str], Sequence[Sequence[object]]]] = field(default_factory=list)


def write_result(result: Result, out: Path) -> list[Path]:
    """Writes NAME.md, and where there are charts NAME.csv and NAME.png; returns the files."""
    facts = provenance(result.sources)
    files = [out / f"{result.name}.md"]
    with atomic_path(files[0]) as temporary:  # first: it says whose the others are
        temporary.write_text(markdown(result, facts))
    if result.charts:
        files += [out / f"{result.name}.csv", out / f"{result.name}.png"]
        write_csv(files[1], facts, csv_rows(result.charts))
        draw(result, files[2])
    return files


def write_csv(path: Path, facts: dict[str, str], rows: Iterable[Sequence[object]]) -> None:
    """Writes rows to a CSV file, with the facts as comments above; the first row holds the columns' names."""
    with atomic_path(path) as temporary, open(temporary, "w", newline="") as file:
        file.writelines(f"# {key}: {value}\n" for key, value in facts.items())
        csv.writer(file).writerows(rows)


def csv_rows(charts: Sequence[Chart]) -> Iterator[list[object]]:
    yield "chart series variant cost low high cost_unit error error_unit on_front default".split()
    for chart in charts:
        front = chart.front()
        for p in chart.points:
            costs, error = [f"{v:.6g}" for v in (p.cost, p.low, p.high)], f"{p.error:.6g}"
            marks = int(p in front), int(p.default)
            yield [chart.title, p.series, p.variant, *costs, chart.cost, error, chart.error, *marks]


def markdown(result: Result, facts: dict[str, str]) -> str:
    """The result as text: findings, picture and further tables; the CSV file holds the points of the charts."""
    lines = [f"# {result.title}", "", header(facts), ""]
    lines += [f"- {finding}" for finding in result.findings]
    if result.charts:
        lines += ["", f"![{result.title}]({result.name}.png)"]
        lines += ["", f"Every point is in [{result.name}.csv]({result.name}.csv)."]
    for title, heads, rows in result.tables:
        lines += ["", f"## {title}", "", *table(heads, rows)]
    return "\n".join(lines) + "\n"


def table(heads: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = [list(map(str, row)) for row in (heads, ["---"] * len(heads), *rows)]
    return ["| " + " | ".join(line) + " |" for line in lines]


def error_range(chart: Chart) -> tuple[float, float]:
    """The range of the error axis: at least a decade, so that equal errors look equal."""
    low, high = min(p.error for p in chart.points), max(p.error for p in chart.points)
    middle, half = math.sqrt(low * high), max(math.sqrt(high / low) * MARGIN, math.sqrt(10))
    return middle / half, middle * half


def draw(result: Result, path: Path) -> None:
    """All charts in one picture, both axes logarithmic; a star marks the default, a line the front."""
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(result.charts))
    rows = -(-len(result.charts) // columns)
    names = list(dict.fromkeys(p.series for chart in result.charts for p in chart.points))
    legend = 0.2 * math.ceil((len(names) + 1) / (2 * columns))
    figure = Figure(figsize=(5.6 * columns, 4.4 * rows + legend), dpi=80, layout="constrained")
    handles: dict[str, object] = {}
    for i, chart in enumerate(result.charts):
        axes = figure.add_subplot(rows, columns, i + 1)
        for name in dict.fromkeys(p.series for p in chart.points):
            points = [p for p in chart.points if p.series == name]
            colour, costs = COLOURS[names.index(name) % len(COLOURS)], [p.cost for p in points]
            spread = [[p.cost - p.low for p in points], [p.high - p.cost for p in points]]
            handles[name] = axes.errorbar(
                costs, [p.error for p in points], xerr=spread, marker="o", markersize=4, linewidth=1, color=colour
            )
        front = chart.front()
        axes.step(
            [p.cost for p in front], [p.error for p in front], where="post", color="#bbbbbb", linewidth=5, zorder=0
        )
        for p in (p for p in chart.points if p.default):
            colour = COLOURS[names.index(p.series) % len(COLOURS)]
            handles["default"] = axes.scatter(
                [p.cost], [p.error], marker="*", s=220, color=colour, edgecolor="black", zorder=5
            )
        axes.set_xscale("log")
        if all(p.error > 0 for p in chart.points):
            axes.set_yscale("log")
            axes.set_ylim(*error_range(chart))
        axes.set_title(chart.title, fontsize=9)
        axes.set_xlabel(chart.cost, fontsize=8)
        axes.set_ylabel(chart.error, fontsize=8)
        axes.tick_params(labelsize=7, which="both")
        axes.grid(True, which="major", linewidth=0.3)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2 * columns, fontsize=8)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png")
