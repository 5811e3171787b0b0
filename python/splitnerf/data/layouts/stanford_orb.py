"""Stanford-ORB, a capture in the blender form: `blender_HDR/OBJECT_scene00N` or `blender_LDR/OBJECT_scene00N`.

transforms_train.json, transforms_test.json   as NeRF-Blender's, without suffixes; poses have OpenGL axes
train/0000.exr or .png, test/...              RGB: linear radiance, or sRGB
train_mask/0000.png, test_mask/...            white is the object
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from splitnerf.data.layouts import transforms
from splitnerf.data.layouts.frame import Frame


def present(root: Path) -> bool:
    """Whether a folder is a capture."""
    return (root / "transforms_train.json").is_file() and (root / "train_mask").is_dir()


splits = transforms.splits


def read(root: Path, split: str | None) -> list[Frame]:
    """The frames of a split, or all. Raises InputError where a file is missing or cannot be used."""
    return [with_mask(frame) for frame in transforms.read(root, split)]


def with_mask(frame: Frame) -> Frame:
    """The frame with the mask that lies in the folder beside its photo's."""
    image = frame.image_path
    return replace(
        frame, mask_path=image.parent.with_name(f"{image.parent.name}_mask") / f"{image.stem}.png", mask_kind="object"
    )
