"""One evaluation from files to scores: what to compare, with which views and lights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from splitnerf.data.asset import Asset, check_place, unit
from splitnerf.data.dataset import Dataset, load_dataset, spread
from splitnerf.data.environment import read_environment, turn_environment
from splitnerf.data.frames import has_test_split
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import srgb_to_linear, straight_srgb, to_uint8
from splitnerf.data.json_files import read_json
from splitnerf.data.pixels import per_channel
from splitnerf.data.reading import Reading
from splitnerf.data.truth import (
    OPAQUE,
    PROTOCOLS,
    ViewTruth,
    load_scene_truth,
    load_view_truths,
    read_relit,
    relight_maps,
)
from splitnerf.errors import InputError
from splitnerf.evaluate.lpips import Distance, Lpips
from splitnerf.evaluate.protocol import ScaledView, evaluate_maps, scaled_scores
from splitnerf.evaluate.score_table import COLUMNS
from splitnerf.progress import tracked
from splitnerf.render.model import ENVIRONMENT_ROWS, SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.path_traced import MOST_SPP, AssetRenderer
from splitnerf.render.renderer import render_maps

FIRST_SEED = 1 << 31  # data are rendered with smaller ones, so that prediction and truth never share their noise
ENVIRONMENTS = ("environment.exr", "environment.hdr")
DARKEST, BRIGHTEST = 0.01, 0.95  # linear values of a photo between which pixels count for its exposure


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
        lpips: A file of VGG16's weights, with which LPIPS is computed; None: it is not.
    """

    downscale: int = 1
    views: int | None = None
    spp: int = 128
    lights: str | None = None
    maps: Path | None = None
    reading: Reading = Reading()
    lpips: Path | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.spp <= MOST_SPP:
            raise InputError(f"--spp must be at least 1 and at most {MOST_SPP}, got {self.spp}")

    def distance(self) -> Distance | None:
        """LPIPS, where it is computed. Raises InputError where its files cannot be used."""
        return None if self.lpips is None else Lpips(self.lpips)


@dataclass
class Evaluated:
    """The contents of evaluation.json, and what they were computed from: the views, their maps and truths, relit views."""

    scores: dict
    dataset: Dataset
    predictions: list[dict[str, np.ndarray]]
    truths: list[ViewTruth]
    relit: RelitViews | None


@dataclass
class RelitViews:
    """Images [H, W, 4] uint8, sRGB with straight alpha, by map and by view, of a dataset relit with `spp` paths a pixel."""

    images: dict[str, list[np.ndarray]]
    dataset: Dataset
    spp: int

    def views(self) -> Iterator[ScaledView]:
        """Each image with its truth, grouped by map; a truth image is read when its turn comes."""
        for name, images in self.images.items():
            for i in range(len(images)):
                yield self.view(name, i)

    def view(self, name: str, index: int) -> ScaledView:
        """One image with its truth."""
        prediction = self.images[name][index].astype(np.float32) / 255
        truth = read_relit(self.dataset, index, name)
        return ScaledView(
            name, srgb_to_linear(prediction[..., :3]), prediction[..., 3], srgb_to_linear(truth[..., :3]), truth[..., 3]
        )


def render_view(
    renderer: AssetRenderer, dataset: Dataset, index: int, environment: np.ndarray, spp: int
) -> dict[str, np.ndarray]:
    """The asset's maps of one view in the data's world frame, see `AssetRenderer.render`."""
    pose, lens = dataset.world_poses[index], dataset.intrinsics[index]
    return renderer.render(
        environment, pose, tuple(lens), dataset.width, dataset.height, spp=spp, seed=FIRST_SEED + index
    )


def relight(renderer: AssetRenderer, dataset: Dataset, maps: dict[str, Path], spp: int) -> RelitViews | None:
    """Renders all views under all environment maps, of each of which the data must hold the truth, with `spp` paths a
    pixel; None where there is no map. Raises InputError where a map cannot be used, or the truth of a view is missing or unreadable."""
    if not maps:
        return None
    for name in maps:
        for index in range(len(dataset)):
            read_relit(dataset, index, name)
    images = {}
    for name, path in maps.items():
        environment, images[name] = read_environment(path), []
        for index in tracked(range(len(dataset)), "relighting, view"):
            rendered = render_view(renderer, dataset, index, environment, spp)
            image = np.dstack([straight_srgb(rendered["radiance"], rendered["alpha"]), rendered["alpha"]])
            images[name].append(to_uint8(image))
    return RelitViews(images, dataset, spp)


