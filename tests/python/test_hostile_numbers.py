"""Numbers that would end the process: those of the tracer. They are refused, or meet nothing."""

import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import scene_of
from splitnerf.fields.occlusion import bit_counts
from splitnerf.ops import MeshScene, occlusion_factors
from splitnerf.ops._library import lib

BAD = [math.nan, math.inf, -math.inf, 1e19, 3e38]
DOWN, ABOVE = torch.tensor([0.0, 0.0, -1.0]), torch.tensor([0.0, 0.0, 3.0])


@pytest.fixture(scope="module")
def ball() -> MeshScene:
    return scene_of(trimesh.creation.icosphere(subdivisions=2))


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e13, 1e18, 3e38])
def test_vertices_out_of_reach_are_refused(value):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, value, 0]], np.float32)
    with pytest.raises(ValueError, match="Scene: vertex 2 is not finite, or farther than 1e12"):
        MeshScene(vertices, np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("n_vertices", "columns", "faces"),
    [
        (3, 3, [[1, 2, 3]]),
        (3, 3, [[-1, 0, 1]]),
        (3, 3, [[1 << 32, 1, 2]]),
        (3, 3, []),
        (0, 3, [[0, 1, 2]]),
        (3, 2, [[0, 1, 2]]),
    ],
)
def test_meshes_that_are_none_are_refused(n_vertices, columns, faces):
    with pytest.raises(ValueError):
        MeshScene(np.eye(3, dtype=np.float32)[:n_vertices, :columns], np.reshape(faces, (-1, 3)).astype(np.int64))
    with pytest.raises(TypeError, match="faces must be integers, got float64"):
        MeshScene(np.eye(3), np.array([[0, 1, 1.7]]))


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("which", ["origin", "direction"])
def test_rays_that_are_none_meet_nothing_and_their_neighbours_what_they_met(ball, value, which):
    """In a packet of 16 with others, alone, and in the last packet."""
    origins, directions = ABOVE.repeat(35, 1), DOWN.repeat(35, 1)
    bad = torch.zeros(35, dtype=torch.bool)
    bad[[0, 7, 16, 34]] = True
    (origins if which == "origin" else directions)[bad, 1] = value
    assert torch.equal(ball.is_open(origins, directions), bad)
    triangles, _, _ = ball.trace_closest(origins.numpy(), directions.numpy())
    assert np.array_equal(triangles < 0, bad.numpy())


LENGTHS = {math.nan: False, -1.0: False, -math.inf: False, math.inf: True, 3e38: True, 1.9: False, 2.1: True}


@pytest.mark.parametrize(("t_far", "meets"), LENGTHS.items())
def test_rays_end_at_their_length_and_lengths_that_are_none_meet_nothing(ball, t_far, meets):
    """The ball begins at 2."""
    assert bool(ball.is_open(ABOVE[None], DOWN[None], t_far)) != meets


@pytest.mark.parametrize("value", BAD)
def test_points_that_are_none_leave_the_factors_of_others_alone(ball, value):
    normals = torch.nn.functional.normalize(torch.randn(20, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    inputs = {name: 1.0 * normals for name in ("positions", "normals", "lobe_dirs")}
    light = {"roughness": torch.full((20, 1), 0.5), "environment": torch.ones(4, 8, 3)}
    good = occlusion_factors(ball, **inputs, **light, n_diffuse_rays=16, n_specular_rays=16, offset=0.01, seed=1)
    for name in inputs:
        changed = {key: part.clone() for key, part in inputs.items()}
        changed[name][4, 0] = value
        found = occlusion_factors(ball, **changed, **light, n_diffuse_rays=16, n_specular_rays=16, offset=0.01, seed=1)
        others = torch.arange(20) != 4
        assert all(torch.equal(a[others], b[others]) for a, b in zip(good, found))
    if math.isfinite(value):
        far = occlusion_factors(ball, **inputs, **light, n_diffuse_rays=16, n_specular_rays=16, offset=value, seed=1)
        assert all((part > 0.999).all() for part in far)  # nothing is met from there


@pytest.mark.parametrize("value", BAD)
def test_bits_of_points_that_are_none(ball, value):
    """They are open wherever they count; those of others are as they were."""
    normals = torch.nn.functional.normalize(torch.randn(20, 3, generator=torch.Generator().manual_seed(0)), dim=1)
    directions = torch.nn.functional.normalize(torch.randn(64, 3, generator=torch.Generator().manual_seed(1)), dim=1)
    good, hits = lib.visibility_bits(ball.handle, 0.5 * normals, normals, directions, 0.01, True)
    points = 0.5 * normals
    points[4, 0] = value
    found, their_hits = lib.visibility_bits(ball.handle, points, normals, directions, 0.01, True)
    others = torch.arange(20) != 4
    assert torch.equal(good[others], found[others]) and torch.equal(hits[others], their_hits[others])
    assert bit_counts(found[4:5, 1]) == 0 and (their_hits[4] < 0).all() and bit_counts(good[4:5, 1]) > 0
