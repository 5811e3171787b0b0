"""Light summed over the directions of the visibility bits: its cells, the integral, and the white furnace."""

import math

import pytest
import torch
import trimesh
from mesh_shapes import bowl, traced
from op_checks import generator, rand, unit
from splitnerf import _core
from splitnerf.config import Config
from splitnerf.fields import Light
from splitnerf.fields.light import panorama_directions
from splitnerf.fields.occlusion import bit_counts
from splitnerf.ops import light_queries, prefilter_light, split_sum_shade
from splitnerf.ops.rays import ShadingSubset
from splitnerf.ops.shading import monte_carlo_light, shade_sums
from splitnerf.render.model import SUMMED_BAND, SceneModel, ShadedPoints
from splitnerf.render.occupancy import make_grid
from splitnerf.render.renderer import MIN_OPACITY, add_corrections, find_samples, render_rays
from splitnerf.training.batches import Batch, draw_numbers, make_probes, probe_counts
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.step import Step
from test_views import Given, ball
from tiny_runs import tiny


class Lamp(Light):
    """A dim sky with a lamp of a few degrees."""

    def __init__(self, axis: tuple[float, float, float], power: float = 50.0):
        super().__init__()
        self.axis, self.power = unit(torch.tensor([axis]))[0], torch.nn.Parameter(torch.tensor(power))

    def forward(self, directions, roughness):
        lobe = torch.exp(200.0 * (directions @ self.axis - 1.0))[:, None]
        return (0.2 + self.power * lobe).expand(-1, 3)


def brute_force(lamp, normals, views, albedo, roughness, metallic) -> torch.Tensor:
    """The rendering equation over 200 x 400 directions, without what blocks them."""
    w = panorama_directions(200).reshape(-1, 3)
    area = (1 - w[:, 2] ** 2).sqrt()
    area = area * (4 * math.pi / area.sum())
    pdf = (1.0 / (len(w) * area)).expand(len(normals), -1)
    light = lamp(w, torch.zeros(len(w), 1)).expand(len(normals), -1, -1)
    sums = monte_carlo_light(normals, views, roughness, w.expand(len(normals), -1, 3), pdf, light)
    return shade_sums(normals, views, albedo=albedo, roughness=roughness, metallic=metallic, sums=sums, compensate=True)


def test_summed_light_is_nearer_to_the_integral_than_the_split():
    """A dark convex object under a lamp: the sum is 2.7 % off where the lamp shines, the split sum 7.4 %."""
    torch.manual_seed(0)
    model = SceneModel(Config().replace({"n_levels": 2, "log2_table_size": 8}))
    model.light = Lamp((0.3, -0.5, 0.7))
    mesh = trimesh.creation.icosphere(3, 0.5)
    model.use_mesh(traced(model, mesh))
    lit = model.evaluate_light()
    g = generator(5)
    n = unit(torch.randn(200, 3, generator=g))
    views = unit(n + 0.9 * unit(torch.randn(200, 3, generator=g)))
    rough, metal, albedo = torch.full((200, 1), 0.6), torch.zeros(200, 1), torch.full((200, 3), 0.05)
    exact = brute_force(model.light, n, views, albedo, rough, metal).detach()
    queries = torch.cat([light_queries(n, views, rough)[0][:200], n])
    light = prefiltered(model.light, queries, torch.cat([rough, torch.ones_like(rough)]))
    one, material = torch.ones(200, 3), {"albedo": albedo, "roughness": rough, "metallic": metal}
    split = split_sum_shade(n, views, **material, specular=light[:200], diffuse=light[200:], compensate=True)
    points = ShadedPoints(split, n, albedo, rough, metal, one, one, n, 0.5 * n)
    every = torch.arange(len(n))
    summed = split.index_add(0, *model.quadrature_correction(lit, views, points, every))
    bright = n @ model.light.axis > 0

    def error(radiance: torch.Tensor) -> float:
        return ((radiance - exact) / exact)[bright].abs().mean().item()

    assert error(summed) < 0.035 and 0.06 < error(split) < 0.09
    narrow = points._replace(roughness=torch.full((200, 1), 0.29))
    assert len(model.quadrature_correction(lit, views, narrow, every)[0]) == 0  # too narrow for so few directions


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_the_furnace_of_the_whole_model(metallic):
    """Under constant light white things, of metal or not, return that light: the split sum to 1 %, which is the
    table's; the sum over 256 directions to 0.2 % in the mean and 5 % at a point."""
    torch.manual_seed(0)
    model = SceneModel(Config().replace({"n_levels": 2, "log2_table_size": 8}))
    with torch.no_grad():
        model.light.texels.zero_()  # exp(0) = 1
    mesh = trimesh.creation.icosphere(3, 0.5)
    model.use_mesh(traced(model, mesh))
    lit = model.evaluate_light()
    g, k = generator(5), 600
    n = unit(torch.randn(k, 3, generator=g))
    views = unit(n + 0.9 * unit(torch.randn(k, 3, generator=g)))
    rough = 0.05 + 0.95 * torch.rand(k, 1, generator=g)
    white = torch.ones(k, 3), rough, torch.full((k, 1), metallic)
    model.material = Given(lambda *_: white)
    points = model.shade(lit, 0.5 * n, torch.zeros(k, 13), torch.zeros(k, 4), n, views)
    summed = points.radiance.index_add(0, *model.quadrature_correction(lit, views, points, torch.arange(k)))
    torch.testing.assert_close(points.radiance, torch.ones(k, 3), rtol=0, atol=0.01)
    assert summed[rough[:, 0] > 0.45].mean().item() == pytest.approx(1.0, abs=0.002)
    assert (summed - 1).abs().max() < 0.05


