"""The protocols of published sets: closed forms of their formulas."""

import numpy as np
import pytest
import trimesh
from painted_ball import bare
from splitnerf.data.asset import Material
from splitnerf.data.layouts.frame import Frame
from splitnerf.errors import InputError
from splitnerf.evaluate.published import views
from splitnerf.evaluate.published.common import Delivered, LitView
from splitnerf.evaluate.published.views import FolderTruth

SIDE = 24
RANDOM = np.random.default_rng(5)


def picture(most: float = 0.9) -> np.ndarray:
    return RANDOM.uniform(0.05, most, (SIDE, SIDE, 3))


def box(low: int, high: int) -> np.ndarray:
    mask = np.zeros((SIDE, SIDE))
    mask[low:high, low:high] = 1
    return mask


def test_nerfactor_scale_is_of_least_squares_on_opaque_pixels():
    truth, alpha = picture(), np.where(box(4, 20) > 0, 1.0, 0.85)
    ours = np.where(alpha[..., None] > 0.9, truth / [2.0, 0.5, 1.25], 9.0)
    assert views.opaque_scale({"albedo": ours}, FolderTruth(None, alpha, truth, None)) == pytest.approx(
        [2.0, 0.5, 1.25]
    )


def test_nerfactor_takes_four_views_of_the_test():
    def view(number: int) -> LitView:
        return LitView(Frame(f"test_{number:03d}", None, np.eye(4), {}), "city", None)

    names = [v.frame.name for v in views.chosen([view(i) for i in range(200)], None)]
    assert names == ["test_049", "test_099", "test_149", "test_199"]
    with pytest.raises(InputError, match="none of the test views 49, 99, 149, 199"):
        views.chosen([view(3)], None)


def test_shiny_normals_are_weighted():
    up, side = (np.broadcast_to(np.array(n, float), (2, 2, 3)) for n in ((0, 0, 1), (0, 1, 0)))
    mixed = np.where(np.array([[[True], [False]], [[False], [False]]]), side, up)
    maps, truth = {"normal": mixed, "alpha": np.array([[3.0, 1], [0, 2]])}, FolderTruth(None, np.ones((2, 2)), None, up)
    assert views.weighted_angle(maps, truth) == pytest.approx(45)
    assert views.weighted_angle(maps | {"alpha": np.zeros((2, 2))}, truth) is None


def test_albedo_is_scaled_before_relighting():
    texture = np.full((2, 2, 3), 0.4, np.float32)
    materials = Material(albedo=(0.2, 0.4, 0.8)), Material(albedo=(0.5, 1, 1), albedo_texture=texture)
    asset = bare(trimesh.Trimesh(np.eye(3), [[0, 1, 2]]), *materials)
    plain, textured = Delivered(asset, None, np.zeros(3), 1).with_albedo(np.array([2.0, 0.5, 3.0])).asset.materials
    assert plain.albedo == pytest.approx((0.4, 0.2, 1.0))
    assert textured.albedo == (1, 1, 1) and textured.albedo_texture[0, 0] == pytest.approx([0.4, 0.2, 1.0])
