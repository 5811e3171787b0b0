"""Whole jobs: reconstruct a dataset into a run folder, evaluate a run again, and the demo."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import torch

from splitnerf.config import Config
from splitnerf.config.settings import UNLIMITED
from splitnerf.data.dataset import Dataset, dataset_fingerprint, load_dataset
from splitnerf.data.exposures import EXPOSURES, write_exposures
from splitnerf.data.frames import has_test_split, refuse_data, split_rule
from splitnerf.data.json_files import write_json
from splitnerf.data.reading import SEPARATED, Reading, is_separated
from splitnerf.data.truth import read_mesh
from splitnerf.delivery import REFINEMENT_FILES, discard_refinement, finish, is_refined, score_run, write_run_report
from splitnerf.devices import refuse_one_processor
from splitnerf.errors import InputError
from splitnerf.evaluate.jobs import Evaluated, Protocol, choose_views, evaluation_path
from splitnerf.files import atomic_path, locked
from splitnerf.notes import note_once
from splitnerf.outputs import Exported, write_assets
from splitnerf.plugins import installed
from splitnerf.refinement.job import STATE
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid
from splitnerf.render.seen import Cameras
from splitnerf.training.checkpoint import config_of, load_checkpoint, restore_model, restored_grid
from splitnerf.training.loop import TrainedScene, begin_training, check_repeatable, check_same_scene
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.metrics import METRICS
from splitnerf.training.observer import Observer
from splitnerf.training.schedule import progress_of

ORIGIN = "origin.json"  # where the data's origin is, of runs whose data have it too far away for float32
RUN_FILES = (
    "config.toml", "checkpoint.pt", METRICS, "mesh.ply", "mesh.glb", "environment.exr", "environment.hdr",
    "evaluation.json", "report.html", ORIGIN, EXPOSURES, *REFINEMENT_FILES,
)  # fmt: skip


def load_splits(
    data: Path, downscale: int, reading: Reading = Reading(), *, masked: bool = True
) -> tuple[Dataset, Dataset | None]:
    """The train split, and the test split or None where no view is held out; a note says what is. Photos without masks are
    refused if `masked`.

    Raises:
        InputError: The data cannot be used.
    """
    test = load_dataset(data, "test", downscale, reading, masked=masked) if has_test_split(data, reading) else None
    train = load_dataset(data, "train", downscale, reading, masked=masked)
    held_out = "no view is" if test is None else f"{len(test)} are"
    note_once(f"{data}: {len(train)} views to train on, {held_out} held out for testing ({split_rule(data, reading)})")
    if train.origin.any():
        x, y, z = train.origin
        note_once(f"{data}: the cameras are far from the origin; results are relative to {x:.10g} {y:.10g} {z:.10g}")
    return train, test


def check_run(run: Path, *, resume: bool, overwrite: bool) -> None:
    """Checks that a run can be made here, and what stands where it is to be.

    Raises:
        InputError: The folder holds a run or a data set, the path is not a folder, or the machine has one processor.
    """
    refuse_one_processor()
    if run.exists() and not run.is_dir():
        raise InputError(f"{run}: is a file; give --out a folder")
    refuse_data(run)
    if not (resume or overwrite) and present_in(run):
        raise InputError(
            f"{run}: holds a run already; continue with --resume, replace it with --overwrite, or give another --out"
        )


def present_in(run: Path) -> list[str]:
    """The files of a run that a folder holds."""
    return [name for name in RUN_FILES if (run / name).exists()]


def clear_run(run: Path) -> None:
    """Deletes the files of a run, and nothing else."""
    discard_refinement(run)
    for name in RUN_FILES:
        (run / name).unlink(missing_ok=True)
    for preview in (run / "previews").glob("step_*.png"):
        preview.unlink()


def begin_or_resume(run: Path) -> tuple[bool, bool]:
    """Whether to resume the run of a folder, or to overwrite it: one that ended before its first checkpoint."""
    if (run / "checkpoint.pt").is_file():
        return True, False
    return False, set(present_in(run)) <= {"config.toml", METRICS}


def is_finished(run: Path) -> bool:
    """Whether a run has delivered what its checkpoint holds: the last file is the report or, where nothing writes one, the
    evaluation; then its state goes."""
    checkpoint, last = run / "checkpoint.pt", run / ("report.html" if installed().write_report else "evaluation.json")
    if not (checkpoint.is_file() and last.is_file()) or (run / STATE).exists():
        return False
    return last.stat().st_mtime_ns >= checkpoint.stat().st_mtime_ns


def reconstruct(
    data: Path,
    run: Path,
    config: Config,
    *,
    downscale: int = 1,
    device: torch.device | str = "cpu",
    resume: bool = False,
    overwrite: bool = False,
    observers: Sequence[Observer] = (),
) -> tuple[TrainedScene, dict | None]:
    """Trains on a dataset, fills the run's folder and calls the observers. Returns the scene and, when finished, its
    evaluation.

    Raises:
        InputError: The data, the settings or the run's folder cannot be used; nothing was written or deleted.
        Diverged, EmptyMesh, OSError: See :func:`splitnerf.training.loop.train`.
    """
    check_repeatable(config, device)
    with locked(run):
        check_run(run, resume=resume, overwrite=overwrite)
        config, dataset, test = load_with_masks(data, run, config, downscale, overwrite)
        training = begin_training(dataset, config, run, torch.device(device), resume=resume, observers=observers)
        begin_run(run, config, dataset, overwrite)
        trained = training.complete()
        if not trained.finished:
            return trained, None
        (run / EXPOSURES).unlink(missing_ok=True)
        if trained.exposures is not None:
            dataset = dataset.exposed(trained.exposures)
            write_exposures(run, dataset)
        return trained, finish(trained, dataset, test, run, resume=resume, observers=training.observers)


def begin_run(run: Path, config: Config, dataset: Dataset, overwrite: bool) -> None:
    """Writes what a run's folder holds from the start; with ``overwrite`` deletes what a run before left there."""
    if overwrite:
        clear_run(run)
    if dataset.origin.any():
        meaning = "add it to positions to get those of the data"
        write_json(run / ORIGIN, {"origin": dataset.origin.tolist(), "meaning": meaning})
    config.write(run / "config.toml")


