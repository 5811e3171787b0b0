"""Stanford-ORB, a capture in the blender form: `blender_HDR/OBJECT_scene00N` or `blender_LDR/OBJECT_scene00N`.

transforms_train.json, transforms_test.json   as NeRF-Blender's, without suffixes; poses have OpenGL axes
train/0000.exr or .png, test/...              RGB: linear radiance, or sRGB
train_mask/0000.png, test_mask/...            white is the object
transforms_novel.json                         photos of the same object in other scenes: `scene_name`, the capture whose
                                              folder beside this one holds the photo; its own `camera_angle_x`; the pose in
                                              this capture's world
../../ground_truth/SCENE/env_map/0000.exr     the light of the photo SCENE/test/0000, in the axes of its camera (OpenGL):
                                              -z in the map's centre, +x to the right of it, y up
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from splitnerf.data.layouts import transforms
from splitnerf.data.layouts.frame import Frame

NOVEL = "transforms_novel.json"
HDR = "blender_HDR"  # the folder of the captures with linear photos
MAP_FROM_CAMERA = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])  # x towards the centre, y to the left, z up


def present(root: Path) -> bool:
    """Whether a folder is a capture."""
    return (root / "transforms_train.json").is_file() and (root / "train_mask").is_dir()


splits = transforms.splits


def read(root: Path, split: str | None) -> list[Frame]:
    """The frames of a split, or all. Raises InputError where a file is missing or cannot be used."""
    return [with_mask(frame) for frame in transforms.read(root, split)]


def ground_truth(root: Path, scene: str | None = None) -> Path:
    """The folder of a capture's truth; `scene` is the capture's name, None for this one."""
    return root.absolute().parents[1] / "ground_truth" / (root.absolute().name if scene is None else scene)


def with_mask(frame: Frame) -> Frame:
    """The frame with the mask that lies in the folder beside its photo's."""
    image = frame.image_path
    return replace(
        frame, mask_path=image.parent.with_name(f"{image.parent.name}_mask") / f"{image.stem}.png", mask_kind="object"
    )
