"""Runs an ablation: trains and scores each row on each scene, and continues an interrupted ablation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from splitnerf.config import Config
from splitnerf.data.json_files import read_json
from splitnerf.errors import InputError
from splitnerf.evaluate.score_table import values_of
from splitnerf.evaluate.scoring import Protocol
from splitnerf.pipeline import evaluate_run, reconstruct

from splitnerf_tools.ablate.rows import Row
from splitnerf_tools.ablate.scores import CLOSE, Score, differences


@dataclass(frozen=True)
class AblationPlan:
    """The plan of an ablation.

    Attributes:
        scenes: The folders of the datasets.
        rows: The rows; the first is the full method.
        seeds: The number of seeds of rows within `CLOSE` of their reference; other rows get one seed.
        protocol: The views and lights by which runs are scored.
        out: The folder of the runs, with one folder per scene.
    """

    scenes: list[Path]
    rows: list[Row]
    seeds: int
    protocol: Protocol
    out: Path


class Interrupted(Exception):
    """Ctrl-C ended a training; its state is saved."""


def ablate(plan: AblationPlan, show: Callable[[list[Score]], None]) -> list[Score]:
    """Trains and scores the runs that are not finished yet, and calls `show` after each run with all scores so far. Raises
    InputError where the data or a run's folder cannot be used, and Interrupted where Ctrl-C ended a training; the same call
    continues it."""
    scores: list[Score] = []

    def run(scene: Path, row: Row, seed: int) -> None:
        values = values_of(run_row(plan, scene, row, seed))
        scores.append(Score(scene.resolve().name, row.name, seed, values, row.reference))
        show(scores)

    for scene in plan.scenes:
        for row in plan.rows:
            run(scene, row, 0)
    for scene in plan.scenes:
        near = [d.row for d in differences(scores, scene.resolve().name) if abs(d.mean) < CLOSE]
        repeated = {*near, *(row.reference for row in plan.rows if row.name in near)}
        for row in plan.rows:
            if row.name in repeated:
                for seed in range(1, plan.seeds):
                    run(scene, row, seed)
    return scores


def run_row(plan: AblationPlan, scene: Path, row: Row, seed: int) -> dict:
    """The evaluation of one run; trains it unless it is finished."""
    config = row.config.replace({"run.seed": seed})
    run = plan.out / scene.resolve().name / (row.slug if seed == 0 else f"{row.slug}_seed{seed}")
    scores = run / "scores.json"
    stored = run / "config.toml"
    if stored.is_file():
        begun = Config.read(stored)
        if begun.replace({"surface.n_levels": config.surface.n_levels}) != config:
            raise InputError(f"{run}: holds a run with other settings; give another --out")
        config = begun  # which has fewer levels where the photos ask for fewer
    if not scores.is_file():
        resume = (run / "checkpoint.pt").is_file()
        _, evaluation = reconstruct(
            scene, run, config, downscale=plan.protocol.downscale, resume=resume, overwrite=not resume
        )
        if evaluation is None:
            raise Interrupted
        evaluate_run(run, scene, dataclasses.replace(plan.protocol, reading=config.reading), scores)
    return read_json(scores, "novel_view")
