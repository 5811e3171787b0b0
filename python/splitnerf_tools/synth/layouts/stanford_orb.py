"""Writes Stanford-ORB's form, see :mod:`splitnerf.data.layouts.stanford_orb`; each relit light is a further capture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.environment import turn_environment
from splitnerf.data.images import write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.layouts.stanford_orb import HDR, MAP_FROM_CAMERA, NOVEL, ground_truth
from splitnerf_tools.synth.layouts.photos import OBJECT, PhotoWriter, mask_of
from splitnerf_tools.synth.writer import Maps


class StanfordOrbWriter(PhotoWriter):
    """A writer; the training photos are those of the first capture."""

    relights = True
    folder = f"{HDR}/{OBJECT}_scene001"

    def __init__(self, out: Path, camera_angle_x: float):
        super().__init__(out, camera_angle_x)
        self._frames: dict[str, list[dict]] = {"train": [], "test": [], "novel": []}

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps) -> None:
        self._frames[split].append(self._photo(self.root, split, index, pose, maps))
        if split == "test":
            self._map("", self.root.name, index, pose)

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

    def _map(self, name: str, scene: str, index: int, pose: np.ndarray) -> None:
        """The light in the axes of the photo's camera."""
        turn = MAP_FROM_CAMERA @ pose[:3, :3].T
        path = ground_truth(self.root, scene) / "env_map" / f"{index:04d}.exr"
        write_image(path, turn_environment(self._lights[name], turn.T))
