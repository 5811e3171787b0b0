"""Runs small enough that a step takes milliseconds."""

import json
from pathlib import Path

import torch
from pytest import CaptureFixture
from splitnerf.cli import BAD_INPUT, main
from splitnerf.config import Config, preset
from splitnerf.data.dataset import Dataset
from splitnerf.training.loop import Training, begun
from splitnerf.training.observer import NOBODY, Observer

# A tenth of the default sizes and less; the method is that of the preset.
SMALL = dict(n_levels=4, log2_table_size=10, target_samples=512, initial_rays=64, grid_resolution=16)
SMALL |= dict(light_resolution=16, light_samples=64, light_queries=16, eikonal_points=32, mesh_resolution=24)
SMALL |= dict(export_resolution=32, export_faces=500, export_texture_size=64, cuda_graphs=False)
SMALL |= {"refinement.enabled": False, "surface.start": "sphere"}


def tiny(name: str = "cpu", **settings: object) -> Config:
    """The settings of a preset, small, with some changed."""
    return preset(name).replace(SMALL | settings)


def as_options(settings: dict[str, object]) -> list[str]:
    """The same settings for the command line."""
    return [part for key, value in settings.items() for part in ("--set", f"{key}={json.dumps(value)}")]


def command(*words: object) -> int:
    """The exit code of `splitnerf` with these words."""
    return main([str(word) for word in words])


def refused(capsys: CaptureFixture, *words: object) -> str:
    """The one line, notes aside, of a command that is refused."""
    capsys.readouterr()
    assert command(*words) == BAD_INPUT
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "note: " not in line)
    assert line.startswith("splitnerf: ")
    return line


def train(data: Path, run: Path, *options: str) -> int:
    """`splitnerf train` with small settings; returns its exit code."""
    return main(["train", str(data), "--out", str(run), *as_options(SMALL), *options])


def train_scene(
    dataset: Dataset, config: Config, run: Path, observer: Observer = NOBODY, *, device="cpu", resume=False
) -> Training:
    """A training after its last step, in the folder `run`."""
    training = begun(dataset, config, run, torch.device(device), observer, resume)
    training.complete()
    return training


def contents(folder: Path) -> dict[Path, bytes]:
    """What each file below a folder holds."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def lines_of(run: Path) -> list[dict]:
    """The lines of a run's metrics.jsonl."""
    return [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
