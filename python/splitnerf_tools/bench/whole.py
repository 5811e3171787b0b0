"""The whole program: errors of the recovered scene against wall time, for the presets and for other settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from splitnerf.config import Config, preset
from splitnerf.evaluate.jobs import Protocol
from splitnerf_tools.ablate.job import Plan, run_row
from splitnerf_tools.ablate.rows import SPLIT, Row
from splitnerf_tools.bench.charts import Chart, Point, Result

BASE, PUBLISHED = "preset cpu", "preset paper"
# Settings that buy time with error, or error with time.
SWITCHES: dict[str, dict[str, object]] = {
    "half the samples": {"target_samples": 2304},
    "twice the samples": {"target_samples": 9216},
    "all samples shaded": {"shades_per_ray": 0},
    "light moved each step": {"light_step_every": 1},
    "light moved every 2 steps": {"light_step_every": 2},
    "512 occlusion bits": {"occlusion_directions": 512},
    "finer hash grid": {"log2_table_size": 18, "n_levels": 11},
    "MLP light": {"light.kind": "mlp"},
    "light by the split sum": SPLIT,
    "normals by finite differences": {"normals": "finite_difference"},
}
NAMES = (PUBLISHED, *SWITCHES)
SOURCES = ("cpp", "python/splitnerf")
MEASURES = {"novel_view": "novel views", "albedo": "albedo", "relight": "relit views"}


def whole(
    scenes: Sequence[Path], configs: dict[str, Config], minutes: Sequence[float], protocol: Protocol, runs: Path,
    show: Callable[[str], None],
) -> Result:  # fmt: skip
    """Trains each configuration on each scene for each time; finished runs are reused.

    Args:
        scenes: The folders of the datasets.
        configs: The configurations by name, from :func:`configurations`.
        minutes: The lengths of training; each is a run of its own, because schedules depend on the length.
        protocol: The views and lights by which runs are scored.
        runs: The folder of the runs.
        show: A function called with a line for each run.

    Raises:
        InputError: The data or a run's folder cannot be used.
        Interrupted: Ctrl-C ended a training; the same call continues it.
    """
    plan = Plan(list(scenes), [], 1, protocol, runs)
    charts = []
    for scene in scenes:
        scores: dict[tuple[str, float], dict] = {}
        for length in sorted(minutes):
            for name, config in configs.items():
                row = Row(f"{name}, {length:g} minutes", config.replace({"max_minutes": length}))
                scores[name, length] = found = run_row(plan, scene, row, config.run.seed)
                values = (f"{MEASURES[key]} {score['psnr']:.2f} dB" for key in MEASURES if (score := found.get(key)))
                show(f"{scene.name}: {row.name}: {', '.join(values)}")
        charts += [chart for key in MEASURES if (chart := chart_of(scene, key, scores)).points]
    names = [scene.name for scene in scenes]
    title = f"The whole program on {' and '.join(names)}: wall time against error"
    return Result("_".join(["whole", *names]), title, SOURCES, findings(charts), charts)


def configurations(names: Sequence[str], settings: dict[str, object]) -> dict[str, Config]:
    """The preset ``cpu`` and the named configurations, by name.

    Args:
        names: The names of configurations, out of `NAMES`.
        settings: Changes to all configurations.
    """
    base = preset("cpu").replace(settings)
    return {BASE: base} | {
        name: preset("paper").replace(settings) if name == PUBLISHED else base.replace(SWITCHES[name]) for name in names
    }


def chart_of(scene: Path, measure: str, scores: dict[tuple[str, float], dict]) -> Chart:
    """The chart of one measure on one scene; without points where the data have no truth for it."""
    points = []
    for (name, length), found in scores.items():
        if found.get(measure) and found.get("seconds"):
            minutes, error = found["seconds"] / 60, 10 ** (-found[measure]["psnr"] / 20)
            points.append(Point(name, f"{length:g} min", minutes, error, minutes, minutes, name == BASE))
    return Chart(f"{scene.resolve().name}: {MEASURES[measure]}", "minutes of training", "RMS error (peak 1)", points)


def findings(charts: Sequence[Chart]) -> list[str]:
    """For each chart, the best of the longest runs, and what is on the front."""
    lines = []
    for chart in charts:
        longest = chart.points[-1].variant
        last = sorted((p for p in chart.points if p.variant == longest), key=lambda p: p.error)
        front = dict.fromkeys(p.series for p in chart.front())
        lines.append(f"{chart.title}: after {longest} {last[0].series} is best; on the front: {', '.join(front)}")
    return lines
