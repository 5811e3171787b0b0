"""What a model's visibility bits keep of a mesh and of the light, and which of it each answer is made of."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import OFFSET, between, corners, grid_mesh, lattice, scene_of
from op_checks import generator, unit
from torch.nn import functional as F

from splitnerf.fields import EvaluatedLight, Light, OcclusionQuery, RaySegments, VisibilityBits
from splitnerf.fields import visibility
from splitnerf.fields.light import lobe_roughness, panorama_directions
from splitnerf.ops import VisibilityCache, cached_occlusion, cached_visibility


def dented() -> trimesh.Trimesh:
    """A floor under a ball, and a ball that sees all of its sky."""
    balls = [trimesh.creation.icosphere(2, 0.4).apply_translation((0, 0, z)) for z in (0.6, 40.0)]
    return trimesh.util.concatenate([grid_mesh(2.0, 8), *balls])


def faces_of(mesh: trimesh.Trimesh) -> torch.Tensor:
    return torch.tensor(np.asarray(mesh.faces))


def bits_on(mesh: trimesh.Trimesh, n_channels: int = 3, indirect: bool = True, **settings) -> VisibilityBits:
    bits = VisibilityBits(256, OFFSET, n_channels, indirect, **settings)
    bits.use(bits.trace(scene_of(mesh), corners(mesh)[0], faces_of(mesh)))
    return bits


def queries(mesh: trimesh.Trimesh, n: int = 80) -> OcclusionQuery:
    x, normals = between(mesh, n)
    g = generator(5)
    lobes = unit(normals + 0.8 * unit(torch.randn(n, 3, generator=g)))
    return OcclusionQuery(torch.empty(n, 0), x, normals, lobes, 0.1 + 0.8 * torch.rand(n, 1, generator=g))


class Painted(Light):
    """The square of the direction channel by channel and a bit of it, and what it was asked about the roughness."""

    def __init__(self):
        super().__init__()
        self.level = torch.nn.Parameter(torch.tensor([1.0, 2.0, 3.0]))

    def forward(self, directions, roughness):
        self.roughness = roughness
        return self.level * (0.3 + directions + 2 * directions**2)


# ---- a mesh ----


def test_the_numbers_of_set_bits():
    words = torch.randint(-(2**31), 2**31, (50, 3), generator=generator(), dtype=torch.int64).to(torch.int32)
    expected = [sum(bin(w & 0xFFFFFFFF).count("1") for w in row) for row in words.tolist()]
    assert visibility.bit_counts(words).tolist() == expected
    assert visibility.bit_counts(words[:, ::2]).tolist() != expected
    assert visibility.bit_counts(torch.full((2, 16), -1, dtype=torch.int32)).tolist() == [512, 512]


@pytest.mark.parametrize("indirect", [True, False])
def test_what_is_kept_of_a_mesh_is_what_its_vertices_see(indirect):
    """Along the normals, from the offset, as many vertices as came, though two are in one place; what they hit where
    it counts."""
    mesh = dented()
    vertices, faces = corners(mesh)[0], faces_of(mesh)
    vertices, faces = torch.cat([vertices, vertices[faces[-1]]]), faces.clone()
    faces[-1] = torch.arange(3) + len(vertices) - 3
    again = trimesh.Trimesh(vertices.numpy(), faces.numpy(), process=False)
    traced = VisibilityBits(256, 0.03, 3, indirect).trace(scene_of(mesh), vertices, faces)
    normals = torch.tensor(np.array(again.vertex_normals)).float()
    expected = VisibilityCache.trace(
        scene_of(mesh), vertices, normals, float(again.area), lattice(256), offset=0.03, with_hits=True
    )
    assert torch.equal(traced.cache.vertices, vertices) and torch.equal(traced.cache.normals, normals)
    assert torch.equal(traced.cache.bits, expected.bits) and traced.cache.radius == expected.radius
    assert (traced.cache.hits is not None and torch.equal(traced.cache.hits, expected.hits)) == indirect


def test_a_mesh_is_convex_whose_every_vertex_sees_all_but_a_share_of_its_sky():
    """The largest share decides, of the directions above the vertex's horizon, and must be less than what is set."""
    mesh = grid_mesh(1.0, 4)
    mesh = trimesh.util.concatenate([mesh, trimesh.creation.icosphere(3, 0.3).apply_translation((0.2, 0, 0.6))])
    bits = bits_on(mesh)
    counts = [visibility.bit_counts(bits.cache.bits[:, side]) for side in (0, 1)]
    largest = (counts[1] / (counts[0] + counts[1])).max().item()
    assert 0.05 < largest < 0.6
    for threshold, expected in ((largest - 1e-4, False), (largest, False), (largest + 1e-4, True), (0.0, False)):
        assert bits_on(mesh, open_below=threshold).is_unoccluded is expected, threshold


