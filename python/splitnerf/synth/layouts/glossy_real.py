"""Writes the form of NeRO's Glossy Real: COLMAP's layout without masks, and the object's points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from splitnerf.data.images import write_image
from splitnerf.files import atomic_path
from splitnerf.synth.layouts.photos import PhotoWriter, motion_of, srgb_photo
from splitnerf.synth.writer import Maps

POINTS = "object_point_cloud.ply"


class GlossyRealWriter(PhotoWriter):
    """A writer; the model is COLMAP's text form."""

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._cameras: list[str] = []
        self._images: list[str] = []

    def mesh(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        super().mesh(vertices, triangles)
        with atomic_path(self.root / POINTS) as temporary:
            temporary.write_bytes(trimesh.PointCloud(vertices).export(file_type="ply"))

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        number, (height, width), k = len(self._images) + 1, maps["alpha"].shape, self.intrinsics(maps)
        name, motion = f"{number:04d}.png", motion_of(pose)
        write_image(self.root / "images" / name, srgb_photo(maps))
        if not self._cameras:
            self._cameras.append(f"1 PINHOLE {width} {height} {_text(k[0, 0], k[1, 1], k[0, 2], k[1, 2])}")
        quaternion = Rotation.from_matrix(motion[:3, :3]).as_quat()[[3, 0, 1, 2]]
        self._images += [f"{number} {_text(*quaternion, *motion[:3, 3])} 1 {name}", ""]

    def close(self) -> None:
        folder = self.root / "colmap/sparse/0"
        for name, lines in (("cameras.txt", self._cameras), ("images.txt", self._images)):
            with atomic_path(folder / name) as temporary:
                temporary.write_text("\n".join(lines) + "\n")


def _text(*numbers: float) -> str:
    return " ".join(repr(float(number)) for number in numbers)
