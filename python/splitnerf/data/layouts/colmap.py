"""COLMAP's sparse models: cameras and images, as text or binary (little endian).

    sparse/0/ or sparse/, or either in colmap/   cameras.bin or cameras.txt, images.bin or images.txt
    images/                                      the images that the model names
    masks/NAME.jpg.png or masks/NAME.png         their masks, optional; what they mean is for :mod:`splitnerf.data.dataset`

The world stays COLMAP's own. Its axes have no meaning unless somebody aligned it, for example with `colmap
model_orientation_aligner`.
"""

from __future__ import annotations

import os
import struct
from codecs import BOM_UTF8
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from scipy.spatial.transform import Rotation

from splitnerf.data.layouts.frame import OPENCV_AXES, Frame, checked_pose, forms, listed_image
from splitnerf.data.lens import MODELS, PARAMETERS, read_lens
from splitnerf.errors import InputError, note_once

PLACES = ("sparse", "colmap/sparse")
# of the files of cameras and images; binary files have all digits
FORMS = ("bin", "bin"), ("txt", "txt"), ("txt", "bin"), ("bin", "txt")
IMAGES, MASKS = "images", "masks"
POINT_BYTES = 24  # of an image point: x, y and the number of its 3D point
LONGEST_NAME = 4096  # bytes
Image = tuple[str, int, tuple[float, ...]]  # name, camera, quaternion (w first) and translation of world to camera


def present(root: Path) -> bool:
    """Whether a folder has a model."""
    return _model_files(root) is not None


def splits(root: Path) -> None:
    """None: a model makes no splits."""
    return None


def read(root: Path, split: None = None) -> list[Frame]:
    """The registered images, by name. Raises InputError where the model or an image cannot be used."""
    cameras_file, source = _model_files(root)
    with _opened(cameras_file) as file:
        listed = [(number, _lens_numbers(*camera, cameras_file)) for number, *camera in _cameras(file)]
    if len(cameras := dict(listed)) < len(listed):
        raise InputError(f"{cameras_file}: has two cameras of one number; replace the model")
    with _opened(source) as file:
        images = sorted(_images(file))
    lenses, frames = {}, []
    for name, camera, motion in images:
        if camera not in lenses:
            if camera not in cameras:
                raise InputError(f"{source}: image {name!r} has camera {camera}, which the model lacks; replace it")
            lenses[camera] = read_lens(cameras[camera], f"{cameras_file}: camera {camera}")
        image = listed_image(root / IMAGES, name, source)
        pose = checked_pose(_camera_to_world(motion), f"{source}: the pose of {name!r}")
        masks = [root / MASKS / form for given in (name, _inside(image, root)) for form in forms(given)]
        candidates = (path for mask in masks for path in (mask.with_name(f"{mask.name}.png"), mask.with_suffix(".png")))
        mask = next((path for path in candidates if os.path.isfile(path) and not path.samefile(image)), None)
        frames.append(Frame(os.path.splitext(name)[0], image, pose, *lenses[camera], mask))
    if not frames:
        raise InputError(f"{source}: has no registered image; give another model")
    used = [frame.mask_path for frame in frames if frame.mask_path is not None]
    if len({*used}) < len(used):
        double = next(frame for frame in frames if frame.mask_path and used.count(frame.mask_path) > 1)
        whole = f"{_inside(double.image_path, root)}.png"
        raise InputError(
            f"{double.mask_path}: may be the mask of several images; call masks by whole names, as {whole}"
        )
    if not used and (root / MASKS).is_dir():
        note_once(
            f"{root / MASKS}: no image has a mask there", f"{_inside(frames[0].image_path, root)}.png would be one"
        )
    return frames


def _inside(image: Path, root: Path) -> str:
    """The path of an image from the folder of images, however the model writes it."""
    return os.path.relpath(image, root / IMAGES)


def _model_files(root: Path) -> tuple[Path, Path] | None:
    """The files of cameras and images of the model with the most images, or None; notes where there are several."""
    found: dict[Path, tuple[Path, Path]] = {}
    for place in PLACES:
        numbered = [path for path in (root / place).glob("*") if path.name.isdigit()]
        for folder in () if found else (root / place, *numbered):
            pairs = [(folder / f"cameras.{one}", folder / f"images.{other}") for one, other in FORMS]
            if there := [pair for pair in pairs if all(map(os.path.isfile, pair))]:
                if len(there) > 1:
                    note_once(f"{folder}: has files of both forms; {there[0][0].name} and {there[0][1].name} are read")
                found[folder] = there[0]
    if len(found) < 2:
        return next(iter(found.values()), None)
    largest = max(found, key=lambda folder: (_n_images(found[folder][1]), folder))
    note_once(f"{root}: has {len(found)} COLMAP models; the one with the most images is read", str(largest))
    return found[largest]


