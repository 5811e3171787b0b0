"""Terms of the loss: closed forms, the formulas as written in torch, gradients, errors."""

from __future__ import annotations

import math

import pytest
import reference
import torch
from op_cases import CASES, field_gradients, pixel_inputs, rand
from op_checks import check_error, check_no_gradient, check_op, generator, grad_leaves, lib

from splitnerf.ops import (
    gradient_losses, linear_to_srgb, material_losses, pixel_losses, quadratic_entropy, srgb_to_linear,
)  # fmt: skip


def same_as(ours: tuple, theirs: tuple, leaves: tuple, twins: tuple) -> None:
    """Values, and gradients of a weighted sum of them."""
    for a, b in zip(ours, theirs):
        torch.testing.assert_close(a, b)
    for losses in (ours, theirs):
        sum(k * x for k, x in zip((1.0, -2.0, 3.0), losses)).backward()
    for a, b in zip(leaves, twins):
        if a.requires_grad:
            torch.testing.assert_close(a.grad, b.grad)


# ---- pixels ----


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("n", [1, 60])
def test_pixels_and_their_gradients_are_the_formula(n, linear):
    leaves, twins = grad_leaves(pixel_inputs(n), (0, 1)), grad_leaves(pixel_inputs(n), (0, 1))
    same_as(pixel_losses(*leaves, linear=linear), reference.pixel_losses(*twins, linear), leaves, twins)


def test_an_exposure_is_a_factor_of_the_colours():
    """Of each channel, and of the gradient; none is the same as 1, and no whole pixel as all that are none."""
    mean, opacity, target, background, whole, exposure = pixel_inputs(60)
    ours, theirs = mean.clone().requires_grad_(), mean.clone().requires_grad_()
    a = pixel_losses(ours, opacity, target, background, whole, exposure)
    b = pixel_losses(theirs * exposure, opacity, target, background, whole)
    torch.testing.assert_close(a, b)
    a.sum().backward()
    b.sum().backward()
    torch.testing.assert_close(ours.grad, theirs.grad)
    none = pixel_losses(mean, opacity, target, background, torch.zeros_like(whole), torch.ones_like(exposure))
    assert torch.equal(pixel_losses(mean, opacity, target, background), none)


def test_a_clipped_photo_asks_only_for_enough():
    bright = torch.full((4, 3), 3.0, requires_grad=True)
    target, opacity = torch.ones(4, 4), torch.ones(4)
    colour, _ = pixel_losses(bright, opacity, target, torch.zeros(4, 3), linear=False)
    colour.backward()
    assert colour.item() == 0.0 and torch.equal(bright.grad, torch.zeros(4, 3))
    assert pixel_losses(0.5 * torch.ones(4, 3), opacity, target, torch.zeros(4, 3), linear=False)[
        0
    ].item() == pytest.approx(0.25)


def test_a_whole_pixel_is_compared_with_what_the_camera_added_up():
    """A white wall behind a grey object that fills .3 of a pixel: as light, not as sRGB; the mask's alpha says nothing of it."""
    mean, opacity, behind = torch.full((1, 3), 0.2), torch.tensor([0.3]), torch.ones(1, 3)
    seen = linear_to_srgb(0.3 * mean + 0.7 * srgb_to_linear(behind))
    whole = torch.ones(1, dtype=torch.bool)
    for alpha in (0.0, 1.0):
        target = torch.cat([seen, torch.tensor([[alpha]])], dim=1)
        colour, mask = pixel_losses(mean, opacity, target, behind, whole)
        assert colour.item() == pytest.approx(0, abs=1e-12)
        assert mask.item() == pytest.approx(-0.1 * math.log(0.3 if alpha else 0.7), rel=1e-6)
        assert pixel_losses(mean, opacity, target, behind)[0].item() > 1e-3
        srgb = pixel_losses(seen, opacity, target, behind, whole, linear=False)[0].item()
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


def test_gradients_and_theirs_are_the_formula():
    leaves, twins = grad_leaves(field_gradients(), (0,)), grad_leaves(field_gradients(), (0,))
    same_as(gradient_losses(*leaves), reference.gradient_losses(*twins), leaves, twins)


def test_neighbours_on_the_other_side_do_not_count():
    gradients = torch.tensor([[0.0, 0, 1], [0, 0, -1], [0.6, 0, 0.8]])
    beside, weights = torch.tensor([0, 0]), torch.ones(1)
    assert gradient_losses(gradients, weights, beside)[1].item() == pytest.approx(math.hypot(0.6, 0.2), rel=1e-6)
    assert gradient_losses(gradients[:2], weights, beside[:1])[1].item() == 0.0


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


