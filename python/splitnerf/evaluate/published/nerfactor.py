"""NeRFactor: validation views 0 to 7 for views, albedo and normals, test views 49, 99, 149 and 199 for relighting.

Source: the repository's README (the choice of views) and nerfactor/test.py (the scale of albedo: one factor per channel
by least squares in linear light over the first validation view, alpha above 0.9, applied before relighting). The script
that computed the paper's table is not in the repository: PSNR and SSIM are over sRGB on white here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.frames import spread_views
from splitnerf.data.layouts import view_folders as layout
from splitnerf.data.layouts.lit import LitView
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import lsq_scale, psnr
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
from splitnerf.evaluate.published.folders import albedo_on_white, lights_of, read_truth
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("psnr", "relit, PSNR", "{:.2f}"),
    ("ssim", "relit, SSIM", "{:.3f}"),
    ("lpips", "relit, LPIPS", "{:.3f}"),
    ("albedo_psnr", "albedo, PSNR", "{:.2f}"),
    ("albedo_ssim", "albedo, SSIM", "{:.3f}"),
    ("albedo_lpips", "albedo, LPIPS", "{:.3f}"),
    ("view_psnr", "novel, PSNR", "{:.2f}"),
    ("normals", "normals, degrees", "{:.2f}"),
)
VALIDATION, TEST = range(8), (49, 99, 149, 199)
OPAQUE = 0.9


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores views, albedo and normals, and relit views where there are maps."""
    notes, frames = [], layout.read_others(root, "val")[: len(VALIDATION)]
    if not frames:
        frames = spread_views(layout.read(root, "test"), len(VALIDATION))
        notes.append(f"no folder val_000: {len(frames)} test views stand for the validation views")
    images, scale = [], np.ones(3)
    for index, frame in enumerate(tracked(frames, "views, image")):
        truth, maps = read_truth(frame), delivered.render(frame, delivered.environment)
        if index == 0 and truth.albedo is not None:
            scale = albedo_scale(maps, truth.albedo, truth.alpha)
        result = {"name": frame.name}
        if delivered.environment is not None:
            result["view_psnr"] = psnr(srgb_on_white(maps), truth.image)
        if truth.albedo is not None:
            ours, theirs = (
                albedo_on_white(maps["albedo"], maps["alpha"], scale),
                albedo_on_white(truth.albedo, truth.alpha),
            )
            result |= compared(ours, theirs, options, "albedo_")
        solid = (truth.alpha > OPAQUE) & (maps["alpha"] > OPAQUE)
        if truth.normal is not None and solid.any():
            result["normals"] = float(angles_deg(unit(maps["normal"]), truth.normal)[solid].mean())
        images.append(result)
    maps = lights_of(root, options)
    scaled = delivered.with_albedo(scale)
    for view in tracked(chosen(layout.relit(root, maps), root) if maps else [], "relit, image"):
        image, truth = srgb_on_white(scaled.render(view.frame, view.radiance())), read_truth(view.frame)
        name = f"{view.frame.name}/{view.light}"
        images.append({"name": name} | compared(image, truth.image, options))
    if not maps:
        notes.append("no lights: give --maps the folder of the set's test lights for relit views")
    return Scores({key: mean_of(images, key) for key, _, _ in COLUMNS}, images, notes)


def albedo_scale(maps: dict[str, np.ndarray], truth: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """[3] the factors that bring albedo nearest to the truth [H, W, 3], where alpha [H, W] is above 0.9."""
    known = alpha > OPAQUE
    return lsq_scale(maps["albedo"][known], truth[known])


def chosen(views: list[LitView], root: Path) -> list[LitView]:
    """The views of the paper's table. Raises InputError where the data have none of them."""
    kept = [view for view in views if int(view.frame.name.rsplit("_", 1)[1]) in TEST]
    if not kept:
        raise InputError(
            f"{root}: has none of the test views {', '.join(map(str, TEST))}, which the protocol takes; add them"
        )
    return kept
