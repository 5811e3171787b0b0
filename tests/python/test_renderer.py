"""What a renderer finds, weighs and hands on: samples that matter, padding that does not, gradients that are derivatives."""

import pytest
import torch
from op_checks import generator, unit
from splitnerf.fields import LightMlp, Occlusion
from splitnerf.fields.surface import SdfSample
from splitnerf.ops.rays import CELL_EMPTY, CELL_OCCUPIED
from splitnerf.render import renderer
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import ProbePoints, RenderedRays, find_samples, render_rays, render_view
from test_views import LENS, POSE, RADIUS, Given, ball

FULL = torch.full((16, 16, 16), CELL_OCCUPIED, dtype=torch.uint8)


def oblique(n: int = 20, dtype: torch.dtype = torch.float32) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Rays from +x past the rim of the ball and then through it, and their jitters."""
    g = generator(7)
    offsets = unit(torch.randn(n, 2, generator=g)) * torch.linspace(1.03, 0.2, n)[:, None] * RADIUS
    origins = torch.cat([torch.full((n, 1), 4.0), offsets], 1)
    directions = torch.tensor([[-1.0, 0, 0]]).expand(n, 3)
    return tuple(x.to(dtype) for x in (origins, directions, torch.rand(n, generator=g)))


def rendered(model: SceneModel, found, **options) -> RenderedRays:
    return render_rays(model, model.evaluate_light(), found, **options)


def test_gradients_of_a_picture_are_its_derivatives():
    """To the field, its sharpness, the materials and the light, each along a random direction, of colours and coverage."""
    model, _ = ball()
    model.light = LightMlp(16, 2, 2, 2, "softplus")
    with torch.no_grad():
        model.light.out.weight.normal_()
        for p in model.sdf_field.parameters():
            p.add_(0.02 * torch.randn_like(p))
    model.double()
    found = find_samples(model, FULL, *oblique(6, torch.float64))
    by_colour, by_opacity = torch.randn(6, 3, dtype=torch.float64), torch.randn(6, dtype=torch.float64)

    def loss():
        ray = rendered(model, found)
        return (by_colour * ray.mean).sum() + by_opacity @ ray.opacity

    loss().backward()
    for name, p in model.named_parameters():
        if name.startswith("occlusion"):
            continue
        along, eps, sides = torch.randn_like(p), 1e-6, []
        for shift in (eps, -eps):
            with torch.no_grad():
                p.add_(shift * along)
                sides.append(loss().item())
                p.sub_(shift * along)
        slope = (sides[0] - sides[1]) / (2 * eps)
        assert (p.grad * along).sum().item() == pytest.approx(slope, rel=1e-4, abs=1e-5), name


@pytest.mark.parametrize(("variance", "share"), [(0.3, 1.0), (0.5, 0.3)])
@pytest.mark.parametrize("anneal", [0.0, 1.0])
def test_no_sample_of_weight_is_missed_and_few_points_are_asked(anneal, variance, share):
    """Of the whole lattice those that weigh more than the least weight and a half are found, broad as the density may be; of a sharp
    one the field is asked at less than a third of the lattice."""
    model, _ = ball(**{"sampling.min_weight": 1e-3})
    with torch.no_grad():
        model.variance.fill_(variance)
    rays = oblique()
    found = find_samples(model, FULL, *rays, anneal)
    model.config = model.config.replace({"sampling.min_weight": 0.0})
    whole = find_samples(model, FULL, *rays, anneal)
    weights = rendered(model, whole).weights
    heavy = weights > 1.5e-3
    here, there = (torch.stack([100.0 * p.ray_indices, p.t_starts], 1) for p in (whole.packed, found.packed))
    apart = torch.cdist(here[heavy], there).amin(1)
    assert heavy.sum() > 60 and apart.max() < 1e-3
    assert found.evaluated.sum() < share * len(weights) and torch.equal(whole.evaluated, whole.packed.offsets.diff())
    assert len(found.directions) < share * len(whole.directions)


@pytest.mark.parametrize("sample_above", [0.0, 1e-3])
def test_a_ray_ends_where_little_light_is_left(sample_above):
    rays = torch.tensor([[4.0, 0.1, 0]]), torch.tensor([[-1.0, 0, 0]]), torch.tensor([0.5])
    found, opacity = {}, {}
    for least in (1e-3, 0.5):
        model, _ = ball(**{"sampling.min_weight": sample_above}, min_transmittance=least)
        found[least] = find_samples(model, FULL, *rays)
        opacity[least] = rendered(model, found[least]).opacity.item()
    assert opacity[1e-3] > 0.99 and 0.5 < opacity[0.5] < 0.95
    if sample_above:
        assert len(found[0.5].directions) < len(found[1e-3].directions)


@pytest.mark.parametrize("sample_above", [0.0, 1e-3])
def test_a_ray_is_evaluated_at_no_more_points_than_are_allowed(monkeypatch, sample_above):
    monkeypatch.setattr(renderer, "MAX_SAMPLES_PER_RAY", 3)
    model, _ = ball(**{"sampling.min_weight": sample_above})
    assert find_samples(model, FULL, *oblique()).evaluated.max() == 3


def test_marks_do_not_follow_the_jitter():
    """Which samples are shaded must not depend on where they lie."""
    model, cells = ball()
    jitter = torch.rand(3000, generator=generator(5))
    rays = torch.tensor([[4.0, 5.0, 0]]).expand(3000, 3), torch.tensor([[-1.0, 0, 0]]).expand(3000, 3)
    phase = find_samples(model, cells, *rays, jitter).phase
    assert phase.min() >= 0 and phase.max() < 1 and phase.mean() == pytest.approx(0.5, abs=0.03)
    assert abs(torch.corrcoef(torch.stack([phase, jitter]))[0, 1]) < 0.06


def test_padding_repeats_the_first_samples_and_changes_nothing():
    """It stands between the samples and the probes, and neighbours are those of samples alone."""
    model, cells = ball()
    rays, g = oblique(), generator(6)
    probes = ProbePoints(
        torch.rand(5, 3, generator=g), torch.tensor([0.0, 0.5, 0.999]), 0.1 * torch.randn(3, 3, generator=g)
    )
    bare = find_samples(model, cells, *rays, probes=probes)
    n = len(bare.directions)
    for more in (7, n + 3):
        padded = find_samples(model, cells, *rays, probes=probes, capacity=n + more)
        assert len(padded.directions) == len(padded.packed.middles) == n + more
        assert torch.equal(padded.positions[:n], bare.positions[:n])
        assert torch.equal(padded.positions[n + more :], bare.positions[n:])
        assert torch.equal(padded.positions[n : n + more], bare.positions[torch.arange(more) % n])
        assert torch.equal(padded.beside, bare.beside) and bare.beside.tolist() == [0, n // 2, int(0.999 * n)]
        assert not padded.directions[n:].any()
        ray, expected = rendered(model, padded, shades_per_ray=2), rendered(model, bare, shades_per_ray=2)
        torch.testing.assert_close((ray.mean, ray.opacity), (expected.mean, expected.opacity))
        assert torch.equal(ray.gradients[n + more :], expected.gradients[n:]) and (ray.weights[n:] == 0).all()
    cut = find_samples(model, cells, *rays, probes=probes, capacity=n - 1)
    assert torch.equal(cut.positions[: n - 1], bare.positions[: n - 1]) and len(cut.directions) == n - 1
    assert int(cut.n_found) == n
    empty = torch.full_like(cells, CELL_EMPTY)
    nothing = find_samples(model, empty, *rays, probes=probes)
    assert torch.equal(nothing.positions, probes.anywhere) and len(nothing.directions) == len(nothing.beside) == 0
    nothing = find_samples(model, empty, *rays, probes=probes, capacity=4)
    assert (nothing.positions[:4] == 0).all() and torch.equal(nothing.positions[4:9], probes.anywhere)
    assert not nothing.beside.any()


def test_values_of_shaded_samples_are_those_of_their_places():
    """Some of the samples are shaded, others with another phase; what they stand for adds up to the coverage and the colour."""
    model, cells = ball(**{"sampling.min_weight": 0.0})
    found = find_samples(model, cells, *oblique())
    ray = rendered(model, found, shades_per_ray=2)
    assert len(ray.shaded) < 0.5 * len(ray.weights) and not torch.equal(ray.shaded, torch.arange(len(ray.shaded)))
    field = model.surface(ray.positions)
    torch.testing.assert_close(ray.positions, found.positions[ray.shaded])
    torch.testing.assert_close(ray.sdf, field.sdf)
    torch.testing.assert_close(ray.points.normals, unit(field.gradient))
    rays = found.packed.ray_indices[ray.shaded]
    torch.testing.assert_close(torch.zeros(20).index_add(0, rays, ray.shares), ray.opacity)
    colours = torch.zeros(20, 3).index_add(0, rays, ray.shares[:, None] * ray.points.radiance)
    torch.testing.assert_close(ray.mean, colours / ray.opacity[:, None].clamp(min=1e-4), rtol=1e-4, atol=1e-4)
    other = rendered(model, found._replace(phase=(found.phase + 0.5) % 1.0), shades_per_ray=2)
    assert not torch.equal(ray.shaded, other.shaded)
    fixed = rendered(model, found, shades_per_ray=2, capacity=(200, 60))
    assert len(fixed.shaded) == 200 and torch.equal(fixed.sizes, ray.sizes) and ray.sizes[0] == len(ray.shaded)
    torch.testing.assert_close(fixed.mean, ray.mean)


class Slabs(torch.nn.Module):
    """Two thin walls across x, at +-0.5, that let a part of the light through."""

    def forward(self, positions: torch.Tensor) -> SdfSample:
        x = positions[:, 0]
        side = torch.where(x > 0, x - 0.5, x + 0.5)
        gradient = side.sign()[:, None] * torch.tensor([1.0, 0, 0])
        outputs = torch.nn.functional.pad((side.abs() - 0.02)[:, None], (0, 12))
        return SdfSample(outputs, torch.zeros(len(x), 8), gradient)


@pytest.mark.parametrize("capacity", [None, (60, 20)])
def test_walls_behind_each_other_are_segments_of_their_own(monkeypatch, capacity):
    """A ray through both has a shaded sample and a leader on each; it is corrected at the heaviest, on the first wall."""
    model, _ = ball(**{"sampling.min_weight": 0.0}, step_scale=0.5)
    with torch.no_grad():
        model.variance.fill_(0.37)
    model.config = model.config.replace({"shading.method": "summed"})
    monkeypatch.setattr(model, "surface", Slabs().forward)
    occlusion = Given(lambda _, x, *__: Occlusion(x.new_ones(len(x), 1), x.new_ones(len(x), 1)))
    model.has_mesh, model.occlusion_at = True, occlusion.forward
    monkeypatch.setattr(model, "evaluate_light", model.light.evaluate)
    asked, nothing = [], (torch.zeros(0, dtype=torch.int64), torch.zeros(0, 3))
    monkeypatch.setattr(model, "quadrature_correction", lambda *args: asked.append(args) or nothing)
    cells = FULL.clone()
    cells[6:10] = CELL_EMPTY
    n = 4
    origins, directions = (torch.tensor([x]).repeat(n, 1) for x in ([4.0, 0.1, 0.2], [-1.0, 0, 0]))
    origins[2, 1] = 9.0  # beside the box
    rays = origins, directions, torch.rand(n, generator=generator(3))
    ray = rendered(model, find_samples(model, cells, *rays), shades_per_ray=6, capacity=capacity)
    m, n_rays, n_segments = ray.sizes.tolist()
    assert n_rays == n - 1 and n_segments == 2 * (n - 1) < m and ray.opacity[0] > 0.8
    *_, segments = occlusion.asked
    x = ray.positions[:, 0]
    leading = x[segments.representatives]
    torch.testing.assert_close(leading[:n_segments].abs(), torch.full((n_segments,), 0.5), rtol=0, atol=0.05)
    assert torch.equal(leading[segments.segment][:m].sign(), x[:m].sign())
    candidates, number = asked[0][3:]
    assert (number is None) == (capacity is None) and (number is None or number == n_rays)
    torch.testing.assert_close(x[candidates[:n_rays]], torch.full((n_rays,), 0.5), rtol=0, atol=0.05)


def test_a_view_is_made_of_the_rays_of_its_pixels(monkeypatch):
    """Half a sample into each ray's lattice, whatever the number of rays at a time, in an image wider than high."""
    model, cells = ball(occlusion_channels=3)
    height, width, lens = 14, 26, LENS + torch.tensor([-12.0, -8.0, 3.0, -4.5])
    maps = render_view(model, cells, POSE, lens, height, width)
    monkeypatch.setattr("splitnerf.render.renderer.CHUNK", 37)
    parts = render_view(model, cells, POSE, lens, height, width)
    for name in maps:
        assert torch.equal(maps[name], parts[name]) and maps[name].shape[:2] == (height, width), name
    fx, fy, cx, cy = lens.tolist()
    row, column = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    local = torch.stack([(column + 0.5 - cx) / fx, -(row + 0.5 - cy) / fy, -torch.ones(height, width)], -1).view(-1, 3)
    n = height * width
    rays = POSE[:3, 3].expand(n, 3), unit(local @ POSE[:3, :3].T), torch.full((n,), 0.5)
    ray = rendered(model, find_samples(model, cells, *rays))
    assert 0.05 < (ray.opacity > 0.5).float().mean() < 0.6
    torch.testing.assert_close(maps["alpha"].reshape(-1), ray.opacity, rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(maps["rgb"].reshape(-1, 3), ray.colour.clamp(0, 1), rtol=1e-4, atol=1e-4)