def test_neighbours_without_a_direction_do_not_count():
    gradients = torch.tensor([[0.0, 0, 1], [0, 0, 1e-5], [0, 1, 0], [0.6, 0, 0.8]])
    pair, alone = torch.tensor([0, 1]), torch.tensor([1])
    assert gradient_losses(gradients, torch.ones(2), pair)[1].item() == pytest.approx(math.sqrt(2), rel=1e-6)
    assert gradient_losses(gradients, torch.ones(2), alone)[1].item() == 0.0


def test_a_gradient_of_length_zero_has_a_finite_one():
    g = torch.zeros(3, 3, requires_grad=True)
    eikonal, smoothness = gradient_losses(g, torch.ones(1), torch.tensor([0, 0]))
    (eikonal + smoothness).backward()
    assert eikonal.item() == 1.0 and smoothness.item() == 0.0 and torch.equal(g.grad, torch.zeros(3, 3))


# ---- materials ----


@pytest.mark.parametrize("smooth_l1", [True, False])
def test_materials_and_their_gradients_are_the_formula(smooth_l1):
    x = rand(50, 3), rand(50, 1, seed=1), rand(50, seed=2)
    leaves, twins = grad_leaves(x, (1,)), grad_leaves(x, (1,))
    ours, theirs = material_losses(*leaves, smooth_l1=smooth_l1), reference.material_losses(*twins, smooth_l1)
    same_as(ours, theirs, leaves, twins)


def test_metals_by_hand():
    """Eq. (18); a metal by halves; dark metals, but neither bright ones nor dielectrics."""
    metallic, shares = torch.tensor([[1.0], [0.4]]), torch.tensor([0.5, 0.25])
    metal, binary, _ = material_losses(torch.ones(2, 3), metallic, shares)
    assert metal.item() == pytest.approx((0.5 + 0.25 * 0.16) / 0.75) and binary.item() == pytest.approx(
        0.25 * 0.24 / 0.75
    )
    assert material_losses(torch.ones(1, 3), metallic[1:], shares[1:], smooth_l1=True)[0].item() == pytest.approx(0.08)
    albedo = torch.tensor([[0.1, 0.2, 0.0], [0.5, 0.1, 0.1], [0.01, 0.01, 0.01]])
    assert material_losses(albedo, torch.tensor([[1.0], [1.0], [0.0]]), torch.ones(3))[2].item() == pytest.approx(
        (1 - 0.2 / 0.4) / 3
    )


# ---- all ----


def test_a_batch_without_anything_costs_nothing():
    nothing = torch.zeros(0, 3)
    losses = [
        *pixel_losses(nothing, torch.zeros(0), torch.zeros(0, 4), nothing),
        *gradient_losses(nothing, torch.zeros(0), torch.zeros(0, dtype=torch.int64)),
        *material_losses(nothing, torch.zeros(0, 1), torch.zeros(0)),
    ]
    assert all(loss.item() == 0.0 for loss in losses)


def test_a_nan_shows():
    for k, linear in ((0, True), (0, False), (1, True)):
        x = list(pixel_inputs())
        x[k][3] = math.nan
        assert pixel_losses(*x, linear=linear)[0].isnan()
    g, w, beside = field_gradients()
    g[4, 1] = math.nan
    assert all(loss.isnan() for loss in gradient_losses(g, w, beside))
    metallic = rand(5, 1)
    metallic[2] = math.nan
    assert all(loss.isnan() for loss in material_losses(rand(5, 3), metallic, rand(5)))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_opcheck_of_the_losses(dtype):
    check_op(lib.pixel_losses, (*pixel_inputs(9, dtype), True), (0, 1))
    check_op(lib.gradient_losses, field_gradients(dtype), (0,))
    for op in ("pixel_losses_backward", "gradient_losses_backward", "material_losses_backward"):
        check_op(getattr(lib, op), CASES[op](dtype))
    check_op(lib.material_losses, (rand(6, 3, dtype=dtype), rand(6, 1, dtype=dtype), rand(6, dtype=dtype), False), (1,))


def test_gradients_of_the_losses_by_differences():
    """In float64, away from the bounds of the mask and from what is clipped."""
    mean, opacity, target, background, whole, exposure = pixel_inputs(9)
    inputs = mean.abs() + 0.1, opacity.clamp(0.1, 0.9), 0.9 * target, background, whole, exposure
    for linear in (True, False):
        assert torch.autograd.gradcheck(lambda *x: lib.pixel_losses(*x, linear), grad_leaves(inputs, (0, 1)))  # noqa: B023
    assert torch.autograd.gradcheck(gradient_losses, grad_leaves(field_gradients(), (0,)))
    assert torch.autograd.gradcheck(material_losses, grad_leaves((rand(6, 3), rand(6, 1), rand(6)), (1,)))


