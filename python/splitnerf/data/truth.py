"""The truth that may lie beside a dataset: material and normal maps per test view, the light, the mesh, and the test views under
other lights, which are read one at a time.

Files, `r_N` standing for the image's own name, each optional:
    r_N_albedo.png   base colour, sRGB, straight alpha
    r_N_orm.png      linear; G roughness, B metallic
    r_N_normal.exr   world-space normals, multiplied by coverage; alpha is the coverage
    r_N_normal.png   world-space normals, negative components clipped to 0, sRGB-encoded (the NeRF Blender scenes)
    light.exr (or .hdr), mesh.ply   in the dataset's folder
Beside an image that has `r_N_alpha.png` too (Shiny Blender), `r_N_normal.png` is n / 2 + 1 / 2, linear.
In view folders (:mod:`splitnerf.data.layouts.view_folders`) `albedo.png`, linear, and `normal.png` lie beside `rgba.png`.

The truth of map M is `r_N_relit_M.png` beside `r_N.png`, or `rgba_M.png` in a view folder: sRGB, straight alpha. The
map itself is `relight_M.hdr` (or .exr) in the data's folder, or M or relight_M with either suffix in a folder of maps.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from splitnerf.data.asset import unit
from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.images import HDR_SUFFIXES, area_average, read_header, read_image, srgb_to_linear
from splitnerf.data.layouts import view_folders
from splitnerf.data.pixels import averaged_codes, decoded
from splitnerf.errors import InputError, note_once

OPAQUE, LENGTHS_ALIKE = 0.9, 0.1
MAPS = {"albedo.png": 4, "orm.png": 4, "normal.exr": 4, "normal.png": 3}  # and how many channels each needs
PREFIX = "relight_"
PROTOCOLS = {"low": (8, 20), "high": (7, 20)}
"""Maps and test views of the published protocols: low-frequency probes (NeRFactor's), and high-frequency maps."""


@dataclass
class ViewTruth:
    """Truth of one view at the dataset's downscale; what does not exist is None.

    Attributes:
        albedo: [H, W, 3] float32, linear, straight.
        roughness: [H, W] float32, perceptual, in [0, 1].
        metallic: [H, W] float32 in [0, 1].
        normal: [H, W, 3] float32, unit, world; 0 where `normal_mask` is false.
        normal_mask: [H, W] bool, the pixels whose normal can be scored.
    """

    albedo: np.ndarray | None = None
    roughness: np.ndarray | None = None
    metallic: np.ndarray | None = None
    normal: np.ndarray | None = None
    normal_mask: np.ndarray | None = None


@dataclass
class SceneTruth:
    """`light` [H, W, 3] float32 linear equirectangular and `mesh` in the data's world, or None."""

    light: np.ndarray | None = None
    mesh: trimesh.Trimesh | None = None


def load_scene_truth(root: str | os.PathLike, origin: np.ndarray | None = None) -> SceneTruth:
    """Loads `light.exr`, or else `light.hdr`, and `mesh.ply` from a dataset's folder where they exist; the mesh is moved by
    -`origin`, see `Dataset`. Raises InputError where one exists but cannot be used."""
    lights, mesh = [Path(root) / f"light{suffix}" for suffix in (".exr", ".hdr")], Path(root) / "mesh.ply"
    light = next((read_environment(path) for path in lights if path.is_file()), None)
    truth = SceneTruth(light, read_mesh(mesh) if mesh.is_file() else None)
    if truth.mesh is not None and origin is not None and origin.any():
        truth.mesh.apply_translation(-origin)
    return truth


def read_mesh(path: str | os.PathLike) -> trimesh.Trimesh:
    """Reads a triangle mesh of any format that trimesh reads, vertices as stored, finite and with an area. Raises
    InputError where the file is missing or unreadable, or the mesh is degenerate or empty."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such mesh; check the path")
    try:
        mesh = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh's loaders raise whatever their parser meets
        raise InputError(f"{path}: cannot be read as a mesh ({error}); replace it") from None
    filled = isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) > 0
    if not filled or not np.isfinite(mesh.vertices).all() or not mesh.area > 0:
        raise InputError(f"{path}: degenerate or empty mesh; replace or remove it")
    return mesh


def load_view_truths(dataset: Dataset) -> list[ViewTruth]:
    """Loads the truth maps of every view of a split, downscaled like its images. Raises InputError where a map exists
    but is unreadable, has too few channels or another size than its image."""
    return [_load_view(dataset, view) for view in range(len(dataset))]


def check_truth(dataset: Dataset) -> None:
    """Raises InputError where a file of the truth of a split cannot be used, as far as the headers of maps tell."""
    load_scene_truth(dataset.root)
    for view, image_path in enumerate(dataset.image_paths):
        for ending, channels in MAPS.items():
            if (path := _map_path(image_path, ending)).is_file():
                _check_map(dataset, view, path, read_header(path)[:3], channels)


def decode_clipped_normals(encoded: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals [..., 3] whose negative components were clipped to 0 before they were sRGB-encoded, 0 where unknown,
    and the known pixels [...] bool: a single component of 0 is restored, with more zeros the normal is unknown."""
    components = srgb_to_linear(encoded)
    clipped = components <= 0
    known = clipped.sum(axis=-1) <= 1
    missing = np.sqrt(np.maximum(1 - (components**2).sum(axis=-1, keepdims=True), 0))
    normals = unit(np.where(clipped, -missing, components))
    return np.where(known[..., None], normals, 0).astype(np.float32), known


def read_map(dataset: Dataset, view: int, path: Path, channels: int) -> np.ndarray | None:
    """Reads a map of a view as [H, W, C] float32, at the file's own size; None where there is no such file. Raises
    InputError where the file is unreadable, has fewer than `channels`, NaN, or another size than the view's image."""
    if not path.is_file():
        return None
    pixels = read_image(path)
    _check_map(dataset, view, path, pixels.shape, channels)
    if not np.isfinite(pixels).all():
        raise InputError(f"{path}: has NaN or infinite pixels; re-export it")
    return pixels


def _map_path(image_path: Path, ending: str) -> Path:
    """Where a map of the view of `image_path` lies."""
    return image_path.with_name(ending if image_path.name == view_folders.PHOTO else f"{image_path.stem}_{ending}")


def _check_map(dataset: Dataset, view: int, path: Path, shape: tuple[int, ...], channels: int) -> None:
    """Raises InputError where a map of `shape` has too few channels, or another size than its view's image."""
    height, width, found = shape
    if found < channels:
        raise InputError(f"{path}: needs {channels} channels, has {found}; re-export it")
    if (height // dataset.downscale, width // dataset.downscale) != tuple(dataset.sizes[view]):
        of = dataset.image_paths[view].name
        raise InputError(f"{path}: is {width}x{height}, not the size of {of}; re-export it")


def relit_path(image_path: Path, name: str) -> Path:
    """Where the view of `image_path` under map `name` lies."""
    stem = image_path.stem if image_path.name == view_folders.PHOTO else f"{image_path.stem}_relit"
    return image_path.with_name(f"{stem}_{name}.png")


def read_relit(dataset: Dataset, index: int, name: str) -> np.ndarray:
    """One view under the light of map `name`, [H, W, 4] float32 sRGB in [0, 1], straight alpha, at the dataset's
    downscale. Raises InputError where the image is missing, unreadable, has no alpha or another size than the view's.
    """
    path = relit_path(dataset.image_paths[index], name)
    pixels = read_map(dataset, index, path, 4)
    if pixels is None:
        raise InputError(f"{path}: no such image, the truth of {dataset.frame_names[index]} under {name}; add it")
    return dataset.padded(decoded(averaged_codes(pixels[..., :4], dataset.downscale)))


def map_files(folder: Path, *, prefixed: bool = False) -> dict[str, Path]:
    """The .hdr and .exr maps of a folder by name, sorted; names have no suffix and no prefix `relight_`. Of two with
    one name the .exr counts. `prefixed`: only files with the prefix count, as in a dataset's folder."""
    found = {}
    for path in sorted(folder.iterdir(), key=lambda path: (path.suffix.lower() != ".exr", path.name), reverse=True):
        if path.suffix.lower() in HDR_SUFFIXES and (path.name.startswith(PREFIX) or not prefixed):
            found[path.stem.removeprefix(PREFIX)] = path
    return dict(sorted(found.items()))


def relight_maps(dataset: Dataset, folder: Path | None = None, protocol: str | None = None) -> dict[str, Path]:
    """The maps to relight with, by name: those of a folder, None for the dataset's own, that have truth images; or with
    a protocol "low" or "high" all of the folder, whose number and that of the views must be those in `PROTOCOLS`.
    Raises InputError where the folder is missing, none of its maps has truth, or it does not fit the protocol."""
    if folder is not None and not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give --maps a folder of .hdr or .exr maps")
    files = map_files(dataset.root, prefixed=True) if folder is None else map_files(folder)
    if protocol is not None:
        n_maps, n_views = PROTOCOLS[protocol]
        if len(files) != n_maps:
            found = f"{folder or dataset.root}: holds {len(files)} maps"
            raise InputError(f"{found}, --lights {protocol} needs {n_maps}; give another --maps")
        if len(dataset) < n_views:
            found = f"{dataset.root}: has {len(dataset)} test views"
            raise InputError(f"{found}, --lights {protocol} needs {n_views}; leave --lights out")
        return files
    kept = {n: f for n, f in files.items() if any(relit_path(image, n).is_file() for image in dataset.image_paths)}
    if folder is not None and not kept:
        example = relit_path(dataset.image_paths[0], next(iter(files), "NAME"))
        raise InputError(f"{folder}: no map has truth images such as {example.name} in {dataset.root}; check the names")
    return kept


def _load_view(dataset: Dataset, view: int) -> ViewTruth:
    image_path, factor = dataset.image_paths[view], dataset.downscale
    in_folder, truth = image_path.name == view_folders.PHOTO, ViewTruth()

    def read(ending: str) -> np.ndarray | None:
        return read_map(dataset, view, _map_path(image_path, ending), MAPS[ending])

    def average(pixels: np.ndarray) -> np.ndarray:
        return dataset.padded(area_average(pixels, factor))

    albedo = read("albedo.png")
    if albedo is not None and in_folder:
        averaged = average(np.concatenate([albedo[..., :3] * albedo[..., 3:4], albedo[..., 3:4]], axis=-1))
        truth.albedo = averaged[..., :3] / np.maximum(averaged[..., 3:], 1e-8)
    elif albedo is not None:
        truth.albedo = dataset.padded(srgb_to_linear(decoded(averaged_codes(albedo, factor))[..., :3]))

    orm = read("orm.png")
    if orm is not None:
        alpha = average(orm[..., 3])
        averaged = average(orm[..., 1:3] * orm[..., 3:]) / np.maximum(alpha, 1e-8)[..., None]
        truth.roughness, truth.metallic = averaged[..., 0], averaged[..., 1]

    exact = read("normal.exr")
    if exact is not None:
        averaged = average(exact)
        truth.normal, truth.normal_mask = _unit(averaged[..., :3], averaged[..., 3] > OPAQUE)
        return truth
    encoded = read("normal.png")
    if encoded is None:
        return truth
    photo, mask = read_image(image_path), dataset.cropped(view, dataset.images[view])[..., 3]
    if photo.shape[2] in (2, 4):
        alpha = photo[..., -1]
    else:
        alpha = np.pad(np.kron(mask, np.ones((factor, factor))), [(0, n % factor) for n in photo.shape[:2]])
    if in_folder or image_path.with_name(f"{image_path.stem}_alpha.png").is_file():
        averaged = average((2 * encoded[..., :3] - 1) * alpha[..., None])
        truth.normal, truth.normal_mask = _unit(averaged, average(alpha) > OPAQUE)
    else:
        normals, known = decode_clipped_normals(encoded[..., :3])
        known &= alpha > OPAQUE
        lengths = np.linalg.norm(srgb_to_linear(encoded[..., :3]), axis=2)[known & (encoded[..., :3] > 0).all(axis=2)]
        if len(lengths) and np.mean(np.abs(lengths - 1) < LENGTHS_ALIKE) < 0.5:
            what = "normals, read as clipped at 0 and in sRGB, have not the length 1; save them as normal.exr instead"
            note_once(f"{image_path.parent}: {what}", _map_path(image_path, "normal.png").name)
        share = average(known.astype(np.float32))
        truth.normal, truth.normal_mask = _unit(average(normals * known[..., None]), share >= 0.5)
    return truth


def _unit(vectors: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    mask = mask & (lengths[..., 0] > 1e-3)
    return np.where(mask[..., None], vectors / np.maximum(lengths, 1e-8), 0).astype(np.float32), mask
