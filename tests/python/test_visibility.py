"""Visibility bits cached on a mesh: against rays, closed forms of occlusion, and the furnace of a bowl."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import OFFSET, between, cache_of, corners, grid_mesh, lattice, scene_of
from op_checks import generator, lib, unit
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.config import Config
from splitnerf.fields import EvaluatedLight, Light, OcclusionQuery, VisibilityBits
from splitnerf.fields.light import panorama_directions
from splitnerf.ops import (
    VisibilityCache,
    cached_occlusion,
    cached_visibility,
    occlusion_factors,
    light_queries,
    split_sum_shade,
    visibility_bits,
)
from splitnerf.render.model import SceneModel

UP = torch.tensor([[0.0, 0.0, 1.0]])


def read(cache: VisibilityCache, x: torch.Tensor, n: torch.Tensor, *, rho: float = 1.0, light=None, radiance=None):
    """cached_occlusion with the lobe about the normal."""
    light = torch.ones_like(cache.directions) if light is None else light
    return cached_occlusion(cache, x, n, n, torch.full((len(x), 1), rho), light, radiance)


# ---- the bits ----


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

    triangle, u, v = trimesh_hits(mesh, origins.reshape(-1, 3), w.repeat(len(x), 1))
    blocked = blocked.reshape(-1)
    weights = np.stack([1 - u - v, u, v], axis=1)[blocked]
    heaviest = np.asarray(mesh.faces)[triangle[blocked], weights.argmax(1)]
    assert np.array_equal(hits.reshape(-1)[blocked].numpy(), heaviest)


def trimesh_hits(mesh: trimesh.Trimesh, origins: torch.Tensor, directions: torch.Tensor) -> tuple:
    scene = _core.Scene(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32))
    _, triangle, u, v = scene.trace_closest(origins.contiguous().numpy(), directions.contiguous().numpy())
    return triangle, u, v


# ---- closed forms ----


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


def test_in_a_right_angled_corner():
    """Long wall of height h at distance a: (1 - a / sqrt(a^2 + h^2)) / 2 is hidden, 1/2 in the limit at the edge."""
    wall = trimesh.Trimesh([(0, -99, 0), (0, 99, 0), (0, 99, 1), (0, -99, 1)], [(0, 1, 2), (0, 2, 3)], process=False)
    a = torch.tensor([0.01, 0.2, 0.5, 1.0, 2.0])
    x = torch.stack([a, 0 * a, 0 * a], dim=1)
    cache = VisibilityCache.trace(scene_of(wall), x, UP.expand(5, 3).contiguous(), 1e-4, lattice(1024), offset=OFFSET)
    o_d = read(cache, x, UP.expand(5, 3))[0][:, 0]
    h = 1 - OFFSET
    expected = 0.5 + 0.5 * a / (a * a + h * h).sqrt()
    torch.testing.assert_close(o_d, expected, rtol=0, atol=0.01)
    assert abs(o_d[0].item() - 0.5) < 0.012


def test_a_lone_sphere_is_open_at_and_between_its_vertices():
    mesh = trimesh.creation.icosphere(3)
    cache = cache_of(mesh)
    light = torch.rand(256, 3, generator=generator())
    for x, n in (corners(mesh), between(mesh, 500)):
        for rho in (0.1, 0.5, 1.0):
            o_d, o_s, i_d, _ = read(cache, x, n, rho=rho, light=light)
            assert (o_d == 1).all() and (o_s == 1).all() and i_d is None


@pytest.mark.parametrize("solid, is_unoccluded", [("sphere", True), ("box", True), ("torus", False)])
def test_convex_surfaces_are_known_to_see_the_whole_sky(solid, is_unoccluded):
    """What is left out for them changes no factor; asked for or not."""
    mesh = {
        "sphere": trimesh.creation.icosphere(4), "box": trimesh.creation.box().subdivide_loop(4), "torus": trimesh.creation.torus(1, 0.4)
    }[solid]  # fmt: skip
    vertices, faces = torch.tensor(np.asarray(mesh.vertices)).float(), torch.tensor(np.asarray(mesh.faces))
    answers = []
    for open_below in (0.02, 0.0):
        bits = VisibilityBits(256, OFFSET, 3, True, open_below)
        bits.use(bits.trace(scene_of(mesh), vertices, faces))
        assert bits.is_unoccluded == (is_unoccluded and open_below > 0)
        n = torch.tensor(np.array(mesh.vertex_normals)).float()
        answers.append(bits(OcclusionQuery(torch.empty(0), vertices, n, n, torch.full((len(n), 1), 0.3))))
    (first, second) = answers
    assert first.diffuse.shape == second.diffuse.shape == (len(vertices), 3)
    torch.testing.assert_close(first.diffuse, second.diffuse, rtol=0, atol=0.02)
    torch.testing.assert_close(first.specular, second.specular, rtol=0, atol=0.02)
    assert (first.diffuse.min() == 1) == is_unoccluded


def test_the_sides_of_a_thin_plate_do_not_mix():
    """A lid over one side of a plate thinner than its mesh's spacing darkens that side alone."""
    top, bottom = grid_mesh(1.0, 20, 0.002), grid_mesh(1.0, 20, -0.002)
    bottom.invert()
    lid = grid_mesh(3.0, 1, 0.3)
    cache = cache_of(trimesh.util.concatenate([top, bottom, lid]))
    x, _ = between(grid_mesh(0.8, 10), 200)
    upper, lower = (read(cache, x, UP.expand(200, 3) * side)[0] for side in (1.0, -1.0))
    assert (lower == 1).all() and (upper < 0.2).all()


