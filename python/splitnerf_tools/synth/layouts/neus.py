"""Writes NeuS's form of DTU and BlendedMVS, see :mod:`splitnerf.data.layouts.neus`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import write_image
from splitnerf.data.layouts.neus import CAMERAS, IMAGES, MASKS
from splitnerf.files import atomic_path
from splitnerf_tools.synth.layouts.photos import PhotoWriter, mask_of, motion_of, srgb_photo
from splitnerf_tools.synth.writer import Maps


class NeusWriter(PhotoWriter):
    """A writer; every eighth view is the reader's test view, whichever split it is of here."""

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._matrices: dict[str, np.ndarray] = {}
        self._count = 0

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        name, k = f"{self._count:03d}.png", self.intrinsics(maps)
        k[:2, 2] -= 0.5  # of a first pixel with its middle at 0
        world = np.eye(4)
        world[:3] = k @ motion_of(pose)[:3]
        self._matrices |= {f"world_mat_{self._count}": world, f"scale_mat_{self._count}": np.eye(4)}
        write_image(self.root / IMAGES / name, srgb_photo(maps))
        write_image(self.root / MASKS / name, mask_of(maps))
        self._count += 1

    def close(self) -> None:
        with atomic_path(self.root / CAMERAS) as temporary, open(temporary, "wb") as file:
            np.savez(file, **self._matrices)
