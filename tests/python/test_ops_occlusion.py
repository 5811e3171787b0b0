"""Rays of a mesh and occlusion_factors, with trimesh and embreex as the independent oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
import trimesh
from op_checks import check_error, check_no_gradient, check_op, devices, generator, lib, unit

from splitnerf.ops import MeshScene, occlusion_factors

DEVICES = devices("occlusion_factors")


def make_mesh() -> trimesh.Trimesh:
    """An icosphere beside a box."""
    sphere, box = trimesh.creation.icosphere(3), trimesh.creation.box((0.8, 1.2, 0.5))
    return trimesh.util.concatenate([sphere.apply_translation((-0.9, 0, 0)), box.apply_translation((0.9, 0.2, -0.1))])


def make_scene(mesh: trimesh.Trimesh) -> MeshScene:
    return MeshScene(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def embreex_oracle(mesh: trimesh.Trimesh):
    pytest.importorskip("embreex", reason="embreex, the oracle, has no wheel for this processor")
    return trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)


@pytest.fixture(scope="module")
def scene() -> MeshScene:
    return make_scene(make_mesh())


def ray_inputs(device, n: int = 3000) -> tuple[torch.Tensor, torch.Tensor]:
    draw = generator()
    origins = torch.randn(n, 3, generator=draw) * 1.5
    return origins.to(device), unit(torch.randn(n, 3, generator=draw)).to(device)


def sample_inputs(device, dtype, n: int = 8) -> tuple:
    """Arguments of ``occlusion_factors``: points on the unit sphere that the scene's sphere is."""
    normals = unit(torch.randn(n, 3, generator=generator(1), dtype=torch.float64))
    lobes = unit(normals + 0.4 * unit(torch.randn(n, 3, generator=generator(2), dtype=torch.float64)))
    positions = normals + torch.tensor([-0.9, 0.0, 0.0])
    roughness = torch.rand(n, 1, generator=generator(3), dtype=torch.float64) * 0.9 + 0.1
    environment = torch.rand(8, 16, 3, generator=generator(4), dtype=torch.float64)
    return tuple(x.to(device, dtype) for x in (positions, normals, lobes, roughness, environment))


# ---- rays ----


def test_visibility_agrees_with_embreex(scene):
    origins, directions = ray_inputs("cpu")
    blocked = embreex_oracle(make_mesh()).intersects_any(origins.numpy(), directions.numpy())
    visible = scene.is_open(origins, directions).numpy()
    assert visible.dtype == np.bool_ and 0.2 < visible.mean() < 0.9
    assert (visible == ~blocked).mean() > 0.999  # rays through an edge may go either way


def test_visibility_ends_at_t_far(scene):
    origin, down = torch.tensor([[-0.9, 0.0, 5.0]]), torch.tensor([[0.0, 0.0, -1.0]])
    assert [scene.is_open(origin, down, t).item() for t in (3.9, 4.1, math.inf)] == [True, False, False]


def test_a_released_scene_raises():
    scene = make_scene(trimesh.creation.box())
    handle = scene.handle
    arguments = *sample_inputs("cpu", torch.float32), 16, 16, 0.0125, False, 3
    lib.occlusion_factors(handle, *arguments)
    del scene
    with pytest.raises(IndexError, match=str(handle)):
        lib.occlusion_factors(handle, *arguments)


def test_bad_meshes_raise():
    vertices, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]])
    for bad_vertices, bad_faces in (
        (vertices, faces + 1),
        (vertices, faces[:0]),
        (vertices * np.nan, faces),
        (vertices[:, :2], faces),
    ):
        with pytest.raises(ValueError):
            MeshScene(bad_vertices, bad_faces)


# ---- occlusion_factors ----


def test_occlusion_agrees_with_rays_of_embreex():
    """The same integral by 4096 independent cosine rays a point, traced by embreex."""
    mesh = make_mesh()
    positions, normals, lobes, roughness, _ = sample_inputs("cpu", torch.float32, 12)
    white = torch.ones(4, 8, 3)
    got, _ = occlusion_factors(
        make_scene(mesh), positions, normals, lobes, roughness, white, n_diffuse_rays=4096, n_specular_rays=1
    )
    rng = np.random.default_rng(0)
    oracle = embreex_oracle(mesh)
    for x, n, o in zip(positions.numpy(), normals.numpy(), got[:, 0].numpy()):
        ball = rng.normal(size=(4096, 3))
        directions = n + ball / np.linalg.norm(ball, axis=1, keepdims=True)  # cosine-weighted
        blocked = oracle.intersects_any(np.repeat((x + 0.0125 * n)[None], 4096, 0), directions)
        assert abs(o - (1 - blocked.mean())) < 0.03


