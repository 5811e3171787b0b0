"""One posed image of any layout, and the checks that all layouts share."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from unicodedata import normalize

import numpy as np

from splitnerf.data.images import HDR_SUFFIXES, LDR_SUFFIXES, read_header
from splitnerf.data.lens import Distortion
from splitnerf.errors import InputError, note_once

RIGID_TOLERANCE = 1e-3
ROUNDED = 5e-3  # largest entry of R^T R - 1 of a rotation R whose entries have three decimals
FARTHEST = 1e9  # largest distance from the origin, in the data's units
OPENCV_AXES = np.diag([1.0, -1.0, -1.0, 1.0])  # from OpenGL's: y and z the other way


@dataclass
class Frame:
    """One posed image.

    Attributes:
        name: The frame's name: the file's stem, or the folder's name where each view has its own folder.
        pose: [4, 4] float64 camera-to-world, OpenGL axes, in the data's world.
        lens: The numbers of the pinhole that the data give: `camera_angle_x` (radians), `fl_x fl_y cx cy w h` (pixels).
        distortion: What the image has to be freed from, or None.
        mask_kind: What the mask is: "object" (white is the object; it replaces the image's alpha), "ignore" (black is
            to be ignored), or "auto" where the layout leaves it open.
        dynamic_mask_path: A file that is white where the image is to be ignored, or None.
        behind_path: The file with what the image would show without the object, see
            :meth:`splitnerf.data.dataset.Dataset.behind`, or None.
        exposure: The factor of the image's linear values.
        gamma: The exponent of its values that gives linear ones; 0 where its curve is sRGB's.
        light_turn: [3, 3] the rotation that carries directions of the data's world to those in which the light stands still, or
            None where it stands still in the data's world.
    """

    name: str
    image_path: Path
    pose: np.ndarray
    lens: dict
    distortion: Distortion | None = None
    mask_path: Path | None = None
    mask_kind: str = "auto"
    dynamic_mask_path: Path | None = None
    behind_path: Path | None = None
    exposure: float = 1.0
    gamma: float = 0.0
    light_turn: np.ndarray | None = None


def checked_pose(matrix: object, name: str) -> np.ndarray:
    """[4, 4] float64 of what a file gives as a camera-to-world matrix, called `name` in messages. Raises InputError
    where it is not a rigid motion of finite numbers."""
    try:
        pose = np.array(matrix, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        pose = np.empty(0)
    if pose.shape != (4, 4):
        raise InputError(f"{name} is not a 4x4 matrix of numbers; repair it")
    if not (np.abs(pose) <= FARTHEST).all():
        raise InputError(f"{name} has NaN, infinite or endless entries; repair or remove the frame")
    rotation = pose[:3, :3]
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if not error < ROUNDED or np.linalg.det(rotation) < 0 or np.abs(pose[3] - [0, 0, 0, 1]).max() > RIGID_TOLERANCE:
        raise InputError(f"{name} is not a rigid camera-to-world pose (scaled, sheared or mirrored); repair it")
    if error > RIGID_TOLERANCE:
        note_once("camera poses are rounded to few digits; the nearest rotations are used", name)
        left, _, right = np.linalg.svd(rotation)
        pose[:3, :3] = left @ right
    return pose


def listed_file(folder: Path, name: str, source: Path) -> Path:
    """The path of a file that `source` lists relative to `folder`, in Windows' form or another Unicode form perhaps; notes once
    where it leads out of the folder."""
    path = next((folder / form for form in forms(name) if os.path.isfile(folder / form)), folder / name)
    if not os.path.abspath(path).startswith(os.path.join(os.path.abspath(folder), "")):
        note_once(f"{source}: names files outside of its folder; they are read", f"{name!r} is one")
    return path


def listed_image(folder: Path, name: str, source: Path, others: Sequence[Path | None] = ()) -> Path:
    """The image that `source` lists relative to `folder`, perhaps without its suffix or with one in other letters; one of `others`, its
    mask, only by its name or where there is no further one and it has an alpha. Raises InputError where there is no such regular file."""
    stem, own = os.path.splitext(name)
    suffixes = [form for suffix in LDR_SUFFIXES + HDR_SUFFIXES for form in (suffix, suffix.upper())]
    longer = [] if own.lower() in suffixes else [name + suffix for suffix in suffixes]
    candidates = (name, *longer, stem + own.lower(), stem + own.upper())
    found = [(given, path) for given in candidates for form in forms(given) if os.path.isfile(path := folder / form)]
    found.sort(key=lambda pair: pair[0] != name and pair[1] in others)
    if found and (found[0][0] == name or found[0][1] not in others or read_header(found[0][1]).channels in (2, 4)):
        if found[0][0] != name and any(not path.samefile(found[0][1]) and path not in others for _, path in found):
            note_once(f"{folder}: images of one name differ in their suffixes; the first one is read", found[0][1].name)
        return listed_file(folder, found[0][0], source)
    raise InputError(
        f"{folder / name}: no such image, with or without a suffix, though {source.name} lists it; add it or remove the frame"
    )


def forms(name: str) -> list[str]:
    """A name as it is, with slashes for backslashes, and in the forms in which file systems keep letters with accents."""
    slashes = name.replace("\\", "/")
    return list(dict.fromkeys([name, slashes, normalize("NFC", slashes), normalize("NFD", slashes)]))