def load_with_masks(
    data: Path, run: Path, config: Config, downscale: int, overwrite: bool
) -> tuple[Config, Dataset, Dataset | None]:
    """The splits of a dataset. Masks that photos lack are found first, and kept in the run's folder; what that takes of the
    run's minutes is taken off the settings that are returned."""
    folder, reading = run / SEPARATED, config.reading
    if is_separated(folder) and not overwrite:
        reading = replace(reading, separated=folder)
    find_masks = installed().find_masks
    train, test = load_splits(data, downscale, reading, masked=find_masks is None)
    if train.masked:
        if overwrite:
            shutil.rmtree(folder, ignore_errors=True)
        return config, train, test
    minutes = config.run.max_minutes * config.separation.share
    steps = UNLIMITED if minutes > 0 else config.separation.steps
    seconds = find_masks(train, test, folder, steps=steps, minutes=minutes, seed=config.run.seed)
    if config.run.max_minutes > 0:
        left = config.run.max_minutes - seconds / 60
        config = config.replace({"run.max_minutes": max(left, 0.1 * config.run.max_minutes)})
    return config, *load_splits(data, downscale, replace(reading, separated=folder))


def load_run(run: Path) -> tuple[SceneModel, OccupancyGrid, dict]:
    """The trained scene of a run's checkpoint, ready to render, and the checkpoint itself.

    Raises:
        InputError: There is no run, or its checkpoint cannot be read.
    """
    if not run.is_dir():
        raise InputError(f"{run}: no such run; train one with `splitnerf train DATA --out {run}`")
    content = load_checkpoint(run / "checkpoint.pt")
    config = config_of(content)
    model = SceneModel(config)
    restore_model(model, content, run / "checkpoint.pt")
    model.open_levels(progress_of(config, content["step"], content["seconds"]))
    SurfaceMesh(model).restore(content)
    grid = make_grid(config)
    if config.sampling.occupancy == "average":  # averages over the training cannot be recomputed
        grid.values, _ = restored_grid(grid, content, run / "checkpoint.pt")
    grid.update(model.sdf_field.sdf, model.s_value)
    return model, grid, content


def evaluate_run(run: Path, data: Path, protocol: Protocol, out: Path | None = None) -> Evaluated:
    """Scores again what a run delivers, see :func:`splitnerf.delivery.score_run`, with relit views of its mesh.glb.

    Args:
        run: The run's folder; its meshes and environment do not change.
        data: The dataset of the run.
        protocol: The views and lights.
        out: The json file for the scores; None writes evaluation.json and report.html in the run's folder.

    Raises:
        InputError: The run or the data cannot be used.
    """
    model, grid, content = load_run(run)
    dataset, test = load_splits(data, protocol.downscale, protocol.reading)
    own = replace(config_of(content).reading, separated=protocol.reading.separated)
    known = dataset if own == protocol.reading else load_dataset(data, "train", protocol.downscale, own)
    check_same_scene(content, dataset_fingerprint(known), run)
    views, maps = choose_views((dataset if test is None else test).in_box(content["box_from_world"].numpy()), protocol)
    clock = time.monotonic()
    mesh = read_mesh(run / "mesh.ply") if (run / "mesh.ply").is_file() else None
    timings = {"training": content["seconds"]}
    with locked(run) if out is None else nullcontext():
        evaluated = score_run(run, model, grid, views, mesh, timings, maps, protocol.spp)
        timings["evaluation"] = time.monotonic() - clock
        write_json(out or evaluation_path(run), evaluated.scores)
        if out is None:
            write_run_report(run, model, evaluated, timings)
    return evaluated


def export_run(
    run: Path,
    out: Path,
    *,
    formats: Sequence[str],
    n_faces: int | None = None,
    texture_size: int | None = None,
    resolution: int | None = None,
) -> Exported:
    """Writes a run's meshes and light into a folder, see :func:`splitnerf.outputs.write_assets`.

    Raises:
        InputError: The run cannot be used, or a format needs a package that is not installed.
        EmptyMesh: The surface is empty.
    """
    if is_refined(run) and out.resolve() == run.resolve():
        raise InputError(f"{run}: delivers what its refinement fitted, which this would replace; give another --out")
    refuse_data(out)
    model, _, content = load_run(run)
    with locked(out):
        if (run / ORIGIN).is_file() and out.resolve() != run.resolve():
            with atomic_path(out / ORIGIN) as temporary:
                shutil.copyfile(run / ORIGIN, temporary)
        return write_assets(
            out, model, content["box_from_world"].numpy(), Cameras(**content["cameras"]), formats=formats,
            resolution=resolution, n_faces=n_faces, texture_size=texture_size,
        )  # fmt: skip
