"""What `splitnerf evaluate` measures: rendered maps of the test views against images and truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import trimesh

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, over_background
from splitnerf.data.truth import OPAQUE, ViewTruth
from splitnerf.evaluate import metrics

Prediction = dict[str, np.ndarray]


def evaluate_maps(
    predictions: Sequence[Prediction],
    dataset: Dataset,
    truths: Sequence[ViewTruth],
    light: np.ndarray | None = None,
    light_truth: np.ndarray | None = None,
    mesh: trimesh.Trimesh | None = None,
    mesh_truth: trimesh.Trimesh | None = None,
    seconds: float | None = None,
) -> dict:
    """Scores the maps of the test views, the light and the mesh.

    PSNR and SSIM are over sRGB on white, means over images. Albedo knows one free factor per channel and scene, since
    light and albedo share it: `raw` without, `lsq` by least squares in linear light over the foreground of all views
    (the headline), `median` by the median ratio. Foreground is alpha > 0.9 in prediction and truth.

    Args:
        predictions: Per view float32 maps: `rgb` [H, W, 3] sRGB straight, `alpha` [H, W], `albedo` [H, W, 3] linear,
            `roughness` [H, W], `metallic` [H, W], `normal` [H, W, 3] unit world. Only `rgb` and `alpha` must be there.
        dataset: The split that was rendered, in the same order and size.
        truths: One per view.
        light: [h, w, 3] linear radiance, equirectangular.
        light_truth: [h, w, 3] linear radiance.
        mesh: The reconstruction in the data's world frame.
        mesh_truth: The true mesh.
        seconds: Training time to record.

    Returns:
        The contents of `evaluation.json`; None where there is no truth.

    Raises:
        ValueError: Numbers or sizes of predictions, images and truths differ.
    """
    if not len(predictions) == len(dataset) == len(truths):
        raise ValueError(f"{len(predictions)} predictions for {len(dataset)} images and {len(truths)} truths")
    for prediction, image in zip(predictions, dataset.images):
        if prediction["rgb"].shape != image[..., :3].shape:
            raise ValueError(f"prediction is {list(prediction['rgb'].shape)}, image is {list(image.shape)}")
    alphas = [image[..., 3] for image in dataset.images]
    foregrounds = [(p["alpha"] > OPAQUE) & (a > OPAQUE) for p, a in zip(predictions, alphas)]
    chamfer, f_score = (None, None) if mesh is None or mesh_truth is None else metrics.mesh_distances(mesh, mesh_truth)

    def pooled(key: str, masks: Sequence[np.ndarray], error: Callable[[np.ndarray, np.ndarray], float]) -> float | None:
        pairs = [
            (p[key][m], getattr(t, key)[m])
            for p, t, m in zip(predictions, truths, masks)
            if key in p and getattr(t, key) is not None
        ]
        if not any(len(x) for x, _ in pairs):
            return None
        return error(np.concatenate([x for x, _ in pairs]), np.concatenate([y for _, y in pairs]))

    opaque = [
        None if t.normal_mask is None else (p["alpha"] > OPAQUE) & t.normal_mask for p, t in zip(predictions, truths)
    ]
    return {
        "novel_view": _similarity(
            [over_background(p["rgb"], p["alpha"]) for p in predictions],
            [over_background(image[..., :3], image[..., 3]) for image in dataset.images],
        ),
        "albedo": _albedo(predictions, truths, alphas, foregrounds),
        "relight": None,
        "normal_mae_deg": pooled("normal", opaque, metrics.normal_mae_deg),
        "roughness_mae": pooled("roughness", foregrounds, lambda x, y: float(np.abs(x - y).mean())),
        "metallic_balanced_accuracy": pooled("metallic", foregrounds, metrics.balanced_accuracy),
        "light_psnr": None if light is None or light_truth is None else metrics.light_psnr(light, light_truth),
        "chamfer": chamfer,
        "f_score": f_score,
        "seconds": seconds,
    }


def _similarity(images: Sequence[np.ndarray], truths: Sequence[np.ndarray]) -> dict:
    pairs = [(np.clip(x, 0, 1), y) for x, y in zip(images, truths)]
    return {
        "psnr": float(np.mean([metrics.psnr(x, y) for x, y in pairs])),
        "ssim": float(np.mean([metrics.ssim(x, y) for x, y in pairs])),
        "lpips": None,
    }


def _albedo(
    predictions: Sequence[Prediction],
    truths: Sequence[ViewTruth],
    alphas: Sequence[np.ndarray],
    foregrounds: Sequence[np.ndarray],
) -> dict | None:
    views = [i for i, (p, t) in enumerate(zip(predictions, truths)) if "albedo" in p and t.albedo is not None]
    if not views:
        return None
    x = np.concatenate([predictions[i]["albedo"][foregrounds[i]] for i in views])
    y = np.concatenate([truths[i].albedo[foregrounds[i]] for i in views])
    white_truths = [over_background(linear_to_srgb(truths[i].albedo), alphas[i]) for i in views]
    variants = {}
    for name, scale in (("raw", np.ones(3)), ("lsq", metrics.lsq_scale(x, y)), ("median", metrics.median_scale(x, y))):
        scaled = [np.clip(linear_to_srgb(predictions[i]["albedo"] * scale), 0, 1) for i in views]
        images = [over_background(albedo, predictions[i]["alpha"]) for albedo, i in zip(scaled, views)]
        variants[name] = _similarity(images, white_truths) | {"scale": [float(s) for s in scale]}
    headline = {key: variants["lsq"][key] for key in ("psnr", "ssim", "lpips")}
    return headline | variants
