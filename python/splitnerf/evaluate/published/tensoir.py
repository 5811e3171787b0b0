"""TensoIR-Synthetic: all test views; relit under five lights, albedo, normals and novel views.

Source: Jin et al., TensoIR: Tensorial Inverse Rendering, CVPR 2023; its repository's renderer.py and
scripts/relight_importance.py. Albedo is rescaled per channel by the median of truth / albedo over the pixels of 20
views where alpha is not 0, before relighting and before its PSNR, which is over all views together to the power of 1 /
2.2. Normals are compared over whole images, the background pointing to +z in both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.frames import spread_views
from splitnerf.data.images import over_background
from splitnerf.data.layouts import view_folders as layout
from splitnerf.evaluate.metrics import median_scale
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
from splitnerf.evaluate.published.folders import FolderTruth, lights_of, read_truth
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("psnr", "relit, PSNR", "{:.2f}"),
    ("ssim", "relit, SSIM", "{:.3f}"),
    ("lpips", "relit, LPIPS", "{:.3f}"),
    ("albedo_psnr", "albedo, PSNR", "{:.2f}"),
    ("view_psnr", "novel, PSNR", "{:.2f}"),
    ("view_ssim", "novel, SSIM", "{:.3f}"),
    ("view_lpips", "novel, LPIPS", "{:.3f}"),
    ("normals", "normals, degrees", "{:.2f}"),
)
LIGHTS = ("bridge", "city", "fireplace", "forest", "night")
SCALE_VIEWS = 20
GAMMA = 2.2
BACKGROUND = np.array([0.0, 0.0, 1.0])  # of normals


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores the test views, relit ones where there are maps."""
    notes, images = [], []
    frames = layout.read(root, "test")
    if options.views is not None:
        notes.append(f"{options.views} of {len(frames)} test views")
        frames = spread_views(frames, options.views)
    scale = albedo_scale(delivered, frames)
    errors = []
    for frame in tracked(frames, "views, image"):
        truth, maps = read_truth(frame), delivered.render(frame, delivered.environment)
        result = {"name": frame.name}
        if delivered.environment is not None:
            result |= compared(srgb_on_white(maps), truth.image, options, "view_")
        if truth.albedo is not None:
            errors.append(albedo_error(maps, truth, scale))
        if truth.normal is not None:
            result["normals"] = whole_normals(maps, truth)
        images.append(result)
    maps = lights_of(root, options)
    if set(maps) & set(LIGHTS):
        maps = {name: path for name, path in maps.items() if name in LIGHTS}
    elif maps:
        notes.append(f"lights {', '.join(maps)}, not the set's {', '.join(LIGHTS)}")
    else:
        notes.append("no lights: give --maps the folder of the set's maps for relit views")
    scaled, kept = delivered.with_albedo(scale), {frame.name for frame in frames}
    views = [view for view in layout.relit(root, maps) if view.frame.name in kept] if maps else []
    for view in tracked(views, "relit, image"):
        image, truth = srgb_on_white(scaled.render(view.frame, view.radiance())), read_truth(view.frame)
        name = f"{view.frame.name}/{view.light}"
        images.append({"name": name} | compared(image, truth.image, options))
    means = {key: mean_of(images, key) for key, _, _ in COLUMNS}
    means["albedo_psnr"] = float(-10 * np.log10(max(np.mean(errors), 1e-10))) if errors else None
    return Scores(means, images, notes)


def albedo_scale(delivered: Delivered, frames: list) -> np.ndarray:
    """[3] the medians of truth / albedo over 20 views, 1 where the data have no albedo."""
    ours, theirs = [], []
    for frame in spread_views(frames, SCALE_VIEWS):
        truth = read_truth(frame)
        if truth.albedo is not None:
            known = truth.alpha > 0
            maps = delivered.render(frame, None)
            ours.append(over_background(maps["albedo"], maps["alpha"])[known])
            theirs.append(over_background(truth.albedo, truth.alpha)[known])
    return median_scale(np.concatenate(ours), np.concatenate(theirs)) if ours else np.ones(3)


def albedo_error(maps: dict[str, np.ndarray], truth: FolderTruth, scale: np.ndarray) -> float:
    """The mean squared error of albedo over white, times the scale where the truth's alpha is not 0, white elsewhere,
    to the power of 1 / 2.2."""
    ours = over_background(maps["albedo"], maps["alpha"]) * scale
    ours = np.where(truth.alpha[..., None] > 0, np.clip(ours, 0, 1), 1.0)
    theirs = over_background(truth.albedo, truth.alpha)
    return float(np.mean((ours ** (1 / GAMMA) - theirs ** (1 / GAMMA)) ** 2))


def whole_normals(maps: dict[str, np.ndarray], truth: FolderTruth) -> float:
    """The mean angle in degrees over the whole image."""
    ours, theirs = (
        unit(normal * alpha[..., None] + BACKGROUND * (1 - alpha[..., None]))
        for normal, alpha in ((unit(maps["normal"]), maps["alpha"]), (truth.normal, truth.alpha))
    )
    return float(angles_deg(ours, theirs).mean())
