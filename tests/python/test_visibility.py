"""Visibility bits cached on a mesh: against rays, a closed form of occlusion, and the furnace of a bowl."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import OFFSET, between, bits_of, bowl, cache_of, corners, grid_mesh, lattice, refresh, scene_of
from op_checks import generator, unit
from splitnerf import _core
from splitnerf.fields import Light, SkyCells, VisibilityBits
from splitnerf.fields.light import lobe_roughness, panorama_directions
from splitnerf.fields.occlusion import bit_counts
from splitnerf.ops import light_queries
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, visibility_bits
from splitnerf.render import model as rendering
from tiny_runs import tiny
from torch.nn import functional as F

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
    single = ((bits[..., None] >> torch.arange(32, dtype=torch.int32)) & 1).bool()
    open_, blocked = single.reshape(len(x), 2, 96).unbind(1)
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


# ---- what a model keeps of a mesh and of the light ----


def dented() -> trimesh.Trimesh:
    """A floor under a ball, and a ball that sees all of its sky."""
    balls = [trimesh.creation.icosphere(2, 0.4).apply_translation((0, 0, z)) for z in (0.6, 40.0)]
    return trimesh.util.concatenate([grid_mesh(2.0, 8), *balls])


def bits_on(mesh: trimesh.Trimesh, **settings) -> VisibilityBits:
    return bits_of(mesh, lattice(256), **settings)


def points_on(mesh: trimesh.Trimesh, n: int = 80) -> list[torch.Tensor]:
    """Positions, normals, axes and roughness of lobes."""
    x, normals = between(mesh, n)
    g = generator(5)
    lobes = unit(normals + 0.8 * unit(torch.randn(n, 3, generator=g)))
    return [x, normals, lobes, 0.1 + 0.8 * torch.rand(n, 1, generator=g)]


class Painted(Light):
    """The square of the direction channel by channel and a bit of it, and what it was asked about the roughness."""

    def __init__(self):
        super().__init__()
        self.level = torch.nn.Parameter(torch.tensor([1.0, 2.0, 3.0]))

    def forward(self, directions, roughness):
        self.roughness = roughness
        return self.level * (0.3 + directions + 2 * directions**2)


class Hazy(Painted):
    """As painted, and brighter for wide lobes."""

    def forward(self, directions, roughness):
        return (1.0 + roughness) * super().forward(directions, roughness)


def lit_up(bits: VisibilityBits) -> None:
    """Makes the mesh send colours of its own, after the place of each vertex."""
    bits.set_radiance((0.5 + bits.cache.vertices[bits.emitters.vertices].abs()) * bits.emitters.facing)


def test_the_numbers_of_set_bits():
    words = torch.randint(-(2**31), 2**31, (50, 3), generator=generator(), dtype=torch.int64).to(torch.int32)
    expected = [sum(bin(w & 0xFFFFFFFF).count("1") for w in row) for row in words.tolist()]
    assert bit_counts(words).tolist() == expected
    assert bit_counts(words[:, ::2]).tolist() != expected
    assert bit_counts(torch.full((2, 16), -1, dtype=torch.int32)).tolist() == [512, 512]


@pytest.mark.parametrize("indirect", [True, False])
def test_what_is_kept_of_a_mesh_is_what_its_vertices_see(indirect):
    """From the offset along the normals, in the directions of the light, as many vertices as came, though two are in
    one place; what they hit where it counts, by the number of the emitter."""
    mesh = dented()
    vertices, faces = corners(mesh)[0], torch.tensor(np.asarray(mesh.faces))
    vertices, faces = torch.cat([vertices, vertices[faces[-1]]]), faces.clone()
    faces[-1] = torch.arange(3) + len(vertices) - 3
    again = trimesh.Trimesh(vertices.numpy(), faces.numpy(), process=False)
    normals = torch.tensor(np.array(again.vertex_normals)).float()
    for towards in (lattice(256), SkyCells(256).aims(Painted().evaluate())):
        scene, far = scene_of(mesh), {"offset": 0.03}
        traced = VisibilityBits.trace(scene, vertices, faces, towards, **far, n_channels=3, indirect=indirect)
        expected = VisibilityCache.trace(scene, vertices, normals, float(again.area), towards, **far, with_hits=True)
        assert torch.equal(traced.cache.vertices, vertices) and torch.equal(traced.cache.normals, normals)
        assert torch.equal(traced.cache.directions, towards) and traced.cache.radius == expected.radius
        assert torch.equal(traced.cache.bits, expected.bits) and (traced.emitters is not None) == indirect
        if indirect:
            hits, emitters = traced.cache.hits, traced.emitters
            assert torch.equal(hits >= 0, expected.hits >= 0)
            vertex, direction = (hits >= 0).nonzero().unbind(1)
            row = hits[vertex, direction].long()
            assert torch.equal(emitters.vertices[row], expected.hits[vertex, direction].long())
            assert torch.equal(emitters.directions[row], direction)
            assert torch.equal(row.unique(), torch.arange(len(emitters.vertices)))
            assert len(set(zip(*(x.tolist() for x in emitters[:2])))) == len(emitters.vertices) > 100
        else:
            assert traced.cache.hits.numel() == 0


def test_a_emitter_knows_its_sides_and_what_it_mirrors():
    """It is seen against the ray that hits it. What it mirrors is what its own vertex sees in the traced direction that
    is nearest to the mirrored one."""
    bits = bits_on(dented())
    emitters, n = bits.emitters, bits.cache.normals[bits.emitters.vertices]
    ray = bits.cache.directions[emitters.directions]
    mirrored = ray - 2 * (ray * n).sum(1, keepdim=True) * n
    nearest = ((mirrored[:, None] - bits.cache.directions) ** 2).sum(-1)
    least, found = nearest.topk(2, largest=False)
    clear = least[:, 1] - least[:, 0] > 1e-5
    expected = bits.cache.hits[emitters.vertices, found[:, 0]].long()
    assert torch.equal(emitters.mirrored[clear], expected[clear]) and clear.float().mean() > 0.9
    assert 0.01 < (emitters.mirrored >= 0).float().mean() < 0.99
    assert torch.equal(emitters.facing, (ray * n).sum(1, keepdim=True) < 0)


def test_a_mesh_is_convex_whose_every_vertex_sees_all_but_a_share_of_its_sky():
    """The largest share decides, of the directions above the vertex's horizon, and must be less than what is set."""
    mesh = grid_mesh(1.0, 4)
    mesh = trimesh.util.concatenate([mesh, trimesh.creation.icosphere(3, 0.3).apply_translation((0.2, 0, 0.6))])
    bits = bits_on(mesh)
    counts = [bit_counts(bits.cache.bits[:, side]) for side in (0, 1)]
    largest = (counts[1] / (counts[0] + counts[1])).max().item()
    assert 0.05 < largest < 0.6
    for threshold, expected in ((largest - 1e-4, False), (largest, False), (largest + 1e-4, True), (0.0, False)):
        assert bits_on(mesh, open_below=threshold).is_unoccluded is expected, threshold


