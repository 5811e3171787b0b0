"""Stanford-ORB, a capture in the blender form: `blender_HDR/OBJECT_scene00N` or `blender_LDR/OBJECT_scene00N`.

transforms_train.json, transforms_test.json   as NeRF-Blender's, without suffixes; poses have OpenGL axes
train/0000.exr or .png, test/...              RGB: linear radiance, or sRGB
train_mask/0000.png, test_mask/...            white is the object
"""

from __future__ import annotations

from pathlib import Path

from splitnerf.data.layouts import transforms
from splitnerf.data.layouts.frame import Frame


def present(root: Path) -> bool:
    """Whether a folder is a capture."""
    return (root / "transforms_train.json").is_file() and (root / "train_mask").is_dir()


splits = transforms.splits


def read(root: Path, split: str | None) -> list[Frame]:
    """The frames of a split, or all. Raises InputError where a file is missing or cannot be used."""
    frames = transforms.read(root, split)
    for frame in frames:
        folder, name = frame.image_path.parent, f"{frame.image_path.stem}.png"
        frame.mask_path, frame.mask_kind = folder.with_name(f"{folder.name}_mask") / name, "object"
    return frames
