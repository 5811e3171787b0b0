"""Operators that hand arguments on: what the next reader of an argument sends back is added in the operator's own gradient."""

from __future__ import annotations

import pytest
import torch
from op_cases import shared_inputs, surface_case
from op_checks import as_tuple, generator
from ray_inputs import composite_case
from shading_inputs import indirect_inputs, query_inputs
from torch.utils._python_dispatch import TorchDispatchMode

from splitnerf.ops import _library

# The arguments by operator, and those among them that take a gradient; what is handed on is registered.
CASES = {
    "surface_weights": (lambda: surface_case(torch.float64), (0, 1, 3)),
    "composite": (lambda: composite_case(torch.float64), (0, 1, 3)),
    "light_queries": (lambda: query_inputs("cpu", torch.float64, True, 7), (0, 2)),
    "split_sum_shade": (lambda: indirect_inputs(torch.float64, 0, 3), (0, 2, 3, 4, 5)),
    "summed_light": (lambda: shared_inputs(), (0, 2, 5)),
}
each_operator = pytest.mark.parametrize("name", CASES)


class Additions(TorchDispatchMode):
    """Counts the sums of two tensors within its block."""

    count = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        self.count += func._schema.name in ("aten::add", "aten::add_")
        return func(*args, **(kwargs or {}))


def leaves_of(name: str) -> tuple[list, list[torch.Tensor]]:
    make, wanted = CASES[name]
    arguments = list(make())
    for i in wanted:
        arguments[i] = arguments[i].detach().clone().requires_grad_()
    return arguments, [arguments[i] for i in wanted]


def weighted(results: tuple, seed: int) -> torch.Tensor:
    """A sum over all results, each number with a weight of its own."""
    drawn = (torch.randn(x.shape, generator=generator(seed + i), dtype=x.dtype) for i, x in enumerate(results))
    return sum((x * w).sum() for x, w in zip(results, drawn))


def gradients(name: str, hands_on: bool, reads_on: bool = True) -> list[torch.Tensor | None]:
    """Of a sum over the results and, with `reads_on`, over cubes of what is handed on."""
    arguments, leaves = leaves_of(name)
    operator = getattr(_library.lib, name)
    if hands_on:
        results, handed = operator.handing_on(*arguments)
    else:
        results, handed = as_tuple(operator(*arguments)), [arguments[i] for i in _library.HANDED_ON[name]]
    total = weighted(results, 30) + (weighted(tuple(x**3 for x in handed), 50) if reads_on else 0.0)
    with Additions() as additions:
        found = torch.autograd.grad(total, leaves, allow_unused=True)
    assert additions.count == (len(handed) if reads_on and not hands_on else 0)
    return found


@each_operator
def test_gradients_are_those_of_both_readers_without_an_addition(name):
    for found, truth in zip(gradients(name, True), gradients(name, False), strict=True):
        torch.testing.assert_close(found, truth, rtol=1e-14, atol=1e-14)


@each_operator
def test_without_a_next_reader_nothing_changes(name):
    for found, truth in zip(gradients(name, True, False), gradients(name, False, False), strict=True):
        assert torch.equal(found, truth)


@each_operator
def test_a_result_that_nobody_reads_counts_as_0(name):
    """Only what is handed on has a gradient."""
    arguments, _ = leaves_of(name)
    _, handed = getattr(_library.lib, name).handing_on(*arguments)
    given = [arguments[i] for i in _library.HANDED_ON[name]]
    truth = torch.autograd.grad(weighted(tuple(x**2 for x in given), 70), given)
    for found, x in zip(torch.autograd.grad(weighted(tuple(y**2 for y in handed), 70), given), truth, strict=True):
        assert torch.equal(found, x) and found.abs().sum() > 0


@each_operator
def test_without_gradients_the_arguments_themselves_are_handed_on(name):
    arguments = list(CASES[name][0]())
    _, handed = getattr(_library.lib, name).handing_on(*arguments)
    assert all(x is arguments[i] for x, i in zip(handed, _library.HANDED_ON[name], strict=True))
    with torch.no_grad():
        arguments, _ = leaves_of(name)
        _, handed = getattr(_library.lib, name).handing_on(*arguments)
    assert all(x is arguments[i] for x, i in zip(handed, _library.HANDED_ON[name], strict=True))


@pytest.mark.parametrize("name", [name for name in CASES if name != "surface_weights"])  # some of whose numbers are at a bend
def test_gradcheck(name):
    arguments, leaves = leaves_of(name)
    places = CASES[name][1]

    def function(*values):
        full = list(arguments)
        for i, value in zip(places, values):
            full[i] = value
        results, handed = getattr(_library.lib, name).handing_on(*full)
        return *results, *(x**2 for x in handed)

    torch.autograd.gradcheck(function, leaves, eps=1e-6, atol=1e-5, rtol=1e-3, fast_mode=True)
