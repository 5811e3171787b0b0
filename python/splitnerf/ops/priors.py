"""What the losses that prefer simple scenes sum over."""

from __future__ import annotations

from torch import Tensor

from splitnerf.ops._library import lib, register


def quadratic_entropy(x: Tensor) -> Tensor:
    """-ln of the mean of exp(-|x_i - x_j|^2 / 4) over all pairs of points, those with themselves included.

    Args:
        x: [n, c], n > 0, in widths within which points count as alike.

    Returns:
        [], from 0 (all alike) to ln n. Differentiable once.

    Raises:
        ValueError: A shape or dtype does not fit, or there is no point.

    Source: Renyi's quadratic entropy of a kernel density (Principe 2010, section 2.2), as Barron and Malik 2015 use it.
    """
    return lib.quadratic_entropy(x)[0]


def _keep_gradient(ctx, inputs, output):
    ctx.mark_non_differentiable(output[1])
    ctx.save_for_backward(output[1])


def _entropy_backward(ctx, grad_entropy, _):
    return ctx.saved_tensors[0] * grad_entropy


register(
    "quadratic_entropy",
    fake=lambda x: (x.new_empty(()), x.new_empty(x.shape)),
    setup_context=_keep_gradient,
    backward=_entropy_backward,
)
