"""Terms of the training loss that look at the light alone. Differentiable once."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from splitnerf.ops._library import lib, register


def light_prior(texels: Tensor, level_sizes: Sequence[int]) -> Tensor:
    r"""How far a light is from a smooth and grey one: the sum over its levels of the mean cost of a texel.

    The mean over the coarsest level, the brightness of the whole light, costs nothing: it is taken from that level's texels. A
    texel d then costs

    .. math:: \ln\left(1 + \frac{b^2}{3 \cdot 0.5^2}\right) + \ln\left(1 + \frac{c}{3 \cdot 0.2^2}\right) ,

    b the mean of its channels and c that of :math:`(d - b)^2`.

    Args:
        texels: [T, 3] log radiance beside the coarser levels, the coarsest level first, float32 or float64.
        level_sizes: The numbers of texels of at most 16 levels; T in sum. The first should be small: each of its texels is
            worked out from all of them.

    Returns:
        []. Differentiable in texels.

    Raises:
        ValueError: A shape, dtype or size does not fit.

    Source: our own; Student's t distribution with 3 degrees of freedom.
    """
    return lib.light_prior(texels, list(level_sizes))


def _keep_texels(ctx, inputs, output):
    texels, ctx.level_sizes = inputs
    ctx.save_for_backward(texels)


def _prior_backward(ctx, grad):
    return lib.light_prior_backward(*ctx.saved_tensors, ctx.level_sizes, grad), None


register(
    "light_prior",
    fake=lambda texels, level_sizes: texels.new_empty(()),
    setup_context=_keep_texels,
    backward=_prior_backward,
)
register("light_prior_backward", fake=lambda texels, level_sizes, grad_loss: texels.new_empty(texels.shape))
