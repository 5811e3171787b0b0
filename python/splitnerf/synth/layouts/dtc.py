"""Writes the form of the Digital Twin Catalog's DSLR sequences, see :mod:`splitnerf.data.layouts.dtc`."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from splitnerf.data.images import write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.layouts.dtc import CAMERAS, MASKS, MESH, METADATA, OBJECT, PHOTOS
from splitnerf.files import atomic_path
from splitnerf.synth.layouts import photos
from splitnerf.synth.writer import Maps

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from glTF's axes


class DtcWriter(photos.PhotoWriter):
    """A writer; the models stand in a folder beside the sequence."""

    folder = "dslr"

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._cameras: list[dict] = []

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        name, k = f"{len(self._cameras):04d}.png", self.intrinsics(maps)
        write_image(self.root / PHOTOS / name, photos.srgb_photo(maps))
        red = photos.mask_of(maps)[..., None] * np.array([1.0, 0, 0], np.float32)
        write_image(self.root / MASKS / name, red)
        intrinsic = {"fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2] - 0.5, "cy": k[1, 2] - 0.5}
        motion = photos.motion_of(pose).tolist()
        self._cameras.append({"image": name, "intrinsic": intrinsic, "T_camera_world": motion})

    def close(self) -> None:
        write_json(self.root / METADATA, {"model_name": [photos.OBJECT]})
        write_json(self.root / OBJECT, {"mesh": {"T_world_object": Z_UP.tolist()}})
        if (self.out / "asset.glb").is_file():
            with atomic_path(self.out / "models" / photos.OBJECT / MESH) as temporary:
                shutil.copyfile(self.out / "asset.glb", temporary)
        write_json(self.root / CAMERAS, {"cameras": self._cameras})
