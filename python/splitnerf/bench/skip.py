"""What each skip is worth: steps a second, and the error at equal steps and at equal time."""

from __future__ import annotations

import json
import subprocess
import sys
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
from splitnerf.outputs import render_maps
from splitnerf.train import train
from splitnerf.workflow import load_splits

SCORED_VIEWS = 8

# Each skip alone: what it sets, against what stands without it.
SWITCHES: dict[str, tuple[dict[str, object], dict[str, object]]] = {
    "samples found without gradients": ({"sample_above": 1e-3}, {"sample_above": 0.0}),
    "few shaded samples a ray": ({"shades_per_ray": 4}, {"shades_per_ray": 0}),
    "light moved every 4 steps": ({"light_step_every": 4}, {"light_step_every": 1}),
    "visibility traced when the mesh has moved": ({"occlusion": "bits"}, {}),
}
NOTHING = "nothing skipped"
ALL = "all"


@dataclass(frozen=True)
class Line:
    """One line of the table.

    Attributes:
        name: Of the skip; `all` for the settings as they are.
        steps_per_second: Of the run of equal time, all its work included.
        psnr_equal_steps: Mean over the test views, dB, after as many steps as the baseline made.
        psnr_equal_time: The same after as many minutes.
    """

    name: str
    steps_per_second: float
    psnr_equal_steps: float
    psnr_equal_time: float


def run_line(
    name: str, config: Config, minutes: float, steps: int | None, train_split: Dataset, views: Dataset, out: Path
) -> tuple[Line, int]:
    """Trains for the minutes, and for the baseline's steps where they are known; the line and the steps made."""
    timed = config.replace({"max_minutes": minutes, "steps": 10**7})
    rate, by_time, made = train_and_score(timed, train_split, views, out / "time")
    if steps is None:
        return Line(name, rate, by_time, by_time), made
    counted = config.replace({"max_minutes": 0.0, "steps": steps})
    _, by_steps, _ = train_and_score(counted, train_split, views, out / "steps")
    return Line(name, rate, by_steps, by_time), made


def train_and_score(config: Config, train_split: Dataset, views: Dataset, run: Path) -> tuple[float, float, int]:
    """Steps a second, mean PSNR over the views, and the number of steps."""
    run.mkdir(parents=True, exist_ok=True)
    config.write(run / "config.toml")
    trained = train(train_split, config, run)
    scores = []
    for i in range(len(views)):
        maps = render_maps(trained.model, trained.grid, views, i)
        truth = over_background(views.images[i, ..., :3], views.images[i, ..., 3])
        scores.append(psnr(over_background(maps["rgb"], maps["alpha"]), truth))
    return trained.step / trained.seconds, float(np.mean(scores)), trained.step


def run_other(executable: Path, data: Path, minutes: float, downscale: int, out: Path) -> tuple[Line, int]:
    """The same by another build of this program, told by its command line: a baseline from before.

    Raises:
        InputError: It cannot be run, or fails.
    """
    command = [str(executable), "train", str(data), "--out", str(out), "--max-minutes", str(minutes), "--downscale", str(downscale)]
    try:
        done = subprocess.run([*command, "--steps", str(10**7)], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    except OSError as error:
        raise InputError(f"{executable}: cannot be run ({error.strerror})") from error
    if done.returncode != 0:
        raise InputError(f"{executable}: train failed ({done.stderr.strip().splitlines()[-1]})")
    last = json.loads((out / "metrics.jsonl").read_text().splitlines()[-1])
    score = read_json(out / "evaluation.json", "novel_view")["novel_view"]["psnr"]
    return Line(str(executable), last["step"] / last["seconds"], score, score), last["step"]
