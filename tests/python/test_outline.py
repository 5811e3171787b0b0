"""The fit of the outline: how coverage changes as vertices move, by finite differences, and meshes that are found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from painted_ball import PHOTO, photos, sky, textured

from splitnerf.ops import MeshScene
from splitnerf.refinement import outline
from splitnerf.refinement.contours import edges_of
from splitnerf.refinement.outline import fit_outline, outline_pixels, slopes, weld
from splitnerf.refinement.pixels import PixelFilter


def test_the_density_is_the_windows():
    t = np.linspace(-1.499, 1.499, 601)
    u = 2 * np.pi * (t / 3 + 0.5)
    window = 0.35875 - 0.48829 * np.cos(u) + 0.14128 * np.cos(2 * u) - 0.01168 * np.cos(3 * u)
    across = np.stack([t, np.full_like(t, 0.3)], axis=1)
    peak = PixelFilter().density(np.array([0.0, 0.3]))
    np.testing.assert_allclose(PixelFilter().density(across) / peak, window / window.max(), atol=0.003)
    grid = np.stack(np.meshgrid(*[np.arange(-1.6, 1.6, 0.02)] * 2), axis=-1)
    assert PixelFilter().density(grid).sum() * 0.02**2 == pytest.approx(1.0, abs=0.002)


def test_edges_join_two_triangles():
    box = trimesh.creation.box()
    edges = edges_of(np.asarray(box.faces))
    assert len(edges.ends) == 18  # 12 of the box and a diagonal of each side
    for (a, b), sides, opposite in zip(edges.ends, edges.triangles, edges.opposite):
        for side, third in zip(sides, opposite):
            assert sorted(box.faces[side]) == sorted([a, b, third])
    assert len(edges_of(np.asarray(box.faces)[:1]).ends) == 0  # what one triangle has alone is no contour's


@pytest.fixture(scope="module")
def pair():
    """A box before a ball, so that outlines end where they pass behind the other one, and its photos."""
    ball, box = trimesh.creation.icosphere(subdivisions=3, radius=0.6), trimesh.creation.box(extents=[0.5, 0.6, 0.7])
    box.apply_transform(trimesh.transformations.rotation_matrix(0.5, [1, 2, 3]))
    box.apply_translation([0.9, 0.1, 0.2])
    both = trimesh.util.concatenate([ball, box])
    asset = textured(both.vertices, both.faces)
    return asset, photos(asset, sky())


def test_slopes_of_the_coverage_are_its_differences(pair, monkeypatch):
    """By rays through both meshes, for moves that differ from vertex to vertex, and along the line of sight too."""
    asset, data = pair
    monkeypatch.setattr(outline, "RAYS", 16384)
    monkeypatch.setattr(outline, "BATCH", 50)
    first = data.images[..., 3].copy()
    first[2:] = 0.0  # two photos
    data = replace(data, images=np.concatenate([data.images[..., :3], first[..., None]], axis=-1))
    pixels, _ = outline_pixels(data)
    place = weld(asset.vertices)
    faces, vertices = place[asset.triangles], np.zeros((place.max() + 1, 3))
    vertices[place] = asset.vertices
    moves = 0.003 * np.sin(vertices[:, [1, 2, 0]] * [3, 2, 4] + [0, 1.5, 1])
    moves += 0.001 * np.random.default_rng(0).normal(size=moves.shape)

    def covered(vertices):
        scene = MeshScene(vertices.astype(np.float32), faces.astype(np.int32))
        return outline.coverage(scene, pixels, np.random.default_rng(1))

    found = covered(vertices + 0.5 * moves) - covered(vertices - 0.5 * moves)
    scene = MeshScene(vertices.astype(np.float32), faces.astype(np.int32))
    expected = slopes(vertices, faces, scene, pixels, (PHOTO, PHOTO)) @ moves.reshape(-1)
    assert np.abs(found).max() > 0.05 and np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(found)


@pytest.mark.parametrize("scale", [0.96, 1.04])
@pytest.mark.parametrize("hard", [False, True])
def test_a_balls_outline_is_found(ball, painted, scale, hard):
    """A ball that is too small or too large gets its size back, from masks with soft edges and without, and stays closed."""
    data = painted[1]
    if hard:
        alpha = (data.images[..., 3:] > 0.5).astype(np.float32)
        data = replace(data, images=np.concatenate([data.images[..., :3], alpha], -1))
    wrong = replace(ball, vertices=scale * ball.vertices)
    found, errors = fit_outline(data, wrong)
    radius = np.linalg.norm(found.vertices, axis=1)
    assert abs(radius.mean() - 1) < 0.15 * abs(scale - 1) and radius.std() < 0.01
    assert errors[-1] < 0.3 * errors[0]
    assert weld(found.vertices).max() == weld(ball.vertices).max()  # what was one vertex still is


def test_a_true_outline_stays(ball, painted):
    found, errors = fit_outline(painted[1], ball)
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < 0.01 and errors[-1] < 5e-3


def test_a_dented_outline_is_found(pair):
    """Vertices move along the surface too: a box's edges come back, and no triangle turns over."""
    asset, data = pair
    place = weld(asset.vertices)
    field = np.sin(5 * asset.vertices[:, [1, 2, 0]] + [0.0, 1.0, 2.0])
    found, errors = fit_outline(data, replace(asset, vertices=(asset.vertices + 0.012 * field).astype(np.float32)))
    assert errors[-1] < 0.2 * errors[0]
    normals = [np.cross(*np.diff(a.vertices[a.triangles], axis=1).transpose(1, 0, 2)) for a in (asset, found)]
    assert (normals[0] * normals[1]).sum(axis=1).min() > 0 and weld(found.vertices).max() == place.max()
