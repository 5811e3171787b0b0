"""Writes the form of NeRO's Glossy Synthetic, see :mod:`splitnerf.data.layouts.glossy`."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
from PIL import Image

from splitnerf.data.images import write_image
from splitnerf.data.layouts.glossy import CAMERA, DEEPEST, DEPTH
from splitnerf.files import atomic_path
from splitnerf.synth.layouts.photos import PhotoWriter, mask_of, motion_of
from splitnerf.synth.writer import Maps, straight_rgba


class GlossyWriter(PhotoWriter):
    """A writer; the cameras, which complete the data, are written last."""

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._cameras: list[tuple[np.ndarray, np.ndarray]] = []

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        number, k = len(self._cameras), self.intrinsics(maps)
        write_image(self.root / f"{number}.png", straight_rgba(maps))
        rows, columns = np.indices(maps["alpha"].shape) + 0.5
        axis = np.sqrt(1 + ((columns - k[0, 2]) / k[0, 0]) ** 2 + ((rows - k[1, 2]) / k[1, 1]) ** 2)
        depth = np.where(mask_of(maps) > 0, maps["depth"] / axis, DEEPEST)
        codes = np.rint((depth / DEEPEST).clip(0, 1) * 65535).astype(np.uint16)
        with atomic_path(self.root / f"{number}{DEPTH}") as temporary:
            Image.fromarray(codes).save(temporary, "png")
        self._cameras.append((motion_of(pose)[:3], k))

    def close(self) -> None:
        for number, camera in reversed(list(enumerate(self._cameras))):
            with atomic_path(self.root / f"{number}{CAMERA}") as temporary:
                temporary.write_bytes(pickle.dumps(camera, protocol=4))
