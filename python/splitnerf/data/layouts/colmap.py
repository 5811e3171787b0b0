"""COLMAP's sparse models: cameras and images, as text or binary.

    sparse/0/ or sparse/, or either in colmap/   cameras.bin and images.bin, or cameras.txt and images.txt
    images/                                      the images that the model names
    masks/NAME.jpg.png or masks/NAME.png         their masks, optional; what they mean is for :mod:`splitnerf.data.dataset`

The world stays COLMAP's own. Its axes have no meaning unless somebody aligned it, for example with `colmap
model_orientation_aligner`.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from splitnerf.data.colmap_files import read_cameras, read_images
from splitnerf.data.layouts.frame import OPENCV_AXES, Frame, checked_pose, listed_image
from splitnerf.data.lens import read_lens
from splitnerf.errors import InputError
from splitnerf.files import is_file
from splitnerf.notes import note_once

PLACES = ("sparse", "colmap/sparse")
IMAGES, MASKS = "images", "masks"


def present(root: Path) -> bool:
    """Whether a folder has a model."""
    return model_files(root) is not None


def splits(root: Path) -> None:
    """None: a model makes no splits."""
    return None


def read(root: Path, split: None = None) -> list[Frame]:
    """The registered images, by name.

    Raises:
        InputError: The model or an image cannot be used.
    """
    cameras_file, source = model_files(root)
    cameras = dict(read_cameras(cameras_file))
    lenses, frames = {}, []
    for name, camera, motion in sorted(read_images(source)):
        if camera not in lenses:
            if camera not in cameras:
                raise InputError(
                    f"{source}: image {name!r} has camera {camera}, which the model lacks; replace the model"
                )
            lenses[camera] = read_lens(cameras[camera], f"{cameras_file}: camera {camera}")
        image = listed_image(root / IMAGES, name, source)
        pose = checked_pose(camera_to_world(motion), f"{source}: the pose of {name!r}")
        candidates = (root / MASKS / f"{name}.png", (root / MASKS / name).with_suffix(".png"))
        mask = next((path for path in candidates if is_file(path)), None)
        frames.append(Frame(os.path.splitext(name)[0], image, pose, *lenses[camera], mask))
    if not frames:
        raise InputError(f"{source}: has no registered image; give another model")
    return frames


def model_files(root: Path) -> tuple[Path, Path] | None:
    """The files of cameras and images of the model with the most images, by the size of that file, or None; notes where
    there are several."""
    found: dict[Path, tuple[Path, Path]] = {}
    for place in PLACES:
        numbered = [path for path in (root / place).glob("*") if path.name.isdigit()]
        for folder in () if found else (root / place, *numbered):
            for ending in ("txt", "bin"):  # binary files have all digits
                files = folder / f"cameras.{ending}", folder / f"images.{ending}"
                if all(map(is_file, files)):
                    found[folder] = files
    if not found:
        return None
    largest = max(found, key=lambda folder: (found[folder][1].stat().st_size, folder))
    if len(found) > 1:
        note_once(f"{root}: has {len(found)} COLMAP models; the largest is read", str(largest))
    return found[largest]


def camera_to_world(motion: tuple[float, ...]) -> np.ndarray:
    """[4, 4] with OpenGL axes, of the seven numbers of an image: quaternion (w first) and translation of world to
    camera, OpenCV axes; NaN where the quaternion is 0."""
    pose = np.eye(4)
    largest = np.abs(motion[:4]).max()
    rotation = Rotation.from_quat(np.roll(motion[:4], -1) / largest).as_matrix().T if largest > 0 else np.full((3, 3), np.nan)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ motion[4:]
    return pose @ OPENCV_AXES
