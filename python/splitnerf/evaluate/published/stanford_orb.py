"""Stanford-ORB: relit and novel views as PSNR-H and PSNR-L, normals and shape.

Source: Kuang et al., Stanford-ORB: A Real-World 3D Object Inverse Rendering Benchmark, 2023; its repository's
orb/utils/metrics.py, test.py and eval_mesh.py.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scipy.ndimage import binary_erosion
from scipy.spatial import cKDTree

from splitnerf.data.asset import unit
from splitnerf.data.images import (
    HDR_SUFFIXES,
    LDR_SUFFIXES,
    area_average,
    linear_to_srgb,
    read_header,
    read_image,
    srgb_to_linear,
)
from splitnerf.data.json_files import need
from splitnerf.data.layouts import stanford_orb as layout
from splitnerf.data.layouts import transforms
from splitnerf.data.layouts.frame import Frame, folder_name
from splitnerf.data.truth import read_mesh
from splitnerf.errors import InputError
from splitnerf.evaluate.metrics import lsq_scale, psnr
from splitnerf.evaluate.published.common import Delivered, LitView, Options, Scores, light_of
from splitnerf.files import is_file
from splitnerf.progress import tracked

SIDE = 512  # pixels at which images are compared
EROSION = np.ones((5, 5), bool)
BRIGHTEST = 4.0  # where PSNR-H clips
SAMPLES = 30_000  # of the surface


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores the photos of `transforms_novel.json` and `transforms_test.json`, the normals of the latter, and the
    mesh."""
    images, notes = [], []
    views = relit(root, options.truth) if (root / layout.NOVEL).is_file() else []
    for view in tracked(views, "relit, image"):
        frame = with_radiance(view.frame)
        maps, photo, mask = _pair(delivered, frame, view.radiance())
        high, low = image_psnr(maps["radiance"], photo, mask, scaled=True)
        images.append({"name": f"{view.light}/{frame.name}", "psnr_h": high if _is_hdr(frame) else None, "psnr_l": low})
    for frame in tracked([with_radiance(frame) for frame in layout.read(root, "test")], "novel, image"):
        maps, photo, mask = _pair(delivered, frame, delivered.environment)
        result = {"name": f"{root.name}/{frame.name}", "normals": _normals(maps, frame, mask, root, options)}
        if delivered.environment is not None:
            high, result["view_psnr_l"] = image_psnr(maps["radiance"], photo, mask, scaled=False)
            result["view_psnr_h"] = high if _is_hdr(frame) else None
        if not _is_hdr(frame) and not notes:
            notes.append(f"no PSNR-H: {layout.HDR} with the photos' EXR files is not next to the data's folder")
        images.append(result)
    return Scores(images, notes, {"chamfer": _chamfer(delivered, root, options)})


def relit(root: Path, truth: Path | None = None) -> list[LitView]:
    """The photos of `transforms_novel.json` with their lights; `truth` is the folder `ground_truth` where it lies
    elsewhere. Raises InputError where a file is missing or cannot be used."""
    path, views = root / layout.NOVEL, []
    meta, entries = transforms.read_entries(path)
    for i, entry in enumerate(entries):
        scene = folder_name(need(entry, "scene_name", path, f" in frame {i}"), f"{path}: 'scene_name' of frame {i}")
        frame = layout.with_mask(transforms.read_frame(entry, meta, i, path, root.absolute().parent / scene))
        folder = layout.ground_truth(root, scene) if truth is None else truth / scene
        turn = layout.MAP_FROM_CAMERA @ frame.pose[:3, :3].T
        views.append(LitView(frame, scene, light_of(folder / "env_map" / f"{frame.image_path.stem}.exr", turn)))
    return views


