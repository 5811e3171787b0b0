"""OpenIllumination: the test photos in the illuminations that training did not see.

The set's paper compares renderings under calibrated lamps with the photos. Its scripts do not state the scale of the lamps, so
one factor per channel for all images, by least squares in linear light, stands for their colour.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import linear_to_srgb
from splitnerf.data.layouts import openillumination as layout
from splitnerf.data.lit_photos import read_lit_photo
from splitnerf.data.relit import map_files
from splitnerf.evaluate.metrics import lsq_sums, psnr, scale_of_sums
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, mean_of
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (("psnr", "relit, PSNR", "{:.2f}"),)


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores all test photos with a known light, over the pixels of the object's masks, in sRGB."""
    maps = {} if options.maps is None else map_files(options.maps)
    pairs, sums = [], np.zeros((2, 3))
    for view in tracked(layout.relit(root, maps), "relit, image"):
        photo, mask = read_lit_photo(view.frame)
        inside = mask > 0
        x, y = delivered.render(view.frame, view.radiance())["radiance"][inside], photo[inside]
        sums += lsq_sums(x, y)
        pairs.append((f"{view.light}/{view.frame.name}", x, y))
    scale = scale_of_sums(sums)
    images = [{"name": name, "psnr": srgb_psnr(x * scale, y)} for name, x, y in pairs]
    return Scores({"psnr": mean_of(images, "psnr")}, images, ["the scale is this project's choice, see docs/data.md"])


def srgb_psnr(prediction: np.ndarray, truth: np.ndarray) -> float:
    """PSNR in dB of linear pixels [n, 3], clipped, in sRGB."""
    return psnr(*(linear_to_srgb(np.clip(x, 0, 1).astype(np.float64)) for x in (prediction, truth)))
