"""The frames of a posed image set: images, poses and lenses.

Layouts:
    NeRF-Blender   `transforms_train.json`, `transforms_test.json`; `file_path` without extension, `camera_angle_x`;
                   RGBA images.
    single file    `transforms.json`; `fl_x fl_y cx cy w h`, `mask_path` beside `file_path`; every 8th frame is the test
                   split.
    view folders   NeRFactor and TensoIR, see :mod:`splitnerf.data.view_folders`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from splitnerf.data import view_folders
from splitnerf.data.images import LDR_SUFFIXES
from splitnerf.data.json_files import read_json
from splitnerf.data.paths import is_file
from splitnerf.errors import InputError

TEST_STRIDE = 8
RIGID_TOLERANCE = 1e-3
SMALLEST_LENS, LARGEST_LENS = 1e-6, 1e9  # bounds of a lens's numbers
SMALLEST_EXPOSURE = 1e-4
FARTHEST = 1e9  # largest distance from the origin, in the data's units


@dataclass
class Frame:
    """One posed image.

    Attributes:
        name: The frame's name: the file's stem, or the folder's name where each view has its own folder.
        image_path: The image file.
        mask_path: The mask file that replaces the image's alpha, or None.
        pose: [4, 4] float64 camera-to-world, OpenGL axes, in the data's world.
        lens: The lens's numbers that the data give: `camera_angle_x` (radians), `fl_x fl_y cx cy w h` (pixels).
        exposure: The factor of the image's linear values.
    """

    name: str
    image_path: Path
    mask_path: Path | None
    pose: np.ndarray
    lens: dict
    exposure: float = 1.0


def read_frames(root: Path, split: str) -> list[Frame]:
    """The frames of one split, in the data's order.

    Args:
        root: Folder of any layout.
        split: "train" or "test".

    Raises:
        InputError: No layout is recognised, or a frame has no image, no usable pose or no lens.
    """
    single, own = root / "transforms.json", root / f"transforms_{split}.json"
    if not own.is_file() and not single.is_file() and view_folders.present(root):
        return [_folder_frame(folder, content, path) for folder, content, path in view_folders.entries(root, split)]
    if own.is_file():
        path = own
    elif single.is_file():
        path = single
    else:
        raise InputError(
            f"{root}: has neither {own.name} nor {single.name}, nor view folders like train_000; "
            "give the folder that holds one"
        )
    meta, entries = _read_entries(path)
    if path == single:
        entries = [e for i, e in enumerate(entries) if (i % TEST_STRIDE == 0) == (split == "test")]
    if not entries:
        raise InputError(f"{path}: has no frames for the {split} split; add posed images")
    return [_listed_frame(entry, meta, i, path) for i, entry in enumerate(entries)]


def read_camera_path(path: Path) -> list[tuple[np.ndarray, dict]]:
    """The cameras of a transforms file whose images need not exist, in its order.

    Args:
        path: JSON with `frames`, each with `transform_matrix`; `camera_angle_x` or `fl_x fl_y cx cy`, `w` and `h` in
            each frame or for all.

    Returns:
        The pose [4, 4] float64 and the lens of each frame, as in `Frame`.

    Raises:
        InputError: The file has no frame, or one of them no usable pose or no lens.
    """
    meta, entries = _read_entries(path)
    if not entries:
        raise InputError(f"{path}: has no frames; add some")
    return [_read_camera(entry, meta, i, path, f"frame {i}") for i, entry in enumerate(entries)]


def has_test_split(root: Path) -> bool:
    """Whether the data have test views; true for a folder of unknown layout, so that reading it raises the error."""
    if (root / "transforms_train.json").exists():
        return (root / "transforms_test.json").exists()
    if (root / "transforms.json").exists() or not view_folders.present(root):
        return True
    return view_folders.present(root, "test")


def lens_intrinsics(lens: dict, size: tuple[int, int]) -> np.ndarray:
    """[4] float64 (fx, fy, cx, cy) in pixels of an image of this (height, width)."""
    height, width = size
    scale_x, scale_y = width / lens.get("w", width), height / lens.get("h", height)
    if "fl_x" in lens:
        fx = lens["fl_x"] * scale_x
        fy = lens.get("fl_y", lens["fl_x"]) * scale_y
    else:
        fx = fy = 0.5 * width / np.tan(0.5 * lens["camera_angle_x"])
    cx = lens["cx"] * scale_x if "cx" in lens else width / 2
    cy = lens["cy"] * scale_y if "cy" in lens else height / 2
    return np.array([fx, fy, cx, cy], dtype=np.float64)


def _need(table: dict, key: str, path: Path, where: str = ""):
    if key not in table:
        raise InputError(f"{path}: missing key '{key}'{where}; add it")
    return table[key]


def _listed_frame(entry: dict, meta: dict, index: int, path: Path) -> Frame:
    """A frame of a transforms file."""
    image_path = _find_image(path.parent, str(_need(entry, "file_path", path, f" in frame {index}")), path)
    mask_path = path.parent / str(entry["mask_path"]) if "mask_path" in entry else None
    pose, lens = _read_camera(entry, meta, index, path, f"frame {index} ({image_path.name})")
    exposure = entry.get("exposure", 1.0)
    if not isinstance(exposure, (int, float)) or not SMALLEST_EXPOSURE <= exposure <= 1 / SMALLEST_EXPOSURE:
        raise InputError(f"{path}: 'exposure' of frame {index} must be a positive number, got {str(exposure)[:40]}; repair it")
    return Frame(image_path.stem, image_path, mask_path, pose, lens, float(exposure))


def _read_entries(path: Path) -> tuple[dict, list[dict]]:
    """A transforms file and its frames."""
    meta = read_json(path, "frames")
    entries = _need(meta, "frames", path)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{path}: 'frames' must be a list of objects")
    return meta, entries


def _read_camera(entry: dict, meta: dict, index: int, path: Path, name: str) -> tuple[np.ndarray, dict]:
    matrix = _need(entry, "transform_matrix", path, f" in frame {index}")
    pose = _checked_pose(matrix, f"{path}: transform_matrix of {name}")
    keys = ("camera_angle_x", "fl_x", "fl_y", "cx", "cy", "w", "h")
    return pose, _checked_lens({key: entry.get(key, meta.get(key)) for key in keys}, path)


def _folder_frame(folder: Path, content: dict, path: Path) -> Frame:
    """A frame of a NeRFactor or TensoIR view folder."""
    matrix = _need(content, "cam_transform_mat", path)
    pose = _checked_pose(view_folders.parse_matrix(matrix), f"{path}: cam_transform_mat")
    lens = {"camera_angle_x": _need(content, "cam_angle_x", path), "w": content.get("imw"), "h": content.get("imh")}
    image_path = folder / view_folders.PHOTO
    if not image_path.is_file():
        raise InputError(f"{image_path}: no such image; add it or remove the folder")
    return Frame(folder.name, image_path, None, pose, _checked_lens(lens, path))


def _checked_pose(matrix: object, frame: str) -> np.ndarray:
    try:
        pose = np.array(matrix, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        pose = np.empty(0)
    if pose.shape != (4, 4):
        raise InputError(f"{frame} is not a 4x4 matrix of numbers; repair it")
    if not (np.abs(pose) <= FARTHEST).all():
        raise InputError(f"{frame} has NaN, infinite or endless entries; repair or remove the frame")
    rotation = pose[:3, :3]
    rigid = np.abs(rotation.T @ rotation - np.eye(3)).max() < RIGID_TOLERANCE and np.linalg.det(rotation) > 0
    if not rigid or np.abs(pose[3] - [0, 0, 0, 1]).max() > RIGID_TOLERANCE:
        raise InputError(f"{frame} is not a rigid camera-to-world pose (scaled, sheared or mirrored); repair it")
    return pose


def _checked_lens(lens: dict, path: Path) -> dict:
    lens = {key: value for key, value in lens.items() if value is not None}
    if "fl_x" not in lens and "camera_angle_x" not in lens:
        raise InputError(f"{path}: missing key 'camera_angle_x' (or 'fl_x'); add it")
    for key, value in lens.items():
        valid = isinstance(value, (int, float)) and SMALLEST_LENS <= value <= LARGEST_LENS
        if not valid or (key == "camera_angle_x" and value >= np.pi):
            raise InputError(f"{path}: '{key}' must be a positive number, got {str(value)[:40]}; repair it")
    return lens


def _find_image(folder: Path, file_path: str, path: Path) -> Path:
    exact = folder / file_path
    if is_file(exact):
        return exact
    for suffix in LDR_SUFFIXES:
        candidate = folder / f"{file_path}{suffix}"
        if is_file(candidate):
            return candidate
    raise InputError(f"{exact}: no such image, though {path.name} lists it; add the image or remove the frame")