def _n_images(path: Path) -> int:
    """The number of images of a model's file."""
    with _opened(path) as file:
        return len(list(_images(file)))


def _cameras(file: BinaryIO) -> Iterator[tuple[int, str, int, int, tuple[float, ...]]]:
    """Number, model, width, height and parameters of each camera."""
    if file.name.endswith(".txt"):
        for number, model, width, height, *parameters in filter(None, map(str.split, _lines(file))):
            yield int(number), model, _whole(width), _whole(height), tuple(map(float, parameters))
        return
    for _ in range(*_take(file, "Q")):
        number, model, width, height = _take(file, "IiQQ")
        name = list(PARAMETERS)[model] if 0 <= model < len(PARAMETERS) else f"number {model}"
        yield number, name, width, height, _take(file, f"{len(PARAMETERS.get(name, '').split())}d")


def _images(file: BinaryIO) -> Iterator[Image]:
    """The images; in a text file each has a second line for its points, which may be empty."""
    if file.name.endswith(".txt"):
        lines = _lines(file)
        for line in filter(str.strip, lines):
            _, *motion, camera, name = line.split(maxsplit=9)
            points = next(lines, "").split()  # x, y and the number of each
            if len(points) % 3 or (points and not points[-1].lstrip("-").isdigit()):
                raise ValueError(f"image {name.strip()!r} has no line of points, which may be empty")
            yield name.strip(), int(camera), tuple(map(float, motion))
        return
    for _ in range(*_take(file, "Q")):
        _, *motion, camera = _take(file, "I7dI")
        start, head = file.tell(), file.read(LONGEST_NAME + 1)
        file.seek(start + head.index(b"\0") + 1)
        (n_points,) = _take(file, "Q")
        if n_points * POINT_BYTES > os.fstat(file.fileno()).st_size - file.tell():
            raise ValueError("it ends too early")
        file.seek(n_points * POINT_BYTES, os.SEEK_CUR)
        yield os.fsdecode(head[: head.index(b"\0")]), camera, tuple(motion)


def _whole(text: str) -> int:
    """A whole number, which may be written like 1920.0."""
    if not float(text).is_integer():
        raise ValueError(f"{text} pixels")
    return int(float(text))


def _lens_numbers(model: str, width: int, height: int, parameters: tuple[float, ...], path: Path) -> dict[str, object]:
    """The numbers of a camera by the names of a transforms file."""
    names = PARAMETERS.get(model, "").split()
    if not names:
        raise InputError(
            f"{path}: COLMAP's camera model {model[:40]} is not read; undistort the photos with `colmap "
            f"image_undistorter`, or use one of {', '.join(MODELS)}"
        )
    if len(names) != len(parameters):
        raise InputError(f"{path}: a camera {model} has {len(parameters)} parameters, not {len(names)}; replace it")
    return dict(zip(names, parameters)) | {"camera_model": model, "w": width, "h": height}


def _take(file: BinaryIO, form: str) -> tuple:
    """The next values of a binary file, in the form of `struct`."""
    return struct.unpack(f"<{form}", file.read(struct.calcsize(f"<{form}")))


def _lines(file: BinaryIO) -> Iterator[str]:
    """The lines of a text file but its comments."""
    if file.read(len(BOM_UTF8)) != BOM_UTF8:
        file.seek(0)
    return (os.fsdecode(line.rstrip(b"\r\n")) for line in file if not line.startswith(b"#"))


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A file of a model; what parsing it raises becomes an InputError."""
    try:
        with open(path, "rb") as file:
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the model") from None
    except (ValueError, struct.error) as error:
        raise InputError(f"{path}: is damaged or no file of COLMAP ({str(error)[:80]}); replace the model") from None


def _camera_to_world(motion: tuple[float, ...]) -> np.ndarray:
    """[4, 4] with OpenGL axes, of the seven numbers of an image: quaternion (w first) and translation of world to
    camera, OpenCV axes; NaN where the quaternion is 0."""
    pose = np.eye(4)
    largest = np.abs(motion[:4]).max()
    rotation = (
        Rotation.from_quat(np.roll(motion[:4], -1) / largest).as_matrix().T if largest > 0 else np.full((3, 3), np.nan)
    )
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ motion[4:]
    return pose @ OPENCV_AXES
