"""OpenIllumination: the test photos in the illuminations that training did not see.

The set's paper compares renderings under calibrated lamps with the photos. Its scripts do not state the scale of the lamps, so
one factor per channel for all images, by least squares in linear light, stands for their colour.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from splitnerf.data.images import linear_to_srgb
from splitnerf.data.layouts import openillumination as layout
from splitnerf.data.layouts.lit import LitView
from splitnerf.data.lit_photos import read_lit_photo
from splitnerf.data.relit import map_files
from splitnerf.evaluate.metrics import lsq_sums, psnr, scale_of_sums
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, mean_of
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (("psnr", "relit, PSNR", "{:.2f}"),)
MOST = float(np.finfo(np.float16).max)


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores all test photos with a known light, over the pixels of the object's masks, in sRGB."""
    maps = {} if options.maps is None else map_files(options.maps)
    views, sums = layout.relit(root, maps), np.zeros((2, 3))
    images = []
    with tempfile.TemporaryFile() as rendered:  # all images at once would not fit into memory
        for view in tracked(views, "relit, image"):
            truth, inside = _photo(view)
            pixels = np.minimum(delivered.render(view.frame, view.radiance())["radiance"][inside], MOST).astype(np.float16)
            sums += lsq_sums(pixels, truth)
            np.save(rendered, pixels)
        rendered.seek(0)
        scale = scale_of_sums(sums)
        for view in tracked(views, "scores, image"):
            pixels, truth = np.load(rendered).astype(np.float32), _photo(view)[0]
            score = srgb_psnr(pixels * scale, truth) if len(truth) else None
            images.append({"name": f"{view.light}/{view.frame.name}", "psnr": score})
    return Scores({"psnr": mean_of(images, "psnr")}, images, ["the scale is this project's choice, see docs/data.md"])


def _photo(view: LitView) -> tuple[np.ndarray, np.ndarray]:
    """The photo's pixels [n, 3] of the object, and where they are, [H, W] bool."""
    photo, mask = read_lit_photo(view.frame)
    return photo[mask > 0], mask > 0


def srgb_psnr(prediction: np.ndarray, truth: np.ndarray) -> float:
    """PSNR in dB of linear pixels [n, 3], clipped, in sRGB."""
    return psnr(*(linear_to_srgb(np.clip(x, 0, 1).astype(np.float64)) for x in (prediction, truth)))
