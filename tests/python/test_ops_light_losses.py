"""log_chroma and light_prior: closed forms, the formulas as written in torch, gradients, errors."""

from __future__ import annotations

import math

import pytest
import reference
import torch
from op_cases import CASES, rand
from op_checks import check_error, check_no_gradient, check_op, generator, grad_leaves, lib

from splitnerf.ops import light_prior, log_chroma

SIZES = [16, 64, 256]


def texels(dtype=torch.float64) -> torch.Tensor:
    return 1.5 * torch.randn(sum(SIZES), 3, generator=generator(3), dtype=torch.float64).to(dtype)


def test_grey_of_any_brightness_has_no_colour_and_a_tint_the_mean_of_its_squares():
    grey = torch.tensor([[0.0] * 3, [1e-9] * 3, [0.5] * 3, [1e20] * 3], dtype=torch.float64)
    assert log_chroma(grey).item() == pytest.approx(0, abs=1e-25)
    tint = torch.tensor([[math.exp(0.3), 1, math.exp(-0.3)]], dtype=torch.float64)
    for brightness in (1.0, 1e9):
        assert log_chroma(brightness * tint).item() == pytest.approx(2 * 0.3**2 / 3, rel=1e-5)
    assert log_chroma(torch.cat([grey, tint])).item() == pytest.approx(2 * 0.3**2 / 15, rel=1e-5)
    assert log_chroma(torch.zeros(0, 3)).item() == 0


def test_a_light_of_one_colour_is_free_and_a_texel_costs_what_its_level_is_worth():
    light = torch.zeros(sum(SIZES), 3, dtype=torch.float64)
    light[:16] += torch.tensor([0.5, 0.0, -0.7])
    assert light_prior(light, SIZES).item() == pytest.approx(0, abs=1e-25)
    for texel, n in ((16, 64), (16 + 63, 64), (16 + 64, 256), (335, 256)):
        for change, cost in (([0.9] * 3, 0.81 / 0.75), ([0.9, 0.0, -0.9], 0.54 / 0.12)):
            changed = light.clone()
            changed[texel] += torch.tensor(change)
            assert light_prior(changed, SIZES).item() == pytest.approx(math.log1p(cost) / n, rel=1e-7)


def test_the_brightness_of_the_whole_light_has_no_gradient():
    light = texels().requires_grad_()
    light_prior(light, SIZES).backward()
    torch.testing.assert_close(light.grad[:16].sum(0), torch.zeros(3, dtype=torch.float64), rtol=0, atol=1e-15)
    assert light.grad[:16].abs().min() > 0 and light.grad[16:].abs().min() > 0


@pytest.mark.parametrize("sizes", [SIZES, [336], [1, 335], [1] * 16])
def test_they_and_their_gradients_are_the_formulas(sizes):
    for ours, theirs, x in (
        (lambda x: light_prior(x, sizes), lambda x: reference.light_prior(x, sizes), texels()[: sum(sizes)]),
        (log_chroma, reference.log_chroma, rand(50, 3)),
    ):
        a, b = x.clone().requires_grad_(), x.clone().requires_grad_()
        found, expected = ours(a), theirs(b)
        torch.testing.assert_close(found, expected)
        (3 * found).backward()
        (3 * expected).backward()
        torch.testing.assert_close(a.grad, b.grad)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_opcheck_gradcheck_and_errors(dtype):
    for op in ("log_chroma", "light_prior"):
        check_op(getattr(lib, op), CASES[op](dtype), (0,))
        check_op(getattr(lib, f"{op}_backward"), CASES[f"{op}_backward"](dtype))
        check_no_gradient(getattr(lib, f"{op}_backward"), CASES[f"{op}_backward"](dtype), 0)
    assert torch.autograd.gradcheck(log_chroma, grad_leaves((rand(6, 3) + 0.1,), (0,)))
    assert torch.autograd.gradcheck(lambda x: light_prior(x, [3, 5]), grad_leaves((texels()[:8],), (0,)))
    check_error(lambda: log_chroma(torch.zeros(4)), "log_chroma", "radiance must be [n, 3]")
    for sizes, text in (
        ([], "1 to 16 numbers"), ([1] * 17, "1 to 16 numbers"), ([8, 0], "must be positive"), ([3, 4], "number of texels")
    ):  # fmt: skip
        check_error(lambda: light_prior(torch.zeros(8, 3), sizes), "light_prior", text)  # noqa: B023


def test_float32_is_close_to_float64_and_a_nan_shows():
    for call, x in ((lambda x: light_prior(x, SIZES), texels()), (log_chroma, rand(300, 3))):
        single, exact = x.float().requires_grad_(), x.float().double().requires_grad_()
        call(single).backward()
        call(exact).backward()
        assert call(single).item() == pytest.approx(call(exact).item(), rel=1e-6)
        torch.testing.assert_close(single.grad.double(), exact.grad, rtol=1e-5, atol=1e-8)
        spoilt = x.clone()
        spoilt[7, 1] = math.nan
        assert call(spoilt).isnan()
