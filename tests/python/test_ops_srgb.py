"""linear_to_srgb and srgb_to_linear."""

from __future__ import annotations

import pytest
import torch
from op_checks import check_error, generator

from splitnerf.ops import linear_to_srgb, srgb_to_linear


def test_values_of_the_standard():
    """IEC 61966-2-1: 0.5 decodes to 0.21404, the joint at 0.04045 to 0.0031308."""
    decoded = srgb_to_linear(torch.tensor([0.0, 0.04045, 0.5, 1.0], dtype=torch.float64))
    assert decoded.tolist() == pytest.approx([0, 0.0031308, 0.2140411, 1], abs=1e-7)
    assert linear_to_srgb(torch.tensor([-1.0, 0.0, 0.5, 4.0])).tolist() == pytest.approx(
        [0, 0, 0.735357, 1.824796], abs=1e-5
    )


@pytest.mark.parametrize("dtype, atol", [(torch.float32, 1e-6), (torch.float64, 1e-7)])
def test_each_undoes_the_other(dtype, atol):
    """To 1e-7, by which the standard's two branches miss each other at the joint."""
    values = torch.linspace(0, 4, 4001, dtype=dtype).view(1, -1)
    torch.testing.assert_close(linear_to_srgb(srgb_to_linear(values)), values, rtol=0, atol=atol)


def test_the_gradient_is_that_of_the_curve():
    x = torch.rand(4, 5, generator=generator(), dtype=torch.float64).add(0.01).requires_grad_()
    assert torch.autograd.gradcheck(linear_to_srgb, x)
    x = torch.tensor([-0.1, 0.0, 1e-9, 0.5], requires_grad=True)
    linear_to_srgb(x).sum().backward()
    assert x.grad[:3].tolist() == pytest.approx([0, 12.92, 12.92]) and torch.isfinite(x.grad).all()


def test_a_nan_and_a_wrong_dtype():
    assert torch.isnan(linear_to_srgb(torch.tensor([torch.nan]))).all()
    check_error(lambda: linear_to_srgb(torch.arange(3)), "linear_to_srgb", "linear must be float32 or float64")
