"""What a run writes while it trains: the lines of metrics.jsonl, and previews."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import area_average, linear_to_srgb, over_background, write_image
from splitnerf.files import atomic_path, reason
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import render_maps
from splitnerf.training.step import StepNumbers

METRICS = "metrics.jsonl"
PREVIEWS = "previews"  # the folder in a run
PREVIEW_EDGE = 256  # pixels, at most
LOG_EVERY = 20  # steps between lines of metrics.jsonl; the first steps and the last one are all logged


class StepLog:
    """The numbers of a run's steps, as lines of metrics.jsonl and as the bar's text. `psnr` is the batches' mean in dB, of the last
    steps above all, None before the first; `pending` is the line of the last step read, while metrics.jsonl lacks it."""

    def __init__(self, run: Path):
        self.path, self.psnr, self.pending = run / METRICS, None, None

    def take(self, numbers: StepNumbers, seconds: float, progress: float, **others: object) -> bool:
        """Takes in the numbers of a step, with other values of its line; returns whether the line is due."""
        if numbers.complete:
            psnr = -10.0 * math.log10(max(numbers.values["colour"], 1e-10))
            self.psnr = psnr if self.psnr is None else 0.95 * self.psnr + 0.05 * psnr
        n_rays, evaluated = numbers.n_rays, max(1, numbers.evaluated)
        self.pending = {
            "step": numbers.step,
            "seconds": round(seconds, 3),
            "progress": progress,
            "loss": numbers.loss,
            **{f"loss_{name}": weight * numbers.values[name] for name, weight in numbers.weights.items()},
            "psnr": self.psnr,
            "rays": n_rays,
            "samples_per_ray": numbers.evaluated / n_rays,
            "kept": numbers.counts.samples / evaluated,
            "shaded": numbers.counts.shaded / evaluated,
            "s": numbers.s,
            **others,
        }
        return numbers.step % LOG_EVERY == 0 or numbers.step <= LOG_EVERY

    def write(self) -> dict[str, object]:
        """Adds the pending line to metrics.jsonl, and returns it. Raises OSError where that is impossible; the folder may be
        gone."""
        line, self.pending = self.pending, None
        try:
            with open(self.path, "a", encoding="utf-8") as log:
                log.write(json.dumps(line) + "\n")
        except OSError as error:
            raise OSError(f"{self.path}: cannot be written ({reason(error)})") from error
        return line

    def text(self, numbers: StepNumbers) -> str:
        """The bar's text for a step: its number, and how well the photos are explained."""
        return f"training, step {numbers.step}" + ("" if self.psnr is None else f", photos {self.psnr:.2f} dB")


def read_metrics(path: Path) -> list[dict]:
    """The lines of a log that can be read; a program that was killed may have left half a line. None without a file."""
    if not path.is_file():
        return []
    return [line for text in path.read_text(encoding="utf-8", errors="replace").splitlines() if (line := _parsed(text))]


def keep_metrics(path: Path, step: int) -> None:
    """Removes from a log the lines that cannot be read, and those after a step from which the run goes on: they come
    again."""
    lines = [json.dumps(line) for line in read_metrics(path) if line["step"] <= step]
    with atomic_path(path) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def write_preview(run: Path, model: SceneModel, grid: OccupancyGrid, dataset: Dataset, step: int) -> Path:
    """``previews/step_NNNNNN.png``: the first view's photo, render, albedo and normals side by side; returns its path. A whole
    photo of a megapixel would take as long as a thousand steps."""
    factor = math.ceil(max(dataset.height, dataset.width) / PREVIEW_EDGE)
    maps = render_maps(model, grid, dataset, 0, factor)
    photo = over_background(dataset.images[0, ..., :3], dataset.images[0, ..., 3])
    panels = [area_average(photo, factor)] + [
        over_background(rgb, maps["alpha"])
        for rgb in (maps["rgb"], linear_to_srgb(maps["albedo"]), 0.5 * maps["normal"] + 0.5)
    ]
    path = run / PREVIEWS / f"step_{step:06d}.png"
    write_image(path, np.concatenate(panels, axis=1).astype(np.float32))
    return path


def _parsed(text: str) -> dict | None:
    try:
        line = json.loads(text, parse_int=lambda digits: int(digits) if len(digits) < 20 else float(digits))
    except (ValueError, RecursionError):
        return None
    return line if isinstance(line, dict) and type(line.get("step")) is int else None
