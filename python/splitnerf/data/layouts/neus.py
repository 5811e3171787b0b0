"""The layout of NeuS (DTU, BlendedMVS): `cameras_sphere.npz`, `image/` and, unless the images have alpha, `mask/`.

    world_mat_0, world_mat_1, ...   4 x 4 float, K [R | t] above a row 0 0 0 1: from the data's world to pixels, the
                                    first pixel's centre at (0, 0), in the order of the images' names
    image/, mask/                   PNG or JPEG of the same names or numbers; white is the object

The world is that of `world_mat`, in its own units; `scale_mat_0` ..., which say where the object is, are not needed.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.linalg import rq

from splitnerf.data.images import LDR_SUFFIXES
from splitnerf.data.layouts.frame import OPENCV_AXES, Frame, checked_pose
from splitnerf.data.lens import read_lens
from splitnerf.errors import InputError, note_once

CAMERAS, IMAGES, MASKS = "cameras_sphere.npz", "image", "mask"
LONGEST_MATRIX = 4096  # bytes of an array in the file
LARGEST_SKEW = 1e-2  # of the pixels' grid


def present(root: Path) -> bool:
    """Whether a folder has the layout."""
    return (root / CAMERAS).is_file()


def splits(root: Path) -> None:
    """None: the layout makes no splits."""
    return None


def read(root: Path, split: None = None) -> list[Frame]:
    """All frames, by name. Raises InputError where a file cannot be used, the numbers of cameras, images and masks differ, or an
    image has no mask of its name."""
    matrices = read_matrices(root / CAMERAS)
    images, masks = _pictures(root / IMAGES), _pictures(root / MASKS)
    for folder, found in ((IMAGES, images), (MASKS, masks)):
        if len(found) != len(matrices) and (folder == IMAGES or found):
            raise InputError(
                f"{root / folder}: has {len(found)} images, {CAMERAS} has {len(matrices)} cameras; repair it"
            )
    mask_of = _paired(images, masks, root / MASKS) if masks else {}
    numbers = [_key(image) for image in images if re.search(r"\d", image.stem)]
    if numbers != sorted(numbers):
        note_once(
            f"{root / IMAGES}: images are paired with cameras in the alphabet's order, which is not that of their numbers"
        )
    frames = []
    for i, (matrix, image) in enumerate(zip(matrices, images)):
        name = f"{root / CAMERAS}: world_mat_{i}"
        intrinsics, pose = decompose(matrix, name)
        numbers = dict(zip(("fl_x", "fl_y", "cx", "cy"), intrinsics.tolist()))
        frames.append(
            Frame(
                image.stem,
                image,
                checked_pose(pose, name),
                read_lens(numbers, name)[0],
                mask_path=mask_of.get(image),
                mask_kind="object",
            )
        )
    return frames


def read_matrices(path: Path) -> list[np.ndarray]:
    """The matrices `world_mat_0`, ... [4, 4] of a file. Raises InputError where it is none, or claims to hold more than it does."""
    try:
        with np.load(path, mmap_mode="r", allow_pickle=False) as archive:
            names = [name for name in archive.files if re.fullmatch(r"world_mat_\d{1,6}", name)]
            if any(archive.zip.getinfo(f"{name}.npy").file_size > LONGEST_MATRIX for name in names):
                raise ValueError(f"a matrix has more than {LONGEST_MATRIX} bytes")
            found = {int(name.removeprefix("world_mat_")): archive[name] for name in names}
    except Exception as error:  # zipfile and NumPy raise whatever they meet
        raise InputError(f"{path}: cannot be read as a file of NumPy arrays ({error}); replace it") from None
    if not found or sorted(found) != list(range(len(found))):
        raise InputError(f"{path}: needs world_mat_0, world_mat_1 and so on without a gap; repair it")
    return [found[i] for i in range(len(found))]


def decompose(matrix: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """(fx, fy, cx, cy) [4], pixel centres at +0.5, and camera-to-world [4, 4], OpenGL axes, of a projection K [R | t] [3 or 4, 4],
    up to a factor, from the world to pixels whose first centre is (0, 0). Raises InputError, with its name, where it is none."""
    usable = matrix.shape in ((4, 4), (3, 4)) and matrix.dtype.kind in "fiu"
    part = matrix[:3].astype(np.float64) if usable else np.full((3, 4), np.nan)
    if not np.isfinite(part).all() or not abs(np.linalg.det(part[:, :3])) > 1e-30:
        raise InputError(f"{name} is not a 4x4 matrix K [R | t] of finite numbers; repair it")
    part = part * np.sign(np.linalg.det(part[:, :3]))
    upper, rotation = rq(part[:, :3])
    signs = np.diag(np.sign(np.diag(upper)))
    upper, rotation = upper @ signs, signs @ rotation
    k = upper / upper[2, 2]
    if abs(k[0, 1]) > LARGEST_SKEW * k[0, 0]:
        raise InputError(f"{name} has skewed pixels, which are not read; rectify the images")
    world_to_camera = np.eye(4)
    world_to_camera[:3, :3], world_to_camera[:3, 3] = rotation, np.linalg.solve(upper, part[:, 3])
    pose = np.linalg.inv(world_to_camera) @ OPENCV_AXES
    return np.array([k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5]), pose


def _pictures(folder: Path) -> list[Path]:
    """The images of a folder by name; none where it does not exist."""
    return sorted(
        path
        for path in folder.glob("*")
        if path.suffix.lower() in LDR_SUFFIXES and path.is_file() and not path.name.startswith("._")
    )


def _paired(images: list[Path], masks: list[Path], folder: Path) -> dict[Path, Path]:
    """The mask of each image: of its name, else its stem, else its numbers. Raises InputError where all three leave one open."""
    for key in (lambda path: path.name, lambda path: path.stem, _key):
        of_key, keys = {key(mask): mask for mask in masks}, list(map(key, images))
        if of_key.keys() == {*keys} and len(of_key) == len(images):
            return {image: of_key[key] for image, key in zip(images, keys)}
    masks_keys = list(map(_key, masks))
    open_one = next(path for path, key in zip(images, keys) if (keys.count(key), masks_keys.count(key)) != (1, 1))
    raise InputError(
        f"{folder}: has no mask that is of {open_one.name} alone; give each image one of its name or number"
    )


def _key(path: Path) -> tuple:
    """What an image and its mask share: the numbers in their names or, without any, the names."""
    return tuple(map(int, re.findall(r"\d+", path.stem))) or (path.stem,)
