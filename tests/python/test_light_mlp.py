"""The light as a network, by its own weights: its waves, layers, activations, and where it starts."""

import pytest
import torch
from op_checks import generator, unit
from splitnerf.fields import LightMlp
from torch import Tensor

ACTIVATIONS = {"softplus": lambda x: torch.logaddexp(x, torch.zeros(())), "exp": lambda x: x.clamp(-12, 12).exp()}
W, RHO = unit(torch.randn(50, 3, generator=generator(1))), torch.rand(50, 1, generator=generator(2))


def light_of(activation: str, n_layers: int = 3) -> LightMlp:
    torch.manual_seed(0)
    return LightMlp(16, n_layers, direction_frequencies=3, roughness_frequencies=2, activation=activation)


def waves(w: Tensor, rho: Tensor) -> Tensor:
    """Sines and cosines of 1, 2 and 4 times each coordinate, then of 1 and 2 times the roughness."""
    angles = torch.stack([2**k * w[:, i] for i in range(3) for k in range(3)], 1)
    rough = torch.cat([rho, 2 * rho], 1)
    return torch.cat([angles.sin(), angles.cos(), rough.sin(), rough.cos()], 1)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("n_layers", [1, 3])
def test_it_is_its_layers_and_the_last_reads_the_waves_again(activation, n_layers):
    light = light_of(activation, n_layers)
    with torch.no_grad():
        for parameter in light.parameters():
            parameter.normal_(std=0.4)
    w, rho = (x.clone().requires_grad_() for x in (W, RHO))
    x = encoded = waves(w, rho)
    torch.testing.assert_close(light.encode(w, rho), encoded)
    assert [tuple(layer.weight.shape) for layer in light.hidden] == [(16, 22)] + [(16, 16)] * (n_layers - 1)
    for layer in light.hidden:
        x = x @ layer.weight.T + layer.bias
        x = x * (x > 0)
    expected = ACTIVATIONS[activation](torch.cat([x, encoded], 1) @ light.out.weight.T + light.out.bias)
    found = light(w, rho)
    torch.testing.assert_close(found, expected)
    for a, b in zip(*(torch.autograd.grad(g.sum(), (w, rho)) for g in (found, expected)), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5)
        assert a.abs().mean() > 0.01


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_it_starts_near_a_half_and_stays_positive_and_finite(activation):
    light = light_of(activation)
    assert light.out.weight.std().item() == pytest.approx(0.01, rel=0.2)
    with torch.no_grad():
        light.out.weight.zero_()
        torch.testing.assert_close(light(W, RHO), torch.full((50, 3), 0.5))
        light.out.bias.copy_(torch.tensor([-30.0, 3.0, 200.0]))
    found = light(W, RHO)[0].tolist()
    expected = {"softplus": [9.36e-14, 3.04859, 200.0], "exp": [6.1442e-06, 20.0855, 162754.8]}[activation]
    assert found == pytest.approx(expected, rel=1e-3)


def test_the_published_light_has_ten_octaves_of_directions_and_five_of_roughness():
    """70 waves, 5 layers of 256."""
    light = LightMlp()
    assert light.encode(W, RHO).shape == (50, 70) and [layer.out_features for layer in light.hidden] == [256] * 5
    assert light.out.in_features == 256 + 70 and light.activation == "softplus"
