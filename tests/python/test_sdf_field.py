"""The distance field by its own weights: one formula, whichever way it is asked, where it starts, and its gradients."""

import math

import pytest
import torch
from op_checks import generator, precisions, unit
from splitnerf.fields import SdfField
from splitnerf.ops import HashGridSpec
from splitnerf.render.model import sharpness
from torch.nn import functional as F

BOX = 1.2
SPEC = HashGridSpec(n_levels=4, base_resolution=4, growth=2.0, log2_table_size=8)


def field_of(dtype: torch.dtype = torch.float64, n_active: int = 3, **settings) -> SdfField:
    """A field whose every parameter counts, of which the last level is closed."""
    torch.manual_seed(0)
    field = SdfField(SPEC, BOX, width=12, n_outputs=3, radius=0.4, **settings)
    field.grid.n_active = n_active
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return field.to(dtype)


def points(n: int = 60) -> torch.Tensor:
    return (2 * torch.rand(n, 3, generator=generator(1), dtype=torch.float64) - 1) * (0.95 * BOX)


def formula(field: SdfField, x: torch.Tensor) -> torch.Tensor:
    """W2 softplus(W1 [x, hash] + b1) + b2, softplus(y) = log(1 + exp(100 y)) / 100; rows of W are length w / |w|."""
    rows = lambda w, length: length * w / w.norm(dim=1, keepdim=True)
    features = field.grid((x + BOX) / (2 * BOX))
    inputs = torch.cat([x, features], 1) @ rows(field.hidden_direction, field.hidden_length).T + field.hidden_bias
    hidden = torch.logaddexp(100 * inputs, torch.zeros(())) / 100
    return hidden @ rows(field.out_direction, field.out_length).T + field.out_bias


def test_every_way_to_ask_gives_the_same_outputs():
    field, x = field_of(), points()
    expected = formula(field, x)
    assert expected.shape == (60, 3) and expected.std(0).min() > 0.05
    sampled, differences = field.sample(x), field.sample_finite_difference(x)
    for outputs in (field(x)[0], sampled.outputs, differences.outputs):
        torch.testing.assert_close(outputs, expected)
    with torch.no_grad():
        quick = field.sdf(x)
    for distances in (field.sdf(x), quick, sampled.sdf, differences.sdf):
        torch.testing.assert_close(distances, expected[:, 0])
    for features in (sampled.features, differences.features):
        torch.testing.assert_close(features, field.grid((x + BOX) / (2 * BOX)))
    assert field.sdf(x).requires_grad and not quick.requires_grad


def test_a_loss_on_outputs_and_gradient_reaches_every_parameter():
    """By differences of 1e-6 in each parameter's direction of its own gradient."""
    field, x = field_of(), points(20)
    a, b = (torch.randn(20, 3, generator=generator(i), dtype=torch.float64) for i in (2, 3))

    def loss(sample) -> torch.Tensor:
        return (sample.outputs * a).sum() + (sample.gradient * b).sum() + sample.features.square().sum()

    for ask in (field.sample, field.sample_finite_difference):
        field.zero_grad()
        loss(ask(x)).backward()
        for name, parameter in field.named_parameters():
            grad, values = parameter.grad.clone(), []
            assert grad.norm() > 1e-3, name
            direction = grad / grad.norm()
            for sign in (-1e-6, 1e-6):
                with torch.no_grad():
                    parameter.add_(sign * direction)
                values.append(loss(ask(x)).item())
                with torch.no_grad():
                    parameter.sub_(sign * direction)
            assert (values[1] - values[0]) / 2e-6 == pytest.approx(grad.norm().item(), rel=1e-4), name


@pytest.mark.parametrize("n_active", [1, 3])
def test_differences_are_taken_in_cells_of_the_finest_open_level(n_active):
    """(f(x + h e) - f(x - h e)) / 2 h along each axis, h the box over its cells."""
    field, x = field_of(n_active=n_active), points(20)
    for cells in (1.0, 0.3):
        h = cells * 2 * BOX / (4 * 2 ** (n_active - 1))
        steps = h * torch.eye(3, dtype=torch.float64)
        expected = torch.stack([(formula(field, x + e) - formula(field, x - e))[:, 0] / (2 * h) for e in steps], 1)
        torch.testing.assert_close(field.sample_finite_difference(x, cells).gradient, expected)


def test_differences_are_not_rounded_to_tensor_cores():
    field = field_of(torch.float32)
    asked = precisions(lambda: field.sample_finite_difference(points().float()))
    assert "ieee" in asked["linear"]


# ---- where it starts ----


def test_it_starts_as_the_distance_to_a_sphere():
    """|x| - r in the mean, up to the bend of softplus: sqrt(pi k) E[softplus(|x| sqrt(2 / k) z)] for normal z; what the
    hash grid says does not count, and the other outputs are small."""
    k = 2048
    for radius in (0.3, 0.7):
        torch.manual_seed(0)
        field = SdfField(SPEC, BOX, width=k, n_outputs=5, radius=radius)
        z = torch.linspace(-6, 6, 4001, dtype=torch.float64)
        density = torch.exp(-z * z / 2) / math.sqrt(2 * math.pi) * (12 / 4000)
        for distance in (0.1, 0.5, 1.0):
            x = distance * unit(torch.randn(400, 3, generator=generator(1)))
            bend = F.softplus(100 * distance * math.sqrt(2 / k) * z) / 100
            expected = math.sqrt(math.pi * k) * (bend * density).sum().item()
            found = field(x)[0].detach()
            assert found[:, 0].mean().item() + radius == pytest.approx(expected, rel=0.03)
            assert found[:, 0].std() < 0.05
            with torch.no_grad():
                table = field.grid.table.clone()
                field.grid.table.normal_()
                assert torch.equal(field(x)[0], found)
                field.grid.table.copy_(table)
        outputs = field.out_direction.detach()
        assert outputs[1:].std().item() == pytest.approx(math.sqrt(1 / k), rel=0.05)
        assert 1e-5 < outputs[0].std() < 1e-3 and not field.out_bias[1:].any() and not field.hidden_bias.any()
        assert field.hidden_direction[:, :3].std().item() == pytest.approx(math.sqrt(2 / k), rel=0.05)
        for part in ("hidden", "out"):
            direction, length = (getattr(field, f"{part}_{name}") for name in ("direction", "length"))
            torch.testing.assert_close(length, direction.norm(dim=1, keepdim=True))


def test_the_sharpness_is_an_exponential_between_its_bounds():
    v = torch.tensor([-0.2, 0.0, 0.3, 0.8, 0.9, 1.0], requires_grad=True)
    s = sharpness(v)
    assert s.tolist() == pytest.approx([math.exp(x) for x in (0, 0, 3, 8, 9, 9)], rel=1e-5)
    (slope,) = torch.autograd.grad(s.sum(), v)
    assert slope[[2, 3]].tolist() == pytest.approx([10 * math.exp(3), 10 * math.exp(8)], rel=1e-5)
    assert not slope[[0, 5]].any()