def prefiltered(lamp, directions, roughness) -> torch.Tensor:
    """gbar of the lamp from many directions."""
    w = torch.from_numpy(_core.fibonacci_sphere(1 << 14)).float()
    return prefilter_light(directions, roughness, light_dirs=w, light=lamp(w, torch.zeros(len(w), 1)).detach())


# ---- what a step and its rays make of the sum ----


def with_mesh(mesh: trimesh.Trimesh, **settings: object) -> SceneModel:
    torch.manual_seed(0)
    model = SceneModel(tiny(n_levels=2, **{"shading.method": "summed"}, open_below=0.0, **settings))
    with torch.no_grad():
        model.light.texels.zero_()
    assert not model.sums_light
    model.use_mesh(traced(model, mesh))
    assert model.sums_light
    return model


def points_at(roughness: torch.Tensor, split: float) -> tuple:
    """Their views, and the points, whose radiance by the split sum is said to be this."""
    n, g = len(roughness), generator(2)
    normals = unit(torch.randn(n, 3, generator=g))
    views = unit(normals + 0.5 * unit(torch.randn(n, 3, generator=g)))
    one = torch.ones(n, 1)
    radiance, albedo = torch.full((n, 3), split), torch.full((n, 3), 0.5)
    return views, ShadedPoints(radiance, normals, albedo, roughness, 0 * one, one, one, normals, 0.5 * normals)


def test_the_sum_comes_in_smoothly_over_its_band():
    """By t^2 (3 - 2 t), t from 0 to 1 about the roughness that the directions resolve: twice, for split sums of 0 and 1, whose
    corrections differ by that. Candidates may be any points; those past their number, and narrow lobes, are not corrected."""
    model = with_mesh(trimesh.creation.icosphere(2, 0.5))
    t = torch.tensor([-0.5, 0.0, 0.1, 0.25, 0.5, 0.8, 1.0, 1.7])
    roughness = (model.cells.summed_from + (t - 0.5) * SUMMED_BAND)[:, None]
    light, candidates = model.evaluate_light(), torch.tensor([6, 3, 0, 5, 2, 7, 4])
    expected = (t * t * (3 - 2 * t)).where(t > 0, 0).where(t < 1, 1)
    for n in (None, 7, 4):
        found = []
        for split in (0.0, 1.0):
            number = None if n is None else torch.tensor(n)
            at, correction = model.quadrature_correction(light, *points_at(roughness, split), candidates, number)
            found.append(torch.zeros(8, 3).index_add(0, at, correction))
            assert n is not None or (expected[at] > 0).all()  # others are left out
        share = (found[0] - found[1])[:, 0]
        counted = torch.zeros(8).index_fill(0, candidates[: n or 7], 1.0)
        torch.testing.assert_close(share, expected * counted, rtol=0, atol=1e-5)


def test_the_sum_holds_what_the_mesh_sends():
    """In a bowl that sends out 1, as the sky does, all is lit by 1: less where the mesh is taken to be dark."""
    model = with_mesh(bowl(2, 0.5))
    bits = model.bits
    x, n = bits.cache.vertices[::5], bits.cache.normals[::5]
    inner = x[:, 2] < -0.1
    one = torch.ones(len(x), 1)
    points = ShadedPoints(torch.zeros(len(x), 3), n, torch.ones(len(x), 3), one, 0 * one, one, one, n, x)
    light, found = model.evaluate_light(), []
    for sent in (torch.ones_like(bits.radiance), None):
        bits.radiance = sent
        found.append(model.quadrature_correction(light, n, points, torch.arange(len(x)))[1])
    torch.testing.assert_close(found[0][inner], torch.ones(int(inner.sum()), 3), rtol=0, atol=0.05)
    assert (found[1][inner] < 0.75).all()


