"""The light's consistency loss by lights whose integrals are known, and the other terms: closed forms, what they draw and see."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from op_checks import generator
from splitnerf.data.environment import seen_at
from splitnerf.fields import LightPyramid
from splitnerf.training import losses
from tiny_runs import tiny

LOOSE = {"light_lobe_below": 0.0, "constants.light_form": "square"}


def rays(weights: list[float], metallic: list[float]) -> SimpleNamespace:
    """Grey samples of these weights."""
    n, metallic = len(weights), torch.tensor(metallic)[:, None]
    points = SimpleNamespace(metallic=metallic, albedo=torch.full((n, 3), 0.4), roughness=torch.full((n, 1), 0.5))
    return SimpleNamespace(shares=torch.tensor(weights), shaded=torch.arange(n), points=points)


class Slope:
    """2 + z where sharp, and where diffuse the integral of that over the cosine: 2 + 2 z / 3. Remembers what it was asked."""

    def __call__(self, directions, roughness):
        self.roughness = roughness[:, 0]
        z = directions[:, 2:]
        return torch.where(roughness < 0.5, 2 + z, 2 + 2 * z / 3).expand(-1, 3)


@pytest.fixture
def sharp_or_diffuse(monkeypatch):
    """Roughness that is drawn is below 0.05: all queries are nearly mirrors or at 1."""
    rand = torch.rand
    monkeypatch.setattr(torch, "rand", lambda *size, **kwargs: 0.05 * rand(*size, **kwargs))


@pytest.mark.parametrize("light_set", ["fibonacci", "uniform"])
def test_a_consistent_light_costs_nothing(sharp_or_diffuse, light_set):
    """Mirrors by samples of their own lobes, diffuse light by the shared set: 2 + 2 z / 3 of each direction z."""
    config = tiny(light_set=light_set, light_lobe_below=0.2, light_samples=8192, light_queries=64)
    loss = losses.light_loss(Slope(), config, generator(), 0).item()
    assert loss < (1e-4 if light_set == "fibonacci" else 5e-3)


def test_half_of_the_queries_are_diffuse_and_the_set_is_as_large_as_set():
    """16 of 32 at 1; 128 shared directions, and 8 more of each lobe narrower than 0.4."""
    light = Slope()
    losses.light_loss(light, tiny(light_samples=128, light_queries=32, **LOOSE), generator(), 0)
    queries = light.roughness[128:]
    assert (light.roughness[:128] == 0).all() and len(queries) == 32
    assert (queries == 1).sum() == 16 and 0.2 < queries[queries < 1].mean() < 0.8
    light = Slope()
    settings = LOOSE | {"light_lobe_below": 0.4, "light_lobe_samples": 8}
    losses.light_loss(light, tiny(light_samples=128, light_queries=32, **settings), generator(), 0)
    queries = light.roughness[-32:]
    assert (light.roughness == 0).sum() == 128 + 8 * (queries < 0.4).sum() > 128


def test_narrow_lobes_are_sampled_anew_with_each_seed():
    class Stripes(Slope):
        def __call__(self, directions, roughness):
            return (2 + (20 * directions[:, :1]).sin()).expand(-1, 3)

    config = tiny(light_queries=16, **LOOSE | {"light_lobe_below": 0.9, "light_lobe_samples": 4})
    first, again, other = (losses.light_loss(Stripes(), config, generator(), seed).item() for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.parametrize("below", [0.0, 0.5])
def test_the_gradient_of_the_light_loss_goes_to_both_sides(below):
    """g(w, 0) = a and g(w, rho > 0) = b: 3 (b - a)^2, whose slopes are -6 (b - a) and 6 (b - a)."""
    levels = torch.tensor([1.0, 1.5], requires_grad=True)

    def light(directions, roughness):
        return levels[(roughness[:, 0] > 0).long()][:, None].expand(-1, 3)

    config = tiny(light_queries=64, **LOOSE | {"light_lobe_below": below})
    losses.light_loss(light, config, generator(), 0).backward()
    assert levels.grad.tolist() == pytest.approx([-3.0, 3.0], rel=1e-3)


@pytest.mark.parametrize(("form", "expected"), [("square", 0.01 + 0.04 + 4.0), ("smooth_l1", 0.005 + 0.02 + 1.5)])
def test_the_light_loss_is_the_mean_over_queries_of_the_sum_over_channels(form, expected):
    """Eq. (11): the mean over s of |g(s) - gbar(s)|^2, a vector's length: off by 0.1, -0.2 and 2."""
    for n_queries in (16, 64):
        config = tiny(light_queries=n_queries, **LOOSE | {"constants.light_form": form})
        loss = losses.light_loss(lambda _, rho: 1 + (rho > 0) * torch.tensor([0.1, -0.2, 2.0]), config, generator(), 0)
        assert loss.item() == pytest.approx(expected, rel=1e-4)


