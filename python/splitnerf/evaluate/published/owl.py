"""Objects With Lighting: the photos to compare with, in the light of the input photos and in two others.

Source: Ummenhofer et al., Objects With Lighting, 3DV 2024; its repository's scripts/evaluate.py, which follows the README but
for one thing: exposure and gains minimise the mean absolute error after the tone curve, not a square in linear light.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar
from skimage.metrics import structural_similarity

from splitnerf.data.images import read_image
from splitnerf.data.layouts import owl as layout
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import psnr
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, mean_of
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("psnr_new", "new light, PSNR", "{:.2f}"), ("ssim_new", "new light, SSIM", "{:.3f}"),
    ("psnr_same", "same light, PSNR", "{:.2f}"), ("ssim_same", "same light, SSIM", "{:.3f}"), ("psnr", "PSNR", "{:.2f}"),
    ("ssim", "SSIM", "{:.3f}"),
)  # fmt: skip
GAINS = (0.5, 2.0)
DARKEST = -10.0  # stops
STEPS = 200  # exposures that are tried before the best is refined


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores all photos to compare with."""
    images = []
    for view in tracked(layout.relit(root, {}), "relit, image"):
        photo, mask = read_image(view.frame.image_path)[..., :3], read_image(view.frame.mask_path)[..., 0] > 0.5
        if mask.shape != photo.shape[:2] or not mask.any():
            raise InputError(f"{view.frame.mask_path}: is empty or has another size than its photo; replace it")
        image = tone_mapped(delivered.render(view.frame, view.radiance())["radiance"], photo, mask)
        both = {"psnr": psnr(image[mask], photo[mask]), "ssim": masked_ssim(image, photo, mask)}
        images.append({"name": view.frame.name} | both | {f"{key}_{view.light}": x for key, x in both.items()})
    return Scores({key: mean_of(images, key) for key, _, _ in COLUMNS}, images)


def tone_mapped(linear: np.ndarray, photo: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """A linear prediction [H, W, 3] in the values of a photo [H, W, 3] in [0, 1], with the exposure that brings it nearest in
    mean absolute error over the pixels of the mask [H, W] bool that the photo does not clip, then with a gain per channel in
    [.5, 2] that does so."""
    known = mask & (photo.max(axis=-1) < 1)
    x, y = linear[known].astype(np.float64), photo[known].astype(np.float64)
    least = x.min(axis=-1)[x.min(axis=-1) > 0] if len(x) else x
    if not len(least):
        return curve(linear)
    brightest = float(np.log2(0.95**layout.GAMMA / least.min()))
    stops = _best(lambda e: np.abs(curve(x * 2.0**e) - y).mean(), DARKEST, max(brightest, DARKEST + 1))
    gains = [_best(lambda g, c=c: np.abs(curve(x[:, c] * g * 2.0**stops) - y[:, c]).mean(), *GAINS) for c in range(3)]
    return curve(linear * (np.array(gains) * 2.0**stops))


def curve(linear: np.ndarray) -> np.ndarray:
    """The set's tone curve: x^(1 / 2.2), clipped to [0, 1]."""
    return np.clip(np.maximum(linear, 0) ** (1 / layout.GAMMA), 0, 1)


def masked_ssim(image: np.ndarray, photo: np.ndarray, mask: np.ndarray) -> float:
    """The mean over the mask of both images' structural similarity, black outside: 7 x 7 windows, as scikit-image has it."""
    if min(mask.shape) < 7:
        raise InputError("SSIM needs photos of at least 7 x 7 pixels")
    pair = (np.float64(x * mask[..., None]) for x in (image, photo))
    return float(structural_similarity(*pair, channel_axis=-1, full=True, data_range=1.0)[1][mask].mean())


def _best(loss, low: float, high: float) -> float:
    """The argument of the least loss in an interval: the best of `STEPS`, refined."""
    grid = np.linspace(low, high, STEPS)
    at = int(np.argmin([loss(e) for e in grid]))
    around = (grid[max(at - 1, 0)], grid[min(at + 1, STEPS - 1)])
    return float(minimize_scalar(loss, bounds=around, method="bounded", options={"xatol": 1e-6}).x)
