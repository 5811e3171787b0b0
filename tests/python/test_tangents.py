"""Tangents against closed forms: a plane, a mirrored one, and a sphere's circles of latitude."""

from __future__ import annotations

import numpy as np
import pytest
from splitnerf.data.asset import vertex_tangents

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UP = np.tile([0.0, 0.0, 1.0], (4, 1))


def test_bitangent_points_up_in_the_texture():
    """u along +x and, v counting downward, the texture's up along +y: an unmirrored frame."""
    tangents = vertex_tangents(QUAD, FACES, UP, np.array([[0, 1], [1, 1], [1, 0], [0, 0]]))
    assert tangents.dtype == np.float32
    assert tangents == pytest.approx(np.tile([1, 0, 0, 1], (4, 1)), abs=1e-6)


@pytest.mark.parametrize(
    ("uv", "tangent", "sign"),
    [
        ([[0, 0], [1, 0], [1, 1], [0, 1]], [1, 0, 0], -1),  # v grows along +y: up is -y = -cross(z, x)
        ([[1, 1], [0, 1], [0, 0], [1, 0]], [-1, 0, 0], -1),  # u mirrored, up is +y = -cross(z, -x)
        ([[1, 1], [1, 0], [0, 0], [0, 1]], [0, -1, 0], 1),  # u along -y, up +x = cross(z, -y)
    ],
)
def test_mirrored_and_turned_textures(uv, tangent, sign):
    tangents = vertex_tangents(QUAD, FACES, UP, np.array(uv, float))
    assert tangents == pytest.approx(np.tile([*tangent, sign], (4, 1)), abs=1e-6)


def test_sphere_has_its_circles_of_latitude():
    """u the longitude, v the colatitude: the tangent is d position / d longitude, the bitangent points north."""
    rows, columns = 41, 80
    theta, phi = np.meshgrid(np.linspace(0.3, np.pi - 0.3, rows), np.linspace(0, 6, columns), indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    faces = np.concatenate([np.stack([a, a + columns, a + columns + 1], 1), np.stack([a, a + columns + 1, a + 1], 1)])
    tangents = vertex_tangents(points, faces, points, np.stack([phi / 6, theta / np.pi], -1).reshape(-1, 2))
    expected = np.stack([-np.sin(phi), np.cos(phi), 0 * phi], -1).reshape(-1, 3)
    inner = ((theta > 0.35) & (theta < 2.8) & (phi > 0.1) & (phi < 5.9)).reshape(-1)
    assert np.abs(tangents[inner, :3] - expected[inner]).max() < 0.01
    assert (tangents[:, 3] == 1).all()
    assert np.abs((tangents[:, :3] * points).sum(axis=1)).max() < 1e-6
    assert np.linalg.norm(tangents[:, :3], axis=1) == pytest.approx(1, abs=1e-6)


def test_corners_weigh_by_their_angle():
    """Two triangles about vertex 0 in one plane, 90 and 30 degrees, whose u run along +x and +y."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-s, c, 0]])
    uv = np.array([[0, 0], [1, 0], [0, -1], [-1, -1]], float)
    tangents = vertex_tangents(vertices, np.array([[0, 1, 2], [0, 2, 3]]), UP, uv)
    # d position / d u of the second: p = a e1 + b e2 with uv = a (0, -1) + b (-1, -1), so u = -b and v = -a - b
    second = np.array([0, 1, 0]) - np.array([-s, c, 0])
    expected = np.pi / 2 * np.array([1, 0, 0]) + np.pi / 6 * second / np.linalg.norm(second)
    assert tangents[0, :3] == pytest.approx(expected / np.linalg.norm(expected), abs=1e-6)


def test_no_texture_area_still_gives_a_frame():
    tangents = vertex_tangents(QUAD, FACES, UP, np.zeros((4, 2)))
    assert np.isfinite(tangents).all()
    assert (tangents[:, 2] == 0).all() and np.linalg.norm(tangents[:, :3], axis=1) == pytest.approx(1)
