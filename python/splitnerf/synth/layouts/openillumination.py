"""Writes the form of OpenIllumination, one light at a time; see :mod:`splitnerf.data.layouts.openillumination`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.environment import directions_of_texels
from splitnerf.data.images import write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.layouts.frame import OPENCV_AXES
from splitnerf.data.layouts.openillumination import LIGHTS, OUTPUT, PHOTOS, POSITIONS, lamp_map
from splitnerf.synth.layouts.photos import OBJECT, PhotoWriter, mask_of, srgb_photo
from splitnerf.synth.writer import Maps

DISTANCE = 5.0  # of the lamps


class OpenIlluminationWriter(PhotoWriter):
    """A writer; of each map it takes the direction of the brightest texel, where a lamp stands."""

    relights = True
    folder = f"obj_01_{OBJECT}"

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._frames: dict[str, dict[str, dict]] = {"train": {}, "test": {}}
        self._lamps: dict[str, np.ndarray] = {}

    def light(self, environment: np.ndarray, name: str | None = None) -> np.ndarray:
        directions, _ = directions_of_texels(environment.shape[0])
        brightest = np.unravel_index(environment.sum(axis=2).argmax(), environment.shape[:2])
        self._lamps[name or ""] = DISTANCE * directions[brightest]
        return super().light(lamp_map(self._lamps[name or ""]), name)

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        camera = self._photo(split, index, "", maps)
        for masks in ("com_masks", "obj_masks"):
            write_image(self.root / OUTPUT / masks / f"{camera}.png", mask_of(maps))
        self._frames[split][camera] = {
            "file_path": f"./images/{camera}", "rotation": 0, "transform_matrix": (pose @ OPENCV_AXES).tolist(),
            "camera_angle_x": self.camera_angle_x, "calib_imgw": maps["alpha"].shape[1], "light_idx": 0,
        }  # fmt: skip

    def relit(self, split: str, index: int, name: str, pose: np.ndarray, maps: Maps) -> None:
        self._photo(split, index, name, maps)

    def close(self) -> None:
        np.save(self.root / POSITIONS, np.stack(list(self._lamps.values())))
        for split, frames in self._frames.items():
            write_json(self.root / OUTPUT / f"transforms_{split}.json", {"frames": frames})

    def _photo(self, split: str, index: int, name: str, maps: Maps) -> str:
        camera, number = f"{'A' if split == 'train' else 'B'}{index}", list(self._lamps).index(name)
        write_image(self.root / LIGHTS / f"{number:03d}" / PHOTOS / f"{camera}.JPG", srgb_photo(maps))
        return camera
