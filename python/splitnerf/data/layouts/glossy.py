"""NeRO's Glossy Synthetic, an object.

    0.png, 1.png, ...        the photos, sRGB; where they have alpha it is the object's
    0-camera.pkl, ...        pickled arrays: [3, 4] from the world to the camera with OpenCV's axes, and K [3, 3], the first
                             pixel's middle at .5
    0-depth.png, ...         16 bits, 65535 is a depth of 15 along the camera's axis; no object where it is 14.5 or more

NeRO's Glossy Real is read as COLMAP's layout. It has no masks.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from splitnerf.data.images import read_header, read_image
from splitnerf.data.layouts.frame import Frame, pinhole_numbers, pose_of_motion
from splitnerf.data.lens import read_lens
from splitnerf.data.paths import is_file
from splitnerf.data.pickled import unpickled_arrays
from splitnerf.errors import InputError

CAMERA, DEPTH = "-camera.pkl", "-depth.png"
DEEPEST, BACKGROUND = 15.0, 14.5
LARGEST_FILE = 1 << 16
NUMBERED = re.compile(r"(0|[1-9][0-9]{0,8})-camera\.pkl")


def present(root: Path) -> bool:
    """Whether a folder is an object's."""
    return (root / f"0{CAMERA}").is_file()


def splits(root: Path) -> None:
    """None: the layout makes no splits."""
    return None


def read(root: Path, split: None = None) -> list[Frame]:
    """All photos, by number.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    numbers = sorted(int(match[1]) for path in root.iterdir() if (match := NUMBERED.fullmatch(path.name)))
    frames = []
    for number in numbers:
        path, image = root / f"{number}{CAMERA}", root / f"{number}.png"
        if not is_file(image):
            raise InputError(f"{image}: no such image, though there is {path.name}; add it or remove the camera")
        pose, k = _read_camera(path)
        lens = read_lens(pinhole_numbers(k, f"{path}: K"), str(path))
        frames.append(Frame(str(number), image, pose_of_motion(pose, f"{path}: the pose"), *lens))
    return frames


def read_depth(frame: Frame) -> np.ndarray:
    """[H, W] depth along the camera's axis, infinite where no object is.

    Raises:
        InputError: The file is missing or unreadable, or has another size than the photo.
    """
    path = frame.image_path.with_name(f"{frame.name}{DEPTH}")
    depth, photo = read_image(path)[..., 0] * DEEPEST, read_header(frame.image_path)
    if depth.shape != (photo.height, photo.width):
        raise InputError(f"{path}: has another size than {frame.image_path.name}; make them the same size")
    return np.where(depth < BACKGROUND, depth, np.inf)


def _read_camera(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The motion [4, 4] and K [3, 3] of a file."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError("too large")
        pose, k = (part.astype(np.float64) for part in unpickled_arrays(path.read_bytes()))
    except Exception as error:  # pickle and NumPy raise whatever they meet
        raise InputError(f"{path}: cannot be read as arrays of a camera ({str(error)[:80]}); replace it") from None
    if pose.shape != (3, 4):
        raise InputError(f"{path}: its pose is {list(pose.shape)}, not [3, 4]; replace it")
    return np.concatenate([pose, [[0.0, 0, 0, 1]]]), k