def test_where_nothing_is_near_the_search_widens_and_then_gives_up():
    mesh = trimesh.util.concatenate([grid_mesh(1.0, 20), grid_mesh(3.0, 1, 1.2)])
    vertices, normals = corners(mesh)
    on_floor = slice(0, 21 * 21)
    cache = VisibilityCache.trace(scene_of(mesh), vertices[on_floor], normals[on_floor], 1.0, lattice(256))
    heights = torch.tensor([0.0, 4.0, 9.0]) * cache.radius
    x = torch.stack([0.01 + 0 * heights, 0.02 + 0 * heights, heights], dim=1)
    at, above, far = read(cache, x, UP.expand(3, 3))[0].mean(1).tolist()
    assert at < 0.8 and abs(above - at) < 0.05 and far == 1.0
    o_d = read(cache, torch.tensor([[math.nan, 0, 0], [0, 0, math.inf]]), UP.expand(2, 3))[0]
    assert o_d.isnan().all()


# ---- against many rays ----


def sky(directions: torch.Tensor) -> torch.Tensor:
    """Blue above, dim below, two soft lamps."""
    z = directions[..., 2:]
    base = torch.cat([0.3 + 0.2 * z, 0.35 + 0.25 * z, 0.5 + 0.4 * z], dim=-1)
    for axis, colour, width in (((1, 0.4, 0.9), (4, 3.6, 2.8), 0.05), ((-0.8, 0.6, 0.3), (1.8, 2.4, 3), 0.1)):
        c = directions @ unit(torch.tensor(axis, dtype=torch.float32))
        base = base + torch.exp((c[..., None] - 1) / width) * torch.tensor(colour)
    return base


