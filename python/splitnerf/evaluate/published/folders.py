"""Shared by the protocols of view folders: the truth of NeRFactor and TensoIR, and compositing over white."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.data.images import linear_to_srgb, over_background, read_image
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.relit import map_files
from splitnerf.errors import InputError
from splitnerf.evaluate.published.common import Options, unit


@dataclass
class FolderTruth:
    """The truth of a view folder: `image` [H, W, 3] sRGB over white, `alpha` [H, W], `albedo` [H, W, 3] linear,
    straight, and `normal` [H, W, 3] unit, world; the last two None where there is no file."""

    image: np.ndarray
    alpha: np.ndarray
    albedo: np.ndarray | None
    normal: np.ndarray | None


def read_truth(frame: Frame) -> FolderTruth:
    """Reads the files in the folder of a view's photo. Raises InputError where one cannot be used."""
    rgba = _read(frame.image_path)
    albedo, normal = (frame.image_path.with_name(name) for name in ("albedo.png", "normal.png"))
    return FolderTruth(
        over_background(rgba[..., :3], rgba[..., 3]),
        rgba[..., 3],
        _read(albedo)[..., :3] if albedo.is_file() else None,
        unit(2 * _read(normal)[..., :3] - 1) if normal.is_file() else None,
    )


def lights_of(root: Path, options: Options) -> dict[str, Path]:
    """The maps by name: those of `--maps`, else `relight_NAME.hdr` in the data's folder."""
    return map_files(root, prefixed=True) if options.maps is None else map_files(options.maps)


def albedo_on_white(albedo: np.ndarray, alpha: np.ndarray, scale: np.ndarray | float = 1.0) -> np.ndarray:
    """[H, W, 3] linear albedo times a factor, clipped, in sRGB over white."""
    return over_background(linear_to_srgb(np.clip(albedo * scale, 0, 1).astype(np.float32)), alpha)


def _read(path: Path) -> np.ndarray:
    pixels = read_image(path)
    if pixels.shape[2] != 4:
        raise InputError(f"{path}: needs an alpha channel; re-export it")
    return pixels