def relight_scores(relit: RelitViews, distance: Distance | None = None) -> dict:
    """The scores of relit views with one factor per channel for all images of all maps, see
    :func:`splitnerf.evaluate.protocol.scaled_scores`, with `maps` (the headline's scores per map), `views` (their number) and
    `spp`. Predictions are 8-bit clipped sRGB images before the factor, as if read from files."""
    scores, per_map = scaled_scores(relit.views, distance)
    return scores | {"maps": per_map, "views": len(relit.dataset), "spp": relit.spp}


def choose_views(dataset: Dataset, protocol: Protocol) -> tuple[Dataset, dict[str, Path]]:
    """The views of a split that a protocol takes, and its maps. Raises InputError where the data lack views or maps
    that the protocol needs."""
    maps = relight_maps(dataset, protocol.maps, protocol.lights)
    count = protocol.views
    if count is None:
        count = PROTOCOLS[protocol.lights][1] if protocol.lights else len(dataset)
    if not 1 <= count <= len(dataset):
        found = f"{dataset.root}: has {len(dataset)} {dataset.split} views"
        raise InputError(f"{found}, {count} were requested; change --views")
    return dataset.select(spread(range(len(dataset)), count)), maps


def asset_mesh(asset: Asset) -> trimesh.Trimesh:
    """The asset's triangles, in its own frame."""
    return trimesh.Trimesh(asset.vertices, asset.triangles, process=False)


def environment_beside(path: Path) -> Path | None:
    """The recovered light in the folder of a GLB file, if there is one."""
    return next((path.with_name(name) for name in ENVIRONMENTS if path.with_name(name).is_file()), None)


def evaluate_asset(path: Path, data: Path, protocol: Protocol, env: Path | None = None) -> Evaluated:
    """Scores a GLB file, in the data's world frame, against the test views of a dataset; `env` is the light of the
    photos, None for the environment.exr or .hdr in the file's folder. Raises InputError where a file cannot be used."""
    asset, distance = read_asset(path), protocol.distance()
    split = "test" if has_test_split(data, protocol.reading) else "train"
    views, maps = choose_views(load_dataset(data, split, protocol.downscale, protocol.reading), protocol)
    env = environment_beside(path) if env is None else env
    check_place(path.parent, views.origin)
    light = None if env is None else read_environment(env)
    return score_asset(asset, light, views, maps, protocol.spp, distance=distance)


def score_asset(
    asset: Asset,
    environment: np.ndarray | None,
    views: Dataset,
    maps: dict[str, Path],
    spp: int,
    seconds: float | None = None,
    free_exposure: bool = False,
    distance: Distance | None = None,
) -> Evaluated:
    """Scores an asset, in the data's world frame, by path tracing.

    Args:
        environment: [h, w, 3] the light of the photos, or None.
        maps: Environment maps for relit views, by name; none for no such views.
        seconds: The time that the asset took, to record.
        free_exposure: Whether each photo has an exposure of its own, which is fitted.
        distance: LPIPS; None: it is not computed.
    """
    renderer = AssetRenderer(asset)
    predictions = asset_predictions(renderer, views, environment, spp)
    relit = relight(renderer, views, maps, spp)
    evaluated = _scored(predictions, views, environment, asset_mesh(asset), relit, seconds, free_exposure, distance)
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
    distance: Distance | None = None,
) -> Evaluated:
    """Scores trained fields by rendering them; arguments as for :func:`score_asset`, with the surface `mesh` in the
    data's world frame (None: that of the asset), and what was exported, which the relit views show, or None."""
    predictions = [render_maps(model, grid, views, i) for i in tracked(range(len(views)), "evaluation, view")]
    light = model.light.panorama(ENVIRONMENT_ROWS).cpu().numpy()
    relit = None if asset is None else relight(AssetRenderer(asset), views, maps, spp)
    mesh = asset_mesh(asset) if mesh is None and asset is not None else mesh
    evaluated = _scored(predictions, views, light, mesh, relit, round(seconds, 1), free_exposure, distance)
    return replace(evaluated, scores=evaluated.scores | {"scored": "fields"})


