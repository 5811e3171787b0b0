"""The protocols that compare test views with photos in sRGB over white: NeRFactor and Shiny Blender.

NeRFactor: validation views 0 to 7 for views, albedo and normals, test views 49, 99, 149 and 199 for relighting. One factor of
albedo per channel, by least squares in linear light over the first validation view, alpha above 0.9, also before relighting.
Source: the repository's README (the choice of views) and nerfactor/test.py (the scale). The script that computed the paper's
table is not in the repository: PSNR and SSIM are over sRGB on white here.

Shiny Blender: novel views, and the angle of normals weighted by coverage; the set has no relit images.
Source: Verbin et al., Ref-NeRF, CVPR 2022; multinerf's loader and evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from splitnerf.data.asset import unit
from splitnerf.data.dataset import spread
from splitnerf.data.images import over_background, read_image, straight_srgb
from splitnerf.data.layouts import transforms, view_folders
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.truth import map_files
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import angles_deg, lsq_scale
from splitnerf.evaluate.protocol import on_white
from splitnerf.evaluate.published.common import Delivered, LitView, Options, Scores, compared, light_of
from splitnerf.files import is_file
from splitnerf.progress import tracked

OPAQUE = 0.9
VALIDATION, TEST = range(8), (49, 99, 149, 199)  # NeRFactor's


@dataclass
class FolderTruth:
    """The truth of a view: `image` [H, W, 3] sRGB over white, `alpha` [H, W], `albedo` [H, W, 3] linear, straight, and `normal`
    [H, W, 3] unit, world; the last two None where there is no file."""

    image: np.ndarray
    alpha: np.ndarray
    albedo: np.ndarray | None
    normal: np.ndarray | None


def read_truth(frame: Frame) -> FolderTruth:
    """Reads a view's photo and the maps beside it. Raises InputError where one cannot be used."""
    path, rgba = frame.image_path, _read(frame.image_path)
    in_folder = path.name == view_folders.PHOTO
    albedo, normal = (path.with_name(n if in_folder else f"{path.stem}_{n}") for n in ("albedo.png", "normal.png"))
    return FolderTruth(
        over_background(rgba[..., :3], rgba[..., 3]),
        rgba[..., 3],
        _read(albedo)[..., :3] if in_folder and albedo.is_file() else None,
        unit(2 * _read(normal)[..., :3] - 1) if normal.is_file() else None,
    )


def nerfactor(delivered: Delivered, root: Path, options: Options) -> Scores:
    """NeRFactor's scores of views, albedo and normals, and of relit views where there are maps."""
    notes, frames = [], view_folders.read_others(root, "val")[: len(VALIDATION)]
    if not frames:
        frames = spread(view_folders.read(root, "test"), len(VALIDATION))
        notes.append(f"no folder val_000: {len(frames)} test views stand for the validation views")
    first = read_truth(frames[0])
    scale = np.ones(3) if first.albedo is None else opaque_scale(delivered.render(frames[0], None), first)

    def compare(maps: dict, truth: FolderTruth) -> dict[str, float | None]:
        result, solid = {}, (truth.alpha > OPAQUE) & (maps["alpha"] > OPAQUE)
        if truth.albedo is not None:
            ours, theirs = on_white(maps["albedo"], maps["alpha"], scale), on_white(truth.albedo, truth.alpha)
            result = compared(ours, theirs, options, "albedo_")
        if truth.normal is not None and solid.any():
            result["normals"] = float(angles_deg(unit(maps["normal"]), truth.normal)[solid].mean())
        return result

    images = view_scores(delivered, frames, options, compare)
    views = relit_views(root, maps_of(root, options, notes))
    kept = chosen(views, root) if views else []
    return Scores(images + relit_scores(delivered.with_albedo(scale), kept, options), notes)


def chosen(views: list[LitView], root: Path) -> list[LitView]:
    """The views of NeRFactor's table. Raises InputError where the data have none of them."""
    kept = [view for view in views if int(view.frame.name.rsplit("_", 1)[1]) in TEST]
    if not kept:
        numbers = ", ".join(map(str, TEST))
        raise InputError(f"{root}: has none of the test views {numbers}, which the protocol takes; add them")
    return kept