def nine_spheres() -> trimesh.Trimesh:
    rng = np.random.default_rng(0)
    parts = [grid_mesh(2.6, 64)]
    for k in range(9):
        r = 0.18 + 0.1 * rng.random()
        ball = trimesh.creation.icosphere(3 if r < 0.23 else 4, radius=r)
        parts.append(ball.apply_translation(((k % 3 - 1) * 0.7, (k // 3 - 1) * 0.7, r + 0.02)))
    return trimesh.util.concatenate(parts)


def test_spheres_on_a_plane_against_4096_rays():
    """256 directions know o_d to about .01, between the vertices as at them."""
    mesh = nine_spheres()
    bits = VisibilityBits(256, OFFSET, 1, indirect=False)
    vertices, normals = corners(mesh)
    bits.use(bits.trace(scene_of(mesh), vertices, torch.tensor(np.asarray(mesh.faces))))
    bits.set_light(EvaluatedLight(Field(sky)))
    some = torch.randperm(len(vertices), generator=generator())[:300]
    for x, n in ((vertices[some], normals[some]), between(mesh, 300)):
        for rho, bound in ((0.1, 0.13), (0.2, 0.084), (0.3, 0.051), (0.5, 0.025)):
            view = unit(n + 0.9 * unit(torch.randn(len(n), 3, generator=generator(4))))
            roughness = torch.full((len(n), 1), rho)
            lobes = light_queries(n, view, roughness)[0][: len(n)]
            got = bits(OcclusionQuery(torch.empty(0), x, n, lobes, roughness))
            o_d, o_s = occlusion_factors(
                scene_of(mesh),
                x,
                n,
                lobes,
                roughness,
                sky(panorama_directions(64)),
                n_diffuse_rays=4096,
                n_specular_rays=1024,
            )
            assert (o_d < 0.95).float().mean() > 0.3
            assert (got.diffuse - o_d).square().mean().sqrt() < 0.015
            assert (got.specular - o_s).square().mean().sqrt() < bound


def test_light_of_the_cells():
    bits = VisibilityBits(256, OFFSET, 1, indirect=False)
    bits.set_light(EvaluatedLight(Field(lambda w: torch.full_like(w, 3.0))))
    torch.testing.assert_close(bits.light, torch.full((256, 3), 3.0))
    bits.set_light(EvaluatedLight(Field(lambda w: w)))  # the mean direction of a cell is that of its centre
    assert (F.normalize(bits.light, dim=1) - bits.directions).norm(dim=1).max() < 0.12
    assert bits.light.mean(0).norm() < 0.01
    area = bits.cell_light(Field(torch.ones_like)).solid_angles
    assert area.sum().item() == pytest.approx(4 * math.pi) and (area * 256 / (4 * math.pi) - 1).abs().max() < 0.35


class Field(Light):
    """A light that does not depend on the roughness."""

    def __init__(self, radiance):
        super().__init__()
        self.radiance = radiance

    def forward(self, directions, roughness):
        return self.radiance(directions)


# ---- indirect light ----


def half_shell(subdivisions: int) -> trimesh.Trimesh:
    """The lower half of the unit sphere, faces inwards."""
    ball = trimesh.creation.icosphere(subdivisions)
    return trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] < 0][:, ::-1])


@pytest.mark.parametrize("albedo", [0.3, 0.8, 1.0])
def test_the_furnace_of_a_bowl(albedo):
    """Each point of half a spherical shell sees as much shell as sky: B = a (1/2 + B/2), so B = a / (2 - a)."""
    cache = cache_of(half_shell(4), 256, offset=1e-3, with_hits=True)
    inner = cache.vertices[:, 2] < -0.15
    radiance = torch.zeros_like(cache.vertices)
    for bounce in range(1, 41):
        o_d, o_s, i_d, i_s = read(cache, cache.vertices, cache.normals, radiance=radiance)
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


def test_a_mirror_sees_what_blocks_its_lobe():
    """Floor under a wall: a narrow lobe towards the wall brings the wall's light and nothing of the sky."""
    floor, wall = grid_mesh(0.4, 8), grid_mesh(4.0, 2)
    wall.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 2, (0, 1, 0)))
    mesh = trimesh.util.concatenate([floor, wall.apply_translation((0.5, 0, 0))])
    cache = cache_of(mesh, with_hits=True)
    colour = torch.tensor([0.2, 0.5, 0.9]).expand(len(cache.vertices), 3).clone()
    colour[: 9 * 9] = 7.0  # the floor itself is not seen
    lobes = unit(torch.tensor([[1.0, 0, 0.6], [-1.0, 0, 0.6]]))
    narrow, light = torch.full((2, 1), 0.1), torch.ones(256, 3)
    _, o_s, _, i_s = cached_occlusion(cache, torch.zeros(2, 3), UP.expand(2, 3), lobes, narrow, light, colour)
    torch.testing.assert_close(i_s[0] / (1 - o_s[0]), torch.tensor([0.2, 0.5, 0.9]), rtol=1e-3, atol=1e-3)
    assert (o_s[0] < 0.05).all() and (o_s[1] > 0.95).all() and (i_s[1] < 0.05).all()