def test_the_gradient_is_that_of_the_weighted_sum():
    """Of 2 x^2 + 5 x - 3 c at x = 3: 17; a term without a gradient is left out."""
    x = torch.tensor(3.0, requires_grad=True)
    terms = losses.Terms()
    terms.add({"a": 2.0, "left out": None, "b": 5.0}, torch.stack([x * x, x, x]))
    terms.add({"c": -3.0}, torch.tensor(1.0))
    terms.backward()
    assert x.grad.item() == pytest.approx(17.0)
    found = {name: (weight, value.item()) for name, (weight, value) in terms.items()}
    assert found == {"a": (2, 9), "b": (5, 3), "c": (-3, 1)}


def test_shares_that_are_not_finite_do_not_stop_the_draw_of_materials():
    ray = rays([1.0, float("nan")], [0.0, 1.0])
    assert losses.material_entropy_loss(ray, tiny(), generator()).item() == pytest.approx(0.0, abs=1e-6)


def occlusion_rays(n: int, channels: int = 1) -> SimpleNamespace:
    """Samples whose number stands in all that belongs to them; factors are off 0.5 by 0.002 and -0.004 of it."""
    number = torch.arange(float(n))
    column = number[:, None]
    points = SimpleNamespace(roughness=column, normals=column + torch.tensor([0.0, 0.5, 0.0]))
    points.occlusion_d, points.occlusion_s = ((0.5 + x * column).expand(-1, channels) for x in (0.002, -0.004))
    rest = {"shaded": torch.arange(n), "shares": 1.0 + number, "positions": column.expand(-1, 3)}
    return SimpleNamespace(**rest, sdf=torch.full((n,), 0.5), points=points)


@pytest.mark.parametrize("channels", [1, 3])
def test_occlusion_is_traced_as_it_is_set_and_what_belongs_to_a_sample_stays_together(monkeypatch, channels):
    """About 60 of 200, off the surface by the offset, by the step's seed, drawn by the run's own generator:
    w (0.002^2 + 0.004^2) i^2 over the sum of w, the mean over channels."""
    asked = []

    def factors(scene, positions, normals, *, lobe_dirs, roughness, environment, **given):
        asked.append((positions, normals, lobe_dirs, roughness[:, 0], given))
        return (torch.full((len(positions), channels), 0.5),) * 2

    monkeypatch.setattr(losses, "occlusion_factors", factors)
    config = tiny(occlusion_share=0.3, occlusion_channels=channels, occlusion_offset=0.037, occlusion_rays=5)
    found = []
    for seed in range(2):
        torch.manual_seed(seed)
        ray = occlusion_rays(200, channels)
        found.append(losses.occlusion_loss(ray, None, None, config, generator(), 9).item())
    positions, normals, lobes, number, given = asked[0]
    assert given == dict(n_diffuse_rays=5, n_specular_rays=5, offset=0.037, seed=9, n_channels=channels)
    assert 30 < len(number) < 90 and number.unique().equal(number)
    on_ray = positions + 0.5 * normals
    for part, own in ((on_ray, [0.0, 0.0, 0.0]), (normals, [0.0, 0.5, 0.0]), (lobes, [0.0, 0.5, 0.0])):
        assert torch.equal(part, number[:, None] + torch.tensor(own))
    w = 1.0 + number
    expected = (w @ ((0.002**2 + 0.004**2) * number.square()) / w.sum()).item()
    assert found[0] == found[1] == pytest.approx(expected, rel=1e-4)


