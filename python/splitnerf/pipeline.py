"""Whole jobs: reconstruct a dataset into a run's folder, score a run again, export it.

A run goes from photos to files: :func:`reconstruct` loads the splits, trains, and :func:`deliver`s: it exports the trained
asset, refines it, scores what is delivered and has the report written.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
import trimesh

from splitnerf.config import Config
from splitnerf.config.settings import UNLIMITED
from splitnerf.data.asset import read_place, write_place
from splitnerf.data.dataset import EXPOSURES, Dataset, dataset_fingerprint, load_dataset, spread, write_exposures
from splitnerf.data.environment import read_environment
from splitnerf.data.frames import has_test_split, split_rule
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import read_json, write_json
from splitnerf.data.reading import SEPARATED, Reading, is_separated
from splitnerf.data.truth import check_truth, read_mesh
from splitnerf.devices import same_bits
from splitnerf.errors import InputError, note, note_once
from splitnerf.evaluate.scoring import Evaluated, Protocol, choose_views, score_asset, score_fields
from splitnerf.export.meshing import EmptyMesh
from splitnerf.export.scene import Exported, Placing, write_assets, write_delivered
from splitnerf.files import is_own, locked
from splitnerf.plugins import installed
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.refine import (
    RECORD,
    STATE,
    TRAINED,
    OtherState,
    forget_state,
    occlusion_texture,
    refine_folder,
    refinement_summary,
)
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid
from splitnerf.render.seen import Cameras
from splitnerf.run_folder import (
    asset_name,
    check_results,
    check_run,
    clear_run,
    discard_refinement,
    is_refined,
    move_assets,
    own_results,
    refuse_no_run,
    write_data_of,
    write_scores,
)
from splitnerf.training.batches import without_fine_levels
from splitnerf.training.checkpoint import check_same_scene, config_of, load_checkpoint, restore_model, restored_grid
from splitnerf.training.loop import Training, begun
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.observer import NOBODY, Event, Observer
from splitnerf.training.schedule import progress_by

REPORT_VIEWS = 4
VIEW_BUDGET = 1 << 20  # pixels of the test views that a run scores by path tracing at its end, REPORT_VIEWS views aside


def load_splits(
    data: Path, downscale: int, reading: Reading = Reading(), *, masked: bool = True
) -> tuple[Dataset, Dataset | None]:
    """The train split, and the test split or None where no view is held out; a note says what is. Photos without masks
    are refused if `masked`. Raises InputError where the data cannot be used."""
    test = load_dataset(data, "test", downscale, reading, masked=masked) if has_test_split(data, reading) else None
    train = load_dataset(data, "train", downscale, reading, masked=masked)
    check_truth(test or train)
    held_out = "no view is" if test is None else f"{len(test)} are"
    note_once(f"{data}: {len(train)} views to train on, {held_out} held out for testing ({split_rule(data, reading)})")
    if train.origin.any():
        x, y, z = train.origin
        note_once(f"{data}: the cameras are far from the origin; results are relative to {x:.10g} {y:.10g} {z:.10g}")
    return train, test


def reconstruct(
    data: Path,
    run: Path,
    config: Config,
    *,
    downscale: int = 1,
    device: torch.device | str = "cpu",
    resume: bool = False,
    overwrite: bool = False,
    observer: Observer = NOBODY,
) -> tuple[Training, dict | None]:
    """Trains on a dataset, fills the run's folder and calls the observer. Returns the training and, when finished, its evaluation.
    Raises InputError where the data, the settings or the run's folder cannot be used; then nothing was written or deleted. Raises
    Diverged, EmptyMesh, OSError as :meth:`splitnerf.training.loop.Training.complete` does."""
    check_repeatable(config, device)
    with locked(run):
        check_run(run, resume=resume, overwrite=overwrite)
        config, dataset, test = load_with_masks(data, run, config, downscale, overwrite)
        config = for_turntable(config) if dataset.light_turns is not None else config
        config = config if resume else without_fine_levels(dataset, config)
        training = begun(dataset, config, run, torch.device(device), observer, resume)
        if overwrite:
            clear_run(run)
        write_place(run, dataset.origin)
        write_data_of(run, dataset)
        config.write(run / "config.toml")
        training.complete()
        if not training.finished:
            return training, None
        (run / EXPOSURES).unlink(missing_ok=True)
        if (found := training.exposures.found) is not None:
            dataset = dataset.exposed(found)
            write_exposures(run, dataset)
        return training, deliver(training, dataset, test, run, resume=resume)


def check_repeatable(config: Config, device: torch.device | str) -> None:
    """Raises InputError where the settings ask for equal bits on a device whose sums have no fixed order."""
    if config.run.deterministic and torch.device(device).type != "cpu":
        raise InputError("a deterministic run needs the CPU, as a GPU adds in any order; leave out --device")


def for_turntable(config: Config) -> Config:
    """The settings for a light of another rotation in each photo. Raises InputError where their occlusion knows one light alone."""
    if config.occlusion.kind == "mlp":
        raise InputError("photos of a turntable need occlusion.kind = bits or off; change --set or --preset")
    return config.replace({"shading.method": "split", "run.cuda_graphs": False})


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
        if overwrite and is_own(folder):
            shutil.rmtree(folder)
        return config, train, test
    minutes = config.run.max_minutes * config.separation.share
    steps = UNLIMITED if minutes > 0 else config.separation.steps
    seconds = find_masks(train, test, folder, steps=steps, minutes=minutes, seed=config.run.seed)
    if config.run.max_minutes > 0:
        left = config.run.max_minutes - seconds / 60
        config = config.replace({"run.max_minutes": max(left, 0.1 * config.run.max_minutes)})
    return config, *load_splits(data, downscale, replace(reading, separated=folder))


def deliver(training: Training, dataset: Dataset, test: Dataset | None, run: Path, *, resume: bool) -> dict | None:
    """Makes the files of a trained run: meshes, environment, evaluation and report, after a refinement if it has one, which
    `resume` continues if the scene has not changed since it was interrupted. Returns the evaluation; None where the refinement was
    interrupted. Raises EmptyMesh where there is no surface; the environment, the evaluation and the report are still written
    then."""
    config, observer, timings = training.config, training.observer, {"training": training.seconds}
    model, mesh, failure, refines = training.model, None, None, config.refinement.enabled
    if not (refines and resume and training.step == training.resumed_at and (run / STATE).is_file()):
        observer(Event("export"))
        clock = time.monotonic()
        discard_refinement(run)
        try:
            where = dataset.box_from_world, Cameras.of(dataset)
            mesh = write_assets(run, model, *where, name=asset_name(run), ground=dataset.ground).mesh
        except EmptyMesh as error:
            failure = error
        timings["export"] = time.monotonic() - clock
    if refines and not failure and not refine_trained(run, dataset, config, resume, observer):
        return None
    observer(Event("evaluation", path=run))
    clock = time.monotonic()
    views = test if test is not None else dataset
    if is_refined(run):
        n = max(REPORT_VIEWS, VIEW_BUDGET // (views.height * views.width))
        views = views.select(spread(range(len(views)), min(n, len(views))))
    evaluated = score_run(run, model, training.grid, views, mesh, timings, {}, Protocol())
    timings["evaluation"] = time.monotonic() - clock
    write_run_report(run, model, evaluated, timings)
    forget_state(run)
    write_scores(run, evaluated.scores)
    if failure:
        raise failure
    return evaluated.scores


def refine_trained(run: Path, dataset: Dataset, config: Config, resume: bool, observer: Observer) -> bool:
    """Refines a run, from what training exported to it or, in a run that continues, to RUN/trained; False where it was interrupted.
    Where photos or asset cannot be used, or numbers are not finite (RuntimeError), the run delivers what training exported."""
    if not (run / STATE).is_file():  # else what stands in the run may be a result of the stage that goes on
        move_assets(run, run / TRAINED)
    observer(Event("refinement", path=run / TRAINED))
    settings = FitSettings(
        sweeps=config.refinement_sweeps,
        minutes=config.refinement_minutes,
        albedo_size=config.refinement.albedo_size,
        seed=abs(config.run.seed) % (1 << 31),
    )
    try:
        with same_bits(config.run.deterministic):
            refined = refine_folder(
                run / TRAINED, dataset, run, settings, resume=resume, save_minutes=config.run.checkpoint_minutes
            )
    except OtherState:
        raise
    except InputError as error:
        move_assets(run / TRAINED, run)
        note(f"{run}: without refinement, as {error}")
        return True
    except RuntimeError:
        move_assets(run / TRAINED, run)
        raise
    return refined is not None


def score_run(
    run: Path,
    model: SceneModel,
    grid: OccupancyGrid,
    views: Dataset,
    mesh: trimesh.Trimesh | None,
    timings: dict[str, float],
    maps: dict[str, Path],
    protocol: Protocol,
) -> Evaluated:
    """Scores what a run delivers: the asset and its light by path tracing after a refinement, else the trained fields with `mesh`,
    that before its decimation (None: of mesh.glb). Where the run learned exposures, each view gets one by its own image. `timings`
    are seconds by part, "training" at least; `maps` those of the relit views, which are of mesh.glb."""
    spp, distance = protocol.spp, protocol.distance()
    asset = read_asset(run / "mesh.glb") if (run / "mesh.glb").is_file() else None
    free = (run / EXPOSURES).is_file()
    if is_refined(run):
        timings["refinement"] = read_json(run / RECORD, "seconds")["seconds"]
        seconds = round(timings["training"] + timings["refinement"], 1)
        evaluated = score_asset(
            asset, read_environment(run / "environment.exr"), views, maps, spp, seconds, free, distance
        )
        return replace(evaluated, scores=evaluated.scores | {"refinement": refinement_summary(run)})
    return score_fields(model, grid, views, mesh, asset, maps, spp, timings["training"], free, distance)


def write_run_report(run: Path, model: SceneModel, evaluated: Evaluated, timings: dict[str, float]) -> None:
    """report.html, where the tools are installed."""
    if (write_report := installed().write_report) is not None:
        write_report(run, model, evaluated, timings)


def load_run(run: Path, sizes: dict[str, object] | None = None) -> tuple[SceneModel, OccupancyGrid, dict]:
    """The trained scene of a run's checkpoint, ready to render, and the checkpoint itself; `sizes` are settings `export.*` by name,
    None: the run's. Raises InputError where there is no run, or its checkpoint cannot be read."""
    refuse_no_run(run)
    content = load_checkpoint(run / "checkpoint.pt")
    config = config_of(content).replace(sizes or {})
    model = SceneModel(config)
    restore_model(model, content, run / "checkpoint.pt")
    model.open_levels(progress_by(config)(content["step"], content["seconds"]))
    model.use_turns(content.get("light_turns"))
    SurfaceMesh(model).restore(content)
    grid = make_grid(config)
    if config.sampling.occupancy == "average":  # averages over the training cannot be recomputed
        grid.values, _ = restored_grid(grid, content, run / "checkpoint.pt")
    grid.update(model.sdf_field.sdf, model.s_value)
    return model, grid, content