def test_visibility_is_asked_on_the_viewers_side():
    model = with_mesh(trimesh.creation.icosphere(2, 0.5))
    asked, visibility = [], model.bits.visibility
    model.bits.visibility = lambda *points: asked.append(points) or visibility(*points)
    views, points = points_at(torch.full((6, 1), 0.9), 0.0)
    at = torch.tensor([4, 1, 2])
    model.quadrature_correction(model.evaluate_light(), views, points._replace(normals=-points.normals), at)
    assert torch.equal(asked[0][0], points.on_surface[at]) and torch.equal(asked[0][1], points.facing[at])


def test_a_new_mesh_is_lit_and_its_light_bounces_three_times(monkeypatch):
    """By the light of now, before its first bounce."""
    asked = []
    monkeypatch.setattr(SceneModel, "refresh_indirect", lambda self, light: asked.append(self.bits.light.clone()))
    torch.manual_seed(0)
    model = SceneModel(tiny(n_levels=2))
    with torch.no_grad():
        model.light.texels[:16] = torch.tensor(3.0).log()
    mesh = bowl(2, 0.5)
    model.use_mesh(traced(model, mesh))
    assert len(asked) == 3
    torch.testing.assert_close(asked[0], torch.full_like(asked[0], 3.0), rtol=1e-4, atol=1e-4)


def test_what_the_sum_adds_goes_to_the_rays_of_its_samples(monkeypatch):
    """Asked on the surface, about each ray's heaviest sample; here it adds the ray's number to its colour."""
    model, cells = ball()
    model.config = model.config.replace({"shading.method": "summed"})
    model.has_mesh = True
    origins = torch.tensor([[4.0, 0.3, 0], [4.0, 5.0, 0], [4.0, -0.2, 0.2]])
    rays = origins, torch.tensor([[-1.0, 0, 0]] * 3), torch.full((3,), 0.5)
    asked, nothing = {}, (torch.zeros(0, dtype=torch.int64), torch.zeros(0, 3))

    def added(light, views, points, candidates, *_):
        asked.update(on_surface=points.on_surface, candidates=candidates)
        return candidates, torch.tensor([[1.0] * 3, [3.0] * 3])

    light, found = model.evaluate_light(), find_samples(model, cells, *rays)
    monkeypatch.setattr(model, "quadrature_correction", lambda *args: nothing)
    without = render_rays(model, light, found, shades_per_ray=2).mean
    monkeypatch.setattr(model, "quadrature_correction", added)
    ray = render_rays(model, light, found, shades_per_ray=2)
    torch.testing.assert_close(ray.mean - without, torch.tensor([1.0, 0.0, 3.0])[:, None].expand(3, 3))
    assert found.packed.ray_indices[ray.shaded[asked["candidates"]]].tolist() == [0, 2]
    assert ray.sdf.abs().max() > 0.01
    torch.testing.assert_close(asked["on_surface"], ray.positions - ray.points.normals * ray.sdf[:, None])


def test_a_corrected_picture_moves_all_its_parts():
    """Visibility has no gradient and needs none: those to the field, the materials and the light are there and finite."""
    model = with_mesh(trimesh.creation.icosphere(2, 0.7), initial_roughness=0.8)
    rays = torch.tensor([[4.0, 0.3, 0], [4.0, -0.2, 0.2]]), torch.tensor([[-1.0, 0, 0]] * 2), torch.full((2,), 0.5)
    cells = make_grid(model.config).cells
    light = model.evaluate_light()
    render_rays(model, light, find_samples(model, cells, *rays)).mean.sum().backward()
    light.backward()
    for name, p in model.named_parameters():
        assert p.grad.isfinite().all() and (p.grad != 0).any(), name


