"""The similarity of two sets of images: PSNR, SSIM and LPIPS over sRGB on white, with or without a free scale."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from splitnerf.data.images import linear_to_srgb, over_background
from splitnerf.data.truth import OPAQUE
from splitnerf.evaluate import metrics
from splitnerf.evaluate.lpips import Distance

MEDIAN_PIXELS = 20_000  # a view contributes at most about twice as many ratios to the median
SCORES = ("psnr", "ssim", "lpips")


@dataclass
class ScaledView:
    """A prediction that is known up to one factor per channel, with its truth.

    Attributes:
        group: The group whose scores are averaged in addition to those of all views, such as the light's name.
        prediction: [H, W, 3] linear, straight.
        alpha: [H, W] coverage of the prediction.
        truth: [H, W, 3] linear, straight.
        truth_alpha: [H, W] coverage of the truth.
    """

    group: str
    prediction: np.ndarray
    alpha: np.ndarray
    truth: np.ndarray
    truth_alpha: np.ndarray


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
    """Scores predictions with one free factor per channel for all views together.

    The factor is fitted in linear light over the foreground of all views, alpha > 0.9 in prediction and truth. `raw`
    has no factor, `lsq` that of least squares (the headline), `median` the median of truth / prediction.

    Args:
        views: A function that returns an iterator over the views, at least one; it is called twice.
        distance: The LPIPS distance, or None.

    Returns:
        The scores (`psnr`, `ssim`, `lpips` of the headline, then the variants with their `scale` [3]), and the
        headline's scores per group.
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


def _scales(views: Iterable[ScaledView]) -> dict[str, np.ndarray]:
    sums, samples = np.zeros((2, 3)), []
    for x, y in _foregrounds(views):
        sums += metrics.lsq_sums(x, y)
        step = max(1, len(x) // MEDIAN_PIXELS)
        samples.append((x[::step], y[::step]))
    x, y = (np.concatenate(parts) for parts in zip(*samples))
    return {"raw": np.ones(3), "lsq": metrics.scale_of_sums(sums), "median": metrics.median_scale(x, y)}


def _foregrounds(views: Iterable[ScaledView]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for view in views:
        mask = (view.alpha > OPAQUE) & (view.truth_alpha > OPAQUE)
        yield view.prediction[mask], view.truth[mask]