def test_all_of_the_sky_is_seen_from_what_counts_as_convex():
    ball = bits_on(trimesh.creation.icosphere(2), open_below=0.02)
    assert ball.is_unoccluded and len(ball.emitters.vertices) == 0 and ball.radiance is None
    assert torch.equal(ball.light, torch.ones(256, 3))  # geometry alone before the first light
    visible, sent = ball.visibility(torch.zeros(5, 3), torch.ones(5, 3))
    assert torch.equal(visible, torch.ones(5, 256)) and sent is None


def test_light_is_averaged_over_the_texels_that_are_nearest_to_a_direction():
    """By solid angle, as rough as a texel is wide, 8 texels or more a direction. Rays are aimed where the power is, which
    moves no cell."""
    sky, light = SkyCells(64), Painted()
    aims, cells = sky.aims(light.evaluate()), sky.light(light)
    rows = math.isqrt(len(light.roughness) // 2)
    w = panorama_directions(rows).reshape(-1, 3)
    assert len(w) == len(light.roughness) >= 8 * 64 > len(panorama_directions(rows - 1).reshape(-1, 3))
    torch.testing.assert_close(light.roughness, torch.full((len(w), 1), lobe_roughness(4 * math.pi / len(w))))
    area = (w[:, 0] ** 2 + w[:, 1] ** 2).sqrt()[:, None]
    nearest = ((w[:, None] - lattice(64)) ** 2).sum(-1).argmin(1)
    value = light(w, torch.zeros(len(w), 1))
    for k in range(64):
        mine = nearest == k
        torch.testing.assert_close(cells.radiance[k], (value * area)[mine].sum(0) / area[mine].sum())
        torch.testing.assert_close(cells.solid_angles[k], 4 * math.pi * area[mine].sum() / area.sum())
        power = (value * area)[mine].sum(1, keepdim=True)
        torch.testing.assert_close(aims[k], F.normalize((w[mine] * power).sum(0), dim=0))
    assert cells.radiance.requires_grad and not aims.requires_grad and not cells.solid_angles.requires_grad
    assert not sky.state_dict()


def test_rays_go_to_the_middles_of_cells_that_are_dark():
    light = Painted()
    with torch.no_grad():
        light.level.zero_()
    torch.testing.assert_close(SkyCells(64).aims(light.evaluate()), lattice(64))


def test_the_light_is_kept_in_its_place_for_recorded_steps():
    """By the model, from the cells of an evaluated light or from its texels."""
    model = rendering.SceneModel(tiny(occlusion_directions=256, n_levels=2))
    model.bits, light = bits_on(dented()), Painted()
    place, expected = model.bits.light.data_ptr(), model.cells.light(light)
    model.weigh_occlusion(light.evaluate())
    assert torch.equal(model.bits.light, expected.radiance) and not model.bits.light.requires_grad
    model.weigh_occlusion(light.evaluate().with_cells(expected._replace(radiance=2 * expected.radiance)))
    assert torch.equal(model.bits.light, 2 * expected.radiance)
    model.bits.restore({"sky": expected.radiance.detach(), "sent": None, "emitters": None})
    assert torch.equal(model.bits.light, expected.radiance) and model.bits.light.data_ptr() == place


def test_light_of_other_emitters_comes_back_to_those_that_are_there():
    """Rays of another machine may hit a few others: those that are not stored keep what they have."""
    bits = bits_on(dented())
    lit_up(bits)
    before, kept = bits.radiance.clone(), bits.state()
    numbers = bits.emitters.vertices * 256 + bits.emitters.directions
    assert torch.equal(kept["emitters"], numbers) and (numbers.diff() > 0).all()
    lost = torch.arange(len(numbers)) % 3 == 1
    strange = torch.tensor([n for n in range(numbers[-1] + 9) if n not in set(numbers.tolist())][::50])
    theirs, order = torch.cat([numbers[~lost], strange]).sort()
    sent = torch.cat([2 * before[~lost], torch.full((len(strange), 3), 77.0)])[order]
    bits.restore(kept | {"sent": sent, "emitters": theirs})
    torch.testing.assert_close(bits.radiance, torch.where(lost[:, None], before, 2 * before))
    bits.restore(kept | {"sent": None, "emitters": None})
    assert bits.radiance is None


@pytest.mark.parametrize("chunk", [1 << 15, 50])
def test_each_emitter_sends_what_it_reflects(monkeypatch, chunk):
    """The materials of its vertex under the light there, towards the ray that sees it, in parts; again in the same
    memory, after the first was read. Its mirror shows the sky, blurred by a cell, or what another emitter sent before."""
    monkeypatch.setattr(rendering, "SHADED_CHUNK", {"cpu": chunk})
    bits, light, asked, seen, before = bits_on(dented()), Hazy().evaluate(), [], [], []
    bits.light = SkyCells(256).light(light).radiance.detach()
    cache, emitters = bits.cache, bits.emitters

    def materials(x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        assert len(x) <= chunk and not torch.is_grad_enabled()
        asked.append(x)
        return x.abs(), 0.3 + 0.2 * x[:, :1], 7 * x[:, 1:2]

    def shade(n, views, albedo, roughness, metallic, specular, diffuse, **how) -> torch.Tensor:
        assert len(n) <= chunk and not torch.is_grad_enabled() and not any("occlusion" in name for name in how)
        seen.append((n, views, albedo, roughness, metallic, specular, diffuse))
        before.append(bits.radiance if bits.radiance is None else bits.radiance.clone())
        return torch.stack([albedo[:, 0], views[:, 1] + specular[:, 1], diffuse[:, 2]], 1)

    x, n, rho = cache.vertices, cache.normals, 0.3 + 0.2 * cache.vertices[:, :1]
    at, views, up = emitters.vertices, -cache.directions[emitters.directions], torch.ones(len(x), 1)
    here, previous = (x.abs()[at], rho[at], 7 * x[at, 1:2]), None
    for turn in range(3):
        asked.clear(), seen.clear(), before.clear()
        place = None if previous is None else bits.radiance.data_ptr()
        refresh(bits, light, materials, shade)
        assert torch.equal(torch.cat(asked), x) and len(seen) == math.ceil(len(at) / chunk)
        assert all((b is previous is None) or torch.equal(b, previous) for b in before)
        o_d, _, i_d, _ = cached_occlusion(cache, x, n, lobe_dirs=n, roughness=rho, light=bits.light, radiance=previous)
        light_d = (o_d * light(n, up) + (0 if i_d is None else i_d))[at]
        sky = light(light_queries(n[at], views, rho[at])[0][: len(at)], (rho[at] ** 4 + 1 / 256) ** 0.25)
        shown = torch.zeros_like(sky) if previous is None else previous[emitters.mirrored.clamp(min=0)]
        light_s = torch.where((emitters.mirrored < 0)[:, None], sky, shown)
        for found, expected in zip(map(torch.cat, zip(*seen)), (n[at], views, *here, light_s, light_d)):
            torch.testing.assert_close(found, expected)
        sent = torch.stack([here[0][:, 0], views[:, 1] + light_s[:, 1], light_d[:, 2]], 1) * emitters.facing
        torch.testing.assert_close(bits.radiance, sent)
        assert place in (None, bits.radiance.data_ptr()) and not bits.radiance.requires_grad
        assert previous is None or (bits.radiance - previous).abs().max() > 1e-3
        previous = bits.radiance.clone()


def test_light_of_the_mesh_is_not_asked_for_where_it_does_not_count():
    """Without indirect light, and on a mesh that hides nothing."""

    def asked(*args: object) -> torch.Tensor:
        raise AssertionError("is not asked")

    ball = bits_on(trimesh.creation.icosphere(2), open_below=0.02)
    for bits in (bits_on(dented(), indirect=False), ball):
        refresh(bits, asked, asked, asked)
        assert bits.radiance is None


@pytest.mark.parametrize("n_channels", [1, 3])
@pytest.mark.parametrize("sends", [True, False])
def test_factors_are_those_of_the_cache_under_the_light_that_is_kept(n_channels, sends):
    """Averaged over the channels where that is set; the light from the mesh keeps its colour."""
    mesh = dented()
    bits, points = bits_on(mesh, n_channels=n_channels), points_on(mesh)
    bits.light = SkyCells(256).light(Painted()).radiance.detach()
    if sends:
        lit_up(bits)
    o_d, o_s, i_d, i_s = cached_occlusion(
        bits.cache, *points[:2], lobe_dirs=points[2], roughness=points[3], light=bits.light, radiance=bits.radiance
    )
    assert (o_d - o_s).abs().max() > 0.1 and (o_d.amax(1) - o_d.amin(1)).max() > 0.05
    if n_channels == 1:
        o_d, o_s = (x.sum(1, keepdim=True) / 3 for x in (o_d, o_s))
    found = bits(*points)
    torch.testing.assert_close(found.diffuse, o_d)
    torch.testing.assert_close(found.specular, o_s)
    if sends:
        assert torch.equal(found.indirect_diffuse, i_d) and torch.equal(found.indirect_specular, i_s)
        assert (i_d - i_s).abs().max() > 0.05
    else:
        assert found.indirect_diffuse is found.indirect_specular is None


def test_a_segment_has_the_factors_of_its_leader():
    """Whatever the numbers of the representatives, and in whatever order the segments come."""
    mesh = dented()
    bits, points = bits_on(mesh), points_on(mesh)
    representatives, segment = torch.tensor([70, 3, 41]), torch.randint(3, (80,), generator=generator(6))
    segments = SimpleNamespace(representatives=representatives, segment=segment)
    lit_up(bits)
    alone = bits(*points)
    for found, expected in zip(bits(*points, segments), alone):
        assert torch.equal(found, expected[representatives[segment]]) and not torch.equal(found, expected)


def test_lobes_are_summed_where_15_directions_are_within_them():
    """A lobe of roughness r holds 3 k r^4 of k directions."""
    for k in (64, 256, 1024):
        assert 3 * k * SkyCells(k).summed_from ** 4 == pytest.approx(15)
