"""One evaluation from files to scores: what to compare, with which views and lights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, load_dataset, spread
from splitnerf.data.environment import read_environment
from splitnerf.data.frames import has_test_split
from splitnerf.data.gltf import read_asset
from splitnerf.data.json_files import read_json
from splitnerf.data.reading import Reading
from splitnerf.data.relit import PROTOCOLS, relight_maps
from splitnerf.data.truth import ViewTruth, load_scene_truth, load_view_truths
from splitnerf.errors import InputError
from splitnerf.evaluate.asset import asset_predictions, environment_beside
from splitnerf.evaluate.exposure import exposed_like
from splitnerf.evaluate.lpips import load_distance
from splitnerf.evaluate.protocol import evaluate_maps
from splitnerf.evaluate.relight import RelitViews, relight, relight_scores
from splitnerf.evaluate.score_table import COLUMNS, GROUPS, SCORES
from splitnerf.progress import tracked
from splitnerf.render.model import ENVIRONMENT_ROWS, SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.path_traced import MOST_SPP, AssetRenderer
from splitnerf.render.renderer import render_maps


@dataclass(frozen=True)
class Protocol:
    """The views and lights of an evaluation.

    Attributes:
        downscale: Integer factor by which images are averaged down.
        views: Test views, evenly spread; None for all, or for the number that `lights` names.
        spp: Paths a pixel of what is path traced.
        lights: "low" or "high" for a published relighting protocol, else None.
        maps: Folder of environment maps; None for those of the data.
        reading: How the data are read.
    """

    downscale: int = 1
    views: int | None = None
    spp: int = 128
    lights: str | None = None
    maps: Path | None = None
    reading: Reading = Reading()

    def __post_init__(self) -> None:
        if not 1 <= self.spp <= MOST_SPP:
            raise InputError(f"--spp must be at least 1 and at most {MOST_SPP}, got {self.spp}")


@dataclass
class Evaluated:
    """Scores, and what they were computed from.

    Attributes:
        scores: The contents of evaluation.json.
        dataset: The views.
        predictions: Maps per view.
        truths: Truth maps per view.
        relit: The relit views, or None.
    """

    scores: dict
    dataset: Dataset
    predictions: list[dict[str, np.ndarray]]
    truths: list[ViewTruth]
    relit: RelitViews | None


def choose_views(dataset: Dataset, protocol: Protocol) -> tuple[Dataset, dict[str, Path]]:
    """The views of a split that a protocol takes, and its maps.

    Raises:
        InputError: The data lack views or maps that the protocol needs.
    """
    maps = relight_maps(dataset, protocol.maps, protocol.lights)
    count = protocol.views
    if count is None:
        count = PROTOCOLS[protocol.lights][1] if protocol.lights else len(dataset)
    if not 1 <= count <= len(dataset):
        found = f"{dataset.root}: has {len(dataset)} {dataset.split} views"
        raise InputError(f"{found}, {count} were requested; change --views")
    return dataset.select(spread(range(len(dataset)), count)), maps


def relit_scores(
    renderer: AssetRenderer, views: Dataset, maps: dict[str, Path], spp: int
) -> tuple[RelitViews | None, dict | None]:
    """Renders and scores the relit views; None and None where there is no map."""
    if not maps:
        return None, None
    relit = relight(renderer, views, maps, spp)
    return relit, relight_scores(relit, load_distance())


def asset_mesh(asset: Asset) -> trimesh.Trimesh:
    """The asset's triangles, in its own frame."""
    return trimesh.Trimesh(asset.vertices, asset.triangles, process=False)


def evaluate_asset(path: Path, data: Path, protocol: Protocol, env: Path | None = None) -> Evaluated:
    """Scores a GLB file against the test views of a dataset.

    Args:
        path: The file, in the data's world frame as a run exports it.
        data: The dataset.
        protocol: Views and lights.
        env: The light of the photos for the novel views; None for the environment.exr or .hdr in its folder. Without
            either `novel_view` and `light_psnr` are None.

    Raises:
        InputError: The file, the data or the light cannot be used.
    """
    asset = read_asset(path)
    split = "test" if has_test_split(data, protocol.reading) else "train"
    views, maps = choose_views(load_dataset(data, split, protocol.downscale, protocol.reading), protocol)
    env = environment_beside(path) if env is None else env
    return score_asset(asset, None if env is None else read_environment(env), views, maps, protocol.spp)


