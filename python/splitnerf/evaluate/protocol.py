"""The scores of `splitnerf evaluate`: rendered maps of the test views against images and truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import trimesh

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import over_background
from splitnerf.data.pixels import Photos
from splitnerf.data.truth import OPAQUE, ViewTruth
from splitnerf.evaluate import metrics
from splitnerf.evaluate.lpips import Distance
from splitnerf.evaluate.similarity import ScaledView, image_scores, mean_scores, scaled_scores

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
    relight: dict | None = None,
    distance: Distance | None = None,
) -> dict:
    """Scores the maps of the test views, the light and the mesh.

    PSNR and SSIM are over sRGB on white, means over images. Pixels that are invalid in the photos do not count in the
    PSNR of novel views and are white in both images elsewhere. Albedo has one free factor per channel and scene, since
    light and albedo share it, see :func:`splitnerf.evaluate.similarity.scaled_scores`. Foreground is alpha > 0.9 in
    prediction and truth.

    Args:
        predictions: Per view float32 maps: `rgb` [H, W, 3] sRGB straight, `alpha` [H, W], `albedo` [H, W, 3] linear,
            `roughness` [H, W], `metallic` [H, W], `normal` [H, W, 3] unit world. Only `alpha` must be there.
        dataset: The split that was rendered, in the same order and size.
        truths: One per view.
        light: [h, w, 3] linear radiance, equirectangular.
        light_truth: [h, w, 3] linear radiance.
        mesh: The reconstruction in the data's world frame.
        mesh_truth: The true mesh.
        seconds: Training time to record.
        relight: The scores of :func:`splitnerf.evaluate.relight.relight_scores`, to record; or None.
        distance: The LPIPS distance, or None.

    Returns:
        The contents of `evaluation.json`; None where there is no truth.

    Raises:
        ValueError: Numbers or sizes of predictions, images and truths differ.
    """
    if not len(predictions) == len(dataset) == len(truths):
        raise ValueError(f"{len(predictions)} predictions for {len(dataset)} images and {len(truths)} truths")
    known = [None] * len(dataset) if dataset.known is None else dataset.known
    shape = dataset.images.shape[1:]
    for prediction in predictions:
        for key in prediction.keys() & {"rgb", "alpha"}:
            if prediction[key].shape[:2] != shape[:2]:
                raise ValueError(f"{key} of a prediction is {list(prediction[key].shape)}, image is {list(shape)}")
    if dataset.known is not None:
        predictions = [p | {"alpha": p["alpha"] * k} for p, k in zip(predictions, known)]
    foregrounds = [(p["alpha"] > OPAQUE) & (dataset.images[i, ..., 3] > OPAQUE) for i, p in enumerate(predictions)]
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
        "novel_view": _novel_view(predictions, dataset.images, known, distance),
        "albedo": _albedo(predictions, truths, dataset.images, distance),
        "relight": relight,
        "normal_mae_deg": pooled("normal", opaque, metrics.normal_mae_deg),
        "roughness_mae": pooled("roughness", foregrounds, lambda x, y: float(np.abs(x - y).mean())),
        "metallic_balanced_accuracy": pooled("metallic", foregrounds, metrics.balanced_accuracy),
        "light_psnr": None if light is None or light_truth is None else metrics.light_psnr(light, light_truth),
        "chamfer": chamfer,
        "f_score": f_score,
        "seconds": seconds,
        "views": len(dataset),
    }


def _novel_view(
    predictions: Sequence[Prediction], images: Photos, known: Sequence[np.ndarray | None], distance: Distance | None
) -> dict | None:
    if not all("rgb" in prediction for prediction in predictions):
        return None
    return mean_scores(
        [
            image_scores(
                over_background(p["rgb"], p["alpha"]), over_background(image[..., :3], image[..., 3]), distance, k
            )
            for p, image, k in zip(predictions, images, known)
        ]
    )


def _albedo(
    predictions: Sequence[Prediction], truths: Sequence[ViewTruth], images: Photos, distance: Distance | None
) -> dict | None:
    known = [i for i, (p, t) in enumerate(zip(predictions, truths)) if "albedo" in p and t.albedo is not None]
    if not known:
        return None

    def views() -> Iterator[ScaledView]:
        for i in known:
            prediction = predictions[i]
            yield ScaledView("", prediction["albedo"], prediction["alpha"], truths[i].albedo, images[i, ..., 3])

    return scaled_scores(views, distance)[0]
