"""The small networks by their own weights: layers, where they start, and what each of their outputs is."""

import math

import pytest
import torch
import trimesh
from mesh_shapes import traced
from op_checks import generator, unit
from splitnerf.fields import MaterialHead, Occlusion, OcclusionHead
from splitnerf.fields.surface import relu_mlp
from splitnerf.render.model import SceneModel
from tiny_runs import tiny


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
