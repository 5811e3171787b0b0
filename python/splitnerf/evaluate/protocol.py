"""The scores of `splitnerf evaluate`: rendered maps of the test views against images and truth, over sRGB on white."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, over_background
from splitnerf.data.pixels import Photos
from splitnerf.data.truth import OPAQUE, ViewTruth
from splitnerf.evaluate import metrics
from splitnerf.evaluate.lpips import Distance

SCORES = ("psnr", "ssim", "lpips")
Prediction = dict[str, np.ndarray]


@dataclass
class ScaledView:
    """A prediction [H, W, 3] linear, straight, that is known up to one factor per channel, its coverage `alpha` [H, W],
    and the same of the truth. `group` is whose scores are averaged in addition to those of all views, such as the
    light's name."""

    group: str
    prediction: np.ndarray
    alpha: np.ndarray
    truth: np.ndarray
    truth_alpha: np.ndarray


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
    """Scores the maps of the test views, the light and the mesh: the contents of `evaluation.json`, None where there is
    no truth.

    PSNR and SSIM are over sRGB on white, means over images. Pixels that are invalid in the photos do not count in the
    PSNR of novel views and are white in both images elsewhere. Albedo has one free factor per channel and scene, since
    light and albedo share it, see :func:`scaled_scores`. Foreground is alpha > 0.9 in prediction and truth.

    Args:
        predictions: Per view float32 maps: `rgb` [H, W, 3] sRGB straight, `alpha` [H, W], `albedo` [H, W, 3] linear,
            `roughness` [H, W], `metallic` [H, W], `normal` [H, W, 3] unit world. Only `alpha` must be there.
        dataset, truths: The views that were rendered, and the truth of each.
        light, light_truth: [h, w, 3] linear radiance, equirectangular.
        mesh, mesh_truth: In the data's world frame.
        seconds, relight: The training time and :func:`splitnerf.evaluate.scoring.relight_scores`, to record.
    """
    known = [None] * len(dataset) if dataset.known is None else dataset.known
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


def image_scores(
    image: np.ndarray, truth: np.ndarray, distance: Distance | None = None, known: np.ndarray | None = None
) -> dict:
    """`psnr` in dB, `ssim` and `lpips` (None without `distance`) of [H, W, 3] sRGB images; the first is clipped. The
    PSNR is over the pixels `known` [H, W] bool, None for all."""
    image = np.clip(image, 0, 1)
    return {
        "psnr": metrics.psnr(image, truth) if known is None else metrics.psnr(image[known], truth[known]),
        "ssim": metrics.ssim(image, truth),
        "lpips": None if distance is None else distance(image, truth),
    }


def mean_scores(scores: Sequence[dict]) -> dict:
    """The means of the results of `image_scores` for at least one image."""
    missing = scores[0]["lpips"] is None
    return {key: None if key == "lpips" and missing else float(np.mean([s[key] for s in scores])) for key in SCORES}


def on_white(linear: np.ndarray, alpha: np.ndarray, scale: np.ndarray | float = 1.0) -> np.ndarray:
    """The image [H, W, 3] that the protocol compares: a straight linear image, scaled, in sRGB, clipped and on
    white."""
    return over_background(np.clip(linear_to_srgb(linear * scale), 0, 1), alpha)


def scaled_scores(
    views: Callable[[], Iterable[ScaledView]], distance: Distance | None = None
) -> tuple[dict, dict[str, dict]]:
    """Scores predictions with one free factor per channel for all views together: `psnr`, `ssim`, `lpips` of the headline, then the
    variants with their `scale` [3]; and the headline's scores per group. `views` is called twice.

    The factor is fitted in linear light over the foreground of all views, alpha > 0.9 in prediction and truth. `raw`
    has no factor, `lsq` that of least squares (the headline).
    """
    scales = _scales(views())
    scores: dict[str, list[dict]] = {name: [] for name in scales}
    groups: dict[str, list[dict]] = {}
    for view in views():
        truth = on_white(view.truth, view.truth_alpha)
        for name, scale in scales.items():
            headline = name == "lsq"
            image = on_white(view.prediction, view.alpha, scale)
            scores[name].append(image_scores(image, truth, distance if headline else None))
            if headline:
                groups.setdefault(view.group, []).append(scores[name][-1])
    variants = {name: mean_scores(scores[name]) | {"scale": [float(s) for s in scales[name]]} for name in scales}
    headline = {key: variants["lsq"][key] for key in SCORES}
    return headline | variants, {group: mean_scores(members) for group, members in groups.items()}


def _novel_view(
    predictions: Sequence[Prediction], images: Photos, known: Sequence[np.ndarray | None], distance: Distance | None
) -> dict | None:
    if not all("rgb" in prediction for prediction in predictions):
        return None
    scores = []
    for p, photo, k in zip(predictions, images, known):
        shown, truth = over_background(p["rgb"], p["alpha"]), over_background(photo[..., :3], photo[..., 3])
        scores.append(image_scores(shown, truth, distance, k))
    return mean_scores(scores)


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


def _scales(views: Iterable[ScaledView]) -> dict[str, np.ndarray]:
    sums = np.zeros((2, 3))
    for view in views:
        mask = (view.alpha > OPAQUE) & (view.truth_alpha > OPAQUE)
        sums += metrics.lsq_sums(view.prediction[mask], view.truth[mask])
    return {"raw": np.ones(3), "lsq": metrics.lsq_scale(sums)}
