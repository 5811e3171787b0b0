"""What an asset's evaluation asks of its renderer and what it makes of the answer; what the sheet of pictures shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from painted_ball import bare
from splitnerf.data.asset import Material
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, read_image, srgb_to_linear, write_image
from splitnerf.evaluate.scoring import (
    Protocol,
    asset_predictions,
    evaluate_asset,
    evaluation_path,
    is_asset,
    relight,
    relight_scores,
)
from splitnerf.export.writers import write_glb

HEIGHT, WIDTH = 12, 16
TILTED = np.float32([0.6, 0, 0.8])


class Answers:
    """A renderer that notes what it is asked and answers with constants, brighter under brighter light."""

    def __init__(self):
        self.asked = []

    def render(self, environment, pose, lens, width, height, *, spp, seed):
        self.asked.append((environment.mean(), pose, lens, width, height, spp, seed))

        def constant(*values):
            return np.broadcast_to(np.float32(values), (height, width, len(values)))

        level = 0.1 * environment.mean() + 0.05 * (len(self.asked) - 1)
        return {
            "radiance": constant(0.5 * level, 0.25 * level, 2.0),
            "alpha": constant(0.5)[..., 0],
            "albedo": constant(0.1, 0.2, 0.3),
            "roughness": constant(0.4)[..., 0],
            "metallic": constant(0.7)[..., 0],
            "normal": constant(0, 0, 1),
            "smooth_normal": 0.5 * constant(*TILTED),
        }


@pytest.fixture
def views(tmp_path) -> Dataset:
    """Three test views of their own poses and lenses, in a frame half as large as the world, each under two lights."""
    paths = [tmp_path / f"test/r_{i}.png" for i in range(3)]
    images = np.full((3, HEIGHT, WIDTH, 4), 0.5, np.float32)
    for i, path in enumerate(paths):
        write_image(path, images[i])
        for name, level in (("day", 0.3), ("night", 0.1)):
            write_image(path.with_name(f"r_{i}_relit_{name}.png"), np.full((HEIGHT, WIDTH, 4), level + 0.2 * i))
    for name, level in (("day", 4.0), ("night", 1.0)):
        write_image(tmp_path / f"relight_{name}.exr", np.full((4, 8, 3), level))
    poses = np.tile(np.eye(4, dtype=np.float32), (3, 1, 1))
    poses[:, :3, 3] = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    lenses = np.float32([[10, 11, 8, 6], [12, 13, 7, 5], [14, 15, 9, 4]])
    return Dataset(
        "toy", tmp_path, "test", 1, images, poses, lenses, [p.stem for p in paths], paths, np.diag([0.5, 0.5, 0.5, 1.0])
    )


def maps_of(views: Dataset) -> dict[str, Path]:
    return {name: views.root / f"relight_{name}.exr" for name in ("day", "night")}


def test_an_assets_maps_are_those_of_each_view(views):
    """Seen in the world, by each view's lens, with noise of its own; normals are those of the mesh, of length one."""
    renderer = Answers()
    predictions = asset_predictions(renderer, views, np.full((2, 4, 3), 8.0, np.float32), spp=5)
    for i, (light, pose, lens, width, height, spp, seed) in enumerate(renderer.asked):
        np.testing.assert_allclose(pose[:3, 3], 2 * views.poses[i, :3, 3])
        assert lens == tuple(views.intrinsics[i]) and (light, width, height, spp) == (8.0, WIDTH, HEIGHT, 5)
    seeds = {asked[-1] for asked in renderer.asked}
    assert len(seeds) == len(predictions) == 3 and min(seeds) >= 2**31
    prediction = predictions[0]
    assert prediction["normal"][3, 4] == pytest.approx(TILTED) and prediction["rgb"][3, 4] == pytest.approx(
        linear_to_srgb(np.float32([0.8, 0.4, 1]))
    )
    known = {"alpha": 0.5, "albedo": [0.1, 0.2, 0.3], "roughness": 0.4, "metallic": 0.7}
    assert all(prediction[name][3, 4] == pytest.approx(value) for name, value in known.items())
    assert "rgb" not in asset_predictions(Answers(), views, None, spp=1)[0]


def test_relit_views_stand_beside_their_truth(views):
    """By map and view, under that map's light, in 8 bit with the coverage; both in linear light once they are compared."""
    relit = relight(Answers(), views, maps_of(views), spp=3)
    expected = {"day": [0.4, 0.45, 0.5], "night": [0.25, 0.3, 0.35]}
    for name, levels in expected.items():
        for i, level in enumerate(levels):
            found = relit.view(name, i)
            assert found.group == name and found.prediction[0, 0] == pytest.approx([level, level / 2, 1], abs=0.005)
            assert found.alpha[0, 0] == pytest.approx(0.5, abs=0.002)
            true = {"day": 0.3, "night": 0.1}[name] + 0.2 * i
            assert found.truth[0, 0] == pytest.approx(srgb_to_linear(np.float32([true] * 3)), abs=0.003)
            assert found.truth_alpha[0, 0] == pytest.approx(true, abs=0.002)
    asked = []
    scores = relight_scores(relit, lambda image, truth: asked.append(1) or 0.5)
    assert scores["spp"] == 3 and scores["views"] == 3 and scores["lpips"] == 0.5 and len(asked) == 6


def test_truth_that_is_missing_is_named_before_anything_is_rendered(views):
    views.image_paths[2].with_name("r_2_relit_night.png").unlink()
    renderer = Answers()
    with pytest.raises(Exception, match="r_2_relit_night.png: no such image"):
        relight(renderer, views, maps_of(views), spp=3)
    assert not renderer.asked


def test_an_asset_is_scored_by_the_test_views_with_the_light_beside_it(data_with_mesh, tmp_path):
    """The demo's true ball: where it is, and by what light; the train views are others."""
    data = data_with_mesh
    mesh = trimesh.load(data / "mesh.ply", process=False)
    assert len(mesh.vertices) > 100
    path = tmp_path / "ball.glb"
    write_glb(path, bare(mesh, Material("grey", (0.5, 0.5, 0.5), 0.5)))
    plain = evaluate_asset(path, data, Protocol(spp=1, views=1))
    assert (
        plain.dataset.split == "test"
        and len(plain.predictions) == 1
        and plain.scores["novel_view"] is plain.scores["light_psnr"] is None
    )
    assert plain.scores["chamfer"] < 0.02 and plain.scores["f_score"] > 0.9
    light = read_image(data / "light.hdr")
    write_image(tmp_path / "environment.exr", light)
    write_image(tmp_path / "environment.hdr", np.ones_like(light))
    beside = evaluate_asset(path, data, Protocol(spp=2, downscale=2))
    assert beside.scores["light_psnr"] > 50 and beside.scores["novel_view"] and beside.scores["views"] == 2
    assert beside.dataset.images.shape[1:3] == (12, 12)
    assert evaluate_asset(path, data, Protocol(spp=1, views=1), tmp_path / "environment.hdr").scores["light_psnr"] < 40


def test_scores_of_a_file_lie_beside_it():
    assert evaluation_path(Path("a/chair.glb")) == Path("a/chair_evaluation.json")
    assert evaluation_path(Path("a/run")) == Path("a/run/evaluation.json")
    assert is_asset(Path("a.GLB")) and is_asset(Path("a.gltf")) and not is_asset(Path("a.obj"))
