"""The protocols of published sets on data that are not the set's: empty masks, other forms, truth that lies elsewhere."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from painted_ball import bare
from splitnerf.data.asset import Material
from splitnerf.data.images import write_image
from splitnerf.data.layouts.frame import Frame
from splitnerf.errors import InputError
from splitnerf.evaluate.published import views
from splitnerf.evaluate.published.common import Delivered, Options

SIDE = 16
LIGHT = np.ones((4, 8, 3), np.float32)


class Painted:
    """An asset whose pictures are given by the test."""

    environment = LIGHT
    asset = bare(trimesh.Trimesh(np.eye(3), [[0, 1, 2]]))
    vertices = 10 * np.eye(3)

    def __init__(self, image: np.ndarray):
        self.image, self.lights = image, []

    def render(self, frame: Frame, light: np.ndarray, factor: int = 1) -> dict:
        self.lights.append(light)
        return {"radiance": self.image, "alpha": np.ones(self.image.shape[:2]), "normal": self.image}


def picture(seed: int = 0, most: float = 0.9) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.05, most, (SIDE, SIDE, 3)).astype(np.float32)


def transforms(folder, names: dict[str, list], **changes):
    for file, images in names.items():
        frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} | changes for name in images]
        (folder / file).write_text(json.dumps({"camera_angle_x": 0.7, "frames": frames}))


def test_photos_of_the_training_are_not_held_out(tmp_path):
    write_image(tmp_path / "a.png", np.dstack([picture(), np.ones((SIDE, SIDE))]))
    transforms(tmp_path, {"transforms.json": ["a.png"]})
    with pytest.raises(InputError, match="lists no test views; give a folder with transforms_test.json"):
        views.shiny(Painted(picture()), tmp_path, Options())


@pytest.mark.parametrize("changes", [{"k1": 0.1}, {"mask_path": "a.png"}, {"exposure": 2.0}, None])
def test_photos_of_another_form_are_refused(changes, tmp_path):
    photo = picture() if changes is None else np.dstack([picture(), np.ones((SIDE, SIDE))])
    write_image(tmp_path / "a.png", photo)
    transforms(tmp_path, {"transforms_train.json": ["a.png"], "transforms_test.json": ["a.png"]}, **(changes or {}))
    with pytest.raises(InputError, match="needs an alpha" if changes is None else "distortion, a mask or a curve"):
        views.shiny(Painted(picture()), tmp_path, Options())


def test_colours_of_vertices_take_the_factor():
    """Materials cannot: their factors end at 1."""
    asset = replace(Painted.asset, colors=np.float32([[0.2, 0.4, 0.8]] * 3), materials=[Material()])
    scaled = Delivered(asset, None, np.zeros(3), 1).with_albedo(np.array([1.5, 2.0, 0.5])).asset
    assert scaled.colors[0] == pytest.approx([0.3, 0.8, 0.4]) and scaled.materials == asset.materials
