"""The terms of the loss in preset `paper`, as its equations print them."""

import dataclasses

import pytest
import torch
from op_checks import generator, unit
from splitnerf.config import preset
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import make_grid
from splitnerf.render.renderer import find_samples, render_rays
from splitnerf.training.batches import Batch, draw_numbers, make_probes, probe_counts
from splitnerf.training.losses import loss_terms

SIZES = {"n_levels": 4, "log2_table_size": 10, "grid_resolution": 16, "min_step": 0.02}
WIDTHS = {"constants.materials_width": 16, "occlusion_width": 16, "light_width": 16}
SMALL = SIZES | WIDTHS | {"light_samples": 64, "light_queries": 32}


@pytest.fixture(scope="module")
def rendered():
    """A model of preset paper, rays that meet its sphere or its edge, and the terms of the loss."""
    torch.manual_seed(0)
    config = preset("paper").replace(SMALL)
    model, g = SceneModel(config), generator(2)
    grid = make_grid(config)
    grid.update(model.sdf_field.sdf, model.s_value)
    n = 300
    origins = 3.0 * unit(torch.randn(n, 3, generator=g))
    directions = unit(0.4 * torch.randn(n, 3, generator=g) - origins)
    target = 0.9 * torch.rand(n, 4, generator=g)  # nowhere saturated
    background, jitter = torch.rand(n, 3, generator=g), torch.rand(n, generator=g)
    photo = torch.zeros(n, dtype=torch.int64), torch.ones(n, 3)
    probes = make_probes(config, *draw_numbers(g, probe_counts(config)))
    whole = torch.zeros(n, dtype=torch.bool)
    batch = Batch(origins, directions, target, *photo, background, whole, jitter, jitter, probes)
    light = model.evaluate_light()
    ray = render_rays(model, light, find_samples(model, grid.cells, *batch[:2], batch.jitter, probes=batch.probes))
    return config, batch, ray, loss_terms(model, light, batch, ray, None, None, g, 0, 0.0)


def weighted(terms, name: str) -> float:
    return terms[name].weight * terms[name].value.item()


@pytest.mark.parametrize("linear", [False, True])
def test_colours_are_summed_over_channels_and_averaged_over_rays(rendered, linear):
    """Eq. (3) with its weight of 10, in sRGB, also where they are added in linear light, over the batch's own background."""
    config, batch, ray, terms = rendered
    if linear:
        model, before = SceneModel(config), ray.colour
        ray = dataclasses.replace(ray, linear=True)
        terms = loss_terms(model, model.evaluate_light(), batch, ray, None, None, generator(2), 0, 0.0)
        assert (ray.colour - before).abs().max() > 0.1
    predicted = batch.background + ray.opacity[:, None] * (ray.colour - batch.background)
    truth = batch.background + batch.target[:, 3:] * (batch.target[:, :3] - batch.background)
    expected = 10.0 * (predicted - truth).square().sum(1).mean().item()
    assert (ray.opacity > 0.5).any() and (ray.opacity < 0.1).any()
    assert weighted(terms, "colour") == pytest.approx(expected, rel=1e-5)


WEIGHTS = dict(colour_weight=0.11, eikonal_weight=0.13, mask_weight=0.17, light_weight=0.19, neutral_weight=0.23)
WEIGHTS |= dict(smoothness_weight=0.29, entropy_weight=0.31, metal_weight=0.37)
WEIGHTS |= dict(dark_metal_weight=0.43, occlusion_weight=0.47, light_prior_weight=0.53)
FIXED = {"light": 2.0, "neutral": 3.0, "entropy": 5.0, "occlusion": 7.0}


@pytest.fixture
def every_term(rendered, monkeypatch):
    """Makes the terms of a step, by weight and value, with settings changed; the terms that draw numbers stand for themselves."""
    from splitnerf.training import losses

    config, batch, ray, _ = rendered
    asked = {}

    def fixed(name: str):
        return lambda *args: asked.update({name: args}) or torch.tensor(FIXED[name])

    for name in FIXED:
        function = {"light": "light_loss", "neutral": "neutral_light_loss", "entropy": "material_entropy_loss"}.get(
            name, f"{name}_loss"
        )
        monkeypatch.setattr(losses, function, fixed(name))

    def terms(step: int = 8, progress: float = 0.5, **settings):
        asked.clear()
        model = SceneModel(config.replace({f"losses.{name}": x for name, x in (WEIGHTS | settings).items()}))
        g = generator(5)
        found = loss_terms(model, model.light, batch, ray, "scene", torch.ones(1), g, step, progress)
        return {name: (term.weight, term.value.item()) for name, term in found.items()}, asked, g

    return terms