def test_float32_of_the_losses_is_close_to_float64():
    for op, inputs in (
        (lambda *x: pixel_losses(*x), pixel_inputs), (lambda *x: gradient_losses(*x), field_gradients),
    ):  # fmt: skip
        for single, exact in zip(op(*inputs(dtype=torch.float32)), op(*inputs())):
            assert single.item() == pytest.approx(exact.item(), rel=1e-5)


def test_what_has_no_gradient_and_what_does_not_fit():
    for index in (2, 3, 5):
        check_no_gradient(lib.pixel_losses, (*pixel_inputs(5), True), index)
    check_no_gradient(lib.gradient_losses, field_gradients(), 1)
    check_no_gradient(lib.material_losses, (rand(6, 3), rand(6, 1), rand(6), False), 0)
    g, w, beside = field_gradients()
    check_error(lambda: gradient_losses(g, w, beside + 15), "gradient_losses", "beside must hold indices of weights")
    check_error(lambda: gradient_losses(g[:25], w, beside), "gradient_losses", "samples and their neighbours")
    check_error(lambda: pixel_losses(*pixel_inputs(4)[:3], rand(5, 3)), "pixel_losses", "background must be [4, 3]")
    check_error(lambda: pixel_losses(*pixel_inputs(4)[:5], rand(4, 1)), "pixel_losses", "exposure must be [4, 3]")
    for op in ("pixel_losses_backward", "gradient_losses_backward", "material_losses_backward"):
        *inputs, grad = CASES[op](torch.float32)
        check_error(lambda: getattr(lib, op)(*inputs, grad[:1]), op, "grad_losses must be")  # noqa: B023
    check_error(lambda: material_losses(rand(4, 3), rand(5, 1), rand(5)), "material_losses", "albedo must be [5, 3]")


# ---- entropy ----


def points(n: int, c: int = 5, dtype=torch.float64) -> torch.Tensor:
    return 2 * torch.randn(n, c, generator=generator(), dtype=torch.float64).to(dtype)


@pytest.mark.parametrize("n", [1, 7, 300])
def test_points_alike_have_none_and_points_far_apart_the_logarithm_of_their_number(n):
    assert quadratic_entropy(torch.full((n, 3), 0.7)).item() == pytest.approx(0.0, abs=1e-6)
    apart = 100.0 * torch.arange(n)[:, None].float()
    assert quadratic_entropy(apart).item() == pytest.approx(math.log(n), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("n", [1, 2, 31, 200])
@pytest.mark.parametrize("shift", [0.0, 1000.0])
def test_it_and_its_gradient_are_the_sum_over_pairs(n, shift):
    ours, theirs = (points(n) + shift).requires_grad_(), (points(n) + shift).requires_grad_()
    entropy, expected = quadratic_entropy(ours), reference.quadratic_entropy(theirs)
    torch.testing.assert_close(entropy, expected, rtol=1e-9, atol=1e-12)
    (3 * entropy).backward()
    (3 * expected).backward()
    torch.testing.assert_close(ours.grad, theirs.grad, rtol=1e-7, atol=1e-12)


def test_float32_is_close_to_float64():
    single = points(384).float().requires_grad_()
    exact = single.detach().double().requires_grad_()
    for x in (single, exact):
        quadratic_entropy(x).backward()
    assert quadratic_entropy(single).item() == pytest.approx(quadratic_entropy(exact).item(), rel=1e-6)
    torch.testing.assert_close(single.grad.double(), exact.grad, rtol=1e-4, atol=1e-8)


def test_a_nan_and_an_infinity_show():
    x = points(40)
    x[3, 1] = math.nan
    assert quadratic_entropy(x).isnan()
    x[3, 1] = math.inf
    assert not quadratic_entropy(x).isfinite() or lib.quadratic_entropy(x)[1].isnan().any()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_opcheck_gradcheck_and_errors(dtype):
    check_op(lib.quadratic_entropy, (points(6, 2, dtype),), (0,))
    assert torch.autograd.gradcheck(quadratic_entropy, grad_leaves((points(6, 2),), (0,)))
    with pytest.raises(Exception, match="x must hold at least one point"):
        quadratic_entropy(torch.zeros(0, 3))
    with pytest.raises(Exception, match=r"x must be \[n, n\] float32"):
        quadratic_entropy(torch.zeros(3))
