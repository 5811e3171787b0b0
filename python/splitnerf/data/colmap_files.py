"""COLMAP's files of cameras and images, binary (little endian) and text."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from splitnerf.data.lens import MODELS
from splitnerf.errors import InputError

PARAMETERS = {
    "SIMPLE_PINHOLE": "f cx cy", "PINHOLE": "fl_x fl_y cx cy", "SIMPLE_RADIAL": "f cx cy k1", "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fl_x fl_y cx cy k1 k2 p1 p2", "OPENCV_FISHEYE": "fl_x fl_y cx cy k1 k2 k3 k4",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1", "RADIAL_FISHEYE": "f cx cy k1 k2",
}  # fmt: skip
NUMBERS = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE",
)  # fmt: skip
POINT_BYTES = 24  # of an image point: x, y and the number of its 3D point
LONGEST_NAME = 4096  # bytes

Camera = dict[str, object]  # numbers for `read_lens`
Image = tuple[str, int, tuple[float, ...]]  # name, camera, quaternion (w first) and translation of world to camera


def read_cameras(path: Path) -> Iterator[tuple[int, Camera]]:
    """Numbers and lenses of the cameras of cameras.bin or cameras.txt.

    Raises:
        InputError: The file is damaged, or a camera has a model that is not read.
    """
    return _cameras_of_binary(path) if path.suffix == ".bin" else _cameras_of_text(path)


def read_images(path: Path) -> Iterator[Image]:
    """The images of images.bin or images.txt.

    Raises:
        InputError: The file is damaged.
    """
    return _images_of_binary(path) if path.suffix == ".bin" else _images_of_text(path)


def _cameras_of_binary(path: Path) -> Iterator[tuple[int, Camera]]:
    with _opened(path) as file:
        (count,) = _take(file, "Q", path)
        for _ in range(count):
            number, model, width, height = _take(file, "IiQQ", path)
            name = NUMBERS[model] if 0 <= model < len(NUMBERS) else f"number {model}"
            n = len(_parameter_names(name, path))
            yield number, _camera(name, width, height, _take(file, f"{n}d", path), path)


def _cameras_of_text(path: Path) -> Iterator[tuple[int, Camera]]:
    for line in _lines(path):
        parts = line.split()
        if not parts:
            continue
        with _named(path, line):
            number, name, (width, height) = int(parts[0]), parts[1], map(int, parts[2:4])
            parameters = [float(part) for part in parts[4:]]
        yield number, _camera(name, width, height, parameters, path)


def _images_of_binary(path: Path) -> Iterator[Image]:
    with _opened(path) as file:
        (count,) = _take(file, "Q", path)
        for _ in range(count):
            _, *motion, camera = _take(file, "I7dI", path)
            name = _take_name(file, path)
            (n_points,) = _take(file, "Q", path)
            _skip(file, n_points * POINT_BYTES, path)
            yield name, camera, tuple(motion)


def _images_of_text(path: Path) -> Iterator[Image]:
    """Each image has a second line for its points, which may be empty."""
    lines = _lines(path)
    for line in lines:
        parts = line.split(maxsplit=9)
        if not parts:
            continue
        with _named(path, line):
            motion, camera, name = tuple(map(float, parts[1:8])), int(parts[8]), parts[9].strip()
        next(lines, None)
        yield name, camera, motion


def _camera(name: str, width: int, height: int, parameters: list[float], path: Path) -> Camera:
    """The numbers of a camera by the names of a transforms file."""
    names = _parameter_names(name, path)
    if len(names) != len(parameters):
        raise InputError(
            f"{path}: a camera {name} has {len(parameters)} parameters, not {len(names)}; replace the model"
        )
    numbers = dict(zip(names, parameters))
    if "f" in numbers:
        numbers["fl_x"] = numbers.pop("f")
    return numbers | {"camera_model": name, "w": width, "h": height}


def _parameter_names(name: str, path: Path) -> list[str]:
    if name not in PARAMETERS:
        raise InputError(
            f"{path}: COLMAP's camera model {name[:40]} is not read; undistort the photos with `colmap "
            f"image_undistorter`, or use one of {', '.join(MODELS)}"
        )
    return PARAMETERS[name].split()


def _take(file: BinaryIO, form: str, path: Path) -> tuple:
    """The next values of a binary file, in the form of `struct`."""
    size = struct.calcsize(f"<{form}")
    data = file.read(size)
    if len(data) < size:
        raise _damaged(path, "it ends too early")
    return struct.unpack(f"<{form}", data)


def _take_name(file: BinaryIO, path: Path) -> str:
    """The next text, which ends with a zero byte."""
    name = bytearray()
    while (byte := file.read(1)) != b"\0":
        name += byte
        if not byte or len(name) > LONGEST_NAME:
            raise _damaged(path, "a name does not end")
    return os.fsdecode(bytes(name))


def _skip(file: BinaryIO, size: int, path: Path) -> None:
    if size > os.fstat(file.fileno()).st_size - file.tell():
        raise _damaged(path, "it ends too early")
    file.seek(size, os.SEEK_CUR)


def _lines(path: Path) -> Iterator[str]:
    """The lines of a text file but its comments."""
    with _opened(path) as file:
        for line in file:
            if not line.startswith(b"#"):
                yield os.fsdecode(line.rstrip(b"\r\n"))


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with open(path, "rb") as file:
            yield file
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the model") from None


@contextmanager
def _named(path: Path, line: str) -> Iterator[None]:
    """Turns what parsing a line raises into an InputError."""
    try:
        yield
    except (ValueError, IndexError):
        raise _damaged(path, f"not a line of such a file: {line[:60]!r}") from None


def _damaged(path: Path, reason: str) -> InputError:
    return InputError(f"{path}: damaged, {reason}; replace the model")
