"""The sRGB curve between linear values and values of an image."""

from __future__ import annotations

from torch import Tensor

from splitnerf.ops._library import lib, register


def linear_to_srgb(linear: Tensor) -> Tensor:
    """Encodes linear values of any shape. Values below 0 count as 0; values above 1 are not clipped. Differentiable
    once.

    The slope is finite everywhere; at 0 it is 12.92.

    Raises:
        ValueError: The dtype does not fit.

    Source: IEC 61966-2-1.
    """
    return lib.linear_to_srgb(linear)


def srgb_to_linear(srgb: Tensor) -> Tensor:
    """Decodes sRGB values >= 0 of any shape. Values above 1 are not clipped. No gradient.

    Raises:
        ValueError: The dtype does not fit.

    Source: IEC 61966-2-1.
    """
    return lib.srgb_to_linear(srgb)


def _keep(ctx, inputs, output):
    ctx.save_for_backward(*inputs)


def _backward(ctx, grad):
    return lib.linear_to_srgb_backward(*ctx.saved_tensors, grad)


register("linear_to_srgb", fake=lambda linear: linear.new_empty(linear.shape), setup_context=_keep, backward=_backward)
register("linear_to_srgb_backward", fake=lambda linear, grad_srgb: linear.new_empty(linear.shape))
register("srgb_to_linear", fake=lambda srgb: srgb.new_empty(srgb.shape))