def test_rays_that_meet_nothing_cost_nothing():
    """No sample is shaded; none is chosen."""
    ray = occlusion_rays(0)
    ray.points.albedo, ray.points.metallic = torch.zeros(0, 3), torch.zeros(0, 1)
    for loss in (
        losses.material_entropy_loss(ray, tiny(), generator()),
        losses.occlusion_loss(ray, None, None, tiny(), generator(), 0),
        losses.occlusion_loss(occlusion_rays(9), None, None, tiny(occlusion_share=0.0), generator(), 0),
        *losses.material_losses(torch.zeros(0, 3), torch.zeros(0, 1), torch.zeros(0)),
    ):
        assert loss.shape == () and loss.item() == 0.0


@pytest.mark.parametrize("light_set", ["fibonacci", "uniform"])
def test_the_light_is_asked_by_the_runs_own_generator(light_set):
    """About unit directions on all sides."""
    asked = []

    class Asked(Slope):
        def __call__(self, directions, roughness):
            asked.append((directions, roughness))
            return super().__call__(directions, roughness)

    config = tiny(light_set=light_set, light_samples=512, light_queries=256, neutral_queries=256)
    for seed in range(2):
        torch.manual_seed(seed)
        losses.light_loss(Asked(), config, generator(), 0)
        losses.neutral_light_loss(Asked(), config, generator())
    for first, again in zip(asked[0] + asked[1], asked[2] + asked[3]):
        assert torch.equal(first, again)
    queries, normals = asked[0][0][-256:], asked[1][0]
    for directions in (asked[0][0][:512], queries, normals):
        torch.testing.assert_close(directions.norm(dim=1), torch.ones(len(directions)))
        assert directions.mean(0).norm() < 0.2
    assert len(normals) == 256 and (asked[1][1] == 1).all()


def test_similar_materials_attract_each_other():
    """Two halves whose roughness, metallic or log albedo differ by d widths: the slope of -ln(1/2 + e^(-d^2/4) / 2), d = 1."""
    attraction = 0.5 * math.exp(-0.25) / (1 + math.exp(-0.25))
    for name, values in (("roughness", [[0.4], [0.6]]), ("metallic", [[0.4], [0.6]]), ("albedo", [[0.29], [0.39]])):
        ray = rays([1.0, 1.0], [0.5, 0.5])
        columns = 3 if name == "albedo" else 1
        leaf = torch.tensor(values).repeat(1, columns).requires_grad_()
        setattr(ray.points, name, leaf)
        width = math.sqrt(3) * math.log(0.40 / 0.30) if name == "albedo" else 0.2
        config = tiny(entropy_points=4000, gloss_width=0.2, albedo_width=width)
        losses.material_entropy_loss(ray, config, generator()).backward()
        by_width = [1 / 0.3, 1 / 0.4] if name == "albedo" else [1.0, 1.0]
        for slope, sign, x in zip(leaf.grad, (-1, 1), by_width):
            expected = sign * attraction * x / width / math.sqrt(columns)
            assert slope.tolist() == pytest.approx([expected] * columns, rel=0.05), name


