"""Whole jobs: reconstruct a dataset into a run folder, evaluate a run again, and the demo."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
import trimesh

from splitnerf.training.checkpoint import config_of, load_checkpoint, restore_model, restored_grid
from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint, load_dataset
from splitnerf.data.frames import has_test_split
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import write_json
from splitnerf.data.truth import load_scene_truth, load_view_truths, read_mesh
from splitnerf.errors import InputError
from splitnerf.evaluate.jobs import Evaluated, Protocol, asset_mesh, choose_views, evaluation_path, relit_scores
from splitnerf.evaluate.lpips import load_distance
from splitnerf.export.meshing import EmptyMesh
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.outputs import Exported, evaluate_scene, light_panels, write_assets
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid
from splitnerf.render.path_traced import AssetRenderer
from splitnerf.report.html import write_report
from splitnerf.training.loop import TrainedScene, check_repeatable, check_same_scene, train

RUN_FILES = (
    "config.toml", "checkpoint.pt", "metrics.jsonl", "mesh.ply", "mesh.glb", "environment.exr", "environment.hdr",
    "evaluation.json", "report.html",
)  # fmt: skip
REPORT_VIEWS = 4


def load_splits(data: Path, downscale: int) -> tuple[Dataset, Dataset | None]:
    """The train split, and the test split or None.

    Raises:
        InputError: The data cannot be used.
    """
    test = load_dataset(data, "test", downscale) if has_test_split(data) else None
    return load_dataset(data, "train", downscale), test


def prepare_run(run: Path, *, resume: bool, overwrite: bool) -> None:
    """Makes the run's folder.

    Raises:
        InputError: The folder holds a run, or the path is not a folder.
    """
    if run.exists() and not run.is_dir():
        raise InputError(f"{run}: is a file; give --out a folder")
    present = [name for name in RUN_FILES if (run / name).exists()]
    if present and overwrite:
        for name in present:
            (run / name).unlink()
        for preview in (run / "previews").glob("step_*.png"):
            preview.unlink()
    elif present and not resume:
        raise InputError(
            f"{run}: holds a run already; go on with --resume, replace it with --overwrite, or give another --out"
        )
    run.mkdir(parents=True, exist_ok=True)


def reconstruct(
    data: Path,
    run: Path,
    config: Config,
    *,
    downscale: int = 1,
    device: torch.device | str = "cpu",
    resume: bool = False,
    overwrite: bool = False,
) -> tuple[TrainedScene, dict | None]:
    """Trains on a dataset and fills the run's folder. Returns the scene and, when finished, its evaluation.

    Raises:
        InputError: The data, the settings or the run's folder cannot be used; nothing was written.
        Diverged, EmptyMesh, OSError: See :func:`splitnerf.training.loop.train`.
    """
    check_repeatable(config, device)
    dataset, test = load_splits(data, downscale)
    prepare_run(run, resume=resume, overwrite=overwrite)
    config.write(run / "config.toml")
    trained = train(dataset, config, run, device=device, resume=resume)
    if not trained.finished:
        return trained, None
    return trained, finish(trained.model, trained.grid, dataset, test, run, {"training": trained.seconds})


def finish(
    model: SceneModel, grid: OccupancyGrid, dataset: Dataset, test: Dataset | None, run: Path, timings: dict[str, float]
) -> dict:
    """Writes meshes, environment, evaluation and report of a trained scene. Returns the evaluation.

    Without a surface (:class:`EmptyMesh`) the environment, the evaluation and the report are still written.
    """
    clock = time.monotonic()
    failure: EmptyMesh | None = None
    mesh: trimesh.Trimesh | None = None
    try:
        mesh = write_assets(run, model, dataset.box_from_world).mesh
    except EmptyMesh as error:
        failure = error
    timings["export"] = time.monotonic() - clock
    clock = time.monotonic()
    views = test if test is not None else dataset
    evaluation, predictions = evaluate_scene(model, grid, views, mesh, timings["training"])
    write_json(run / "evaluation.json", evaluation)
    timings["evaluation"] = time.monotonic() - clock
    write_run_report(model, views, predictions, evaluation, run, timings)
    if failure:
        raise failure
    return evaluation


def write_run_report(
    model: SceneModel, views: Dataset, predictions: list[dict], evaluation: dict, run: Path, timings: dict[str, float]
) -> None:
    """report.html: maps beside the truth, the light beside its Monte Carlo estimate, curves and settings."""
    truths = load_view_truths(views)
    shown = np.unique(np.linspace(0, len(views) - 1, REPORT_VIEWS).round().astype(int))
    pages = []
    for i in shown:
        prediction = dict(predictions[i])
        prediction["occlusion_diffuse"] = prediction.pop("occlusion_d")
        prediction["occlusion_specular"] = prediction.pop("occlusion_s")
        truth = {key: value for key, value in vars(truths[i]).items() if key != "name"}
        truth |= {"rgb": views.images[i, ..., :3], "alpha": views.images[i, ..., 3]}
        pages.append({"name": views.frame_names[i], "truth": truth, "prediction": prediction})
    lines = (run / "metrics.jsonl").read_text().splitlines()
    write_report(
        run / "report.html",
        title=views.name,
        summary={"Result": headline(evaluation), "All scores": evaluation, "Settings": asdict(model.config)},
        views=pages,
        lights=light_panels(model),
        light_truth=load_scene_truth(views.root).light,
        history=[json.loads(line) for line in lines],
        timings=timings,
    )


def headline(evaluation: dict) -> dict[str, float]:
    """The most important scores; scores without truth in the data are left out."""
    novel_view, relight, albedo = (evaluation[key] or {} for key in ("novel_view", "relight", "albedo"))
    scores = {
        "novel views, PSNR dB": novel_view.get("psnr"),
        "novel views, SSIM": novel_view.get("ssim"),
        "relit views, PSNR dB": relight.get("psnr"),
        "albedo, PSNR dB": albedo.get("psnr"),
        "normals, degrees": evaluation["normal_mae_deg"],
        "roughness, mean error": evaluation["roughness_mae"],
        "metallic, accuracy": evaluation["metallic_balanced_accuracy"],
        "light, PSNR dB": evaluation["light_psnr"],
        "mesh, F-score": evaluation["f_score"],
    }
    return {name: value for name, value in scores.items() if value is not None}


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
    model.open_levels(1.0)
    SurfaceMesh(model).restore(content)
    grid = make_grid(config)
    if config.sampling.occupancy == "average":  # averages over the training cannot be recomputed
        grid.values, _ = restored_grid(grid, content, run / "checkpoint.pt")
    grid.update(model.sdf_field.sdf, model.s_value)
    return model, grid, content


def evaluate_run(run: Path, data: Path, protocol: Protocol, out: Path | None = None) -> Evaluated:
    """Renders a run's test views again from its checkpoint, and relit views of its mesh.glb, and scores them.

    Args:
        run: The run's folder; its meshes and environment do not change.
        data: The dataset of the run.
        protocol: The views and lights.
        out: The json file for the scores; None writes evaluation.json and report.html in the run's folder.

    Raises:
        InputError: The run or the data cannot be used.
    """
    model, grid, content = load_run(run)
    dataset, test = load_splits(data, protocol.downscale)
    views, maps = choose_views(dataset if test is None else test, protocol)
    clock = time.monotonic()
    relit, relight, mesh = None, None, None
    if (run / "mesh.glb").is_file():
        asset = read_asset(run / "mesh.glb")
        mesh = asset_mesh(asset)
        relit, relight = relit_scores(AssetRenderer(asset), views, maps, protocol.spp)
    if (run / "mesh.ply").is_file():
        mesh = read_mesh(run / "mesh.ply")
    evaluation, predictions = evaluate_scene(model, grid, views, mesh, content["seconds"], relight, load_distance())
    timings = {"training": content["seconds"], "evaluation": time.monotonic() - clock}
    write_json(out or evaluation_path(run), evaluation)
    if out is None:
        write_run_report(model, views, predictions, evaluation, run, timings)
    return Evaluated(evaluation, views, predictions, load_view_truths(views), relit)


def export_run(
    run: Path,
    out: Path,
    *,
    formats: Sequence[str],
    n_faces: int,
    texture_size: int,
    resolution: int | None = None,
) -> Exported:
    """Writes a run's meshes and light into a folder, see :func:`splitnerf.outputs.write_assets`.

    Raises:
        InputError: The run cannot be used, or a format needs a package that is not installed.
        EmptyMesh: The surface is empty.
    """
    model, _, content = load_run(run)
    box_from_world = content["box_from_world"].numpy()
    out.mkdir(parents=True, exist_ok=True)
    return write_assets(
        out, model, box_from_world, formats=formats, resolution=resolution, n_faces=n_faces, texture_size=texture_size
    )
