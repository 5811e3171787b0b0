"""The table of checks, and what they share.

A check is a function with its operator's name. Its docstring states what is known without the operator; it yields what
the operator gives beside what that should be, and a tolerance where the default does not fit. All tensors are made on
torch's default device.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops import brdf_lut

CHECKS: dict[str, Callable[[], Iterator[tuple]]] = {}
N = 38  # points: two full vectors of 16 and a rest
STEP = 1e-6  # of the differences, in float64


def check(function: Callable[[], Iterator[tuple]]) -> Callable[[], Iterator[tuple]]:
    """Adds a check to the table."""
    CHECKS[function.__name__] = function
    return function


def lut() -> Tensor:
    """The table of the split sum on the default device."""
    return brdf_lut(torch.get_default_device())


def pattern(*shape: int) -> Tensor:
    """Numbers between 0.5 and 1.5, no two alike."""
    return 1 + 0.5 * torch.sin(torch.arange(math.prod(shape), dtype=torch.float32)).reshape(shape)


def sphere(n: int) -> Tensor:
    """[n, 3] evenly spread unit directions, from +z to -z; none lies on an axis or between two."""
    turn = torch.tensor([[math.cos(1), math.sin(1), 0.0], [-math.sin(1), math.cos(1), 0.0], [0.0, 0.0, 1.0]])
    return torch.tensor(_core.fibonacci_sphere(n), dtype=torch.float32) @ turn


def axis(x: float, y: float, z: float, n: int = N) -> Tensor:
    """[n, 3] copies of a vector."""
    return torch.tensor([[x, y, z]]).repeat(n, 1)


def column(value: float, n: int = N) -> Tensor:
    """[n, 1] copies of a number."""
    return torch.full((n, 1), value)


def slopes(
    operator: Callable, inputs: tuple, wanted: tuple[int, ...], gradients: tuple[Tensor, ...] = ()
) -> Iterator[tuple[Tensor, Tensor]]:
    """Derivatives along a direction of each wanted input: by the gradient in float32, and by differences in float64.

    Without ``gradients`` those are taken from the backward pass.
    """
    if not gradients:
        leaves = [x.detach().clone().requires_grad_() if i in wanted else x for i, x in enumerate(inputs)]
        gradients = torch.autograd.grad(total(operator(*leaves)), [leaves[i] for i in wanted])
    table = lut()
    exact = [x.double() if isinstance(x, Tensor) and x.is_floating_point() and x is not table else x for x in inputs]
    for i, gradient in zip(wanted, gradients):
        along = pattern(*gradient.shape)
        ends = [total(operator(*exact[:i], exact[i] + step * along, *exact[i + 1 :])) for step in (-STEP, STEP)]
        yield (gradient.double() * along).sum(), (ends[1] - ends[0]) / (2 * STEP)


def total(outputs: Tensor | tuple[Tensor, ...]) -> Tensor:
    """One number of all outputs."""
    outputs = outputs if isinstance(outputs, (tuple, list)) else (outputs,)
    return sum((x.double() * pattern(*x.shape)).sum() for x in outputs if x.is_floating_point())
