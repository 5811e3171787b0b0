"""Writes rendered views in the form of published sets that have less than the full truth.

Cameras, photos and masks are theirs; `light.hdr` and `mesh.ply` in the data's folder are the truth, which the sets do not have.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from splitnerf.data.environment import turn_environment
from splitnerf.data.images import linear_to_srgb, write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.layouts.frame import OPENCV_AXES
from splitnerf.data.layouts.neus import CAMERAS, IMAGES, MASKS
from splitnerf.data.layouts.stanford_orb import HDR, MAP_FROM_CAMERA, NOVEL, ground_truth
from splitnerf.files import atomic_path

from splitnerf_tools.synth.writer import Maps, SceneWriter, ViewWriter

OBJECT = "asset"  # the name of the object in folders


class ShinyWriter(SceneWriter):
    """Shiny Blender: that of NeRF-Blender, and for test images `r_000_normal.png`, n / 2 + 1 / 2, and `r_000_alpha.png`."""

    relights = False

    def _write_truth(self, image: Path, maps: Maps) -> None:
        normal = np.concatenate([0.5 * maps["smooth_normal"] + 0.5, maps["alpha"][..., None]], axis=-1)
        write_image(image.with_name(f"{image.stem}_normal.png"), normal)
        write_image(image.with_name(f"{image.stem}_alpha.png"), maps["alpha"])


class StanfordOrbWriter(ViewWriter):
    """Stanford-ORB, see :mod:`splitnerf.data.layouts.stanford_orb`: the training photos are those of the first capture, each
    relit light is a further capture, and the light of each test photo is in the axes of its camera."""

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(Path(out) / HDR / f"{OBJECT}_scene001", camera_angle_x)
        self._frames: dict[str, list[dict]] = {"train": [], "test": [], "novel": []}
        self._lights: dict[str | None, np.ndarray] = {}

    def light(self, environment: np.ndarray, name: str | None = None) -> np.ndarray:
        # The set's own file may round it.
        self._lights[name] = super().light(environment) if name is None else environment
        return self._lights[name]

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        self._frames[split].append(self._photo(self.root, split, index, pose, maps))
        if split == "test":
            self._map(None, self.root.name, index, pose)

    def relit(self, split: str, index: int, name: str, pose: np.ndarray, maps: Maps) -> None:
        scene = f"{OBJECT}_scene{[n for n in self._lights if n].index(name) + 2:03d}"
        entry = self._photo(self.root.with_name(scene), split, index, pose, maps)
        self._frames["novel"].append(entry | {"scene_name": scene, "camera_angle_x": self.camera_angle_x})
        self._map(name, scene, index, pose)

    def close(self) -> None:
        for split in ("train", "test"):
            content = {"camera_angle_x": self.camera_angle_x, "frames": self._frames[split]}
            write_json(self.root / f"transforms_{split}.json", content)
        if self._frames["novel"]:
            write_json(self.root / NOVEL, {"frames": self._frames["novel"]})

    def _photo(self, folder: Path, split: str, index: int, pose: np.ndarray, maps: Maps) -> dict:
        write_image(folder / split / f"{index:04d}.exr", maps["radiance"])
        write_image(folder / f"{split}_mask" / f"{index:04d}.png", mask_of(maps))
        return {"file_path": f"{split}/{index:04d}", "transform_matrix": pose.tolist()}

    def _map(self, name: str | None, scene: str, index: int, pose: np.ndarray) -> None:
        turn = MAP_FROM_CAMERA @ pose[:3, :3].T
        path = ground_truth(self.root, scene) / "env_map" / f"{index:04d}.exr"
        write_image(path, turn_environment(self._lights[name], turn.T))


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