def test_the_model_shades_with_the_light_of_its_mesh():
    """In a bowl: o g + i takes the place of the light, each refresh adds a bounce, and the sums converge."""
    settings = {
        "n_levels": 2,
        "log2_table_size": 8,
        "occlusion.kind": "bits",
        "indirect": True,
        "occlusion_directions": 64,
        "shading.method": "split",
    }
    torch.manual_seed(0)
    model = SceneModel(Config().replace(settings | {"initial_roughness": 0.9}))
    mesh = half_shell(3)
    vertices, faces = torch.tensor(np.asarray(mesh.vertices)).float(), torch.tensor(np.asarray(mesh.faces))
    model.use_mesh(model.occlusion.trace(scene_of(mesh), vertices, faces))
    bits = model.occlusion
    assert not any(key.startswith("occlusion") for key in model.state_dict())

    x, n = bits.cache.vertices[::9], bits.cache.normals[::9]
    field = model.surface(x)
    field = field._replace(outputs=field.outputs * torch.tensor([0.0] + [1.0] * 12))  # as if the level set passed there
    shaded = model.shade(model.evaluate_light(), x, field.outputs, field.features, n, n)
    occlusion = bits(OcclusionQuery(torch.empty(0), x, n, shaded.lobe_dirs, shaded.roughness))
    light_s, light_d = model.light(shaded.lobe_dirs, shaded.roughness), model.light(n, torch.ones(len(x), 1))
    expected = split_sum_shade(
        n, n, shaded.albedo, shaded.roughness, shaded.metallic, occlusion.specular * light_s + occlusion.indirect_specular,
        occlusion.diffuse * light_d + occlusion.indirect_diffuse, torch.ones(len(x), 1), torch.ones(len(x), 1), "exact", True,
    )  # fmt: skip
    torch.testing.assert_close(shaded.radiance, expected, rtol=1e-3, atol=1e-4)
    assert torch.equal(shaded.occlusion_d, occlusion.diffuse) and shaded.radiance.requires_grad

    bits.radiance, levels = None, []
    for _ in range(6):
        model.refresh_indirect(model.evaluate_light())
        levels.append(bits.radiance.mean().item())
    steps = np.diff(levels)
    assert (steps > 0).all() and (steps[1:] < 0.6 * steps[:-1]).all() and steps[0] > 0.05 * levels[0]


# ---- the directions one by one ----


def test_visibility_of_a_vertex_is_its_bits():
    """At a vertex that has no neighbour in reach: open, blocked with the light of what is hit, or below the horizon."""
    floor, ball = grid_mesh(2.0, 2), trimesh.creation.icosphere(2, 0.5).apply_translation((0, 0, 0.9))
    cache = cache_of(trimesh.util.concatenate([floor, ball]), 64, with_hits=True)
    cache = dataclasses.replace(cache, radius=0.1, **grids(cache.vertices, 0.1))
    sent = torch.rand(len(cache.vertices), 3, generator=generator(1))
    visible, arriving = cached_visibility(cache, 0 * UP, UP, sent)
    centre = 4  # of the floor's 3 x 3 vertices
    open_, blocked = unpacked(cache.bits[centre])
    above = cache.directions[:, 2] > 0
    assert torch.equal(visible[0].bool() & above, open_) and 3 < blocked.sum() < 30
    expected = torch.where(blocked[:, None], sent[cache.hits[centre].clamp(min=0).long()], torch.zeros(3))
    torch.testing.assert_close(arriving[0], expected)
    assert (visible[0][~above] == 1).all()
    assert (
        torch.equal(cached_visibility(cache, 0 * UP, UP)[0], visible)
        and cached_visibility(cache, 0 * UP, UP)[1] is None
    )
    assert cached_visibility(cache, UP * math.nan, UP, sent)[0].isnan().all()


def grids(vertices: torch.Tensor, radius: float) -> dict:
    return dict(zip(("starts", "order"), lib.vertex_grids(vertices, radius, 4)))


def unpacked(words: torch.Tensor) -> torch.Tensor:
    """[2, words] int32 -> [2, directions] bool."""
    return ((words[..., None] >> torch.arange(32, dtype=torch.int32)) & 1).bool().reshape(2, -1)


def test_sums_of_directions_agree_with_the_factors():
    """Summing V L cos and (1 - V) C cos over the directions is what cached_occlusion does."""
    mesh = trimesh.util.concatenate(
        [grid_mesh(2.0, 8), trimesh.creation.icosphere(2, 0.4).apply_translation((0, 0, 0.7))]
    )
    cache = cache_of(mesh, 256, with_hits=True)
    x, n = between(mesh, 50)
    light, sent = torch.rand(256, 3, generator=generator(3)), torch.rand(len(cache.vertices), 3, generator=generator(4))
    visible, arriving = cached_visibility(cache, x, n, sent)
    o_d, _, i_d, _ = read(cache, x, n, light=light, radiance=sent)
    cosine = (n @ cache.directions.T).clamp(min=0)
    torch.testing.assert_close((visible * cosine) @ light / (cosine @ light), o_d, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(
        (arriving * cosine[..., None]).sum(1) / cosine.sum(1, keepdim=True), i_d, rtol=1e-4, atol=1e-5
    )
