"""take_rows, and the short way that Python takes to an operator."""

from __future__ import annotations

import pytest
import torch
from op_cases import CASES
from op_checks import check_error, check_op, devices, generator, lib

from splitnerf.ops import linear_to_srgb, take_rows
from splitnerf.ops import _library

INDEX = torch.tensor([4, 0, 0, 2])
each_device = pytest.mark.parametrize("device", devices("take_rows"))


def arrays(device: str = "cpu", n: tuple[int, ...] = (5, 9, 5)) -> list[torch.Tensor]:
    """Rows of three, two and one number."""
    return [torch.randn(n[i], 3 - i, generator=generator(i), dtype=torch.float64).to(device) for i in range(3)]


@each_device
def test_rows_are_those_of_the_list(device):
    given = arrays(device)
    for found, x in zip(take_rows(given, INDEX.to(device)), given, strict=True):
        assert torch.equal(found, x[INDEX.to(device)])


@each_device
def test_gradients_of_a_row_add_up_and_those_of_others_are_0(device):
    """Of sum(a) and sum(c^2); what has no gradient gets none."""
    a, b, c = arrays(device)
    a.requires_grad_(), c.requires_grad_()
    x, y, z = take_rows([a, b, c], INDEX.to(device))
    assert not y.requires_grad
    (x.sum() + z.square().sum()).backward()
    counts = torch.tensor([2.0, 0, 1, 0, 1], device=device, dtype=torch.float64)[:, None]
    assert torch.equal(a.grad, counts.expand(5, 3)) and b.grad is None
    torch.testing.assert_close(c.grad, 2 * counts * c.detach())


def test_a_result_that_is_not_used_costs_no_gradient():
    a, _, c = arrays()
    a.requires_grad_(), c.requires_grad_()
    take_rows([a, c], INDEX)[0].sum().backward()
    assert c.grad is None and a.grad is not None


@pytest.mark.parametrize("take", [take_rows, lib.take_rows])
def test_derivatives_of_first_and_second_order(take):
    a, b, c = arrays()

    def squared(a, c):
        return tuple(take([a * a, b, c * a[:, :1]], INDEX))

    leaves = a.requires_grad_(), c.requires_grad_()
    assert torch.autograd.gradcheck(squared, leaves) and torch.autograd.gradgradcheck(squared, leaves)


def test_none_are_taken_of_none():
    found = take_rows([torch.empty(0, 3), torch.empty(0, 2)], torch.empty(0, dtype=torch.int64))
    assert [tuple(x.shape) for x in found] == [(0, 3), (0, 2)]


def test_operators():
    for name in ("take_rows", "put_rows"):
        tensors, *rest = CASES[name](torch.float64)
        check_op(getattr(lib, name), (tensors, *rest))
        check_op(getattr(lib, name), ([x.clone().requires_grad_() for x in tensors], *rest))


def test_what_does_not_fit_is_named():
    given = arrays()
    check_error(lambda: take_rows([], INDEX), "take_rows", "tensors must be 1 to 16")
    check_error(lambda: take_rows([given[0]] * 17, INDEX), "take_rows", "tensors must be 1 to 16")
    check_error(lambda: take_rows([given[1], given[0]], torch.tensor([5])), "take_rows", "index must hold numbers of rows")
    check_error(lambda: take_rows([given[0], given[0][0]], INDEX), "take_rows", "tensors must be [n, n]")
    check_error(lambda: lib.put_rows(given[:1], INDEX[:1], [9]), "put_rows", "tensors must be [1, n]")
    check_error(lambda: lib.put_rows([given[0]], torch.arange(5), [5, 5]), "put_rows", "n_rows must hold a number")
    check_error(lambda: lib.put_rows([given[0]], torch.arange(5), [-1]), "put_rows", "n_rows must not be negative")


# ---- the short way ----


def ways(x: torch.Tensor) -> list[torch.Tensor]:
    """A result and its gradient by the short way and by torch's."""
    found = []
    for operator in (_library.lib.linear_to_srgb, lib.linear_to_srgb):
        leaf = x.clone().requires_grad_()
        y = operator(leaf)
        y.sum().backward()
        found += [(y.detach(), leaf.grad)]
    return found


def test_the_short_way_leads_to_the_same_numbers():
    x = torch.rand(50, dtype=torch.float64, generator=generator())
    (ours, gradient), (theirs, expected) = ways(x)
    assert torch.equal(ours, theirs) and torch.equal(gradient, expected) and (gradient > 0).all()


def test_the_short_way_is_taken(monkeypatch):
    """Unless torch traces or transforms, which only its own way can follow."""
    x, taken = torch.rand(5), []
    real = _library._NODES["linear_to_srgb"]
    monkeypatch.setitem(_library._NODES, "linear_to_srgb", lambda *given: taken.append("node") or real(*given))
    linear_to_srgb(x.clone().requires_grad_())
    assert taken == ["node"]
    with torch.autograd.forward_ad.dual_level():
        linear_to_srgb(x.clone().requires_grad_())
    monkeypatch.setattr(torch.compiler, "is_compiling", lambda: True)
    linear_to_srgb(x.clone().requires_grad_())
    assert taken == ["node"]


def test_a_second_derivative_that_is_not_there_raises():
    x = torch.rand(5, requires_grad=True)
    (slope,) = torch.autograd.grad(linear_to_srgb(x).sum(), x, create_graph=True)
    with pytest.raises(RuntimeError, match="linear_to_srgb_backward: no gradient is defined"):
        slope.sum().backward()
