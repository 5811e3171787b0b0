"""take_rows, and the short way that Python takes to an operator."""

from __future__ import annotations

import subprocess
import sys

import pytest
import torch
from op_cases import CASES
from op_checks import check_error, check_op, devices, floats, generator, lib
from torch.utils._pytree import tree_map
from torch.utils.checkpoint import checkpoint

from splitnerf.ops import clear_unless, linear_to_srgb, take_rows
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


@each_device
@pytest.mark.parametrize("kept", [True, False])
def test_arrays_are_cleared_unless_they_are_kept(device, kept):
    """With all bits as they were, or 0 wherever a number was, of any kind."""
    given = [torch.randn(700, 3, device=device), torch.full((5,), torch.nan, device=device), torch.empty(0, 2, device=device)]
    before = [x.clone() for x in given]
    clear_unless(given, torch.tensor(kept, device=device))
    for x, y in zip(given, before):
        assert torch.equal(x.isnan(), y.isnan()) and torch.equal(x.nan_to_num(9.0), y.nan_to_num(9.0)) if kept else (x == 0).all()


def test_what_cannot_be_cleared_is_refused():
    kept, given = torch.tensor(False), torch.zeros(4, 3)
    torch.library.opcheck(lib.clear_unless_, ([given], kept))
    check_error(lambda: clear_unless([given.t()], kept), "clear_unless_", "contiguous")
    check_error(lambda: clear_unless([given, given.double()], kept), "clear_unless_", "one dtype")
    check_error(lambda: clear_unless([given], kept[None]), "clear_unless_", "kept must be []", "[1] bool")
    check_error(lambda: clear_unless([], kept), "clear_unless_", "tensors must be 1 to 16")


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


def by(way, name: str, inputs: tuple, i: int) -> list[torch.Tensor] | None:
    """The results of an operator and the gradient of their sum to input i, by a way; None where there is no such gradient."""
    leaves = tree_map(lambda x: x.detach().clone() if isinstance(x, torch.Tensor) else x, inputs)
    wanted = leaves[i] if isinstance(leaves[i], list) else [leaves[i]]
    for leaf in wanted:
        leaf.requires_grad_()
    try:
        found = floats(getattr(way, name)(*leaves))
        gradients = torch.autograd.grad(sum(x.sum() for x in found), wanted, allow_unused=True)
    except RuntimeError as error:
        assert "gradient" in str(error)
        return None
    return [x.detach() for x in found] + [x for x in gradients if x is not None]


@pytest.mark.parametrize("name", sorted(name for name in _library._NODES if name in CASES))
def test_the_short_way_leads_to_the_same_numbers(name):
    """And to the same gradients, and refuses the same."""
    inputs = CASES[name](torch.float64)
    n_compared = 0
    for i, x in enumerate(inputs):
        first = x[0] if isinstance(x, list) else x
        if not isinstance(first, torch.Tensor) or not first.is_floating_point():
            continue
        ours, theirs = by(_library.lib, name, inputs, i), by(lib, name, inputs, i)
        assert (ours is None) == (theirs is None)
        n_compared += ours is not None
        for a, b in zip(ours or [], theirs or [], strict=True):
            torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-12, equal_nan=True)
    assert n_compared > 0


def test_a_tuple_of_tensors_is_as_good_as_a_list():
    a = torch.rand(5, 3, requires_grad=True)
    x, y = _library.lib.take_rows((a, 2 * a), INDEX)
    (x.sum() + y.sum()).backward()
    assert a.grad.sum() == 4 * 3 * 3


def test_activations_may_be_computed_again():
    """What torch's checkpointing does in the backward pass."""
    x = torch.rand(5, requires_grad=True)
    again = checkpoint(lambda y: linear_to_srgb(torch.sin(y) * 0.5 + 0.2), x, use_reentrant=False)
    (gradient,) = torch.autograd.grad(again.sum(), x)
    (expected,) = torch.autograd.grad(linear_to_srgb(torch.sin(x) * 0.5 + 0.2).sum(), x)
    assert torch.equal(gradient, expected)


def test_modes_that_change_arguments_change_what_is_saved():
    """As one that computes in float64."""

    class Doubles(torch.overrides.TorchFunctionMode):
        def __torch_function__(self, function, types, args=(), kwargs=None):
            return function(*(x.double() if isinstance(x, torch.Tensor) else x for x in args), **(kwargs or {}))

    x = torch.rand(5, requires_grad=True)
    with Doubles():
        y = linear_to_srgb(x)
    assert y.dtype == torch.float64
    assert torch.autograd.grad(y.sum(), x)[0].dtype == torch.float32


def test_compilation_in_a_new_process():
    """Of an operator that nobody called before."""
    code = """
import torch
from splitnerf.ops import linear_to_srgb
f = torch.compile(lambda x: linear_to_srgb(x) + 1, fullgraph=True, backend="aot_eager")
x = torch.rand(5, requires_grad=True)
f(x).sum().backward()
assert x.grad is not None
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=100)


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
