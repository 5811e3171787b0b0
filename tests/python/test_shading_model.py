"""How the whole model shades a point, and what it asks of its parts: closed forms of the factors, of Fresnel's term, of the light."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from op_checks import generator, unit
from tiny_runs import tiny

from splitnerf.fields import EvaluatedLight, Light, LightMlp, Occlusion
from splitnerf.ops import FRESNEL_MODES, brdf_lut, split_sum_shade
from splitnerf.render.model import SceneModel, ShadedPoints
from splitnerf.training import losses

K = 60  # points
NODES = 32  # of the table of F1 and F2, along either edge


class TwoLights(Light):
    """One radiance for whoever asks about the diffuse light, roughness 1, and another for all lobes."""

    def __init__(self, diffuse: float, specular: float):
        super().__init__()
        self.level = torch.nn.Parameter(torch.tensor([specular, diffuse]))

    def forward(self, directions, roughness):
        return self.level[(roughness[:, 0] == 1).long()][:, None].expand(-1, 3)


class Given(torch.nn.Module):
    """Answers the same to everybody."""

    def __init__(self, answer):
        super().__init__()
        self.answer = answer

    def forward(self, *inputs):
        return self.answer


def points_of(metallic: float, roughness: float = 0.4) -> tuple:
    g = generator(3)
    albedo = 0.1 + 0.8 * torch.rand(K, 3, generator=g)
    return albedo, torch.full((K, 1), roughness), torch.full((K, 1), metallic)


def shade(light: Light, materials: tuple, occlusion: Occlusion | None = None, **settings: object) -> ShadedPoints:
    """Points of these materials, seen from anywhere above, by a model with this light and these factors."""
    model = SceneModel(tiny(**{"shading.method": "split"}, **settings))
    model.light, model.material = light, Given(materials)
    if occlusion is not None:
        model.occlusion = Given(occlusion)
    g = generator(4)
    normals = unit(torch.randn(K, 3, generator=g))
    views = unit(normals + 0.97 * unit(torch.randn(K, 3, generator=g)))
    n_features = model.sdf_field.grid.spec.n_outputs
    light = EvaluatedLight(model.light.evaluate())
    return model.shade(light, torch.zeros(K, 3), torch.zeros(K, 13), torch.zeros(K, n_features), normals, views)


def factors(diffuse: float, specular: float, channels: int = 1) -> Occlusion:
    return Occlusion(torch.full((K, channels), diffuse), torch.full((K, channels), specular))


# ---- the factors of occlusion ----


@pytest.mark.parametrize("channels", [1, 3])
def test_a_metal_is_darkened_by_what_its_lobe_does_not_see(channels):
    """It has no diffuse part: its radiance is o_s times that of an open place, whatever o_d is."""
    light, metal, settings = TwoLights(2.0, 3.0), points_of(1.0), {"occlusion_channels": channels}
    open_place = shade(light, metal, **settings).radiance
    blocked = shade(light, metal, factors(0.9, 0.25, channels), **settings)
    torch.testing.assert_close(blocked.radiance, 0.25 * open_place)
    assert (blocked.occlusion_d == 0.9).all() and (blocked.occlusion_s == 0.25).all()


def test_a_matte_surface_is_darkened_by_what_its_hemisphere_does_not_see():
    """Where no light comes from the lobe, radiance is o_d times that of an open place, whatever o_s is."""
    light, matte = TwoLights(2.0, 0.0), points_of(0.0)
    open_place = shade(light, matte).radiance
    assert open_place.min() > 0.05
    torch.testing.assert_close(shade(light, matte, factors(0.25, 0.9)).radiance, 0.25 * open_place)


def test_light_of_the_object_itself_comes_in_where_the_sky_does_not():
    """A metal reflects o_s of the sky and the specular indirect light, a matte surface without a lobe the diffuse ones."""
    sent_d, sent_s = torch.full((K, 3), 0.7), torch.full((K, 3), 0.4)
    dark = TwoLights(0.0, 0.0)
    blocked = factors(0.25, 0.5)._replace(indirect_diffuse=sent_d, indirect_specular=sent_s)
    for materials, light, sky, sent in (
        (points_of(1.0), TwoLights(2.0, 3.0), 0.5 * 3.0, 0.4), (points_of(0.0), TwoLights(2.0, 0.0), 0.25 * 2.0, 0.7),
    ):  # fmt: skip
        only = Occlusion(*blocked[:2], sent_d, sent_s if materials[2][0] == 1 else 0 * sent_s)
        unit_light = shade(TwoLights(1.0, 1.0 if materials[2][0] == 1 else 0.0), materials).radiance
        torch.testing.assert_close(shade(light, materials, only).radiance, (sky + sent) * unit_light)
        torch.testing.assert_close(shade(dark, materials, only).radiance, sent * unit_light)


# ---- Fresnel's term ----


def at_nodes(mode: str, metallic: float = 0.0, albedo: tuple = (0.2, 0.5, 0.9)) -> tuple[torch.Tensor, dict]:
    """Radiance [n, 3] at the nodes of the table but for n.v = 0, under light 1 from everywhere, and what it is made of."""
    x, rho = torch.meshgrid(torch.linspace(0, 1, NODES)[1:], torch.linspace(0, 1, NODES), indexing="xy")
    cosine, rho = x.reshape(-1) ** 2, rho.reshape(-1, 1)
    n = len(cosine)
    up = torch.tensor([[0.0, 0.0, 1.0]]).expand(n, 3)
    views = torch.stack([(1 - cosine**2).sqrt(), torch.zeros(n), cosine], 1)
    albedo, one = torch.tensor([albedo]).expand(n, 3), torch.ones(n, 1)
    white = torch.ones(n, 3)
    radiance = split_sum_shade(up, views, albedo, rho, metallic * one, white, white, one, one, fresnel_mode=mode)
    f1, f2, _, layer = brdf_lut()[:, 1:].reshape(-1, 4, 1).unbind(1)
    return radiance, dict(albedo=albedo, rho=rho, grazing=(1 - cosine[:, None]) ** 5, f1=f1, f2=f2, layer=layer)


@pytest.mark.parametrize("metallic", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("mode", FRESNEL_MODES)
def test_fresnels_term_by_its_name(mode, metallic):
    """exact: E = m (albedo F1 + F2) + (1 - m) E_d, diffuse (1 - m)(1 - E_d); as published E = F_r F1 + F2,
    (1 - m)(1 - F_r), with Schlick's F_r = F0 + (1 - rho - F0)(1 - n.v)^5, in the released code with max(1 - rho, F0) for
    1 - rho."""
    radiance, p = at_nodes(mode, metallic)
    if mode == "exact":
        energy, taken = metallic * (p["albedo"] * p["f1"] + p["f2"]) + (1 - metallic) * p["layer"], p["layer"]
    else:
        f0 = 0.04 * (1 - metallic) + metallic * p["albedo"]
        rim = 1 - p["rho"] if mode == "paper" else torch.maximum(1 - p["rho"], f0)
        taken = f0 + (rim - f0) * p["grazing"]
        energy = taken * p["f1"] + p["f2"]
    diffuse = (1 - metallic) * (1 - taken) * p["albedo"]
    torch.testing.assert_close(radiance, diffuse + energy, rtol=1e-4, atol=1e-5)


def test_white_returns_its_light_by_the_exact_term_and_more_by_the_published_ones():
    """(1 - E) + E = 1; those that count Fresnel's term twice send out more than comes in."""
    for mode in FRESNEL_MODES:
        radiance, _ = at_nodes(mode, 0.0, (1.0, 1.0, 1.0))
        if mode == "exact":
            torch.testing.assert_close(radiance, torch.ones_like(radiance))
        else:
            assert radiance.max() > 1.02