def test_each_term_has_its_own_weight_and_its_own_value(rendered, every_term):
    """Colours three times, for their channels; masks by cross entropy, metals by weighted means over shaded samples."""
    _, batch, ray, _ = rendered
    found, _, _ = every_term()
    opacity, mask = ray.opacity.clamp(1e-3, 1 - 1e-3), batch.target[:, 3]
    w, m = ray.shares / ray.shares.sum(), ray.points.metallic[:, 0]
    f0 = ray.points.albedo.amax(1)
    expected = {
        "eikonal": (0.13, (ray.gradients.norm(dim=1) - 1).square().mean().item()),
        "mask": (0.17, -(mask * opacity.log() + (1 - mask) * (1 - opacity).log()).mean().item()),
        "metal": (0.37, (w @ m.square()).item()),
        "dark_metal": (0.43, (w @ (m * (1 - f0 / 0.4).clamp(min=0))).item()),
        "light": (0.19, 2.0),
        "neutral": (0.23, 3.0),
        "entropy": (0.31, 5.0),
        "occlusion": (0.47, 7.0),
    }
    assert found["colour"][0] == pytest.approx(3 * 0.11) and found["smoothness"] == (0.29, 0.0)
    assert set(found) == {*expected, "colour", "smoothness"}
    for name, (weight, value) in expected.items():
        assert found[name] == (weight, pytest.approx(value, rel=2e-2 if name == "mask" else 1e-4)), name


def test_terms_come_when_they_are_due(every_term):
    """Priors from the half of the run; what has no weight is not computed."""
    assert "entropy" not in every_term(progress=0.49)[0]
    assert not every_term(**dict.fromkeys(WEIGHTS, 0.0))[0].keys() - {"colour", "eikonal", "occlusion"}


def test_priors_of_the_shape_end(rendered):
    """From their share of the run on a tenth of the weights of distances and masks is left, and no smoothness."""
    config, batch, ray, _ = rendered
    config = config.replace({"smoothness_weight": 0.29, "mask_weight": 0.17, "constants.shape_priors_until": 0.7})
    model = SceneModel(config)
    before, after = (loss_terms(model, model.light, batch, ray, None, None, generator(5), 0, at) for at in (0.69, 0.7))
    weights = {name: (before[name].weight, after[name].weight) for name in ("eikonal", "mask", "colour")}
    assert weights["eikonal"] == pytest.approx((0.1, 0.01)) and weights["mask"] == pytest.approx((0.17, 0.017))
    assert weights["colour"][0] == weights["colour"][1] and before["smoothness"].weight == 0.29
    assert "smoothness" not in after


@pytest.mark.parametrize(("error", "factor"), [(1 / 1500, 1.0), (1 / 6000, 0.25), (0.003, 4.5), (0.1, 10.0)])
def test_normals_are_smoother_where_photos_are_explained_less(every_term, monkeypatch, error, factor):
    from splitnerf.training import losses

    monkeypatch.setattr(losses, "pixel_losses", lambda *_, **options: torch.tensor([error, 1.0]))
    monkeypatch.setattr(losses, "gradient_losses", lambda *_: torch.tensor([2.0, 3.0]))
    found, _, _ = every_term()
    assert found["eikonal"] == (0.13, 2.0) and found["smoothness"] == (0.29, pytest.approx(3.0 * factor))


def test_terms_that_draw_numbers_draw_others_with_each_step(every_term):
    """By the run's generator, and by the step's number as the seed of what has no generator."""
    for step in (8, 12):
        _, asked, g = every_term(step=step)
        assert asked["light"][-2:] == asked["occlusion"][-2:] == (g, step)
        assert asked["neutral"][-1] is asked["entropy"][-1] is g