@pytest.mark.parametrize("device", DEVICES)
def test_lone_sphere_is_open(device):
    sphere = trimesh.creation.icosphere(4)
    normals = torch.tensor(np.asarray(sphere.vertices[::20]), dtype=torch.float32, device=device)
    roughness = torch.full_like(normals[:, :1], 0.4)
    environment = torch.rand(8, 16, 3, generator=generator()).to(device)
    for factor in occlusion_factors(make_scene(sphere), normals, normals, normals, roughness, environment):
        assert factor.shape == (len(normals), 1) and (factor == 1).all()


@pytest.mark.parametrize("device", DEVICES)
def test_under_a_sphere(device):
    """Half angle 30 degrees straight above: 1 - sin^2 = 3/4."""
    sphere = trimesh.creation.icosphere(5).apply_translation((0, 0, 2 + 0.0125))
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, device=device)
    rough = torch.ones_like(up[:, :1])
    for light in (1.0, 0.0):  # black light falls back to geometry
        environment = torch.full((4, 8, 3), light, dtype=torch.float64, device=device)
        o_d, o_s = occlusion_factors(
            make_scene(sphere),
            0 * up,
            up,
            up,
            rough,
            environment,
            n_diffuse_rays=8192,
            n_specular_rays=8192,
            n_channels=3,
        )
        assert o_d.shape == (1, 3)
        torch.testing.assert_close(o_d, torch.full_like(o_d, 0.75), rtol=0, atol=3e-3)
        torch.testing.assert_close(o_s, torch.full_like(o_s, 0.75), rtol=0, atol=3e-3)


@pytest.mark.parametrize("device", DEVICES)
def test_occlusion_opcheck_precision_and_gradients(device, scene):
    numbers = (16, 16, 0.0125, False, 3)
    for dtype in (torch.float32, torch.float64):
        check_op(lib.occlusion_factors, (scene.handle, *sample_inputs(device, dtype), *numbers))
    single, double = (
        lib.occlusion_factors(scene.handle, *sample_inputs(device, t, 100), 64, 64, 0.0125, False, 3)
        for t in (torch.float32, torch.float64)
    )
    for a, b in zip(single, double):
        assert (a.double() - b).abs().mean() < 1e-3  # single rays at an edge may go either way
        assert (b >= 0).all() and (b <= 1).all()
    for index in range(1, 6):
        check_no_gradient(lib.occlusion_factors, (scene.handle, *sample_inputs(device, torch.float32), *numbers), index)
    assert all(
        x.shape == (0, 3)
        for x in lib.occlusion_factors(scene.handle, *sample_inputs(device, torch.float32, 0), *numbers)
    )


@pytest.mark.parametrize("device", DEVICES)
def test_occlusion_seed_and_errors(device, scene):
    inputs = sample_inputs(device, torch.float32, 60)
    first, again, other = (occlusion_factors(scene, *inputs, seed=s)[0] for s in (0, 0, 1))
    assert torch.equal(first, again) and not torch.equal(first, other)
    positions, normals, lobes, roughness, environment = inputs
    check_error(
        lambda: occlusion_factors(scene, positions, normals[1:], lobes, roughness, environment),
        "occlusion_factors",
        "normals",
        "[60, 3]",
        "[59, 3]",
    )
    check_error(
        lambda: occlusion_factors(scene, positions, normals, lobes, roughness, environment[0]),
        "environment",
        "[n, n, 3]",
        "[16, 3]",
    )
    check_error(
        lambda: occlusion_factors(scene, positions, normals, lobes, roughness, environment[:0]),
        "environment",
        "at least one texel",
    )
    check_error(lambda: occlusion_factors(scene, *inputs, n_diffuse_rays=0), "n_diffuse_rays", "[1, 2^20]")
    check_error(
        lambda: occlusion_factors(scene, *inputs, n_channels=2), "occlusion_factors", "n_channels", "1 or 3", "2"
    )


def test_rays_that_start_along_themselves():
    """Under a plane at .02, offset .05: from off the surface all is open; along the ray only what has left the plane
    behind, cos > .4, which is 1 - .4^2 of the cosine-weighted sky."""
    plane = trimesh.Trimesh([[-9, -9, 0.02], [9, -9, 0.02], [9, 9, 0.02], [-9, 9, 0.02]], [[0, 1, 2], [0, 2, 3]])
    up, white = torch.tensor([[0.0, 0.0, 1.0]]), torch.ones(4, 8, 3)
    for along_ray, expected in ((False, 1.0), (True, 0.84)):
        o_d, _ = occlusion_factors(
            make_scene(plane),
            0 * up,
            up,
            up,
            torch.ones(1, 1),
            white,
            n_diffuse_rays=4096,
            offset=0.05,
            along_ray=along_ray,
        )
        assert o_d.item() == pytest.approx(expected, abs=0.01)
