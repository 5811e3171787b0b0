"""step_numbers: the list of a step's numbers, and the flag that follows from it."""

from __future__ import annotations

import math

import pytest
import torch
from op_cases import step_inputs
from op_checks import check_error, check_no_gradient, check_op, devices, lib

from splitnerf.ops import step_numbers

each_device = pytest.mark.parametrize("device", devices("step_numbers"))
NOTHING = torch.zeros(0, dtype=torch.int64)


def asked(device: str = "cpu", gradients: list[torch.Tensor] | None = None, term: float = 2.0, limit: float = 10.0) -> tuple:
    """The list (term, 5, -3, 7 counted, 6 evaluated, s = 4), whose limits are this."""
    gradients = [torch.tensor([[3.0, 0.0]]), torch.tensor(-4.0)] if gradients is None else gradients
    rest = [torch.tensor([term])], [torch.tensor([-3]), torch.tensor(7)], torch.tensor([1, 5]), torch.tensor(4.0)
    move = lambda x: [y.to(device) for y in x] if isinstance(x, list) else x.to(device)  # noqa: E731
    return tuple(map(move, (gradients, *rest, torch.full((6,), limit))))


@each_device
def test_a_list_in_its_order(device):
    numbers, allowed = step_numbers(*asked(device))
    assert numbers.tolist() == [2, 5, -3, 7, 6, 4] and allowed.item() is True


@each_device
@pytest.mark.parametrize("limit", [7.5, 7.0, 4.5])
def test_a_number_must_be_below_its_limit(device, limit):
    assert step_numbers(*asked(device, limit=limit))[1].item() == (limit > 7)


@each_device
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_not_allowed(device, value):
    """Not even below an infinite limit."""
    numbers, allowed = step_numbers(*asked(device, term=value, limit=math.inf))
    assert not allowed and numbers[1] == 5
    assert not step_numbers(*asked(device, [torch.tensor([1.0, value])], limit=math.inf))[1]


@each_device
@pytest.mark.parametrize("value", [1e30, -2e19])
def test_a_gradient_whose_square_is_no_number_is_not_allowed(device, value):
    for n in (1, 9, 5000):
        numbers, allowed = step_numbers(*asked(device, [torch.full((n,), value)], limit=1e18))
        assert not allowed and not numbers[1] < 1e18


@each_device
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=["float32", "float64"])
def test_the_norm_of_gradients_of_all_sizes(device, dtype):
    """Of as many numbers as an item has, one more and one less, and of many items."""
    sizes = (0, 1, 3, 4, 5, 8, 4095, 4096, 4097, 70000)
    gradients = [torch.randn(n, generator=torch.Generator().manual_seed(n), dtype=dtype) for n in sizes]
    none = torch.tensor(1.0, dtype=dtype, device=device)
    numbers, _ = step_numbers(
        [x.to(device) for x in gradients], [], [], NOTHING.to(device), none, torch.ones(3, dtype=dtype, device=device)
    )
    truth = torch.cat(gradients).double().norm().item()
    assert numbers[0].item() == pytest.approx(truth, rel=1e-6 if dtype == torch.float32 else 1e-14)


def test_parts_of_tensors_and_gradients_that_are_not_contiguous():
    losses, turned = torch.arange(4.0), torch.randn(5, 3).t()
    numbers, _ = step_numbers([turned], [losses[1], losses[3]], [], NOTHING, losses[2], torch.ones(5))
    torch.testing.assert_close(numbers, torch.tensor([1.0, 3.0, turned.norm(), 0.0, 2.0]))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=["float32", "float64"])
def test_opcheck(dtype):
    check_op(lib.step_numbers, step_inputs(dtype))
    assert not lib.step_numbers(*step_inputs(dtype))[1]  # one is too large


def test_no_gradient_is_defined():
    check_no_gradient(lib.step_numbers, asked(), 4)


def test_what_does_not_fit_is_refused():
    gradients, terms, counts, evaluated, s, limits = asked()
    refused = lambda *given: (lambda: step_numbers(*given))  # noqa: E731
    check_error(refused([gradients[0].double()], terms, counts, evaluated, s, limits), "step_numbers: gradients must be float32", "float64")
    check_error(refused(gradients, [torch.zeros(25)], counts, evaluated, s, limits), "limits must be [30]", "[6]")
    check_error(refused(gradients, [torch.zeros(25)], counts, evaluated, s, torch.ones(30)), "terms must hold at most 24 numbers")
    check_error(refused(gradients, terms, [torch.arange(9)], evaluated, s, torch.ones(13)), "counts must hold at most 8 numbers")
    check_error(refused(gradients, terms, terms, evaluated, s, limits), "counts must be int64", "float32")
    check_error(refused(gradients, terms, counts, evaluated, limits, limits), "s must be one number")
    check_error(refused([s] * 97, terms, counts, evaluated, s, limits), "gradients must be at most 96")