def test_a_new_mesh_takes_the_place_of_the_one_before():
    """With its bits, its convexity, and no light of its own."""
    bits = bits_on(dented(), open_below=0.02)
    assert bits.ready and not bits.is_unoccluded
    bits.refresh(lambda x, n: torch.ones_like(x))
    ball = trimesh.creation.icosphere(2)
    bits.use(bits.trace(scene_of(ball), corners(ball)[0], faces_of(ball)))
    assert bits.is_unoccluded and bits.radiance is None and len(bits.cache.vertices) == len(ball.vertices)
    assert not VisibilityBits(256, OFFSET, 3, True).ready
    visible, sent = bits.visibility(torch.zeros(5, 3), torch.ones(5, 3))
    assert torch.equal(visible, torch.ones(5, 256)) and sent is None


# ---- the light ----


def test_light_is_averaged_over_the_texels_that_are_nearest_to_a_direction():
    """By solid angle, as rough as a texel is wide, 8 texels or more a direction; its direction is that of its power."""
    bits, light = VisibilityBits(64, OFFSET, 3, True), Painted()
    cells = bits.cell_light(light)
    rows = math.isqrt(len(light.roughness) // 2)
    w = panorama_directions(rows).reshape(-1, 3)
    assert len(w) == len(light.roughness) >= 8 * 64 > len(panorama_directions(rows - 1).reshape(-1, 3))
    torch.testing.assert_close(light.roughness, torch.full((len(w), 1), lobe_roughness(4 * math.pi / len(w))))
    area = (w[:, 0] ** 2 + w[:, 1] ** 2).sqrt()[:, None]
    nearest = ((w[:, None] - bits.directions) ** 2).sum(-1).argmin(1)
    value = light(w, torch.zeros(len(w), 1))
    for k in range(64):
        mine = nearest == k
        torch.testing.assert_close(cells.radiance[k], (value * area)[mine].sum(0) / area[mine].sum())
        torch.testing.assert_close(cells.solid_angles[k], 4 * math.pi * area[mine].sum() / area.sum())
        power = (value * area)[mine].sum(1, keepdim=True)
        torch.testing.assert_close(cells.directions[k], F.normalize((w[mine] * power).sum(0), dim=0))
    assert cells.radiance.requires_grad and not cells.directions.requires_grad and not cells.solid_angles.requires_grad


def test_the_light_is_kept_in_its_place_for_recorded_steps():
    bits, light = VisibilityBits(64, OFFSET, 3, True), Painted()
    assert torch.equal(bits.light, torch.ones(64, 3))  # geometry alone before the first light
    place = bits.light.data_ptr()
    expected = bits.cell_light(light)
    bits.set_light(EvaluatedLight(light))
    assert torch.equal(bits.light, expected.radiance) and not bits.light.requires_grad
    bits.set_light(EvaluatedLight(light, expected._replace(radiance=2 * expected.radiance)))
    assert torch.equal(bits.light, 2 * expected.radiance)
    bits.restore_light({"sky": expected.radiance.detach(), "sent": None})
    assert torch.equal(bits.light, expected.radiance) and bits.light.data_ptr() == place
    assert not bits.state_dict()


def test_light_that_was_kept_comes_back():
    mesh = dented()
    ours, theirs = bits_on(mesh), bits_on(mesh)
    ours.set_light(EvaluatedLight(Painted()))
    for sends in (False, True):
        if sends:
            ours.refresh(lambda x, n: 0.5 + x.abs())
        kept = {name: x if x is None else x.clone() for name, x in ours.cached_light().items()}
        assert (kept["sent"] is not None) == sends
        theirs.restore_light(kept)
        for a, b in zip(ours(queries(mesh)), theirs(queries(mesh))):
            assert (a is None and b is None) or torch.equal(a, b)
    theirs.restore_light({"sky": kept["sky"], "sent": None})
    assert theirs.radiance is None


@pytest.mark.parametrize("chunk", [1 << 15, 50])
def test_each_vertex_sends_what_it_is_shaded_with(monkeypatch, chunk):
    """Asked at the vertices along their normals, in parts; again in the same memory, after the first was read."""
    monkeypatch.setattr(visibility, "SHADED_CHUNK", chunk)
    bits, seen = bits_on(dented()), []

    def shade(x: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
        assert len(x) <= chunk and not torch.is_grad_enabled()
        seen.append(bits.radiance if bits.radiance is None else bits.radiance.clone())
        return torch.stack([x[:, 0], n[:, 1], x[:, 2] + len(seen)], 1)

    bits.refresh(shade)
    first, place = bits.radiance.clone(), bits.radiance.data_ptr()
    torch.testing.assert_close(first[:, :2], torch.stack([bits.cache.vertices[:, 0], bits.cache.normals[:, 1]], 1))
    n_parts = len(seen)
    bits.refresh(shade)
    assert n_parts == math.ceil(len(first) / chunk) and len(seen) == 2 * n_parts
    assert all(x is None for x in seen[:n_parts]) and all(torch.equal(x, first) for x in seen[n_parts:])
    torch.testing.assert_close(bits.radiance[:, 2], first[:, 2] + n_parts)
    assert bits.radiance.data_ptr() == place


def test_light_of_the_mesh_is_not_asked_for_where_it_does_not_count():
    """Without indirect light, before a mesh, and on one that hides nothing."""

    def shade(x: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
        raise AssertionError("is not asked")

    ball = bits_on(trimesh.creation.icosphere(2), open_below=0.02)
    for bits in (bits_on(dented(), indirect=False), VisibilityBits(64, OFFSET, 3, True), ball):
        bits.refresh(shade)
        assert bits.radiance is None


# ---- answers ----


@pytest.mark.parametrize("n_channels", [1, 3])
@pytest.mark.parametrize("sends", [True, False])
def test_factors_are_those_of_the_cache_under_the_light_that_is_kept(n_channels, sends):
    """Averaged over the channels where that is set; the light from the mesh keeps its colour."""
    mesh = dented()
    bits, q = bits_on(mesh, n_channels), queries(mesh)
    bits.set_light(EvaluatedLight(Painted()))
    if sends:
        bits.refresh(lambda x, n: 0.5 + x.abs())
    o_d, o_s, i_d, i_s = cached_occlusion(bits.cache, *q[1:], bits.light, bits.radiance)
    assert (o_d - o_s).abs().max() > 0.1 and (o_d.amax(1) - o_d.amin(1)).max() > 0.05
    if n_channels == 1:
        o_d, o_s = (x.sum(1, keepdim=True) / 3 for x in (o_d, o_s))
    found = bits(q)
    torch.testing.assert_close(found.diffuse, o_d)
    torch.testing.assert_close(found.specular, o_s)
    if sends:
        assert torch.equal(found.indirect_diffuse, i_d) and torch.equal(found.indirect_specular, i_s)
        assert (i_d - i_s).abs().max() > 0.05
    else:
        assert found.indirect_diffuse is found.indirect_specular is None


def test_a_segment_has_the_factors_of_its_leader():
    """Whatever the numbers of the leaders, and in whatever order the segments come."""
    mesh = dented()
    bits, q = bits_on(mesh), queries(mesh)
    leaders, segment = torch.tensor([70, 3, 41]), torch.randint(3, (80,), generator=generator(6))
    bits.refresh(lambda x, n: 0.5 + x.abs())
    alone = bits(q)
    for found, expected in zip(bits(q, RaySegments(leaders, segment)), alone):
        assert torch.equal(found, expected[leaders[segment]]) and not torch.equal(found, expected)


def test_directions_are_seen_as_the_cache_has_them():
    mesh = dented()
    bits, q = bits_on(mesh), queries(mesh)
    for sends in (False, True):
        if sends:
            bits.refresh(lambda x, n: 0.5 + x.abs())
        visible, sent = bits.visibility(q.positions, q.normals)
        expected = cached_visibility(bits.cache, q.positions, q.normals, bits.radiance)
        assert torch.equal(visible, expected[0]) and 0.01 < (visible < 1).float().mean() < 0.9
        assert (sent is None and not sends) or torch.equal(sent, expected[1])
    bits.is_unoccluded = True
    visible, sent = bits.visibility(q.positions, q.normals)
    assert torch.equal(visible, torch.ones(80, 256)) and sent is None


def test_no_gradient_flows_through_the_factors():
    mesh = dented()
    bits, q = bits_on(mesh), queries(mesh)
    bits.light.requires_grad_()
    found = bits(OcclusionQuery(*(part.clone().requires_grad_() for part in q)))
    assert not found.diffuse.requires_grad and not found.specular.requires_grad


def test_lobes_are_summed_where_15_directions_are_within_them():
    """A lobe of roughness r holds 3 k r^4 of k directions."""
    for k in (64, 256, 1024):
        assert 3 * k * VisibilityBits(k, OFFSET, 3, True).summed_from ** 4 == pytest.approx(15)
