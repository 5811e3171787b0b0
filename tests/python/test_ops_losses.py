"""Terms of the loss and the curve of sRGB: closed forms, and numbers at which the formulas bend."""

import math

import pytest
import torch
from op_cases import field_gradients, pixel_inputs
from op_checks import generator, lib
from splitnerf.ops import linear_to_srgb
from splitnerf.ops.light import light_prior
from splitnerf.ops.shading import srgb_to_linear
from splitnerf.ops.training import gradient_losses, pixel_losses, quadratic_entropy

# ---- pixels ----


def losses(mean, opacity, *rest, **options):
    named = dict(zip(("target", "background", "whole", "exposure"), rest))
    return pixel_losses(mean, opacity, **named, **options)


def test_no_exposure_is_one_and_no_whole_pixels_are_none():
    *photo, whole, exposure = pixel_inputs()
    none = torch.zeros_like(whole), torch.ones_like(exposure)
    assert torch.equal(losses(*photo), losses(*photo, *none))


def test_a_whole_pixel_is_compared_with_what_the_camera_added_up():
    """A white wall behind a grey object that fills 0.3 of a pixel: as light, not as sRGB; the mask's alpha says nothing of it."""
    mean, opacity, behind = torch.full((1, 3), 0.2), torch.tensor([0.3]), torch.ones(1, 3)
    seen = linear_to_srgb(0.3 * mean + 0.7 * srgb_to_linear(behind))
    whole = torch.ones(1, dtype=torch.bool)
    for alpha in (0.0, 1.0):
        target = torch.cat([seen, torch.tensor([[alpha]])], dim=1)
        colour, mask = losses(mean, opacity, target, behind, whole)
        assert colour.item() == pytest.approx(0, abs=1e-12)
        assert mask.item() == pytest.approx(-0.1 * math.log(0.3 if alpha else 0.7), rel=1e-6)
        assert losses(mean, opacity, target, behind)[0].item() > 1e-3
        srgb = losses(seen, opacity, target, behind, whole, linear=False)[0].item()
        assert srgb == pytest.approx((0.7 * (1 - seen[0, 0].item())) ** 2, rel=1e-5)


# ---- gradients ----


def crease(positions: torch.Tensor) -> torch.Tensor:
    """Normals up on the left of x = 0, and on its right, by 60 degrees to the side."""
    right = (positions[:, :1] > 0).float()
    tilted = torch.tensor([math.sin(math.pi / 3), 0.0, math.cos(math.pi / 3)])
    return right * tilted + (1 - right) * torch.tensor([0.0, 0.0, 1.0])


def test_smoothness_counts_bends():
    """Flat ground costs nothing; beside an edge of 60 degrees, whose normals are 1 apart, the share that the shift
    carries across it."""
    shifts = 0.02 * torch.randn(20000, 3, generator=generator())

    def loss(x: float) -> float:
        at = torch.tensor([[x, 0.0, 0.0]])
        gradients = 7 * torch.cat([crease(at), torch.ones(3, 3), crease(at + shifts)])
        return gradient_losses(gradients, torch.ones(1), torch.zeros(20000, dtype=torch.int64))[1].item()

    crossed = 0.5 * torch.erfc(torch.tensor(0.5) / 2**0.5).item()  # a normal variable beyond half its deviation
    assert loss(-0.5) == pytest.approx(0.0, abs=1e-6) and loss(0.5) == pytest.approx(0.0, abs=1e-6)
    assert loss(-0.01) == pytest.approx(crossed, rel=0.05)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_neighbours_at_a_right_angle_count_whatever_their_rounding(dtype):
    angles = 0.01 * torch.arange(100, dtype=dtype)
    here = torch.stack([angles.cos(), torch.zeros_like(angles), angles.sin()], 1)
    up = torch.tensor([[0.0, 1, 0]], dtype=dtype).expand(100, 3)
    _, smoothness = gradient_losses(torch.cat([here, up]), torch.ones(100, dtype=dtype), torch.arange(100))
    assert smoothness.item() == pytest.approx(math.sqrt(2), rel=1e-6)


def test_normals_a_rounding_apart_know_in_which_direction():
    """The difference of such normals is rounding along themselves; its gradient must not see that."""
    gradients = torch.tensor(
        [[-2.1564362e-10, -2.3488480e-10, 1.51317392e-3], [-6.111313e-10, -7.259329e-10, 4.662408e-3]]
    )
    found = []
    for dtype in (torch.float32, torch.float64):
        g = gradients.to(dtype).requires_grad_()
        smoothness = gradient_losses(g, torch.ones(1, dtype=dtype), torch.tensor([0]))[1]
        found.append(torch.autograd.grad(smoothness, g)[0].double())
    assert found[1].norm(dim=1).tolist() == pytest.approx([1 / 1.51317392e-3, 1 / 4.662408e-3], rel=1e-6)
    torch.testing.assert_close(found[0], found[1], rtol=1e-5, atol=1e-3)


# ---- all ----


def test_a_nan_and_an_infinity_show():
    for k, linear in ((0, True), (0, False), (1, True)):
        x = list(pixel_inputs())
        x[k][3] = math.nan
        assert losses(*x, linear=linear)[0].isnan()
    g, w, beside = field_gradients()
    g[4, 1] = math.nan
    assert all(loss.isnan() for loss in gradient_losses(g, w, beside))
    light = torch.zeros(sum(SIZES), 3)
    light[7, 1] = math.nan
    assert light_prior(light, SIZES).isnan()
    x = torch.randn(40, 5, generator=generator())
    x[3, 1] = math.nan
    assert quadratic_entropy(x).isnan()
    x[3, 1] = math.inf
    assert not quadratic_entropy(x).isfinite() or lib.quadratic_entropy(x)[1].isnan().any()


# ---- the light's prior ----

SIZES = [16, 64, 256]


def test_a_light_of_one_colour_is_free_and_a_texel_costs_what_its_level_is_worth():
    light = torch.zeros(sum(SIZES), 3, dtype=torch.float64)
    light[:16] += torch.tensor([0.5, 0.0, -0.7])
    assert light_prior(light, SIZES).item() == pytest.approx(0, abs=1e-25)
    for texel, n in ((16, 64), (16 + 63, 64), (16 + 64, 256), (335, 256)):
        for change, cost in (([0.9] * 3, 0.81 / 0.75), ([0.9, 0.0, -0.9], 0.54 / 0.12)):
            changed = light.clone()
            changed[texel] += torch.tensor(change)
            assert light_prior(changed, SIZES).item() == pytest.approx(math.log1p(cost) / n, rel=1e-7)


# ---- sRGB ----


def test_values_of_the_standard():
    """IEC 61966-2-1: 0.5 decodes to 0.21404, the joint at 0.04045 to 0.0031308."""
    decoded = srgb_to_linear(torch.tensor([0.0, 0.04045, 0.5, 1.0], dtype=torch.float64))
    assert decoded.tolist() == pytest.approx([0, 0.0031308, 0.2140411, 1], abs=1e-7)
    encoded = linear_to_srgb(torch.tensor([-1.0, 0.0, 0.5, 4.0]))
    assert encoded.tolist() == pytest.approx([0, 0, 0.735357, 1.824796], abs=1e-5)


def test_the_curve_has_a_gradient_below_its_bend():
    x = torch.tensor([-0.1, 0.0, 1e-9, 0.5], requires_grad=True)
    linear_to_srgb(x).sum().backward()
    assert x.grad[:3].tolist() == pytest.approx([0, 12.92, 12.92]) and torch.isfinite(x.grad).all()