def score_asset(
    asset: Asset,
    environment: np.ndarray | None,
    views: Dataset,
    maps: dict[str, Path],
    spp: int,
    seconds: float | None = None,
    free_exposure: bool = False,
) -> Evaluated:
    """Scores an asset by path tracing.

    Args:
        asset: The asset, in the data's world frame.
        environment: [h, w, 3] the light of the photos, or None.
        views: The views.
        maps: Environment maps for relit views, by name; none for no such views.
        spp: Paths a pixel.
        seconds: The time that the asset took, to record.
        free_exposure: Whether each photo has an exposure of its own, which is fitted.
    """
    renderer = AssetRenderer(asset)
    predictions = asset_predictions(renderer, views, environment, spp)
    relit = relit_scores(renderer, views, maps, spp)
    evaluated = _scored(predictions, views, environment, asset_mesh(asset), relit, seconds, free_exposure)
    return replace(evaluated, scores=evaluated.scores | {"scored": "asset", "spp": spp})


def score_fields(
    model: SceneModel,
    grid: OccupancyGrid,
    views: Dataset,
    mesh: trimesh.Trimesh | None,
    asset: Asset | None,
    maps: dict[str, Path],
    spp: int,
    seconds: float,
    free_exposure: bool = False,
) -> Evaluated:
    """Scores trained fields by rendering them.

    Args:
        model, grid: The trained scene.
        views: The views.
        mesh: The surface, in the data's world frame; None for that of the asset.
        asset: What was exported, which the relit views show; None where there is none.
        maps, spp, seconds, free_exposure: See :func:`score_asset`; `spp` is of the relit views.
    """
    predictions = [render_maps(model, grid, views, i) for i in tracked(range(len(views)), "evaluation, view")]
    light = model.light.panorama(ENVIRONMENT_ROWS).cpu().numpy()
    relit = (None, None) if asset is None else relit_scores(AssetRenderer(asset), views, maps, spp)
    mesh = asset_mesh(asset) if mesh is None and asset is not None else mesh
    evaluated = _scored(predictions, views, light, mesh, relit, round(seconds, 1), free_exposure)
    return replace(evaluated, scores=evaluated.scores | {"scored": "fields"})


def _scored(
    predictions: list[dict[str, np.ndarray]],
    views: Dataset,
    light: np.ndarray | None,
    mesh: trimesh.Trimesh | None,
    relit: tuple[RelitViews | None, dict | None],
    seconds: float | None,
    free_exposure: bool,
) -> Evaluated:
    """Scores rendered views, a light and a mesh against the truth of the data."""
    if free_exposure and light is not None:
        views = exposed_like(views, predictions)
    truths, truth = load_view_truths(views), load_scene_truth(views.root, views.origin)
    scores = evaluate_maps(
        predictions,
        views,
        truths,
        light,
        truth.light,
        mesh,
        truth.mesh,
        seconds,
        relight=relit[1],
        distance=load_distance(),
    )
    return Evaluated(scores | ({"exposures": "fitted"} if free_exposure else {}), views, predictions, truths, relit[0])


def is_asset(path: Path) -> bool:
    """Whether a path names an asset's file rather than a run's folder."""
    return path.suffix.lower() in (".glb", ".gltf")


def evaluation_path(target: Path) -> Path:
    """The file of the scores of a run, or of an asset's file."""
    return target.with_name(f"{target.stem}_evaluation.json") if is_asset(target) else target / "evaluation.json"


def read_evaluation(target: Path) -> dict:
    """The scores that an earlier evaluation of a run or a file wrote.

    Raises:
        InputError: There are none, or the file holds no scores.
    """
    path = evaluation_path(target)
    if not path.is_file():
        raise InputError(f"{path}: no such evaluation; make it with `splitnerf evaluate {target} --data DATA`")
    scores = read_json(path, "novel_view")
    if not is_evaluation(scores):
        raise InputError(f"{path}: is not an evaluation; make it with `splitnerf evaluate {target} --data DATA`")
    return scores


def holds_evaluation(path: Path) -> bool:
    """Whether a file is an evaluation."""
    try:
        return is_evaluation(read_json(path, "novel_view"))
    except InputError:
        return False


def is_evaluation(content: dict) -> bool:
    """Whether contents of a file are scores as an evaluation writes them."""
    groups = [content.get(key) for key, _ in GROUPS]
    numbers = [content.get(key) for key, *_ in COLUMNS]
    for group in groups:
        if group is not None and not (isinstance(group, dict) and {key for key, *_ in SCORES} <= group.keys()):
            return False
        numbers += [group[key] for key, *_ in SCORES] if group else []
    return "novel_view" in content and all(type(number) in (int, float, type(None)) for number in numbers)
