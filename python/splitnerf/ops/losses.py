"""Terms of the training loss, each computed together with its gradient in one pass over the pixels, points or pairs.

All are differentiable once, in the arguments that the docstrings name; a gradient to any other argument raises.
"""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register


def pixel_losses(
    mean: Tensor, opacity: Tensor, target: Tensor, background: Tensor, whole: Tensor | None = None, *, linear: bool = True
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
        linear: Whether ``mean`` is linear; otherwise it is sRGB.

    Returns:
        [2]: colour, the mean over channels and pixels, and mask, the mean over pixels; 0 without pixels.
        Differentiable in mean and opacity.

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (3); NeuS Eq. (17).
    """
    whole = torch.zeros_like(opacity, dtype=torch.bool) if whole is None else whole
    return lib.pixel_losses(mean, opacity, target, background, whole, linear)[0]


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
        [2]: eikonal, the mean of (|g| - 1)^2, and smoothness, the weighted mean distance of unit normals; 0 without
        points. Differentiable in the gradients.

    Raises:
        ValueError: A shape, dtype or index does not fit.

    Source: Gropp et al. 2020 (eikonal).
    """
    return lib.gradient_losses(gradients, weights, beside)[0]


def material_losses(
    albedo: Tensor, metallic: Tensor, shares: Tensor, *, smooth_l1: bool = False
) -> Tensor:
    """Three penalties on metallic m: for metals, for values between 0 and 1, and for dark metals.

    Args:
        albedo: [n, 3] linear albedo in [0, 1]; no gradient.
        metallic: [n, 1] metallic m in [0, 1].
        shares: [n] weights of the points.
        smooth_l1: Whether the first penalty is m^2 / 2, the smooth L1 loss, instead of m^2.

    Returns:
        [3]: metal, binary_metal and dark_metal, weighted means of m^2, of m (1 - m) and of m (1 - F0 / .4)+, where
        F0 is the brightest channel of the albedo; 0 without points. Differentiable in metallic.

    Raises:
        ValueError: A shape or dtype does not fit.

    Source: SplitNeRF Eq. (18), over all samples instead of a tenth. A dark metal and a black dielectric with F0 = .04
    look nearly alike, but no dark metals exist (Akenine-Moller et al., Real-Time Rendering, 4th ed., table 9.2).
    """
    return lib.material_losses(albedo, metallic, shares, smooth_l1)[0]


def quadratic_entropy(x: Tensor) -> Tensor:
    """The entropy -ln mean exp(-|x_i - x_j|^2 / 4) over all pairs of points, with i = j.

    Args:
        x: [n, c] points, n > 0; coordinates divided by the width within which points count as similar.

    Returns:
        [] entropy, from 0 (all points equal) to ln n. Differentiable in x.

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
    return colour_by_mean * grad[0], by_opacity, None, None, None, None


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
