"""How the whole model shades a point, and what it asks of its parts: closed forms of the factors, and Fresnel's term."""

import pytest
import reference
import torch
from op_checks import generator, unit
from splitnerf.fields import Light, Occlusion
from splitnerf.ops.shading import brdf_lut
from splitnerf.render.model import SceneModel, ShadedPoints
from test_views import Given
from tiny_runs import tiny

K = 60  # points


class TwoLights(Light):
    """One radiance for whoever asks about the diffuse light, roughness 1, and another for all lobes."""

    def __init__(self, diffuse: float, specular: float):
        super().__init__()
        self.level = torch.nn.Parameter(torch.tensor([specular, diffuse]))

    def forward(self, directions, roughness):
        return self.level[(roughness[:, 0] == 1).long()][:, None].expand(-1, 3)


def points_of(metallic: float, roughness: float = 0.4) -> tuple:
    g = generator(3)
    albedo = 0.1 + 0.8 * torch.rand(K, 3, generator=g)
    return albedo, torch.full((K, 1), roughness), torch.full((K, 1), metallic)


def seen() -> tuple[torch.Tensor, torch.Tensor]:
    """Normals, and directions to viewers anywhere above them."""
    g = generator(4)
    normals = unit(torch.randn(K, 3, generator=g))
    return normals, unit(normals + 0.97 * unit(torch.randn(K, 3, generator=g)))


def shade(light: Light, materials: tuple, occlusion: Occlusion | None = None, **settings: object) -> ShadedPoints:
    """Points of these materials, seen from anywhere above, by a model with this light and these factors."""
    model = SceneModel(tiny(**{"shading.method": "split"}, **settings))
    model.light, model.material = light, Given(lambda *_: materials)
    if occlusion is not None:
        model.occlusion_at = lambda *_: occlusion
    normals, views = seen()
    n_features = model.sdf_field.grid.spec.n_outputs
    light = model.light.evaluate()
    return model.shade(light, torch.zeros(K, 3), torch.zeros(K, 13), torch.zeros(K, n_features), normals, views)


def factors(diffuse: float, specular: float, channels: int = 1) -> Occlusion:
    return Occlusion(torch.full((K, channels), diffuse), torch.full((K, channels), specular))


@pytest.mark.parametrize("channels", [1, 3])
def test_a_metal_is_darkened_by_what_its_lobe_does_not_see(channels):
    """It has no diffuse part: its radiance is o_s times that of an open place, whatever o_d is."""
    light, metal, settings = TwoLights(2.0, 3.0), points_of(1.0), {"occlusion_channels": channels}
    open_place = shade(light, metal, **settings).radiance
    blocked = shade(light, metal, factors(0.9, 0.25, channels), **settings)
    torch.testing.assert_close(blocked.radiance, 0.25 * open_place)
    assert (blocked.occlusion_d == 0.9).all() and (blocked.occlusion_s == 0.25).all()


def test_light_of_the_object_itself_comes_in_where_the_sky_does_not():
    """A metal reflects o_s of the sky and the specular indirect light, a matte surface without a lobe the diffuse ones."""
    sent_d, sent_s = torch.full((K, 3), 0.7), torch.full((K, 3), 0.4)
    dark = TwoLights(0.0, 0.0)
    blocked = factors(0.25, 0.5)._replace(indirect_diffuse=sent_d, indirect_specular=sent_s)
    for materials, light, sky, sent in (
        (points_of(1.0), TwoLights(2.0, 3.0), 0.5 * 3.0, 0.4),
        (points_of(0.0), TwoLights(2.0, 0.0), 0.25 * 2.0, 0.7),
    ):
        only = Occlusion(*blocked[:2], sent_d, sent_s if materials[2][0] == 1 else 0 * sent_s)
        unit_light = shade(TwoLights(1.0, 1.0 if materials[2][0] == 1 else 0.0), materials).radiance
        torch.testing.assert_close(shade(light, materials, only).radiance, (sky + sent) * unit_light)
        torch.testing.assert_close(shade(dark, materials, only).radiance, sent * unit_light)


MODES = {"exact": 0, "paper": 1}  # by their numbers in the reference


@pytest.mark.parametrize(("mode", "compensate"), [*((mode, True) for mode in MODES), ("exact", False)])
def test_the_model_shades_by_the_terms_that_are_set(mode, compensate):
    light, materials = TwoLights(2.0, 3.0), points_of(0.8, roughness=0.7)
    shaded = shade(light, materials, **{"shading.fresnel": mode, "shading.compensate": compensate})
    normals, views = seen()
    white, one = torch.ones(K, 3), torch.ones(K, 1)

    def by(mode: str, compensate: bool) -> torch.Tensor:
        lights = 3 * white, 2 * white, one, one, brdf_lut()
        return reference.split_sum_shade(normals, views, *materials, *lights, MODES[mode], compensate)

    torch.testing.assert_close(shaded.radiance, by(mode, compensate), rtol=1e-4, atol=1e-5)
    others = [by(name, compensate) for name in MODES if name != mode] + [by(mode, not compensate)]
    assert all((shaded.radiance - other).abs().max() > 0.03 for other in others)
