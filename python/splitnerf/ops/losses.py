"""Terms of the training loss, each found together with its gradient in one pass over the pixels, points or pairs.

All are differentiable once, in what the docstrings name; a gradient to anything else raises.
"""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register


def pixel_losses(
    mean: Tensor, opacity: Tensor, target: Tensor, background: Tensor, *, linear: bool = True
) -> tuple[Tensor, Tensor]:
    """Mean squared sRGB error of pixels against photos, both over one background, and the cross entropy with their masks.

    A channel that the photo clipped says only that the truth is at least as bright: there, and only there, the prediction
    is clipped too.

    Args:
        mean: [n, 3] colour of the object alone, not premultiplied.
        opacity: [n] in [0, 1].
        target: [n, 4] sRGB, straight alpha.
        background: [n, 3] sRGB.
        linear: Whether ``mean`` is linear, or sRGB already.

    Returns:
        colour [] and mask [], means over values and pixels; 0 without any. Differentiable in mean and opacity.

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (3); NeuS Eq. (17).
    """
    colour, mask = lib.pixel_losses(mean, opacity, target, background, linear)[0].unbind()
    return colour, mask


def gradient_losses(gradients: Tensor, weights: Tensor, beside: Tensor) -> tuple[Tensor, Tensor]:
    """What a distance field's gradients should be: of length 1 everywhere, and of one direction with their neighbours'.

    Of the surfaces that explain the images the second prefers the one that wavers least: the distance of the unit normals
    adds up to the same along a smooth bend and along a sharp edge, so that edges stay. Neighbours on the other side of a
    thin part, whose normals are more than 90 degrees off, do not count, nor gradients shorter than 1e-3.

    Args:
        gradients: [n, 3], those of k samples first and those of m neighbours last.
        weights: [k] rendering weights of the samples.
        beside: [m] int64, the samples that the last gradients are neighbours of.

    Returns:
        eikonal [], the mean of (|g| - 1)^2, and smoothness [], the mean distance of unit normals by the weights; 0 without
        any. Differentiable in the gradients.

    Raises:
        ValueError: A shape, dtype or index does not fit.

    Source: Gropp et al. 2020 (eikonal).
    """
    eikonal, smoothness = lib.gradient_losses(gradients, weights, beside)[0].unbind()
    return eikonal, smoothness


def material_losses(
    albedo: Tensor, metallic: Tensor, shares: Tensor, *, smooth_l1: bool = False
) -> tuple[Tensor, Tensor, Tensor]:
    """How unlikely metals are: that a point is one at all, by halves, or a dark one.

    Args:
        albedo: [n, 3] linear; taken as given.
        metallic: [n, 1] in [0, 1].
        shares: [n] by which the points count.
        smooth_l1: Of the first: m^2 / 2, as the smooth L1 loss has it.

    Returns:
        Means [] of m^2, m (1 - m) and m (1 - F0 / .4)+, F0 the brightest channel; 0 without any. Differentiable in metallic.

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (18), over all samples, not a tenth. A dark metal and a black dielectric of F0 = .04 look nearly
    alike, and there are no dark metals (Akenine-Moller et al., Real-Time Rendering, 4th ed., table 9.2).
    """
    metal, binary, dark = lib.material_losses(albedo, metallic, shares, smooth_l1)[0].unbind()
    return metal, binary, dark


def quadratic_entropy(x: Tensor) -> Tensor:
    """-ln of the mean of exp(-|x_i - x_j|^2 / 4) over all pairs of points, those with themselves included.

    Args:
        x: [n, c], n > 0, in widths within which points count as alike.

    Returns:
        [], from 0 (all alike) to ln n. Differentiable.

    Raises:
        ValueError: A shape or dtype does not fit, or there is no point.

    Source: Renyi's quadratic entropy of a kernel density (Principe 2010, section 2.2), as Barron and Malik 2015 use it.
    """
    return lib.quadratic_entropy(x)[0]


def _keep_gradients(ctx, inputs, output):
    ctx.mark_non_differentiable(*output[1:])
    ctx.save_for_backward(*output[1:])


def _pixel_backward(ctx, grad, *_):
    refuse_gradients(ctx, "pixel_losses", target=2, background=3)
    colour_by_mean, colour_by_opacity, mask_by_opacity = ctx.saved_tensors
    by_opacity = torch.addcmul(colour_by_opacity * grad[0], mask_by_opacity, grad[1])
    return colour_by_mean * grad[0], by_opacity, None, None, None


def _gradient_backward(ctx, grad, *_):
    refuse_gradients(ctx, "gradient_losses", weights=1)
    eikonal_by, smoothness_by = ctx.saved_tensors
    return torch.addcmul(eikonal_by * grad[0], smoothness_by, grad[1]), None, None


def _material_backward(ctx, grad, *_):
    refuse_gradients(ctx, "material_losses", albedo=0, shares=2)
    return None, (grad @ ctx.saved_tensors[0])[:, None], None, None


def _entropy_backward(ctx, grad, *_):
    return ctx.saved_tensors[0] * grad


register(
    "pixel_losses",
    fake=lambda mean, opacity, *rest: (
        mean.new_empty(2), mean.new_empty(mean.shape), mean.new_empty(opacity.shape), mean.new_empty(opacity.shape)
    ),
    setup_context=_keep_gradients,
    backward=_pixel_backward,
)  # fmt: skip
register(
    "gradient_losses",
    fake=lambda gradients, *rest: (gradients.new_empty(2), *(gradients.new_empty(gradients.shape) for _ in range(2))),
    setup_context=_keep_gradients,
    backward=_gradient_backward,
)
register(
    "material_losses",
    fake=lambda albedo, metallic, *rest: (metallic.new_empty(3), metallic.new_empty(3, metallic.shape[0])),
    setup_context=_keep_gradients,
    backward=_material_backward,
)
register(
    "quadratic_entropy",
    fake=lambda x: (x.new_empty(()), x.new_empty(x.shape)),
    setup_context=_keep_gradients,
    backward=_entropy_backward,
)