def shiny(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Shiny Blender's scores of the test views. Raises InputError where the data list no test views, or are of another
    form than the set's."""
    if "test" not in (transforms.splits(root) or ()):
        raise InputError(f"{root}: lists no test views; give a folder with transforms_test.json")
    notes, frames = [], transforms.read(root, "test")
    if options.views is not None:
        notes.append(f"{options.views} of {len(frames)} test views")
        frames = spread(frames, options.views)
    for frame in frames:
        if frame.distortion is not None or frame.mask_path is not None or frame.exposure != 1 or frame.gamma:
            found = "the frame has distortion, a mask or a curve, which the set does not have"
            raise InputError(f"{frame.image_path}: {found}; leave it out")

    def compare(maps: dict, truth: FolderTruth) -> dict[str, float | None]:
        return {} if truth.normal is None else {"normals": weighted_angle(maps, truth)}

    return Scores(view_scores(delivered, frames, options, compare), notes)


def view_scores(
    delivered: Delivered, frames: list[Frame], options: Options, compare: Callable[[dict, FolderTruth], dict]
) -> list[dict]:
    """The numbers of each view: those of its photo, where the light is known, and those of `compare`."""
    images = []
    for frame in tracked(frames, "views, image"):
        truth, maps = read_truth(frame), delivered.render(frame, delivered.environment)
        novel = {} if delivered.environment is None else compared(_picture(maps), truth.image, options, "view_")
        images.append({"name": frame.name} | novel | compare(maps, truth))
    return images


def relit_scores(delivered: Delivered, views: list[LitView], options: Options) -> list[dict]:
    """The numbers of each relit view."""
    images = []
    for view in tracked(views, "relit, image"):
        image, truth = _picture(delivered.render(view.frame, view.radiance())), read_truth(view.frame)
        images.append({"name": f"{view.frame.name}/{view.light}"} | compared(image, truth.image, options))
    return images


def opaque_scale(maps: dict[str, np.ndarray], truth: FolderTruth) -> np.ndarray:
    """[3] NeRFactor's factors of albedo."""
    known = truth.alpha > OPAQUE
    return lsq_scale(maps["albedo"][known], truth.albedo[known])


def weighted_angle(maps: dict[str, np.ndarray], truth: FolderTruth) -> float | None:
    """Shiny Blender's mean angle in degrees, weighted by both coverages; None without weight."""
    weights = maps["alpha"] * truth.alpha
    total = weights.sum(dtype=np.float64)
    return float((angles_deg(unit(maps["normal"]), truth.normal) * weights).sum() / total) if total > 0 else None


def maps_of(root: Path, options: Options, notes: list[str]) -> dict[str, Path]:
    """The maps of the options, else of the data's folder, by name; a note says that there is none."""
    maps = map_files(root, prefixed=True) if options.maps is None else map_files(options.maps)
    if not maps:
        notes.append("no lights: give --maps the folder of the set's test lights for relit views")
    return maps


def relit_views(root: Path, maps: dict[str, Path]) -> list[LitView]:
    """The test views of view folders in the lights of maps, as far as there are photos `rgba_NAME.png`. Raises InputError where
    there is none, or a file cannot be used."""
    views = []
    for frame in view_folders.read(root, "test") if maps else ():
        for name, path in maps.items():
            image = frame.image_path.with_name(f"{frame.image_path.stem}_{name}.png")
            if is_file(image):
                views.append(LitView(replace(frame, image_path=image), name, light_of(path)))
    if maps and not views:
        raise InputError(
            f"{root}: no test view has a photo under {', '.join(maps)}; give --maps the folder of the set's test lights"
        )
    return views


def _picture(maps: dict[str, np.ndarray]) -> np.ndarray:
    """[H, W, 3] the image of a rendering, clipped, in sRGB over white, composited as image viewers do."""
    return over_background(straight_srgb(maps["radiance"], maps["alpha"]), maps["alpha"])


def _read(path: Path) -> np.ndarray:
    pixels = read_image(path)
    if pixels.shape[2] != 4:
        raise InputError(f"{path}: needs an alpha channel; re-export it")
    return pixels
