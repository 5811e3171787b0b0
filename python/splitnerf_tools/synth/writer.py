"""Writes rendered views as a dataset with its truth.

Layouts:
    blender     `transforms_{train,test}.json`, `{train,test}/r_000.png`; for test views also `_albedo.png`, `_orm.png`
                (R = 1, G = roughness, B = metallic), `_normal.exr` and `_relit_<map>.png`.
    nerfactor   a folder per view, `train_000`, `test_000`, with `rgba.png` and `metadata.json`; for test views also
                `albedo.png`, `normal.png` and `rgba_<map>.png`.

In the dataset's folder of each: `light.hdr`, `relight_<map>.hdr`, `mesh.ply`. Colours are sRGB with straight alpha (but
the albedo of nerfactor is linear), normals world space without the normal map.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from splitnerf.data.images import linear_to_srgb, read_radiance, write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.layouts import view_folders
from splitnerf.data.truth import PREFIX, relit_path
from splitnerf.export.scene import write_mesh_ply

LAYOUTS = ("blender", "nerfactor")
Maps = dict[str, np.ndarray]


class SceneWriter:
    """Takes the renderings of one scene; the files that name the views are written last, by `close`. Any method raises OSError
    where a file cannot be written.

    Args:
        root: The dataset's folder; made where it is missing.
        camera_angle_x: Horizontal field of view of all cameras, in radians.
        layout: One of `LAYOUTS`.
    """

    def __init__(self, root: Path, camera_angle_x: float, layout: str = "blender"):
        self.root, self.camera_angle_x, self.layout = root, camera_angle_x, layout
        self._views: dict[str, list[tuple[Path, dict]]] = {}

    def light(self, environment: np.ndarray, name: str | None = None) -> np.ndarray:
        """Writes an environment map, [h, w, 3] linear radiance, and returns it as the file holds it, to render with. Its name is
        None for the light of the photos."""
        path = self.root / ("light.hdr" if name is None else f"{PREFIX}{name}.hdr")
        write_image(path, environment)
        return read_radiance(path)

    def mesh(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        """Writes the true mesh, vertices [n, 3] in the world of the cameras, triangles [m, 3]."""
        write_mesh_ply(self.root / "mesh.ply", trimesh.Trimesh(vertices, triangles, process=False))

    def view(self, split: str, index: int, pose: np.ndarray, maps: Maps, light_turn: np.ndarray | None = None) -> None:
        """Writes a photo, and the truth of test views.

        Args:
            split: "train" or "test".
            index: Number of the view in its split.
            pose: [4, 4] camera-to-world, OpenGL axes.
            maps: The maps of `AssetRenderer.render`: `radiance` and `alpha`; for test views also `albedo`, `roughness`,
                `metallic` and `smooth_normal`.
            light_turn: [3, 3] that of :class:`splitnerf.data.layouts.frame.Frame`, with layout `blender`.
        """
        image = self._image_path(split, index)
        write_image(image, straight_rgba(maps))
        height, width = maps["alpha"].shape
        if self.layout == "blender":
            entry = {"file_path": f"./{split}/{image.stem}", "transform_matrix": pose.tolist()}
            entry |= {} if light_turn is None else {"light_rotation": light_turn.tolist()}
        else:
            entry = {"cam_angle_x": self.camera_angle_x, "imw": width, "imh": height}
            entry |= {"cam_transform_mat": ",".join(map(repr, pose.ravel().tolist()))}
        self._views.setdefault(split, []).append((image, entry))
        if split == "test":
            self._write_truth(image, maps)

    def relit(self, index: int, name: str, maps: Maps) -> None:
        """Writes a test view under map `name`."""
        write_image(relit_path(self._image_path("test", index), name), straight_rgba(maps))

    def close(self) -> None:
        """Writes the poses, which complete the dataset."""
        for split, views in self._views.items():
            if self.layout == "blender":
                content = {"camera_angle_x": self.camera_angle_x, "frames": [entry for _, entry in views]}
                write_json(self.root / f"transforms_{split}.json", content)
                continue
            for image, entry in views:
                write_json(image.with_name(view_folders.METADATA), entry)

    def _image_path(self, split: str, index: int) -> Path:
        if self.layout == "blender":
            return self.root / split / f"r_{index:03d}.png"
        return self.root / f"{split}_{index:03d}" / view_folders.PHOTO

    def _write_truth(self, image: Path, maps: Maps) -> None:
        alpha, normal = maps["alpha"][..., None], maps["smooth_normal"]
        if self.layout != "blender":
            write_image(image.with_name("albedo.png"), np.concatenate([maps["albedo"], alpha], axis=-1))
            write_image(image.with_name("normal.png"), np.concatenate([0.5 * normal + 0.5, alpha], axis=-1))
            return
        albedo = np.concatenate([linear_to_srgb(maps["albedo"]), alpha], axis=-1)
        orm = np.stack([maps["alpha"] > 0, maps["roughness"], maps["metallic"], maps["alpha"]], axis=-1)
        write_image(image.with_name(f"{image.stem}_albedo.png"), albedo)
        write_image(image.with_name(f"{image.stem}_orm.png"), orm)
        # EXR stores colours associated with alpha.
        premultiplied = np.concatenate([normal * alpha, alpha], axis=-1)
        write_image(image.with_name(f"{image.stem}_normal.exr"), premultiplied, half=True)


def straight_rgba(maps: Maps) -> np.ndarray:
    """[H, W, 4] sRGB, straight alpha."""
    alpha = maps["alpha"][..., None]
    return np.concatenate([linear_to_srgb(maps["radiance"] / np.maximum(alpha, 1e-8)), alpha], axis=-1)
