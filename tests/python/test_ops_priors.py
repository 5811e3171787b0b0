"""quadratic_entropy: closed forms, the sum over pairs as written, gradients, errors."""

from __future__ import annotations

import math

import pytest
import torch
from op_checks import check_op, generator, grad_leaves, lib

from splitnerf.ops import quadratic_entropy


def by_pairs(x: torch.Tensor) -> torch.Tensor:
    return -torch.log(torch.exp(-0.25 * (x[:, None] - x[None]).square().sum(-1)).mean())


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
    entropy, expected = quadratic_entropy(ours), by_pairs(theirs)
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