def test_what_is_seen_pulls_the_light():
    surroundings = np.zeros((16, 32, 4), np.float32)
    surroundings[8:] = [0.2, 0.4, 0.8, 1.0]
    radiance, known = seen_at(surroundings, np.array([[0, 0, -1.0], [0, 0, 1.0], [0.6, 0, -0.8]]))
    assert np.allclose(radiance[[0, 2]], [0.2, 0.4, 0.8]) and known.tolist() == [1, 0, 1]
    light = LightPyramid(16)
    seen = losses.SeenLight(surroundings, torch.device("cpu"))
    optimiser = torch.optim.Adam(light.parameters(), lr=0.05)
    for _ in range(150):
        optimiser.zero_grad()
        evaluated = light.evaluate()
        loss = seen.loss(evaluated)
        loss.backward()
        evaluated.backward()
        optimiser.step()
    assert loss.item() < 0.02
    down, up = torch.tensor([[0, 0, -1.0]]), torch.tensor([[0, 0, 1.0]])
    none = torch.zeros(1, 1)
    assert torch.allclose(light(down, none), torch.tensor([[0.2, 0.4, 0.8]]), rtol=0.05)
    assert not torch.allclose(light(up, none), torch.tensor([[0.2, 0.4, 0.8]]), rtol=0.05)


class Sky:
    """A light of one colour, tinted towards +z."""

    def __init__(self, colour: list[float], tint: float):
        self.colour, self.tint = torch.tensor(colour), tint

    def __call__(self, directions, roughness):
        return self.colour * torch.exp(self.tint * directions[:, 2:] * torch.tensor([1.0, 0.0, -1.0]))


def test_neutral_light_loss_measures_chroma_alone():
    """Grey light of any brightness costs nothing; a tint e^(t z), e^0, e^(-t z) costs the mean of 2 (t z)^2 / 3."""
    config, g = tiny(neutral_queries=20000), generator()
    assert losses.neutral_light_loss(Sky([3.0, 3.0, 3.0], 0.0), config, g).item() == pytest.approx(0.0, abs=1e-9)
    coloured = Sky([math.exp(0.5), 1.0, math.exp(-0.5)], 0.0)  # the same from everywhere: (0.5^2 + 0 + 0.5^2) / 3
    assert losses.neutral_light_loss(coloured, config, g).item() == pytest.approx(0.5 / 3, rel=1e-4)
    tinted = losses.neutral_light_loss(Sky([1.0, 1.0, 1.0], 0.6), config, g).item()
    assert tinted == pytest.approx(2.0 / 3.0 * 0.36 / 3.0, rel=0.03)


def entropy(albedo: list[float], weights: list[float] | None = None, roughness: list[float] | None = None) -> float:
    """Of grey points, from many draws."""
    n = len(albedo)
    ray = rays((weights or [1.0] * n) * 2000, [0.0] * n * 2000)
    ray.points.albedo = torch.tensor(albedo)[:, None].expand(-1, 3).repeat(2000, 1)
    ray.points.roughness = torch.tensor(roughness or [0.5] * n)[:, None].repeat(2000, 1)
    config = tiny(entropy_points=4000, albedo_width=0.3, gloss_width=0.2)
    return losses.material_entropy_loss(ray, config, generator()).item()


def test_material_entropy_counts_materials():
    """One material: 0. k equal shares of materials far apart: ln k. Two that differ by d in ln albedo:
    -ln(1/2 + e^(-3 (d/width)^2 / 4) / 2). A share that no ray sees does not count."""
    assert entropy([0.4]) == pytest.approx(0.0, abs=1e-6)
    assert entropy([0.02, 0.2, 0.9]) == pytest.approx(math.log(3), abs=0.01)
    close = -math.log(0.5 + 0.5 * math.exp(-0.75 * (math.log(0.31 / 0.26) / 0.3) ** 2))
    assert entropy([0.25, 0.30]) == pytest.approx(close, rel=0.02)
    apart = -math.log(0.5 + 0.5 * math.exp(-0.25 * (0.8 / 0.2) ** 2))
    assert entropy([0.2, 0.2], roughness=[0.1, 0.9]) == pytest.approx(apart, abs=0.01)
    assert entropy([0.02, 0.9], weights=[1.0, 0.0]) == pytest.approx(0.0, abs=1e-6)
