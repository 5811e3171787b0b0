"""The maps of an asset at the test views, so that any GLB is scored like a trained scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import turn_environment
from splitnerf.evaluate.relight import render_view, straight_srgb
from splitnerf.progress import tracked
from splitnerf.render.path_traced import AssetRenderer

ENVIRONMENTS = ("environment.exr", "environment.hdr")


def environment_beside(path: Path) -> Path | None:
    """The recovered light in the folder of a GLB file, if there is one."""
    return next((path.with_name(name) for name in ENVIRONMENTS if path.with_name(name).is_file()), None)


def asset_predictions(
    renderer: AssetRenderer, dataset: Dataset, environment: np.ndarray | None, spp: int
) -> list[dict[str, np.ndarray]]:
    """Renders the asset's material and normal maps and, where the light is known, its image.

    Args:
        renderer: The asset, in the data's world frame.
        dataset: The views.
        environment: [h, w, 3] linear radiance, or None.
        spp: Paths a pixel.

    Returns:
        The maps of each view for :func:`splitnerf.evaluate.protocol.evaluate_maps`: `alpha`, `albedo`, `roughness`,
        `metallic`, `normal` (without the normal map, like the truth) and, with a light, `rgb`. In addition
        `shading_normal`, with the normal map.
    """
    predictions = []
    for index in tracked(range(len(dataset)), "path tracing, view"):
        light = np.ones((2, 4, 3), np.float32) if environment is None else environment
        light = light if dataset.light_turns is None else turn_environment(light, dataset.light_turns[index])
        maps = render_view(renderer, dataset, index, light, spp)
        prediction = {key: maps[key] for key in ("alpha", "albedo", "roughness", "metallic")}
        for key, kept in (("normal", "smooth_normal"), ("shading_normal", "normal")):
            lengths = np.linalg.norm(maps[kept], axis=-1, keepdims=True)
            prediction[key] = maps[kept] / np.maximum(lengths, 1e-8)
        if environment is not None:
            prediction["rgb"] = straight_srgb(maps)
        predictions.append(prediction)
    return predictions
