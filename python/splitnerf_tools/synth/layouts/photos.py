"""Shared by the writers of photographed sets: RGB photos over black, mask files, poses as world-to-camera matrices."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import linear_to_srgb, read_radiance, write_image
from splitnerf.data.layouts.frame import OPENCV_AXES
from splitnerf.export.mesh import write_mesh_ply
from splitnerf_tools.synth.writer import Maps

OBJECT = "asset"  # the name of the object in folders


class PhotoWriter:
    """A writer of one of these sets; `light.hdr` and `mesh.ply` in the data's folder are the truth, which the sets do
    not have.

    Args:
        out: The folder that holds all; made where it is missing.
        camera_angle_x: Horizontal field of view of all cameras, in radians.

    Attributes:
        root: The folder to train on.
        relights: Whether the set has photos in other lights.
    """

    relights = False
    folder = ""  # of the data, in `out`

    def __init__(self, out: Path, camera_angle_x: float):
        self.out, self.camera_angle_x = Path(out), camera_angle_x
        self.root = self.out / self.folder
        self._lights: dict[str, np.ndarray] = {}  # that photos are rendered with, by name, "" for that of the training

    def light(self, environment: np.ndarray, name: str | None = None) -> np.ndarray:
        """Takes a light and returns the one to render with: that of the training as `light.hdr` stores it; one of a
        name as it is, which the set's own file may round."""
        if name is None:
            write_image(self.root / "light.hdr", environment)
            environment = read_radiance(self.root / "light.hdr")
        self._lights[name or ""] = environment
        return environment

    def mesh(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        """Writes the true mesh, see `SceneWriter.mesh`."""
        write_mesh_ply(self.root / "mesh.ply", vertices, triangles)

    def relit(self, split: str, index: int, name: str, pose: np.ndarray, maps: Maps) -> None:
        """Writes a photo in another light."""
        raise NotImplementedError

    def intrinsics(self, maps: Maps) -> np.ndarray:
        """K [3, 3] of a view, the first pixel's middle at 0.5."""
        height, width = maps["alpha"].shape
        focal = 0.5 * width / np.tan(0.5 * self.camera_angle_x)
        return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])


def motion_of(pose: np.ndarray) -> np.ndarray:
    """[4, 4] from the world to the camera with OpenCV's axes, of a camera-to-world pose with OpenGL's."""
    return np.linalg.inv(pose @ OPENCV_AXES)


def srgb_photo(maps: Maps) -> np.ndarray:
    """[H, W, 3] the photo over black."""
    return linear_to_srgb(maps["radiance"])


def mask_of(maps: Maps) -> np.ndarray:
    """[H, W] float32, 1 on pixels of which the object covers at least half."""
    return (maps["alpha"] >= 0.5).astype(np.float32)
