"""Conjugate gradients for a positive definite system that is known by its products."""

from __future__ import annotations

from collections.abc import Callable

import torch
from scipy.sparse.linalg import LinearOperator, cg
from torch import Tensor

EXACT = 1e-7  # share of the right side: a smaller residual is rounding


@torch.no_grad()
def conjugate_gradients(
    product: Callable[[Tensor], Tensor], precondition: Callable[[Tensor], Tensor], right: Tensor, n_iterations: int
) -> Tensor:
    """An approximate solution x of A x = right, on the CPU, of the shape of `right`, by scipy with at most `n_iterations` products.
    `product` is x -> A x, A symmetric and positive definite; `precondition` is x -> M x, M likewise and near the inverse of A."""
    b = right.numpy().ravel()

    def operator(function: Callable[[Tensor], Tensor]) -> LinearOperator:
        return LinearOperator(
            2 * b.shape, lambda x: function(torch.from_numpy(x).view(right.shape)).numpy().ravel(), dtype=b.dtype
        )

    found, _ = cg(operator(product), b, rtol=EXACT, maxiter=n_iterations, M=operator(precondition))
    return torch.from_numpy(found).view(right.shape)
