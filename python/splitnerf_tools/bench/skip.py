"""The gain of each skip: steps per second, and the error at equal steps and at equal time."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import over_background
from splitnerf.data.json_files import read_json
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import psnr
from splitnerf.render.renderer import render_maps
from splitnerf.training.loop import train
from splitnerf_tools.bench.provenance import header, provenance

# The settings that turn each skip off.
UNSKIPPED: dict[str, object] = {"sampling.min_weight": 0.0, "shades_per_ray": 0, "light_step_every": 1, "open_below": 0.0}
# The settings that belong to each skip.
SKIPS: dict[str, tuple[str, ...]] = {
    "samples found without gradients": ("sampling.min_weight",),
    "few shaded samples a ray": ("shades_per_ray",),
    "light moved every few steps": ("light_step_every",),
}
BASELINE, ALL = "nothing skipped", "all"
SOURCES = ("cpp", "python/splitnerf")
NEVER = 10**7  # steps that no run reaches


@dataclass(frozen=True)
class Line:
    """One line of the table.

    Attributes:
        name: The name of the skip.
        steps_per_second: The steps per second of the run of equal time, with all its work.
        psnr_equal_steps: The mean PSNR of the test views in dB, after the number of steps of the baseline.
        psnr_equal_time: The mean PSNR of the test views in dB, after the minutes of the baseline.
    """

    name: str
    steps_per_second: float
    psnr_equal_steps: float
    psnr_equal_time: float

    def text(self, baseline: Line) -> str:
        ratio = self.steps_per_second / baseline.steps_per_second
        return f"{self.name:34s} {ratio:5.1f}x {self.psnr_equal_steps:10.2f} dB {self.psnr_equal_time:10.2f} dB"


HEADER = f"{'':34s} {'steps/s':>6s} {'equal steps':>13s} {'equal time':>13s}"


def skip_table(
    full: Config, minutes: float, training: Dataset, views: Dataset, out: Path, other: Callable[[], tuple[Line, int]] | None,
    show: Callable[[str], None],
) -> list[Line]:  # fmt: skip
    """Trains without any skip, with one at a time, and with all.

    Args:
        full: The configuration with all skips.
        minutes: The length of each run of equal time.
        training: The train split.
        views: The views that are scored.
        out: The folder of the runs.
        other: A function that returns the baseline's line and number of steps from another build; None: the baseline is
            this build without any skip.
        show: A function called with each line.
    """
    plain = full.replace(UNSKIPPED)
    baseline, steps = other() if other else run_line(BASELINE, plain, minutes, None, training, views, out / "baseline")
    lines = [baseline]
    show(header(provenance(SOURCES)))
    show(HEADER)
    show(baseline.text(baseline))
    alone = {name: plain.replace({key: full[key] for key in keys}) for name, keys in SKIPS.items()}
    for i, (name, config) in enumerate((alone | {ALL: full}).items()):
        line, _ = run_line(name, config, minutes, steps, training, views, out / f"skip_{i}")
        lines.append(line)
        show(line.text(baseline))
    return lines


def run_line(
    name: str, config: Config, minutes: float, steps: int | None, training: Dataset, views: Dataset, out: Path
) -> tuple[Line, int]:
    """Trains for the minutes and, if given, for the baseline's steps; returns the line and the number of steps."""
    timed = config.replace({"max_minutes": minutes, "steps": NEVER})
    rate, by_time, made = train_and_score(timed, training, views, out / "equal_time")
    if steps is None:
        return Line(name, rate, by_time, by_time), made
    counted = config.replace({"max_minutes": 0.0, "steps": steps})
    _, by_steps, _ = train_and_score(counted, training, views, out / "equal_steps")
    return Line(name, rate, by_steps, by_time), made


def train_and_score(config: Config, training: Dataset, views: Dataset, run: Path) -> tuple[float, float, int]:
    """Steps a second, mean PSNR over the views, and the number of steps."""
    run.mkdir(parents=True, exist_ok=True)
    config.write(run / "config.toml")
    trained = train(training, config, run)
    scores = []
    for i in range(len(views)):
        maps = render_maps(trained.model, trained.grid, views, i)
        truth = over_background(views.images[i, ..., :3], views.images[i, ..., 3])
        scores.append(psnr(over_background(maps["rgb"], maps["alpha"]), truth))
    return trained.step / trained.seconds, float(np.mean(scores)), trained.step


def run_other(executable: Path, data: Path, minutes: float, downscale: int, run: Path) -> tuple[Line, int]:
    """The line and the number of steps of another build of this program, run through its command line.

    Raises:
        InputError: The other build cannot be run, or fails.
    """
    command = [
        str(executable), "train", str(data), "--out", str(run), "--max-minutes", str(minutes), "--downscale", str(downscale),
        "--steps", str(NEVER),
    ]  # fmt: skip
    try:
        done = subprocess.run(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    except OSError as error:
        raise InputError(f"{executable}: cannot be run ({error.strerror})") from error
    if done.returncode != 0:
        raise InputError(f"{executable}: train failed ({(done.stderr.strip().splitlines() or ['no message'])[-1]})")
    last = json.loads((run / "metrics.jsonl").read_text().splitlines()[-1])
    score = read_json(run / "evaluation.json", "novel_view")["novel_view"]["psnr"]
    return Line(executable.name, last["step"] / last["seconds"], score, score), last["step"]
