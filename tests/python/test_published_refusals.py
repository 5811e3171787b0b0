"""The protocols of published sets on data of other forms than the set's."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from painted_ball import bare
from splitnerf.data.asset import Material
from splitnerf.data.images import write_image
from splitnerf.errors import InputError
from splitnerf.evaluate.published import views
from splitnerf.evaluate.published.common import Delivered, Options

SIDE = 16


def picture() -> np.ndarray:
    return np.random.default_rng(0).uniform(0.05, 0.9, (SIDE, SIDE, 3)).astype(np.float32)


def transforms(folder, names: dict[str, list], **changes):
    for file, images in names.items():
        frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} | changes for name in images]
        (folder / file).write_text(json.dumps({"camera_angle_x": 0.7, "frames": frames}))


def test_photos_of_the_training_are_not_held_out(tmp_path):
    write_image(tmp_path / "a.png", np.dstack([picture(), np.ones((SIDE, SIDE))]))
    transforms(tmp_path, {"transforms.json": ["a.png"]})
    with pytest.raises(InputError, match="lists no test views; give a folder with transforms_test.json"):
        views.shiny(None, tmp_path, Options())


@pytest.mark.parametrize("changes", [{"k1": 0.1}, {"mask_path": "a.png"}, {"exposure": 2.0}, None])
def test_photos_of_another_form_are_refused(changes, tmp_path):
    photo = picture() if changes is None else np.dstack([picture(), np.ones((SIDE, SIDE))])
    write_image(tmp_path / "a.png", photo)
    transforms(tmp_path, {"transforms_train.json": ["a.png"], "transforms_test.json": ["a.png"]}, **(changes or {}))
    with pytest.raises(InputError, match="needs an alpha" if changes is None else "distortion, a mask or a curve"):
        views.shiny(None, tmp_path, Options())


def test_colours_of_vertices_take_the_factor():
    """Materials cannot: their factors end at 1."""
    asset = bare(trimesh.Trimesh(np.eye(3), [[0, 1, 2]]))
    asset = replace(asset, colors=np.float32([[0.2, 0.4, 0.8]] * 3), materials=[Material()])
    scaled = Delivered(asset, None, np.zeros(3), 1).with_albedo(np.array([1.5, 2.0, 0.5])).asset
    assert scaled.colors[0] == pytest.approx([0.3, 0.8, 0.4]) and scaled.materials == asset.materials
