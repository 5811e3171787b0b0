"""The protocols that compare test views with photos in sRGB over white: NeRFactor, TensoIR-Synthetic and Shiny Blender.

NeRFactor: validation views 0 to 7 for views, albedo and normals, test views 49, 99, 149 and 199 for relighting. One factor of
albedo per channel, by least squares in linear light over the first validation view, alpha above 0.9, also before relighting.
Source: the repository's README (the choice of views) and nerfactor/test.py (the scale). The script that computed the paper's
table is not in the repository: PSNR and SSIM are over sRGB on white here.

TensoIR-Synthetic: all test views, relit under five lights. Albedo is rescaled per channel by the median of truth / albedo over
the pixels of 20 views where alpha is not 0, before relighting and before its PSNR, which is over all views together to the
power of 1 / 2.2. Normals are compared over whole images, the background pointing to +z in both.
Source: Jin et al., CVPR 2023; its repository's renderer.py and scripts/relight_importance.py.

Shiny Blender: novel views, and the angle of normals weighted by coverage; the set has no relit images.
Source: Verbin et al., Ref-NeRF, CVPR 2022; multinerf's loader and evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np

from splitnerf.data.asset import unit
from splitnerf.data.dataset import spread
from splitnerf.data.images import over_background, read_image, straight_srgb
from splitnerf.data.layouts import transforms, view_folders
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.truth import map_files
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import angles_deg, lsq_scale, median_scale
from splitnerf.evaluate.protocol import on_white
from splitnerf.evaluate.published.common import Delivered, LitView, Options, Scores, compared, light_of
from splitnerf.files import is_file
from splitnerf.progress import tracked

OPAQUE = 0.9
VALIDATION, TEST = range(8), (49, 99, 149, 199)  # NeRFactor's
LIGHTS = ("bridge", "city", "fireplace", "forest", "night")  # TensoIR's, as the next three
SCALE_VIEWS = 20
GAMMA = 2.2
BACKGROUND = np.array([0.0, 0.0, 1.0])  # of normals


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
    pairs = albedo_pairs(delivered, frames[:1])
    scale = opaque_scale(*pairs[0]) if pairs else np.ones(3)

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


def tensoir(delivered: Delivered, root: Path, options: Options) -> Scores:
    """TensoIR's scores of the test views, and of relit ones where there are maps."""
    notes: list[str] = []
    frames = test_views(view_folders, root, options, notes)
    pairs = albedo_pairs(delivered, spread(frames, SCALE_VIEWS))
    scale, errors = median_ratio(pairs) if pairs else np.ones(3), []

    def compare(maps: dict, truth: FolderTruth) -> dict[str, float | None]:
        if truth.albedo is not None:
            errors.append(albedo_error(maps, truth, scale))
        return {} if truth.normal is None else {"normals": whole_normals(maps, truth)}

    images = view_scores(delivered, frames, options, compare)
    maps, kept = maps_of(root, options, notes), {frame.name for frame in frames}
    if maps and not set(maps) & set(LIGHTS):
        notes.append(f"lights {', '.join(maps)}, not the set's {', '.join(LIGHTS)}")
    else:
        maps = {name: path for name, path in maps.items() if name in LIGHTS}
    views = [view for view in relit_views(root, maps) if view.frame.name in kept]
    images += relit_scores(delivered.with_albedo(scale), views, options)
    return Scores(images, notes, {"albedo_psnr": float(-10 * np.log10(max(np.mean(errors), 1e-10)))} if errors else {})


def shiny(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Shiny Blender's scores of the test views. Raises InputError where the data list no test views, or are of another
    form than the set's."""
    if "test" not in (transforms.splits(root) or ()):
        raise InputError(f"{root}: lists no test views; give a folder with transforms_test.json")
    notes: list[str] = []
    frames = test_views(transforms, root, options, notes)
    for frame in frames:
        if frame.distortion is not None or frame.mask_path is not None or frame.exposure != 1 or frame.gamma:
            found = "the frame has distortion, a mask or a curve, which the set does not have"
            raise InputError(f"{frame.image_path}: {found}; leave it out")

    def compare(maps: dict, truth: FolderTruth) -> dict[str, float | None]:
        return {} if truth.normal is None else {"normals": weighted_angle(maps, truth)}

    return Scores(view_scores(delivered, frames, options, compare), notes)


def test_views(layout: ModuleType, root: Path, options: Options, notes: list[str]) -> list[Frame]:
    """The test views, or as many of them as the options ask for."""
    frames = layout.read(root, "test")
    if options.views is None:
        return frames
    notes.append(f"{options.views} of {len(frames)} test views")
    return spread(frames, options.views)


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


def albedo_pairs(delivered: Delivered, frames: list[Frame]) -> list[tuple[dict, FolderTruth]]:
    """The renderings and the truths of those of the views whose albedo is known."""
    truths = [(frame, read_truth(frame)) for frame in frames]
    return [(delivered.render(frame, None), truth) for frame, truth in truths if truth.albedo is not None]


def opaque_scale(maps: dict[str, np.ndarray], truth: FolderTruth) -> np.ndarray:
    """[3] NeRFactor's factors of albedo."""
    known = truth.alpha > OPAQUE
    return lsq_scale(maps["albedo"][known], truth.albedo[known])


def median_ratio(pairs: list[tuple[dict, FolderTruth]]) -> np.ndarray:
    """[3] TensoIR's factors of albedo."""
    ours = [over_background(maps["albedo"], maps["alpha"])[truth.alpha > 0] for maps, truth in pairs]
    theirs = [over_background(truth.albedo, truth.alpha)[truth.alpha > 0] for _, truth in pairs]
    return median_scale(np.concatenate(ours), np.concatenate(theirs))


def albedo_error(maps: dict[str, np.ndarray], truth: FolderTruth, scale: np.ndarray) -> float:
    """TensoIR's mean squared error of albedo over white: times the scale where the truth's alpha is not 0, white elsewhere."""
    ours = over_background(maps["albedo"], maps["alpha"]) * scale
    ours = np.where(truth.alpha[..., None] > 0, np.clip(ours, 0, 1), 1.0)
    theirs = over_background(truth.albedo, truth.alpha)
    return float(np.mean((ours ** (1 / GAMMA) - theirs ** (1 / GAMMA)) ** 2))


def whole_normals(maps: dict[str, np.ndarray], truth: FolderTruth) -> float:
    """TensoIR's mean angle in degrees over the whole image."""
    ours, theirs = (
        unit(normal * alpha[..., None] + BACKGROUND * (1 - alpha[..., None]))
        for normal, alpha in ((unit(maps["normal"]), maps["alpha"]), (truth.normal, truth.alpha))
    )
    return float(angles_deg(ours, theirs).mean())


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
