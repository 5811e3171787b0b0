"""Environment maps given by the user."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from splitnerf import _core
from splitnerf.data.images import HDR_SUFFIXES, area_average, read_header, read_image, read_radiance
from splitnerf.errors import InputError, note

ASPECT_TOLERANCE = 0.02
BRIGHTEST = 1e12  # W / m^2 / sr; the sun has 1e7
FINER = 3  # samples across a texel of a turned map
NEGATIVE_SHARE = 1e-3  # largest share of the map's sum; resampling and compression leave so much


def read_environment(path: str | os.PathLike) -> np.ndarray:
    """[h, w, 3] float32, finite and >= 0: an equirectangular map of linear radiance, u = 0.5 - atan2(y, x)/(2 pi), v = acos(z)/pi
    from the top. Negative pixels that sum to at most a thousandth of the map are set to 0, with a note on stderr. Raises InputError
    where the file is no EXR or HDR file, not 2:1 or black, or has NaN, infinite or many negative pixels."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such environment map; check the path")
    if path.suffix.lower() not in HDR_SUFFIXES or read_header(path).bits != 32:
        raise InputError(f"{path}: an environment map must hold linear radiance; use an .exr or .hdr file")
    radiance = read_radiance(path)
    height, width = radiance.shape[:2]
    if abs(width - 2 * height) > ASPECT_TOLERANCE * width:
        raise InputError(f"{path}: is {width}x{height}; an equirectangular map is twice as wide as high")
    negative = radiance < 0
    if negative.any():
        total, dark = radiance.sum(where=~negative, dtype=np.float64), -radiance.sum(where=negative, dtype=np.float64)
        if dark > NEGATIVE_SHARE * total:
            raise InputError(f"{path}: has negative pixels, {dark / max(total, 1e-30):.1%} of its light; re-export it")
        note(f"{path}: {negative.any(axis=2).sum()} pixels were slightly negative; set to 0")
        radiance = np.maximum(radiance, 0)
    if radiance.max() > BRIGHTEST:
        raise InputError(f"{path}: has pixels above {BRIGHTEST:g}, whose sums overflow; scale it down")
    if not radiance.any():
        raise InputError(f"{path}: is black and lights nothing; use another map")
    return radiance


def read_surroundings(path: str | os.PathLike) -> np.ndarray:
    """[h, 2 h, 4] float32: an equirectangular map of linear radiance with a fourth channel in [0, 1], how well it is
    known. Raises InputError where the file is no such map."""
    image = read_image(path)
    good = image.ndim == 3 and image.shape[2] == 4 and image.shape[1] == 2 * image.shape[0]
    if not good or not np.isfinite(image).all() or image.min() < 0 or image[..., 3].max() > 1:
        raise InputError(f"{path}: is no map of radiance with a fourth channel in [0, 1]; run splitnerf prepare again")
    return image.astype(np.float32)


def sample_environment(radiance: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Radiance [..., 3] float32 from directions [..., 3] of any length above 0, of a map [h, w, 3], interpolated
    bilinearly."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return _bilinear(radiance, np.arctan2(np.hypot(x, y), z) / np.pi, 0.5 - np.arctan2(y, x) / (2 * np.pi))


def directions_of_texels(height: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions [h, 2 h, 3] of the texels of an equirectangular map, and their solid angles [h, 2 h]."""
    ring = np.sin((np.arange(height) + 0.5) * np.pi / height)[:, None]
    areas = np.broadcast_to(ring / ring.sum() * 2 * np.pi / height, (height, 2 * height))
    return _core.equirect_directions(height, 2 * height), areas


def texels_of_directions(directions: np.ndarray, height: int) -> np.ndarray:
    """[n] int64, the texels [height, 2 height], counted row by row, in which directions [n, 3] lie; of any length above 0."""
    x, y, z = directions.T
    row = (np.arctan2(np.hypot(x, y), z) / np.pi * height).astype(np.int64).clip(0, height - 1)
    column = ((0.5 - np.arctan2(y, x) / (2 * np.pi)) * 2 * height).astype(np.int64) % (2 * height)
    return row * 2 * height + column


def seen_at(surroundings: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What photos show around the object, see :func:`read_surroundings`, in directions [n, 3]: the radiance [n, 3], and
    how well it is known [n], in [0, 1]; the radiance is 0 where nothing is."""
    share = surroundings[..., 3:]
    mean = sample_environment(np.concatenate([surroundings[..., :3] * share, share], axis=2), directions)
    known = mean[..., 3]
    return mean[..., :3] / np.maximum(known, 1e-6)[..., None], np.where(known > 1e-3, known, 0.0).astype(np.float32)


def rotate_environment(radiance: np.ndarray, degrees: float) -> np.ndarray:
    """Turns the light [h, w, 3] about the z axis by degrees, counter-clockwise seen from above; columns are
    interpolated linearly, which keeps each row's mean."""
    shift = degrees / 360 * radiance.shape[1]
    whole = int(np.floor(shift))
    share = shift - whole
    near = np.roll(radiance, -whole, axis=1)
    return ((1 - share) * near + share * np.roll(near, -1, axis=1)).astype(radiance.dtype)


def turn_environment(radiance: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """The light [h, 2 h, 3] float32 of a map [h, 2 h, 3] in another world; `turn` [3, 3] is the rotation from that
    world to the map's. Each texel is the mean of `FINER` x `FINER` samples."""
    directions, _ = directions_of_texels(FINER * radiance.shape[0])
    return area_average(sample_environment(radiance, directions @ np.asarray(turn).T), FINER)


def resize_environment(image: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resizes an equirectangular map [H, W, C] to [height, width, C] float32: whole blocks are averaged, the rest is
    bilinear, wrapping around in u."""
    image = np.asarray(image, np.float32)
    factor = min(image.shape[0] // height, image.shape[1] // width)
    if factor > 1 and image.shape[0] % factor == 0 and image.shape[1] % factor == 0:
        image = area_average(image, factor)
    if image.shape[:2] == (height, width):
        return image
    v, u = (np.arange(height)[:, None] + 0.5) / height, (np.arange(width) + 0.5) / width
    return _bilinear(image, *np.broadcast_arrays(v, u))


def _bilinear(image: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """[..., C] float32, a map [h, w, C] between its texels, at v from the top and u [...] as shares of it; u wraps around."""
    height, width = image.shape[:2]
    places = np.stack([(v * height - 0.5).clip(0, height - 1), u * width - 0.5])
    bands = (map_coordinates(band, places, np.float32, order=1, mode="grid-wrap") for band in np.moveaxis(image, -1, 0))
    return np.stack([*bands], axis=-1)