def _scored(
    predictions: list[dict[str, np.ndarray]],
    views: Dataset,
    light: np.ndarray | None,
    mesh: trimesh.Trimesh | None,
    relit: RelitViews | None,
    seconds: float | None,
    free_exposure: bool,
    distance: Distance | None,
) -> Evaluated:
    """Scores rendered views, a light and a mesh against the truth of the data, and relit views."""
    if free_exposure and light is not None:
        views = exposed_like(views, predictions)
    truths, truth = load_view_truths(views), load_scene_truth(views.root, views.origin)
    relit_scores = None if relit is None else relight_scores(relit, distance)
    scores = evaluate_maps(
        predictions, views, truths, light, truth.light, mesh, truth.mesh, seconds, relit_scores, distance
    )
    scores |= {"exposures": "fitted"} if free_exposure else {}
    return Evaluated(scores, views, predictions, truths, relit)


def asset_predictions(
    renderer: AssetRenderer, dataset: Dataset, environment: np.ndarray | None, spp: int
) -> list[dict[str, np.ndarray]]:
    """The maps of an asset at each view for :func:`splitnerf.evaluate.protocol.evaluate_maps`: `alpha`, `albedo`,
    `roughness`, `metallic`, `normal` (without the normal map, like the truth), under a light [h, w, 3] also `rgb`; and
    `shading_normal`, with the normal map."""
    predictions = []
    for index in tracked(range(len(dataset)), "path tracing, view"):
        light = np.ones((2, 4, 3), np.float32) if environment is None else environment
        light = light if dataset.light_turns is None else turn_environment(light, dataset.light_turns[index])
        maps = render_view(renderer, dataset, index, light, spp)
        prediction = {key: maps[key] for key in ("alpha", "albedo", "roughness", "metallic")}
        prediction |= {"normal": unit(maps["smooth_normal"]), "shading_normal": unit(maps["normal"])}
        if environment is not None:
            prediction["rgb"] = straight_srgb(maps["radiance"], maps["alpha"])
        predictions.append(prediction)
    return predictions


def exposed_like(views: Dataset, predictions: Sequence[dict[str, np.ndarray]]) -> Dataset:
    """Views with exposures fitted to predictions (maps `rgb`, `alpha`): one factor a photo, the median ratio of the
    channels' means where the object covers both. Photos without such pixels keep their exposure."""
    factors = np.ones(len(views))
    for i, maps in enumerate(predictions):
        photo = views.images[i]
        ours, theirs = (srgb_to_linear(x.astype(np.float32)) for x in (maps["rgb"], photo[..., :3]))
        counts = (photo[..., 3] > OPAQUE) & (maps["alpha"] > OPAQUE)
        exposed = theirs * per_channel(views.exposures)[i].astype(np.float32)
        counts &= ((exposed > DARKEST) & (exposed < BRIGHTEST)).all(-1)
        ours, theirs = (x.mean(-1).clip(1e-4) for x in (ours, theirs))
        if counts.any():
            factors[i] = np.exp(np.median(np.log(theirs[counts] / ours[counts])))
    return views.exposed(per_channel(views.exposures) * factors[:, None])


def is_asset(path: Path) -> bool:
    """Whether a path names an asset's file rather than a run's folder."""
    return path.suffix.lower() in (".glb", ".gltf")


def evaluation_path(target: Path) -> Path:
    """The file of the scores of a run, or of an asset's file."""
    return target.with_name(f"{target.stem}_evaluation.json") if is_asset(target) else target / "evaluation.json"


def read_evaluation(target: Path) -> dict:
    """The scores that an earlier evaluation of a run or a file wrote. Raises InputError where there are none, or the
    file holds no scores."""
    path = evaluation_path(target)
    if not path.is_file():
        raise InputError(f"{path}: no such evaluation; make it with `splitnerf evaluate {target} --data DATA`")
    scores = read_json(path, "novel_view")
    if not is_evaluation(scores):
        raise InputError(f"{path}: is not an evaluation; make it with `splitnerf evaluate {target} --data DATA`")
    return scores


def is_evaluation(content: dict) -> bool:
    """Whether contents of a file are scores as an evaluation writes them."""
    if "novel_view" not in content:
        return False
    for *_, (group, *measure) in COLUMNS:
        value = content.get(group)
        if measure and value is not None:
            if not isinstance(value, dict) or measure[0] not in value:
                return False
            value = value[measure[0]]
        if type(value) not in (int, float, type(None)) or abs(value or 0) > 1e300:
            return False
    return True
