"""Terms of the training loss: one pass over the pixels, points or pairs finds their values, another one their gradients.

All are differentiable once, in the arguments that the docstrings name; a gradient to any other argument raises.
"""

from __future__ import annotations

from torch import Tensor
from torch.autograd.function import once_differentiable

from splitnerf.ops._library import lib, refuse_gradients, register


def pixel_losses(
    mean: Tensor,
    opacity: Tensor,
    target: Tensor,
    background: Tensor,
    whole: Tensor | None = None,
    exposure: Tensor | None = None,
    *,
    linear: bool = True,
) -> Tensor:
    """Mean squared sRGB error of pixels against photos over the same background, and the cross entropy with their
    masks.

    Where a photo's channel is clipped, the true value is at least 1. There, and only there, the prediction is clipped
    too.

    Args:
        mean: [n, 3] colours of the object alone, not premultiplied.
        opacity: [n] opacities in [0, 1].
        target: [n, 4] sRGB values of the photos in [0, 1], straight alpha.
        background: [n, 3] sRGB colours in [0, 1].
        whole: [n] bool, the pixels whose photo is what the camera saw, the object and the background together (both added up
            as light, if ``linear``): there the background is what it would have seen without the object, the target's alpha
            says nothing of the colour, and the mask counts a tenth. None: no pixel.
        exposure: [n, 3] factors of ``mean``, by which a photo shows more or less than an exposure of 1. None: all are 1.
        linear: Whether ``mean`` is linear; otherwise it is sRGB.

    Returns:
        [2]: colour, the mean over channels and pixels, and mask, the mean over pixels; 0 without pixels.
        Differentiable in mean and opacity.

    Source: SplitNeRF Eq. (3); NeuS Eq. (17).
    """
    return lib.pixel_losses(mean, opacity, target, background, whole, exposure, linear)


def gradient_losses(gradients: Tensor, weights: Tensor, beside: Tensor) -> Tensor:
    """The eikonal loss and the smoothness loss of a distance field's gradients.

    The eikonal loss asks for gradients of length 1. The smoothness loss asks for equal directions at neighbouring
    points: among the surfaces that explain the images it prefers the one with the least variation of normals. It sums
    distances of unit normals, which are equal for a smooth bend and for a sharp edge, so that edges survive. It leaves
    out neighbours whose normals differ by more than 90 degrees (they lie on the other side of a thin part) and
    gradients shorter than 1e-3.

    Args:
        gradients: [n, 3] gradients of the field: the first k belong to samples, the last m to neighbours.
        weights: [k] rendering weights of the samples.
        beside: [m] int64, the sample beside each neighbour.

    Returns:
        [2]: eikonal, the mean of :math:`(|g| - 1)^2`, and smoothness, the weighted mean distance of unit normals; 0 without
        points. Differentiable in the gradients.

    Source: Gropp et al. 2020 (eikonal).
    """
    return lib.gradient_losses(gradients, weights, beside)[0]


def quadratic_entropy(x: Tensor) -> Tensor:
    r"""The entropy of points, over all n^2 pairs of them, i = j included.

    .. math:: -\ln \frac{1}{n^2} \sum_{i,j} e^{-|x_i - x_j|^2 / 4}

    Args:
        x: [n, c] points, n > 0; coordinates divided by the width within which points count as similar.

    Returns:
        [] entropy, from 0 (all points equal) to ln n. Differentiable in x.

    Source: Renyi's quadratic entropy of a kernel density (Principe 2010, section 2.2), as Barron and Malik 2015 use it.
    """
    return lib.quadratic_entropy(x)[0]


def _keep_pixels(ctx, inputs, output):
    *tensors, ctx.linear = inputs
    ctx.save_for_backward(*tensors)


def _pixel_backward(ctx, grad):
    refuse_gradients(ctx, "pixel_losses", target=2, background=3, exposure=5)
    return *lib.pixel_losses_backward(*ctx.saved_tensors, ctx.linear, grad), None, None, None, None, None


def _keep_inputs_and_total(ctx, inputs, output):
    """Saves the inputs and the sum of weights, to which there is no gradient."""
    ctx.mark_non_differentiable(output[1])
    ctx.set_materialize_grads(False)  # else zeros are made for it
    ctx.save_for_backward(*inputs, output[1])


def _gradient_backward(ctx, grad, _):
    refuse_gradients(ctx, "gradient_losses", weights=1)
    return None if grad is None else lib.gradient_losses_backward(*ctx.saved_tensors, grad), None, None


def _keep_gradient(ctx, inputs, output):
    ctx.mark_non_differentiable(output[1])
    ctx.set_materialize_grads(False)  # else zeros are made for it
    ctx.save_for_backward(output[1])


@once_differentiable
def _entropy_backward(ctx, grad, _):
    return None if grad is None else ctx.saved_tensors[0] * grad


register(
    "pixel_losses", fake=lambda mean, *rest: mean.new_empty(2), setup_context=_keep_pixels, backward=_pixel_backward
)
register(
    "pixel_losses_backward",
    fake=lambda mean, opacity, *rest: (mean.new_empty(mean.shape), opacity.new_empty(opacity.shape)),
)
register(
    "gradient_losses",
    fake=lambda gradients, *rest: (gradients.new_empty(2), gradients.new_empty(())),
    setup_context=_keep_inputs_and_total,
    backward=_gradient_backward,
)
register("gradient_losses_backward", fake=lambda gradients, *rest: gradients.new_empty(gradients.shape))
register(
    "quadratic_entropy",
    fake=lambda x: (x.new_empty(()), x.new_empty(x.shape)),
    setup_context=_keep_gradient,
    backward=_entropy_backward,
)
