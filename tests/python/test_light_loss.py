"""The light's consistency loss by lights whose integrals are known, and what the other terms draw and see."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from op_checks import generator
from splitnerf.data.environment import seen_at
from splitnerf.fields import LightPyramid
from splitnerf.training import losses
from test_physics import rays
from tiny_runs import tiny

LOOSE = {"light_lobe_below": 0.0, "constants.light_form": "square"}


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
    ray.points.albedo, ray.points.roughness = torch.full((2, 3), 0.4), torch.full((2, 1), 0.5)
    assert losses.material_entropy_loss(ray, tiny(), generator()).item() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("channels", [1, 3])
def test_occlusion_is_traced_for_its_share_as_it_is_set(monkeypatch, channels):
    """A fifth of the samples, off the surface by the offset, by the step's seed; all off by 0.1 and 0.3 cost 0.1 in each channel."""
    asked, n = {}, 2000

    def factors(scene, positions, normals, *, lobe_dirs, roughness, environment, **kwargs):
        asked.update(n=len(positions), **kwargs)
        return torch.full((len(positions), channels), 0.5), torch.full((len(positions), channels), 0.5)

    monkeypatch.setattr(losses, "occlusion_factors", factors)
    ray = rays([1.0] * n, [0.0] * n)
    ray.positions = ray.normals = torch.zeros(n, 3)
    ray.sdf, ray.points.roughness = torch.zeros(n), torch.ones(n, 1)
    ray.points.occlusion_d, ray.points.occlusion_s = torch.full((n, channels), 0.6), torch.full((n, channels), 0.2)
    config = tiny(occlusion_share=0.2, occlusion_channels=channels, occlusion_offset=0.037, occlusion_rays=5)
    loss = losses.occlusion_loss(ray, None, None, config, generator(), 9)
    assert loss.item() == pytest.approx(0.1, rel=1e-4) and asked.pop("n") == pytest.approx(0.2 * n, rel=0.15)
    assert asked == dict(n_diffuse_rays=5, n_specular_rays=5, offset=0.037, seed=9, n_channels=channels)


def occlusion_rays(n: int) -> SimpleNamespace:
    """Samples whose number stands in all that belongs to them; factors are off 0.5 by 0.002 and -0.004 of it."""
    number = torch.arange(float(n))
    column = number[:, None]
    points = SimpleNamespace(roughness=column, occlusion_d=0.5 + 0.002 * column, occlusion_s=0.5 - 0.004 * column)
    normals, sdf = column + torch.tensor([0.0, 0.5, 0.0]), torch.full((n,), 0.5)
    rest = {"shaded": torch.arange(n), "shares": 1.0 + number, "positions": column.expand(-1, 3)}
    return SimpleNamespace(**rest, sdf=sdf, normals=normals, points=points)


def test_what_belongs_to_a_chosen_sample_stays_together(monkeypatch):
    """About 60 of 200, drawn by the run's own generator: w (0.002^2 + 0.004^2) i^2 over the sum of w."""
    asked = []

    def factors(scene, positions, normals, lobe_dirs, roughness, environment, **_):
        asked.append((positions, normals, lobe_dirs, roughness[:, 0]))
        return torch.full((len(positions), 1), 0.5), torch.full((len(positions), 1), 0.5)

    monkeypatch.setattr(losses, "occlusion_factors", factors)
    config = tiny(occlusion_share=0.3, occlusion_channels=1)
    found = []
    for seed in range(2):
        torch.manual_seed(seed)
        found.append(losses.occlusion_loss(occlusion_rays(200), None, None, config, generator(), 0).item())
    positions, normals, lobes, number = asked[0]
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
        ray.points.albedo, ray.points.roughness = torch.full((2, 3), 0.4), torch.full((2, 1), 0.5)
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