def test_a_correction_counts_by_the_share_of_its_segment():
    """Three rays of 100 samples with every second one shaded, in segments of 1 to 5; two samples of one ray are corrected."""
    shaded, rays = torch.arange(0, 300, 2), torch.arange(300) // 100
    segment = torch.repeat_interleave(torch.arange(50), torch.tensor([1, 2, 5, 3, 4]).repeat(10))
    shares, opacity, mean, correction = rand(150, seed=1), rand(4, seed=2), rand(4, 3), rand(5, 3, seed=4)
    opacity[2], at, none = 1e-9, torch.tensor([7, 120, 0, 9, 149]), torch.zeros(0)
    spread = ShadingSubset(shaded, none, none, none, none, torch.zeros(50), segment, none)
    expected = mean.clone()
    for k, added in zip(at.tolist(), correction):
        ray = rays[shaded[k]]
        expected[ray] += added * shares[segment == segment[k]].sum() / opacity[ray].clamp(min=MIN_OPACITY)
    found = add_corrections(mean, correction, at, spread, rays, shares, opacity)
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=1e-12)


def test_rays_are_weighed_by_the_cosine_they_are_told():
    """Oblique rays, whose weights change while the cosine is annealed, of the same samples."""
    model, cells = ball()
    rays = torch.tensor([[4.0, 0.5, 0]]), torch.tensor([[-1.0, 0, 0]]), torch.tensor([0.5])
    found, light = find_samples(model, cells, *rays), model.evaluate_light()
    weights = [render_rays(model, light, found._replace(anneal=torch.tensor(x))).weights for x in (0.0, 1.0)]
    assert (weights[0] - weights[1]).abs().max() > 0.01


def test_a_step_leaves_its_own_gradients_and_shades_and_probes_as_it_is_set():
    model, cells = ball(shades_per_ray=1, smoothness_points=40, eikonal_points=30, entropy_points=20)
    grid = make_grid(model.config)
    grid.cells = cells
    step, g = Step(model, grid, SurfaceMesh(model), generator(3)), generator(4)
    rays = torch.tensor([[4.0, 0.01 * i, 0] for i in range(30)]), torch.tensor([[-1.0, 0, 0]] * 30)
    jitter = torch.rand(30, generator=g)
    target, background = torch.rand(30, 4, generator=g), torch.rand(30, 3, generator=g)
    photo = target, torch.zeros(30, dtype=torch.int64), torch.ones(30, 3), background, torch.zeros(30, dtype=torch.bool)
    probes = make_probes(model.config, *draw_numbers(g, probe_counts(model.config)))
    batch = Batch(*rays, *photo, jitter, jitter, probes)
    gradients = []
    for _ in range(2):
        ray, _ = step.gradients(batch, model.evaluate_light(), 1, 0.0)
        gradients.append(model.sdf_field.hidden_direction.grad.clone())
    torch.testing.assert_close(*gradients)
    n = len(ray.weights)
    assert len(ray.found.beside) == 40 and len(ray.gradients) == n + 30 + 40
    assert len(ray.shaded) < 0.5 * n
    assert step.capacity.of_shading is None  # it has no limit
    entropies = []
    for seed in range(2):
        torch.manual_seed(seed)
        step = Step(model, grid, SurfaceMesh(model), generator(3))
        entropies.append(step.gradients(batch, model.evaluate_light(), 1, 0.9)[1]["entropy"].value.item())
    assert entropies[0] == entropies[1] > 0


@pytest.mark.parametrize("name", ["analytic", "finite_difference"])
def test_normals_are_taken_as_set(name):
    torch.manual_seed(0)
    model = SceneModel(tiny(normals=name, **{"shading.method": "split"}))
    with torch.no_grad():
        model.sdf_field.grid.table.normal_(std=0.02)
    x = torch.rand(50, 3) - 0.5
    gradients = {
        "analytic": model.sdf_field.sample(x).gradient,
        "finite_difference": model.sdf_field.sample_finite_difference(x).gradient,
    }
    assert torch.equal(model.surface(x).gradient, gradients[name])
    assert (gradients["analytic"] - gradients["finite_difference"]).abs().max() > 0.01


def test_the_bits_are_made_as_they_are_set():
    """Rays start farther out and see more of the bowl's sky; it counts as open below a share, and sends nothing."""
    settings = {"open_below": 0.9, "indirect": False, "occlusion_directions": 288, "occlusion_channels": 1}
    near, far = (SceneModel(tiny(occlusion_offset=offset, **settings)) for offset in (0.01, 0.2))
    near, far = (traced(model, bowl(2, 0.5)) for model in (near, far))
    assert near.is_unoccluded and near.emitters is None and near.n_channels == 1 and len(near.light) == 288
    blocked = [int(bit_counts(bits.cache.bits[:, 1]).sum()) for bits in (near, far)]
    assert blocked[0] > 1.1 * blocked[1] > 0
