"""The NeRFactor and TensoIR layouts: a folder per view.

`train_000` ..., `test_000` ... (others, such as `val_000`, are not read), each with
    metadata.json    `cam_angle_x` in radians, `cam_transform_mat` 16 numbers parted by commas, the rows of the
                     camera-to-world matrix with OpenGL axes, `imw`, `imh`
    rgba.png         the photo, sRGB, straight alpha
    rgba_<map>.png   the view under another light, optional
    albedo.png       linear, 8 bit, straight alpha, optional
    normal.png       world-space normals n as n / 2 + 1 / 2, linear, 8 bit, optional
"""

from __future__ import annotations

import re
from pathlib import Path

from splitnerf.data.json_files import need, read_json
from splitnerf.data.layouts.frame import Frame, checked_pose
from splitnerf.data.lens import read_lens
from splitnerf.errors import InputError

METADATA, PHOTO = "metadata.json", "rgba.png"
SPLITS = ("train", "test")


def present(root: Path) -> bool:
    """Whether `root` has view folders to train on."""
    return "train" in splits(root)


def splits(root: Path) -> list[str]:
    """The splits that have a view folder."""
    return [split for split in SPLITS if any((folder / METADATA).is_file() for folder in _folders(root, split))]


def read(root: Path, split: str | None) -> list[Frame]:
    """The views of a split, or of both, by number. Raises InputError where the split has no folder, or a folder lacks
    its photo or usable metadata."""
    chosen = splits(root) if split is None else [split]
    folders = [folder for name in chosen for folder in _folders(root, name)]
    if not folders:
        raise InputError(f"{root}: has no view folder {split}_000 for the {split} split; add posed images")
    return [_read_view(folder) for folder in folders]


def _read_view(folder: Path) -> Frame:
    path, image_path = folder / METADATA, folder / PHOTO
    content = read_json(path, "cam_transform_mat")
    matrix = need(content, "cam_transform_mat", path)
    if isinstance(matrix, str):
        words = matrix.split(",")
        matrix = [words[start : start + 4] for start in range(0, len(words), 4)]
    pose = checked_pose(matrix, f"{path}: cam_transform_mat")
    numbers = {"camera_angle_x": need(content, "cam_angle_x", path), "w": content.get("imw"), "h": content.get("imh")}
    if not image_path.is_file():
        raise InputError(f"{image_path}: no such image; add it or remove the folder")
    return Frame(folder.name, image_path, pose, *read_lens(numbers, str(path)))


def _folders(root: Path, split: str) -> list[Path]:
    named = [(re.fullmatch(rf"{split}_(\d+)", path.name), path) for path in root.glob(f"{split}_*") if path.is_dir()]
    return [path for _, path in sorted((int(match[1]), path) for match, path in named if match)]
