"""How the whole model shades a point, and what it asks of its parts: closed forms of the factors, and Fresnel's term."""

import math

import pytest
import reference
import torch
import trimesh
from mesh_shapes import traced
from op_checks import generator, unit
from splitnerf.fields import Light, MaterialHead, Occlusion, OcclusionHead
from splitnerf.fields.surface import relu_mlp
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


# ---- the networks by their own weights ----


@pytest.mark.parametrize("n_layers", [1, 3])
def test_a_network_is_its_layers_with_what_is_negative_cut_off_between_them(n_layers):
    """max(0, W x + b) for each hidden layer, W x + b at the end."""
    torch.manual_seed(0)
    net = relu_mlp(5, 16, n_layers, 4)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.normal_()
    matrices = list(net.parameters())
    assert [tuple(x.shape) for x in matrices[::2]] == [(16, 5)] + [(16, 16)] * (n_layers - 1) + [(4, 16)]
    x = expected = torch.randn(30, 5, generator=generator(1))
    for weight, bias in zip(matrices[:-2:2], matrices[1:-2:2]):
        expected = torch.where(expected @ weight.T + bias > 0, expected @ weight.T + bias, 0.0)
    torch.testing.assert_close(net(x), expected @ matrices[-2].T + matrices[-1])


def test_hidden_layers_keep_the_size_of_what_they_read_and_outputs_start_near_0():
    """Weights with a mean square of 2 over the number of inputs: half of each unit's square is cut off."""
    torch.manual_seed(0)
    net = relu_mlp(100, 400, 3, 50)
    *hidden, out = (layer for layer in net if isinstance(layer, torch.nn.Linear))
    for layer in hidden:
        assert layer.weight.square().mean().item() == pytest.approx(2.0 / layer.in_features, rel=0.05)
    assert out.weight.std().item() == pytest.approx(0.01, rel=0.05)
    assert not any(layer.bias.any() for layer in (*hidden, out))


def test_materials_are_their_own_outputs():
    """Three of albedo, one of roughness, one of metallic: sigmoids, the roughness brought to [least, 1]."""
    head = MaterialHead(4, 8, 1, 0.5, 0.2)
    logits = torch.tensor([-2.0, -0.5, 0.4, 1.0, 3.0])
    with torch.no_grad():
        head.net[-1].weight.zero_()
        head.net[-1].bias.copy_(logits)
    albedo, roughness, metallic = head(torch.zeros(2, 4))
    share = 1 / (1 + torch.exp(-logits))
    torch.testing.assert_close(albedo, share[:3].expand(2, 3))
    torch.testing.assert_close(roughness, (0.2 + 0.8 * share[3:4]).expand(2, 1))
    torch.testing.assert_close(metallic, share[4:].expand(2, 1))


@pytest.mark.parametrize(("initial", "least", "expected"), [(0.2, 0.2, 0.2008), (0.1, 0.2, 0.2008), (1.0, 0.2, 0.9992)])
def test_a_roughness_at_the_end_of_its_range_can_be_learned(initial, least, expected):
    """It starts a thousandth of the range from there, where the sigmoid still has a slope; albedo starts at a half."""
    torch.manual_seed(0)
    head = MaterialHead(4, 8, 1, initial, least)
    albedo, roughness, metallic = head(torch.zeros(1, 4))
    assert roughness.item() == pytest.approx(expected, abs=1e-6)
    torch.testing.assert_close(albedo, torch.full((1, 3), 0.5))
    assert metallic.item() == pytest.approx(1 / (1 + math.exp(2)))


def factors_of(head: OcclusionHead) -> Occlusion:
    return head([torch.randn(40, 7, generator=generator(3))])


@pytest.mark.parametrize("channels", [1, 3])
def test_the_factors_are_their_own_outputs_and_mostly_open_at_first(channels):
    head = OcclusionHead(7, 8, 1, channels)
    with torch.no_grad():
        head.net[-1].weight.zero_()
    found = factors_of(head)
    assert found.diffuse.shape == found.specular.shape == (40, channels)
    for factor in found[:2]:
        torch.testing.assert_close(factor, torch.full_like(factor, 1 / (1 + math.exp(-2))))
    logits = torch.linspace(-3, 2, 2 * channels)
    with torch.no_grad():
        head.net[-1].bias.copy_(logits)
    found, share = factors_of(head), 1 / (1 + torch.exp(-logits))
    torch.testing.assert_close(found.diffuse, share[:channels].expand(40, channels))
    torch.testing.assert_close(found.specular, share[channels:].expand(40, channels))
    assert found.indirect_diffuse is found.indirect_specular is None


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", ["mlp", "bits", "off"])
def test_all_is_open_before_the_first_mesh_without_occlusion_and_where_nothing_is_blocked(kind, channels):
    """A cube is convex: its bits answer with 1, and the network learns that by itself."""
    settings = {"occlusion.kind": kind, "occlusion.channels": channels, "shading.method": "split"}
    model = SceneModel(tiny(**settings))
    inputs = [torch.rand(40, 13), torch.rand(40, 3), torch.rand(40, model.sdf_field.grid.spec.n_outputs)]
    points = [torch.rand(40, 3), *(unit(torch.randn(40, 3)) for _ in range(2)), torch.rand(40, 1)]
    ones = torch.ones(40, channels)
    for has_mesh in (False, True):
        if has_mesh:
            model.use_mesh(None if kind != "bits" else traced(model, trimesh.creation.box()))
        for factor in model.occlusion_at(inputs, *points)[:2]:
            assert torch.equal(factor, ones) != (has_mesh and kind == "mlp") and factor.shape == ones.shape
    assert model.is_unoccluded == (kind == "bits")
