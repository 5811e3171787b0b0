"""Writes rendered views in the form of published sets that have less than the full truth.

Cameras, photos and masks are theirs; `light.hdr` and `mesh.ply` in the data's folder are the truth, which the sets do not have.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from splitnerf.data.images import linear_to_srgb, write_image
from splitnerf.data.layouts.frame import OPENCV_AXES
from splitnerf.data.layouts.neus import CAMERAS, IMAGES, MASKS
from splitnerf.files import atomic_path

from splitnerf_tools.synth.writer import Maps, SceneWriter, ViewWriter


class ShinyWriter(SceneWriter):
    """Shiny Blender: that of NeRF-Blender, and for test images `r_000_normal.png`, n / 2 + 1 / 2, and `r_000_alpha.png`."""

    relights = False

    def _write_truth(self, image: Path, maps: Maps) -> None:
        normal = np.concatenate([0.5 * maps["smooth_normal"] + 0.5, maps["alpha"][..., None]], axis=-1)
        write_image(image.with_name(f"{image.stem}_normal.png"), normal)
        write_image(image.with_name(f"{image.stem}_alpha.png"), maps["alpha"])


class NeusWriter(ViewWriter):
    """NeuS's form of DTU and BlendedMVS, see :mod:`splitnerf.data.layouts.neus`; every eighth view is the reader's test view,
    whichever split it is of here."""

    relights = False

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._matrices: dict[str, np.ndarray] = {}

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        number, (height, width) = len(self._matrices) // 2, maps["alpha"].shape
        focal = 0.5 * width / np.tan(0.5 * self.camera_angle_x)
        # The first pixel's middle is at 0.
        k = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
        world = np.eye(4)
        world[:3] = k @ np.linalg.inv(pose @ OPENCV_AXES)[:3]
        self._matrices |= {f"world_mat_{number}": world, f"scale_mat_{number}": np.eye(4)}
        write_image(self.root / IMAGES / f"{number:03d}.png", linear_to_srgb(maps["radiance"]))
        write_image(self.root / MASKS / f"{number:03d}.png", mask_of(maps))

    def close(self) -> None:
        with atomic_path(self.root / CAMERAS) as temporary, open(temporary, "wb") as file:
            np.savez(file, **self._matrices)


def mask_of(maps: Maps) -> np.ndarray:
    """[H, W] float32, 1 on pixels of which the object covers at least half."""
    return (maps["alpha"] >= 0.5).astype(np.float32)
