"""Visibility bits cached on a mesh: against rays, a closed form of occlusion, and the furnace of a bowl."""

import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import OFFSET, bowl, cache_of, corners, grid_mesh, lattice, scene_of
from op_cases import cached_occlusion_inputs
from op_checks import lib
from splitnerf import _core
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, visibility_bits

UP = torch.tensor([[0.0, 0.0, 1.0]])


def read(cache: VisibilityCache, x: torch.Tensor, n: torch.Tensor, *, light=None, radiance=None):
    """cached_occlusion at roughness 1 with the lobe about the normal."""
    light = torch.ones_like(cache.directions) if light is None else light
    return cached_occlusion(cache, x, n, lobe_dirs=n, roughness=torch.ones(len(x), 1), light=light, radiance=radiance)


def test_bits_and_hits_are_those_of_single_rays():
    sphere, box = trimesh.creation.icosphere(2), trimesh.creation.box((0.8, 1.2, 0.5))
    mesh = trimesh.util.concatenate([sphere.apply_translation((-0.9, 0, 0)), box.apply_translation((0.6, 0.2, -0.1))])
    scene, (x, n), w = scene_of(mesh), corners(mesh), lattice(96)
    bits, hits = visibility_bits(scene, x, n, w, OFFSET, with_hits=True)
    assert bits.shape == (len(x), 2, 3) and hits.shape == (len(x), 96)
    open_, blocked = (
        ((bits[..., None] >> torch.arange(32, dtype=torch.int32)) & 1).bool().reshape(len(x), 2, 96).unbind(1)
    )
    origins = (x + OFFSET * n)[:, None].expand(-1, 96, 3)
    expected = scene.is_open(origins.reshape(-1, 3), w.repeat(len(x), 1)).view(len(x), 96)
    above = n @ w.T > 0
    assert torch.equal(open_, expected & above) and torch.equal(blocked, ~expected & above)
    assert torch.equal(hits >= 0, blocked) and 0.02 < blocked[above].float().mean() < 0.9
    assert torch.equal(visibility_bits(scene, x, n, w, OFFSET)[0], bits)

    single = _core.Scene(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32))
    triangle, u, v = single.trace_closest(origins.reshape(-1, 3).numpy(), w.repeat(len(x), 1).numpy())
    blocked = blocked.reshape(-1)
    weights = np.stack([1 - u - v, u, v], axis=1)[blocked]
    heaviest = np.asarray(mesh.faces)[triangle[blocked], weights.argmax(1)]
    assert np.array_equal(hits.reshape(-1)[blocked].numpy(), heaviest)


@pytest.mark.parametrize("height", [1.3, 2.0, 3.0])
def test_under_a_sphere(height):
    """A unit sphere straight above hides sin^2 of its half angle of the cosine-weighted hemisphere."""
    ball = trimesh.creation.icosphere(4).apply_translation((0, 0, height))
    cache = cache_of(trimesh.util.concatenate([grid_mesh(0.4, 4), ball]), 1024)
    for light in (None, torch.zeros(1024, 3)):  # black light falls back to geometry
        o_d, o_s, _, _ = read(cache, 0 * UP, UP, light=light)
        assert o_d.shape == (1, 3)
        expected = 1 - 1 / (height - OFFSET) ** 2
        assert abs(o_d[0, 0].item() - expected) < 0.01
        torch.testing.assert_close(o_s, o_d, rtol=0, atol=1e-5)  # the lobe of roughness 1 about n is the cosine's


@pytest.mark.parametrize("albedo", [0.3, 0.8, 1.0])
def test_the_furnace_of_a_bowl(albedo):
    """Each point of half a spherical shell sees as much shell as sky: B = a (1/2 + B/2), so B = a / (2 - a)."""
    cache = cache_of(bowl(4), 256, offset=1e-3, with_hits=True)
    inner = cache.vertices[:, 2] < -0.15
    radiance = torch.zeros_like(cache.vertices)
    for bounce in range(1, 41):
        o_d, _, i_d, i_s = read(cache, cache.vertices, cache.normals, radiance=radiance)
        radiance = albedo * (o_d + i_d)
        if bounce in (1, 3):
            expected = 0.5 * albedo * sum((0.5 * albedo) ** k for k in range(bounce))
            assert abs(radiance[inner].mean().item() - expected) < 0.01
    assert abs(o_d[inner].mean().item() - 0.5) < 0.01
    assert (radiance[inner] - albedo / (2 - albedo)).abs().max() < 0.04
    assert abs(radiance[inner].mean().item() - albedo / (2 - albedo)) < 0.01
    torch.testing.assert_close(i_s, i_d, rtol=1e-4, atol=1e-5)  # roughness 1 about the normal
    if albedo == 1.0:  # all that arrives, from sky or bowl, is 1
        torch.testing.assert_close((o_d + i_d)[inner], torch.ones(int(inner.sum()), 3), rtol=0, atol=0.04)


def test_a_point_that_is_none_has_no_factors():
    inputs = cached_occlusion_inputs(torch.float32)
    assert all(part.isnan().all() for part in lib.cached_occlusion(inputs[0] * math.nan, *inputs[1:]))