def read_lit_photo(frame: Frame, factor: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """The photo of a pinhole at an exposure of 1, averaged down by a factor: [H, W, 3] float32 linear radiance as the
    file has it (not multiplied by coverage), and [H, W] float32 the mask in [0, 1]: of the mask's file, else alpha,
    else 1. Raises InputError where a file is missing or cannot be used."""
    path = frame.image_path
    if path.suffix.lower() not in LDR_SUFFIXES + HDR_SUFFIXES:
        raise InputError(f"{path}: must be PNG, JPEG, EXR or HDR; convert it")
    pixels = read_image(path)
    if not np.isfinite(pixels).all():
        raise InputError(f"{path}: has NaN or infinite pixels; re-export it")
    colour, mask = pixels[..., :3], np.ones(pixels.shape[:2], np.float32)
    if not _is_hdr(frame):
        colour = colour ** np.float32(frame.gamma) if frame.gamma else srgb_to_linear(colour)
    if frame.mask_path is not None:
        mask = read_image(frame.mask_path)[..., 0]
        if mask.shape != pixels.shape[:2]:
            raise InputError(f"{frame.mask_path}: has another size than {path.name}; make them the same size")
    elif pixels.shape[2] == 4:
        mask = pixels[..., 3]
    return area_average(colour / np.float32(frame.exposure), factor), area_average(mask, factor)


def with_radiance(frame: Frame) -> Frame:
    """The frame with the photo of `blender_HDR` in place of that of `blender_LDR`, whose values are clipped, if it
    exists."""
    photo = frame.image_path.absolute()
    path = photo.parents[2].with_name(layout.HDR) / photo.parents[1].name / photo.parent.name / f"{photo.stem}.exr"
    return replace(frame, image_path=path) if not _is_hdr(frame) and is_file(path) else frame


def _is_hdr(frame: Frame) -> bool:
    return frame.image_path.suffix.lower() in HDR_SUFFIXES


def image_psnr(
    prediction: np.ndarray, truth: np.ndarray, mask: np.ndarray, *, scaled: bool
) -> tuple[float, float] | tuple[None, None]:
    """PSNR-H and PSNR-L in dB of linear images [H, W, 3] with a mask [H, W]; None where nothing is inside of the eroded
    mask.

    Both images are black outside of the mask, eroded by 5 x 5, and the error is the mean over the whole frame. With
    `scaled` each channel of the prediction has the factor that least squares give in linear light. PSNR-H: both images
    times mean(sRGB(y)) / mean(y) of the truth y clipped to 1, then clipped at 4, linear. PSNR-L: clipped at 1, in sRGB.
    Neither is less than that of an image that is 0.5 inside.
    """
    inside = eroded(mask)
    if not inside.any():
        return None, None
    x, y = (np.asarray(image, np.float64) * inside[..., None] for image in (prediction, np.maximum(truth, 0)))
    low = y.clip(0, 1)
    brighten = linear_to_srgb(low).mean() / low.mean() if low.mean() > 1e-8 else 1.0
    scale = lsq_scale(x[inside], y[inside]) if scaled else np.ones(3)
    grey = 0.5 * inside[..., None] * np.ones(3)

    bright, encoded = (y * brighten).clip(0, BRIGHTEST), linear_to_srgb(low)
    high = psnr((x * scale * brighten).clip(0, BRIGHTEST), bright)
    low_range = psnr(linear_to_srgb((x * scale).clip(0, 1)), encoded)
    return max(high, psnr(grey, bright)), max(low_range, psnr(grey, encoded))


def eroded(mask: np.ndarray) -> np.ndarray:
    """[H, W] bool, the pixels of a mask [H, W] in [0, 1] above 0.5 whose 5 x 5 neighbours in the image are so too."""
    return binary_erosion(mask > 0.5, EROSION, border_value=1)


def normal_distance(prediction: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float | None:
    """The mean of 1 - cos of the angle between normals [H, W, 3] of any length, over the eroded mask; None where that
    is empty."""
    inside = eroded(mask)
    return float((1 - (unit(prediction) * unit(truth)).sum(axis=-1))[inside].mean()) if inside.any() else None


def chamfer(mesh: trimesh.Trimesh, truth: np.ndarray) -> float:
    """2000 times the mean squared distance between points on a mesh and points [n, 3], averaged over both directions.
    This is the scale of the paper's table, twice the one that its text states."""
    points = np.asarray(trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)[0])
    near, far = cKDTree(points).query(truth)[0], cKDTree(truth).query(points)[0]
    return float(1e3 * ((near**2).mean() + (far**2).mean()))


def _pair(delivered: Delivered, frame: Frame, light: np.ndarray | None) -> tuple[dict, np.ndarray, np.ndarray]:
    factor = _factor(frame)
    photo, mask = read_lit_photo(frame, factor)
    return delivered.render(frame, light, factor), photo, mask


def _factor(frame: Frame) -> int:
    return max(1, read_header(frame.image_path).height // SIDE)


def _normals(maps: dict, frame: Frame, mask: np.ndarray, root: Path, options: Options) -> float | None:
    path = _truth(root, options) / "surface_normal" / f"{frame.name}.npy"
    if not path.is_file():
        return None
    try:
        truth = np.load(path, allow_pickle=False)
    except Exception as error:  # a damaged file may raise anything
        raise InputError(f"{path}: cannot be read as an array ({str(error)[:80]}); replace it") from None
    factor = _factor(frame)
    if truth.shape != (mask.shape[0] * factor, mask.shape[1] * factor, 3):
        raise InputError(f"{path}: is {list(truth.shape)}, not of its photo's size; replace it")
    ours = maps["normal"] @ frame.pose[:3, :3]  # in the camera's axes, OpenGL
    return normal_distance(ours, area_average(truth.astype(np.float32), factor), mask)


def _chamfer(delivered: Delivered, root: Path, options: Options) -> float | None:
    path = _truth(root, options) / "mesh_blender" / "mesh.obj"
    if not path.is_file():
        return None
    return chamfer(
        trimesh.Trimesh(delivered.vertices, delivered.asset.triangles, process=False), read_mesh(path).vertices
    )


def _truth(root: Path, options: Options) -> Path:
    return layout.ground_truth(root) if options.truth is None else options.truth / root.absolute().name
