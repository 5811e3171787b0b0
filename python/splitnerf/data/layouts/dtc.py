"""Digital Twin Catalog, a sequence of the DSLR camera.

    camera_poses.json   `cameras`, each with `image`, `intrinsic` (fx, fy, cx, cy; the first pixel's middle at 0, as OpenCV
                        has it) and `T_camera_world` [4, 4], from the world to the camera with OpenCV's axes
    png/                the photos, RGB
    mask/               black where the object is not; the set's tool `generate_dslr_mask.py` writes them, optional
    object_pose.json    `mesh`: `T_world_object` [4, 4], from the true mesh's own axes to the world
    metadata.json       `model_name`: the folder of the true mesh `3d-asset.glb` among the models
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.json_files import need, read_json
from splitnerf.data.layouts.frame import Frame, folder_name, listed_image, pose_of_motion
from splitnerf.data.lens import read_lens
from splitnerf.data.paths import is_file
from splitnerf.errors import InputError

CAMERAS, OBJECT, METADATA = "camera_poses.json", "object_pose.json", "metadata.json"
PHOTOS, MASKS, MESH = "png", "mask", "3d-asset.glb"


def present(root: Path) -> bool:
    """Whether a folder is a sequence."""
    return (root / CAMERAS).is_file()


def splits(root: Path) -> None:
    """None: a sequence makes no splits."""
    return None


def read(root: Path, split: None = None) -> list[Frame]:
    """All photos, in the file's order.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    path = root / CAMERAS
    cameras = need(read_json(path, "cameras"), "cameras", path)
    if not isinstance(cameras, list) or not cameras or not all(isinstance(camera, dict) for camera in cameras):
        raise InputError(f"{path}: 'cameras' must be a list of objects; repair it")
    frames = []
    for index, camera in enumerate(cameras):
        where = f"of camera {index}"
        image = listed_image(root / PHOTOS, str(need(camera, "image", path, f" {where}")), path)
        pose = pose_of_motion(need(camera, "T_camera_world", path, f" {where}"), f"{path}: T_camera_world {where}")
        given = need(camera, "intrinsic", path, f" {where}")
        numbers = {name: _number(given, name, path, where) for name in ("fx", "fy", "cx", "cy")}
        lens = {"fl_x": numbers["fx"], "fl_y": numbers["fy"], "cx": numbers["cx"] + 0.5, "cy": numbers["cy"] + 0.5}
        mask = root / MASKS / image.name
        frames.append(Frame(
            image.stem, image, pose, *read_lens(lens, str(path)), mask if is_file(mask) else None, "object",
        ))  # fmt: skip
    return frames


def object_to_world(root: Path) -> np.ndarray:
    """[4, 4] from the true mesh's own axes to the world.

    Raises:
        InputError: The file is missing or cannot be used.
    """
    path = root / OBJECT
    mesh = need(read_json(path, "mesh"), "mesh", path)
    try:
        matrix = np.array(mesh["T_world_object"], np.float64)
    except (KeyError, TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise InputError(f"{path}: 'T_world_object' is not a 4x4 matrix of numbers; repair it")
    return matrix


def model_name(root: Path) -> str:
    """The folder of the true mesh among the models.

    Raises:
        InputError: The file is missing or names none.
    """
    path = root / METADATA
    names = need(read_json(path, "model_name"), "model_name", path)
    name = names[0] if isinstance(names, list) and names else names
    return folder_name(name, f"{path}: 'model_name'")


def _number(given: object, name: str, path: Path, where: str) -> float:
    try:
        return float(given[name])
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: 'intrinsic' {where} needs a number '{name}'; repair it") from None
