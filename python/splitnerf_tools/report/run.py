"""The report of a run: its result compared with the truth."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset, spread
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb, over_background
from splitnerf.data.truth import load_scene_truth
from splitnerf.evaluate.score_table import graded
from splitnerf.evaluate.scoring import Evaluated, asset_predictions
from splitnerf.fields.light import panorama_directions
from splitnerf.ops import fibonacci_directions, prefilter_light
from splitnerf.pipeline import REPORT_VIEWS
from splitnerf.refinement.refine import TRAINED
from splitnerf.relight.background import compose
from splitnerf.relight.cameras import turntable
from splitnerf.relight.rendering import lowest
from splitnerf.relight.studio import studio_light
from splitnerf.render.model import SceneModel
from splitnerf.render.path_traced import AssetRenderer
from splitnerf.run_folder import ASSET_FILES, is_refined
from splitnerf.training.metrics import METRICS, read_metrics

from splitnerf_tools.report.html import write_report

RELIT = ("studio", "sunny", "sunset")
RELIT_SIDE, RELIT_SPP, RELIT_GREY = 384, 64, 0.7
ROUGHNESS = (0.0, 0.25, 0.5, 1.0)  # of the light's panels


def write_run_report(run: Path, model: SceneModel, evaluated: Evaluated, timings: dict[str, float]) -> None:
    """Writes report.html: maps and truth, the changes by the refinement, the light, curves and settings."""
    views, predictions, truths = evaluated.dataset, evaluated.predictions, evaluated.truths
    shown = spread(range(len(views)), REPORT_VIEWS)
    pages = []
    for i in shown:
        prediction = dict(predictions[i])
        for old, new in (("occlusion_d", "occlusion_diffuse"), ("occlusion_s", "occlusion_specular")):
            if old in prediction:
                prediction[new] = prediction.pop(old)
        truth = {key: value for key, value in vars(truths[i]).items() if key != "name"}
        truth |= {"rgb": views.images[i, ..., :3], "alpha": views.images[i, ..., 3]}
        pages.append({"name": views.frame_names[i], "truth": truth, "prediction": prediction})
    light, photo = run / "environment.exr", max(views.height, views.width)
    write_report(
        run / "report.html",
        title=run.resolve().name,
        grades=graded(evaluated.scores),
        summary={"All scores": evaluated.scores, "Settings": asdict(model.config)},
        views=pages,
        refinement=refinement_page(run, views, predictions, shown, evaluated.scores) if is_refined(run) else None,
        lights=light_panels(model),
        light_truth=load_scene_truth(views.root).light,
        history=read_metrics(run / METRICS),
        timings=timings,
        light=read_environment(light) if light.is_file() else None,
        asset=run / "mesh.glb",
        relit=relit_pictures(read_asset(run / "mesh.glb"), photo) if (run / "mesh.glb").is_file() else [],
        albedo_scale=evaluated.scores["albedo"] and evaluated.scores["albedo"]["lsq"]["scale"],
    )


def refinement_page(run: Path, views: Dataset, predictions: list[dict], shown: list[int], scores: dict) -> dict | None:
    """The report's data on the refinement, see :func:`splitnerf_tools.report.write_report`; None where a file of it is gone."""
    source = run / TRAINED
    if not all((folder / name).is_file() for folder in (source, run) for name in ASSET_FILES[:2]):
        return None
    chosen = views.select(shown)
    lights = [read_environment(folder / "environment.exr") for folder in (source, run)]
    before = asset_predictions(AssetRenderer(read_asset(source / "mesh.glb")), chosen, lights[0], scores["spp"])
    pages = []
    for k, i in enumerate(shown):
        photo, coverage = views.images[i, ..., :3], views.images[i, ..., 3]
        pictures = [over_background(photo, coverage)]
        pictures += [over_background(p["rgb"], p["alpha"]) for p in (before[k], predictions[i])]
        errors = [float(np.square(p["alpha"] - coverage).mean()) for p in (before[k], predictions[i])]
        pages.append({"name": views.frame_names[i], "pictures": pictures, "coverage": errors})
    return {"views": pages, "summary": scores["refinement"], "lights": lights}


def relit_pictures(asset: Asset, photo: int) -> list[tuple[str, np.ndarray]]:
    """The asset path traced on a grey ground under lights that the program makes: name and [side, side, 3] sRGB. Photos of `photo`
    pixels carry no more than pictures of twice as many."""
    side = min(RELIT_SIDE, 2 * photo)
    renderer, view, pictures = AssetRenderer(asset), turntable(asset, 1, size=(side, None))[0], []
    for name in RELIT:
        camera = view.pose, view.intrinsics, view.width, view.height
        options = {"spp": RELIT_SPP, "clamp_indirect": 1.0}  # caustics of few paths are specks
        images = renderer.render(studio_light(name), *camera, **options, catcher_height=lowest(asset))
        behind = np.full((view.height, view.width, 3), RELIT_GREY, np.float32)
        pictures.append((name, linear_to_srgb(np.clip(compose(images, behind, 1.0)[..., :3], 0, 1))))
    return pictures


@torch.no_grad()
def light_panels(model: SceneModel, height: int = 64, n_samples: int = 8192) -> list[dict]:
    """g(w, rho) and its Monte Carlo estimate from g(w, 0), as [height, 2 height, 3] maps."""
    sources = fibonacci_directions(n_samples, torch.Generator(model.device).manual_seed(0))
    evaluated = model.light.evaluate()
    light = torch.cat([evaluated(d, torch.zeros_like(d[:, :1])) for d in sources.split(1 << 15)])
    queries = panorama_directions(height, model.device).reshape(-1, 3)
    panels = []
    for roughness in ROUGHNESS:
        g = model.light.panorama(height, roughness)
        g_bar = g
        if roughness > 0:
            asked = queries, torch.full_like(queries[:, :1], roughness)
            g_bar = prefilter_light(*asked, light_dirs=sources, light=light).view_as(g)
        panels.append({"roughness": roughness, "g": g.cpu().numpy(), "g_bar": g_bar.cpu().numpy()})
    return panels