@pytest.mark.parametrize("mode", FRESNEL_MODES)
def test_the_model_shades_by_the_term_that_is_set(mode):
    light, materials = TwoLights(2.0, 3.0), points_of(0.8, roughness=0.7)
    shaded = shade(light, materials, **{"shading.fresnel": mode})
    g = generator(4)
    normals = unit(torch.randn(K, 3, generator=g))
    views = unit(normals + 0.97 * unit(torch.randn(K, 3, generator=g)))
    white, one = torch.ones(K, 3), torch.ones(K, 1)
    expected = {
        name: split_sum_shade(normals, views, *materials, 3 * white, 2 * white, one, one, name, True) for name in FRESNEL_MODES
    }  # fmt: skip
    torch.testing.assert_close(shaded.radiance, expected[mode])
    assert all((expected[mode] - expected[other]).abs().max() > 0.03 for other in FRESNEL_MODES if other != mode)


# ---- the light and its consistency ----


class Steps(torch.nn.Module):
    """Radiance 1 from everywhere, but 1 + off, channel by channel, where it is asked for a rough lobe."""

    def __init__(self, off: list[float]):
        super().__init__()
        self.off = torch.tensor(off)

    def forward(self, directions, roughness):
        return 1.0 + (roughness > 0) * self.off


@pytest.mark.parametrize(
    ("form", "expected"), [("square", 0.1**2 + 0.2**2 + 2.0**2), ("smooth_l1", 0.005 + 0.02 + 1.5)]
)
def test_the_light_loss_is_the_mean_over_queries_of_the_sum_over_channels(form, expected):
    """Eq. (11): the mean over s of |g(s) - gbar(s)|^2, a vector's length: off by (0.1, -0.2, 2) costs 0.01 + 0.04 + 4."""
    config = tiny(**{"light.kind": "mlp", "shading.method": "split", "constants.light_form": form}, light_noise=0.0, light_lobe_below=0.0)
    for n_queries in (16, 64):
        found = losses.light_loss(Steps([0.1, -0.2, 2.0]), config.replace({"light_queries": n_queries}), generator(), 0)
        assert found.item() == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("activation", ["softplus", "exp"])
