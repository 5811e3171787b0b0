"""The cameras of relit pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.data.asset import Asset
from splitnerf.data.frames import read_frames
from splitnerf.data.images import read_header
from splitnerf.data.layouts.transforms import read_camera_path
from splitnerf.data.lens import check_shape, lens_intrinsics
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.render.path_traced import LARGEST_PICTURE, MOST_VIEWS

DEFAULT_SIZE = 512
HALF_FIELD = np.radians(19.8)  # half field of view of the shorter side: a 50 mm lens on a 36 mm wide sensor
MARGIN = 1.1
FRONT_AZIMUTH = -90.0  # glTF's front, +z of the file, is -y here


@dataclass(frozen=True)
class View:
    """One picture to take: a pose [4, 4] float64 camera-to-world, OpenGL axes, (fx, fy, cx, cy) in pixels, pixel
    centres at +0.5, the size in pixels, and the rotation of the light about z in degrees, counter-clockwise seen from
    above."""

    pose: np.ndarray
    intrinsics: tuple[float, float, float, float]
    width: int
    height: int
    light_degrees: float = 0.0


def parse_size(text: str) -> tuple[int, int | None]:
    """(width, height or None) of "W" or "WxH". Raises InputError where the text has another form, or a side is below 1
    or above 16384."""
    parts = text.lower().split("x")
    digits = all(part.isascii() and part.isdigit() and len(part) < 10 for part in parts)
    if len(parts) > 2 or not digits or not all(1 <= int(part) <= LARGEST_PICTURE for part in parts):
        raise InputError(f"--size must be W or WxH in pixels, 1 to {LARGEST_PICTURE}, got '{text}'")
    return int(parts[0]), int(parts[1]) if len(parts) == 2 else None


def bounding_sphere(asset: Asset) -> tuple[np.ndarray, float]:
    """Centre [3] of the bounding box of the used vertices, and their largest distance from it; float64."""
    points = asset.vertices[np.unique(asset.triangles)].astype(np.float64)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def turntable(
    asset: Asset, count: int, *, elevation: float = 20.0, rotate: str = "camera", size: tuple[int, int | None] | None
) -> list[View]:
    """Cameras on a circle around the object, the first in front; its bounding sphere fills the picture except for a margin of 10 %.
    Raises InputError where the count or the elevation is out of range.

    Args:
        elevation: The elevation of the camera above the horizon, degrees in (-90, 90).
        rotate: "camera", or "light" to keep the camera and turn the light, counter-clockwise seen from above.
        size: The result of `parse_size`; without a height the picture is square, and None means 512x512.
    """
    if not 1 <= count <= MOST_VIEWS:
        raise InputError(f"--turntable must be at least 1 and at most {MOST_VIEWS}, got {count}")
    if not -90 < elevation < 90:
        raise InputError(f"--elevation must lie between -90 and 90 degrees, got {elevation:g}")
    width, height = size or (DEFAULT_SIZE, None)
    height = height or width
    focal = 0.5 * min(width, height) / np.tan(HALF_FIELD)
    centre, radius = bounding_sphere(asset)
    distance = MARGIN * radius / np.sin(HALF_FIELD)
    views = []
    for turn in 360.0 * np.arange(count) / count:
        azimuth = np.radians(FRONT_AZIMUTH + (turn if rotate == "camera" else 0.0))
        pose = look_at(centre, azimuth, np.radians(elevation), distance)
        light = float(turn) if rotate == "light" else 0.0
        views.append(View(pose, (focal, focal, width / 2, height / 2), width, height, light))
    return views


def look_at(centre: np.ndarray, azimuth: float, elevation: float, distance: float) -> np.ndarray:
    """[4, 4] pose of an upright camera that looks at a point; azimuth from +x towards +y, radians."""
    level = np.cos(elevation)
    back = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(back, right), back, centre + distance * back], axis=1)
    return pose


def data_views(root: Path, split: str, size: tuple[int, int | None] | None, reading: Reading = Reading()) -> list[View]:
    """The cameras of a data set's split, in the data's world; each image's size is the default. Raises InputError where
    the data cannot be used, or the size has another shape than the images."""
    frames, _ = read_frames(root, split, reading)
    views = []
    for frame in frames:
        height, width, *_ = read_header(frame.image_path)
        check_shape(frame.lens, (height, width), frame.image_path)
        lens = {"w": width, "h": height} | frame.lens
        views.append(_lens_view(frame.pose, lens, size, str(frame.image_path), (width, height)))
    return views


def path_views(path: Path, size: tuple[int, int | None] | None) -> list[View]:
    """The cameras of a file in the form of transforms.json; its `w` and `h`, else 512x512, unless a size is given.
    Raises InputError where the file cannot be used, or the size has another shape than its `w` and `h`."""
    views, cameras = [], read_camera_path(path)
    if len(cameras) > MOST_VIEWS:
        raise InputError(f"{path}: has {len(cameras)} cameras, more than {MOST_VIEWS}; split it")
    for pose, lens in cameras:
        if ("w" in lens) != ("h" in lens):
            raise InputError(f"{path}: has only one of 'w' and 'h'; give both or none")
        if "fl_x" in lens and "w" not in lens:
            raise InputError(f"{path}: 'fl_x' is in pixels and needs 'w' and 'h'; add them")
        own = (int(lens["w"]), int(lens["h"])) if "w" in lens else None
        if own and not all(1 <= side <= LARGEST_PICTURE for side in own):
            raise InputError(f"{path}: 'w' and 'h' must lie between 1 and {LARGEST_PICTURE}, got {own[0]} and {own[1]}")
        views.append(_lens_view(pose, lens, size, str(path), own))
    return views


def _lens_view(
    pose: np.ndarray, lens: dict, size: tuple[int, int | None] | None, name: str, own: tuple[int, int] | None
) -> View:
    """A view through a lens, scaled from the lens's own (width, height) to the requested size."""
    width, height = size or own or (DEFAULT_SIZE, None)
    if height is None:
        height = max(1, round(width * own[1] / own[0])) if own else width
    if own and abs(height - width * own[1] / own[0]) > 1:
        raise InputError(f"{name}: is {own[0]}x{own[1]}, --size {width}x{height} would stretch it; give a width alone")
    return View(pose, tuple(lens_intrinsics(lens, (height, width)).tolist()), width, height)
