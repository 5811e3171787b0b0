"""The photos of all splits, reduced to the size at which they are compared, and what is measured on each alone."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import area_average, linear_to_srgb

SIZE = 200  # pixels, about, along the shorter edge of a reduced photo
FIRST_CODE = 0.5 / 255  # what a colour may lack of the brightest and still be clipped


@dataclass
class ReducedView:
    """One photo.

    Attributes:
        name: The image's path in the data's folder.
        path: The image file.
        held_out: Whether the photo is for testing.
        pose: [4, 4] float64 camera-to-world, OpenGL axes, internal frame.
        intrinsics: [4] float64 (fx, fy, cx, cy) in reduced pixels.
        colour: [h, w, 3] float32, reduced, sRGB, at the stated exposure.
        mask: [h, w] bool, the object.
        known: [h, w] bool, the pixels that say something.
        exposure: The stated factor of the photo's linear values.
        share: The part of the known pixels that is the object.
        cut: The part of the photo's edge that is the object.
        clipped: The part of the object's pixels of which a channel is as bright as the file can tell.
    """

    name: str
    path: Path
    held_out: bool
    pose: np.ndarray
    intrinsics: np.ndarray
    colour: np.ndarray
    mask: np.ndarray
    known: np.ndarray
    exposure: float
    share: float
    cut: float
    clipped: float

    @property
    def place(self) -> np.ndarray:
        """[3] the camera's position."""
        return self.pose[:3, 3]

    def shown(self, points: np.ndarray, nearest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The points [m, 3] that lie within the photo and farther away than `nearest`: their numbers [k], the rows and columns
        of their pixels [k], and their depths [k]."""
        local = (points - self.place) @ self.pose[:3, :3]
        depth = np.maximum(-local[:, 2], 1e-6)
        fx, fy, cx, cy = self.intrinsics
        x, y = np.floor(cx + fx * local[:, 0] / depth), np.floor(cy - fy * local[:, 1] / depth)
        height, width = self.mask.shape
        numbers = np.flatnonzero((-local[:, 2] > nearest) & (x >= 0) & (x < width) & (y >= 0) & (y < height))
        return numbers, y[numbers].astype(int), x[numbers].astype(int), depth[numbers]


def views_of(split: Dataset) -> list[ReducedView]:
    """The photos of a split."""
    factor = max(1, min(split.height, split.width) // SIZE)
    return [_view(split, index, factor) for index in range(len(split))]


def _view(split: Dataset, index: int, factor: int) -> ReducedView:
    image, path, exposure = split.images[index], split.image_paths[index], float(split.exposures[index])
    sharp = np.ones(image.shape[:2], bool) if split.known is None else split.known[index]
    known = area_average(sharp.astype(np.float32), factor) > 0.5
    mask = (area_average(image[..., 3], factor) > 0.5) & known
    colour = area_average(image[..., :3], factor)
    object_pixels = sharp & (image[..., 3] > 0.5)
    brightest = float(linear_to_srgb(np.float32([1 / exposure]))[0]) - FIRST_CODE
    clipped = image[..., :3][object_pixels].max(axis=1, initial=0) >= brightest
    edge = known & ~ndimage.binary_erosion(known)
    return ReducedView(
        name=os.path.relpath(path, split.root),
        path=path,
        held_out=split.split == "test",
        pose=split.poses[index].astype(np.float64),
        intrinsics=split.intrinsics[index].astype(np.float64) / factor,
        colour=colour,
        mask=mask,
        known=known,
        exposure=float(split.stated[index]),
        share=float(mask.sum() / max(1, known.sum())),
        cut=float((mask & edge).sum() / max(1, edge.sum())),
        clipped=float(clipped.mean()) if len(clipped) else 0.0,
    )
