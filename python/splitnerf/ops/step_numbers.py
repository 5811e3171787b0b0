"""The numbers of a training step, and whether it may be taken, without a wait for the device."""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.ops._library import lib, register


def step_numbers(
    gradients: list[Tensor], terms: list[Tensor], counts: list[Tensor], evaluated: Tensor, s: Tensor, limits: Tensor
) -> tuple[Tensor, Tensor]:
    """Lists a step's numbers, and compares each with a limit. No gradient.

    Args:
        gradients: Up to 96 tensors of any shapes. Each is read once.
        terms: The terms of the loss, up to 24 numbers in tensors of any shapes.
        counts: Up to 8 int64 numbers in tensors of any shapes.
        evaluated: [n_rays] int64, which are added up.
        s: One number.
        limits: [k] what each number of the list must stay below, in the dtype of gradients, terms and s.

    Returns:
        numbers [k]: the terms, the Euclidean norm of all gradients, the counts, the sum of `evaluated`, and s.
        allowed [] bool: whether each is nearer to 0 than its limit; a NaN is not.

    Raises:
        ValueError: A shape, dtype or number of numbers does not fit.
    """
    return lib.step_numbers(gradients, terms, counts, evaluated, s, limits)


register(
    "step_numbers",
    fake=lambda gradients, terms, counts, evaluated, s, limits: (
        limits.new_empty(limits.shape), evaluated.new_empty((), dtype=torch.bool)
    ),
)  # fmt: skip