def test_the_mlp_light_hears_the_roughness(activation):
    """For each direction g(w, .) is a function of rho that bends: by rho's own sines and cosines, k octaves of them."""
    torch.manual_seed(0)
    light = LightMlp(width=16, n_layers=2, direction_frequencies=2, roughness_frequencies=4, activation=activation)
    with torch.no_grad():
        light.out.weight.normal_(std=0.3)
    w = unit(torch.randn(1, 3)).expand(200, 3)
    rho = torch.linspace(0, 1, 200)[:, None].requires_grad_()
    radiance = light(w, rho)
    assert (radiance.amax(0) - radiance.amin(0)).min() > 0.02
    (slope,) = torch.autograd.grad(radiance.sum(), rho)
    assert slope.abs().max() > 0.1 and slope.std() > 0.1
    encoded = light.encode(w, rho.detach())
    waves = torch.cat([f(2.0**k * rho.detach()) for f in (torch.sin, torch.cos) for k in range(4)], 1)
    assert np.allclose(encoded[:, -8:], waves, atol=1e-6)


def test_the_mlp_light_learns_a_lamp_that_fades_with_roughness():
    """Two levels, 2 where sharp and 0.5 where rough: a light that is deaf to roughness stays at their mean, 1.25."""
    torch.manual_seed(0)
    light = LightMlp(width=16, n_layers=2, direction_frequencies=2, roughness_frequencies=3)
    optimiser = torch.optim.Adam(light.parameters(), lr=0.02)
    g = generator()
    for _ in range(150):
        w, rho = unit(torch.randn(128, 3, generator=g)), torch.randint(2, (128, 1), generator=g).float()
        loss = (light(w, rho) - (2.0 - 1.5 * rho)).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    w = unit(torch.randn(50, 3, generator=g))
    for rho, level in ((0.0, 2.0), (1.0, 0.5)):
        torch.testing.assert_close(light(w, torch.full((50, 1), rho)).mean().item(), level, rtol=0, atol=0.1)
