"""Where rays of a mesh end, meshes that are refused, and occlusion_factors, whose closed forms stand in C++."""

import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import scene_of
from op_checks import check_error, generator, unit
from splitnerf.ops import MeshScene, occlusion_factors


def make_mesh() -> trimesh.Trimesh:
    """An icosphere beside a box."""
    sphere, box = trimesh.creation.icosphere(3), trimesh.creation.box((0.8, 1.2, 0.5))
    return trimesh.util.concatenate([sphere.apply_translation((-0.9, 0, 0)), box.apply_translation((0.9, 0.2, -0.1))])


@pytest.fixture(scope="module")
def scene() -> MeshScene:
    return scene_of(make_mesh())


def sample_inputs(n: int) -> tuple:
    """Arguments of ``occlusion_factors``: points on the unit sphere that the scene's sphere is."""
    normals = unit(torch.randn(n, 3, generator=generator(1)))
    lobes = unit(normals + 0.4 * unit(torch.randn(n, 3, generator=generator(2))))
    roughness, environment = (
        torch.rand(n, 1, generator=generator(3)) * 0.9 + 0.1,
        torch.rand(8, 16, 3, generator=generator(4)),
    )
    return normals + torch.tensor([-0.9, 0.0, 0.0]), normals, lobes, roughness, environment


# ---- rays ----


def test_visibility_ends_at_t_far(scene):
    origin, down = torch.tensor([[-0.9, 0.0, 5.0]]), torch.tensor([[0.0, 0.0, -1.0]])
    assert [scene.is_open(origin, down, t).item() for t in (3.9, 4.1, math.inf)] == [True, False, False]


def test_bad_meshes_raise():
    vertices, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]])
    for bad_vertices, bad_faces in (
        (vertices, faces + 1),
        (vertices, faces - 1),
        (vertices, faces + (1 << 32)),
        (vertices, faces[:0]),
        (vertices[:0], faces),
        (vertices * np.nan, faces),
        (vertices[:, :2], faces),
    ):
        with pytest.raises(ValueError):
            MeshScene(bad_vertices, bad_faces)


# ---- occlusion_factors ----


def test_seed_and_channels(scene):
    inputs = dict(zip(("positions", "normals", "lobe_dirs", "roughness", "environment"), sample_inputs(60)))
    first, again, other, colours = (
        occlusion_factors(scene, **inputs, seed=s, n_channels=c) for s, c in ((0, 1), (0, 1), (1, 1), (0, 3))
    )
    for a, b, c, each in zip(first, again, other, colours):
        assert torch.equal(a, b) and not torch.equal(a, c) and each.shape == (60, 3)
        torch.testing.assert_close(a, each.mean(1, keepdim=True))
    check_error(
        lambda: occlusion_factors(scene, **inputs, n_channels=2), "occlusion_factors", "n_channels", "1 or 3", "2"
    )
