"""What the tools add to the program `splitnerf`, see :mod:`splitnerf.plugins`. Each hook imports its tool when it is called."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING

from splitnerf.plugins import Plugin

from splitnerf_tools.commands import ablate, batch, bench, demo, doctor, inspect, prepare, synth, view

if TYPE_CHECKING:
    from splitnerf.data.dataset import Dataset
    from splitnerf.evaluate.scoring import Evaluated
    from splitnerf.render.model import SceneModel
    from splitnerf.training.observer import Observer


def find_masks(train: Dataset, test: Dataset | None, folder: Path, *, steps: int, minutes: float, seed: int) -> float:
    from splitnerf_tools.separation.separate import separate

    return separate(train, test, folder, steps=steps, minutes=minutes, seed=seed)


def write_report(run: Path, model: SceneModel, evaluated: Evaluated, timings: dict[str, float]) -> None:
    from splitnerf_tools.report.run import write_run_report

    write_run_report(run, model, evaluated, timings)


def watch(name: str, port: int) -> AbstractContextManager[Observer]:
    from splitnerf_tools.view.training_page import training_page

    return training_page(name, port)


def failing_operators(device: str) -> tuple[list[str], int]:
    from splitnerf_tools.doctor.self_test import failures, operators

    return [failure.operator for failure in failures(device)], len(operators(device))


PLUGIN = Plugin(
    commands={
        "data": (prepare, inspect, synth),
        "results": (view,),
        "many runs": (batch, ablate),
        "this installation": (doctor, bench, demo),
    },
    find_masks=find_masks,
    write_report=write_report,
    watch=watch,
    failing_operators=failing_operators,
)