def evaluate_run(run: Path, data: Path, protocol: Protocol, out: Path | None = None) -> Evaluated:
    """Scores again what a run delivers, see :func:`score_run`, with relit views of its mesh.glb; its meshes and
    environment do not change. The scores go to `out`, by default with a report.html into the run's folder. Raises
    InputError where the run or the data cannot be used."""
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
        evaluated = score_run(run, model, grid, views, mesh, timings, maps, protocol)
        timings["evaluation"] = time.monotonic() - clock
        if out is None:
            write_run_report(run, model, evaluated, timings)
            write_scores(run, evaluated.scores)
        else:
            write_json(out, evaluated.scores)
    return evaluated


def export_run(
    run: Path, out: Path, *, formats: Sequence[str], sizes: dict[str, object], placing: Placing, overwrite: bool
) -> Exported:
    """Writes a run's meshes and light into a folder, see :func:`splitnerf.export.scene.write_assets`: what the run delivers; with
    other `sizes`, settings `export.*` by name, or into the run, what was trained. origin.json says where an asset is that is not as
    the data have it. Raises EmptyMesh where the surface is empty, and InputError where the run cannot be used, files would be
    replaced (unless ``overwrite``), or a format needs a package that is not installed."""
    if (is_refined(run) and out.resolve() == run.resolve()) or (out / RECORD).is_file():
        raise InputError(f"{out}: holds what a refinement fitted, which this would replace; give another --out")
    refuse_no_run(run)
    check_results(out, run, overwrite=overwrite)
    read_place(run)  # before anything is written
    own = own_results(out, run)
    if own and placing != Placing():
        raise InputError(
            f"{out}: the run's own asset stands where the data are; for --pivot, --scale and --height give another --out"
        )
    refined = is_refined(run) and not own
    if refined and sizes:
        note(
            f"another size is of what was trained, without the refinement; `splitnerf refine {out}` fits it to the photos"
        )
    asset = read_asset(run / "mesh.glb") if refined and not sizes else None
    if asset is None:
        model, _, content = load_run(run, sizes)
    with locked(out):
        if asset is not None:
            asset.name = asset_name(run)
            exported = write_delivered(run, out, formats, asset, occlusion_texture(asset), placing)
        else:
            where = content["box_from_world"].numpy(), Cameras(**content["cameras"])
            options = {"formats": formats, "name": asset_name(run), "placing": placing}
            ground = None if content.get("ground") is None else content["ground"].numpy()
            exported = write_assets(out, model, *where, **options, ground=ground)
        if out.resolve() != run.resolve():
            known, _ = read_place(run) or (np.zeros(3), 1.0)
            write_place(out, known + exported.origin, exported.scale)
    return exported
