"""From a trained scene to what a run delivers: the export, the refinement, the scores and the report."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import trimesh

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, spread
from splitnerf.data.environment import read_environment
from splitnerf.data.exposures import EXPOSURES
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import read_json, write_json
from splitnerf.data.truth import load_view_truths
from splitnerf.devices import same_bits
from splitnerf.errors import InputError
from splitnerf.evaluate.jobs import Evaluated, Protocol, asset_mesh, relit_scores, score_asset
from splitnerf.evaluate.lpips import load_distance
from splitnerf.export.meshing import EmptyMesh
from splitnerf.notes import note
from splitnerf.outputs import evaluate_scene, write_assets
from splitnerf.plugins import installed
from splitnerf.refinement.fit import RefinementSettings, decibels
from splitnerf.refinement.job import RECORD, STATE, TRAINED, OtherState, forget_state, refine_folder
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.path_traced import AssetRenderer
from splitnerf.render.seen import Cameras
from splitnerf.training.loop import TrainedScene
from splitnerf.training.observer import Observer

ASSET_FILES = ("mesh.glb", "environment.exr", "environment.hdr")
REFINEMENT_FILES = (RECORD, STATE, *(f"{TRAINED}/{name}" for name in ASSET_FILES))
REPORT_VIEWS = 4
VIEW_BUDGET = 1 << 20  # pixels of the test views that a run scores by path tracing at its end, REPORT_VIEWS views aside


def is_refined(run: Path) -> bool:
    """Whether a run delivers what a refinement fitted."""
    return (run / RECORD).is_file() and (run / "mesh.glb").is_file()


def export_folder(run: Path) -> Path:
    """Where a run's trained asset is written: the run, or RUN/trained where the run delivers a refined one."""
    return run / TRAINED if is_refined(run) else run


def finish(
    trained: TrainedScene, dataset: Dataset, test: Dataset | None, run: Path, *, resume: bool, observers: Observer = Observer()
) -> dict | None:
    """Makes the files of a trained run: meshes, environment, evaluation and report, after a refinement if it has one.

    Without a surface (:class:`EmptyMesh`) the environment, the evaluation and the report are still written.

    Args:
        trained: The scene.
        dataset, test: The train split, and the test split or None.
        run: The run's folder.
        resume: Whether to continue the refinement, if the scene has not changed since it was interrupted.
        observers: The observers to call.

    Returns:
        The evaluation; None where the refinement was interrupted.
    """
    config, timings, mesh, failure = trained.model.config, {"training": trained.seconds}, None, None
    refines = config.refinement.enabled
    if not (refines and resume and trained.n_new == 0 and (run / STATE).is_file()):
        observers.delivering("export")
        clock = time.monotonic()
        discard_refinement(run)
        try:
            mesh = write_assets(run, trained.model, dataset.box_from_world, Cameras.of(dataset)).mesh
        except EmptyMesh as error:
            failure = error
        timings["export"] = time.monotonic() - clock
    if refines and not failure and not refine_trained(run, dataset, config, resume, observers):
        return None
    observers.delivering("evaluation", run)
    clock = time.monotonic()
    views = test if test is not None else dataset
    if is_refined(run):
        n = max(REPORT_VIEWS, VIEW_BUDGET // (views.height * views.width))
        views = views.select(spread(range(len(views)), min(n, len(views))))
    evaluated = score_run(run, trained.model, trained.grid, views, mesh, timings, {}, Protocol.spp)
    write_json(run / "evaluation.json", evaluated.scores)
    timings["evaluation"] = time.monotonic() - clock
    write_run_report(run, trained.model, evaluated, timings)
    forget_state(run)
    if failure:
        raise failure
    return evaluated.scores


def refine_trained(run: Path, dataset: Dataset, config: Config, resume: bool, observers: Observer) -> bool:
    """Refines a run, from what training exported to the run or, in a run that continues, to RUN/trained.

    Photos or an asset that it cannot use leave it out, with a note; the run then delivers what training exported.

    Returns:
        False where it was interrupted.

    Raises:
        RuntimeError: Numbers are no longer finite; the run delivers what training exported.
        OSError: A file cannot be written.
    """
    if not (run / STATE).is_file():  # else what stands in the run may be a result of the stage that goes on
        move_assets(run, run / TRAINED)
    observers.delivering("refinement", run / TRAINED)
    settings = RefinementSettings(
        sweeps=config.refinement_sweeps, minutes=config.refinement_minutes, seed=abs(config.run.seed) % (1 << 31)
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


def move_assets(source: Path, target: Path) -> None:
    """Moves the asset and its light, as far as they are there."""
    target.mkdir(exist_ok=True)
    for name in ASSET_FILES:
        if (source / name).is_file():
            os.replace(source / name, target / name)


def discard_refinement(run: Path) -> None:
    """Deletes the files of a refinement except the asset, and those it started from."""
    for name in REFINEMENT_FILES:
        (run / name).unlink(missing_ok=True)
    if (run / TRAINED).is_dir() and not any((run / TRAINED).iterdir()):
        (run / TRAINED).rmdir()


def score_run(
    run: Path, model: SceneModel, grid: OccupancyGrid, views: Dataset, mesh: trimesh.Trimesh | None, timings: dict[str, float],
    maps: dict[str, Path], spp: int,
) -> Evaluated:  # fmt: skip
    """Scores what a run delivers: the asset and its light by path tracing after a refinement, else the trained fields. Where
    the run learned exposures, each view gets one by its own image.

    Args:
        run: The run's folder.
        model, grid: The trained scene.
        views: The views.
        mesh: The trained mesh before its decimation, which is scored with the fields; None for that of mesh.glb.
        timings: Seconds by part, "training" at least; that of a refinement is added.
        maps: Environment maps of relit views by name, which are rendered of mesh.glb.
        spp: Paths a pixel.
    """
    asset = read_asset(run / "mesh.glb") if (run / "mesh.glb").is_file() else None
    free = (run / EXPOSURES).is_file()
    if is_refined(run):
        timings["refinement"] = read_json(run / RECORD, "seconds")["seconds"]
        seconds = round(timings["training"] + timings["refinement"], 1)
        evaluated = score_asset(asset, read_environment(run / "environment.exr"), views, maps, spp, seconds, free)
        return replace(evaluated, scores=evaluated.scores | {"refinement": refinement_summary(run)})
    relit, relight = (None, None) if asset is None else relit_scores(AssetRenderer(asset), views, maps, spp)
    mesh = asset_mesh(asset) if mesh is None and asset is not None else mesh
    scores, predictions, views = evaluate_scene(model, grid, views, mesh, timings["training"], relight, load_distance(), free)
    return Evaluated(scores, views, predictions, load_view_truths(views), relit)


def refinement_summary(run: Path) -> dict:
    """The changes by the refinement of a run; pairs are before and after."""
    record = read_json(run / RECORD, "sweeps")
    sweeps, outline = record["sweeps"], record["outline"]
    return {
        "steps": len(sweeps), "seconds": record["seconds"],
        "photos_psnr": [decibels(sweeps[i]["error"]) for i in (0, -1)],
        "outline_error": [outline[0], outline[-1]] if outline else None,
        "saturated": record["saturated"],
    }  # fmt: skip


def write_run_report(run: Path, model: SceneModel, evaluated: Evaluated, timings: dict[str, float]) -> None:
    """report.html, where a plugin writes it."""
    if (write_report := installed().write_report) is not None:
        write_report(run, model, evaluated, timings)
