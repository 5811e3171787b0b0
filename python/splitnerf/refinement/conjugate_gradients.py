"""Conjugate gradients for a positive definite system that is given by its products."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

TINY = 1e-30  # below it a product of vectors counts as zero


@torch.no_grad()
def conjugate_gradients(
    product: Callable[[Tensor], Tensor], precondition: Callable[[Tensor], Tensor], right: Tensor, n_iterations: int
) -> Tensor:
    """An approximate solution x of A x = right, of the shape of `right`.

    Source: Nocedal and Wright 2006, Algorithm 5.3.

    Args:
        product: x -> A x, A symmetric and positive definite.
        precondition: x -> M x, M symmetric, positive definite and near the inverse of A.
        right: The right side.
        n_iterations: The number of products.
    """
    solution, rest = torch.zeros_like(right), right
    along = towards = precondition(rest)
    size = (rest * towards).sum()
    for _ in range(n_iterations):
        image = product(along)
        length = size / (along * image).sum().clamp(min=TINY)
        solution = solution + length * along
        rest = rest - length * image
        towards = precondition(rest)
        size, old = (rest * towards).sum(), size
        along = towards + (size / old.clamp(min=TINY)) * along
    return solution
