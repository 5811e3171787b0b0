"""Photos of an object that turns before a camera on a stand: what stands still in them, and how the light turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy import ndimage
from splitnerf.errors import InputError

from splitnerf_tools.capture.photographs import read_upright, write_png

EDGE = 320  # pixels, of the longest edge of the photos that are compared
MOST_OTHERS = 32  # with which a photo is compared
ALIKE = 8.0  # difference of 8-bit values, of the most different channel, up to which pixels count as alike
STILL = 0.2  # share of the other photos in which a pixel that stands still is alike: a stand may be moved up and down
LEAST_MOVING = 0.002  # share of the pixels of all photos
STEEP = 0.3  # horizontal part of the axis of a camera below which its upward axis tells where it stands
GROWN = 2  # pixels by which what moves is made wider, for features at its outline


def moving_pixels(photos: Sequence[np.ndarray], of: Sequence[object] | None = None) -> list[np.ndarray]:
    """[h, w] bool of each photo [h, w, 3] int16 of 8 bits: what is unlike many others of its size and lens `of[i]` (None: any)."""
    kinds = [(photo.shape, of and of[i]) for i, photo in enumerate(photos)]
    result = []
    for i, photo in enumerate(photos):
        others = [j for j in range(len(photos)) if j != i and kinds[j] == kinds[i]]
        chosen = np.unique(np.linspace(0, len(others) - 1, min(len(others), MOST_OTHERS)).astype(int))
        alike = np.zeros(photo.shape[:2], int)
        for k in chosen:
            alike += np.abs(photo - photos[others[k]]).max(axis=2) < ALIKE
        moving = ndimage.binary_opening(alike < max(1.0, STILL * len(chosen)))
        result.append(ndimage.binary_dilation(moving, iterations=GROWN))
    return result


def reduced(photo: np.ndarray) -> np.ndarray:
    """[h, w, 3] int16 values of 8 bits of a photo [H, W, 3] uint8 or uint16, at most EDGE pixels large."""
    scale = min(1.0, EDGE / max(photo.shape))
    size = tuple(max(1, round(edge * scale)) for edge in photo.shape[1::-1])
    small = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    return (small >> 8 if small.dtype == np.uint16 else small).astype(np.int16)


def write_moving(images: Path, folder: Path, report: Callable[[float], None]) -> None:
    """For each photo `images/GROUP/FILE` a mask `folder/GROUP/FILE.png`, white where something moves, as COLMAP reads it. Raises
    InputError where nothing moves."""
    paths = sorted(path for path in images.rglob("*") if path.is_file())
    photos, sizes = [], []
    for i, path in enumerate(paths):
        photo = read_upright(path)
        photos.append(reduced(photo))
        sizes.append(photo.shape[1::-1])
        report((i + 1) / len(paths))
    masks = moving_pixels(photos, [path.parent for path in paths])
    if np.mean([mask.mean() for mask in masks]) < LEAST_MOVING:
        raise InputError(
            f"{images}: the photos are all alike, so nothing turns; leave --turntable out, or check the photos"
        )
    for path, size, mask in zip(paths, sizes, masks):
        target = folder / path.parent.relative_to(images) / f"{path.name}.png"
        target.parent.mkdir(parents=True, exist_ok=True)
        write_png(target, 255 * cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST))


def light_turns(poses: np.ndarray) -> np.ndarray:
    """[n, 3, 3] rotations from directions of a world whose z axis is the turntable's, to those in which the light stands still:
    that of a camera which goes up and down alone. `poses` are [n, 4, 4] camera-to-world, OpenGL axes."""
    up, back = poses[:, :3, 1], poses[:, :3, 2]
    # Where the camera stands, as seen from the axis: of unit length whatever its height, if its x axis is level.
    towards = back * up[:, 2:] - up * back[:, 2:]
    level = np.linalg.norm(back[:, :2], axis=1, keepdims=True) > STEEP
    x, y, _ = np.where(level, back, towards).T
    angle = np.arctan2(y, x)
    cos, sin, zero, one = np.cos(angle), np.sin(angle), np.zeros(len(up)), np.ones(len(up))
    return np.stack([cos, sin, zero, -sin, cos, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)
