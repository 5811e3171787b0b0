"""Shiny Blender: novel views on white, and the angle of normals weighted by coverage.

Source: Verbin et al., Ref-NeRF, CVPR 2022; multinerf's loader and evaluation. The set has no relit images.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.frames import spread_views
from splitnerf.data.images import over_background, read_image
from splitnerf.data.layouts import transforms as layout
from splitnerf.data.layouts.frame import Frame
from splitnerf.errors import InputError
from splitnerf.evaluate.published.common import (
    Column,
    Delivered,
    Options,
    Scores,
    angles_deg,
    compared,
    mean_of,
    srgb_on_white,
    unit,
)
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("view_psnr", "novel, PSNR", "{:.2f}"),
    ("view_ssim", "novel, SSIM", "{:.3f}"),
    ("view_lpips", "novel, LPIPS", "{:.3f}"),
    ("normals", "normals, degrees", "{:.2f}"),
)


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores the test views.

    Raises:
        InputError: The data list no test views, or are of another form than the set's.
    """
    if "test" not in (layout.splits(root) or ()):
        raise InputError(f"{root}: lists no test views; give a folder with transforms_test.json")
    images, notes, frames = [], [], layout.read(root, "test")
    if options.views is not None:
        notes.append(f"{options.views} of {len(frames)} test views")
        frames = spread_views(frames, options.views)
    for frame in tracked(frames, "views, image"):
        rgba, maps = _rgba(frame), delivered.render(frame, delivered.environment)
        result = {"name": frame.name}
        if delivered.environment is not None:
            result |= compared(srgb_on_white(maps), over_background(rgba[..., :3], rgba[..., 3]), options, "view_")
        path = frame.image_path.with_name(f"{frame.image_path.stem}_normal.png")
        if path.is_file():
            truth = unit(2 * read_image(path)[..., :3] - 1)
            result["normals"] = weighted_angle(unit(maps["normal"]), truth, maps["alpha"] * rgba[..., 3])
        images.append(result)
    return Scores({key: mean_of(images, key) for key, _, _ in COLUMNS}, images, notes)


def _rgba(frame: Frame) -> np.ndarray:
    """[H, W, 4] the photo of a pinhole, its alpha the object's."""
    if frame.distortion is not None or frame.mask_path is not None or frame.exposure != 1 or frame.gamma:
        raise InputError(
            f"{frame.image_path}: the frame has distortion, a mask or a curve, which the set does not have; leave it out"
        )
    rgba = read_image(frame.image_path)
    if rgba.shape[2] != 4:
        raise InputError(f"{frame.image_path}: has no alpha, which the set's photos have; give photos with it")
    return rgba


def weighted_angle(prediction: np.ndarray, truth: np.ndarray, weights: np.ndarray) -> float | None:
    """The mean angle in degrees between unit normals [H, W, 3], weighted [H, W]; None without weight."""
    total = weights.sum(dtype=np.float64)
    return float((angles_deg(prediction, truth) * weights).sum() / total) if total > 0 else None
