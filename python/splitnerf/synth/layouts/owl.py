"""Writes the form of Objects With Lighting, see :mod:`splitnerf.data.layouts.owl`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import write_image
from splitnerf.data.layouts.owl import GAMMA, INPUTS
from splitnerf.synth.layouts.photos import OBJECT, PhotoWriter, mask_of, motion_of
from splitnerf.synth.writer import Maps

STOPS = (-0.75, 0.5)  # exposures of the input photos and of those to compare with


class OwlWriter(PhotoWriter):
    """A writer; the test views are the photos to compare with, first those in the light of the input photos."""

    relights = True
    folder = f"dataset/{OBJECT}/test"

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._compared = 0

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        if split == "train":
            self._photo(self.root / INPUTS, "", f"{index:04d}", STOPS[0], pose, maps)
        else:
            self._compare("", pose, maps)

    def relit(self, split: str, index: int, name: str, pose: np.ndarray, maps: Maps) -> None:
        self._compare(name, pose, maps)

    def close(self) -> None:
        (self.root / INPUTS / "exposure.txt").write_text(f"{STOPS[0]}\n")

    def _compare(self, name: str, pose: np.ndarray, maps: Maps) -> None:
        number, self._compared = f"{self._compared:04d}", self._compared + 1
        self._photo(self.root, "gt_", number, STOPS[1], pose, maps)
        (self.root / f"gt_exposure_{number}.txt").write_text(f"{STOPS[1]}\n")
        write_image(self.root / f"gt_env_512_rotated_{number}.hdr", self._lights[name])

    def _photo(self, folder: Path, prefix: str, number: str, stops: float, pose: np.ndarray, maps: Maps) -> None:
        values = np.clip(maps["radiance"] * 2.0**stops, 0, 1) ** (1 / GAMMA)
        write_image(folder / f"{prefix}image_{number}.png", values)
        write_image(folder / f"{prefix}mask_{number}.png", mask_of(maps))
        height, width = maps["alpha"].shape
        motion = motion_of(pose)
        rows = [*self.intrinsics(maps), *motion[:3, :3], motion[:3, 3], (width, height, 3)]
        text = "\n".join(" ".join(repr(float(x)) for x in row) for row in rows)
        (folder / f"{prefix}camera_{number}.txt").write_text(text + "\n")
