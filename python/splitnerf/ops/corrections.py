"""Sums over directions in place of the split sum: which points get one, and what it adds to the colours of the rays."""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.ops._library import lib, refuse_gradients, register


def wide_lobes(
    candidates: Tensor, roughness: Tensor, low: float, high: float, n_candidates: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """The points whose lobes are wide enough for a sum over directions, and by which share it counts. No gradient.

    ``share = t^2 (3 - 2 t)``, t rising from 0 at the roughness `low` to 1 at `high`.

    Args:
        candidates: [k] int64 numbers of points in [0, n). On a GPU a number out of range counts as the nearest one.
        roughness: [n, 1] perceptual roughness in [0, 1], float32 or float64.
        low, high: The ends of the transition, low < high.
        n_candidates: [] int64, how many of the first candidates count; all of them stay, the others with a share of 0, so that
            the host need not wait for a GPU. None: all count, and those with a share of 0 are left out.

    Returns:
        at [m] int64 and share [m] in [0, 1].

    Raises:
        ValueError: A shape, dtype or number does not fit.
    """
    return lib.wide_lobes(candidates, roughness, low, high, n_candidates)


def add_corrections(
    mean: Tensor, correction: Tensor, at: Tensor, shaded: Tensor, ray_indices: Tensor, segment: Tensor, weights: Tensor,
    opacity: Tensor, min_opacity: float,
) -> Tensor:  # fmt: skip
    r"""Adds what shaded samples are corrected by to the colours of their rays, each by the share that its segment carries.

    .. math::

       mean_{ray} \leftarrow mean_{ray}
           + correction\, \frac{\sum_{segment} weights}{\max(opacity_{ray}, min\_opacity)}

    Args:
        mean: [n_rays, 3] colours of the rays.
        correction: [m, 3] radiance to add.
        at: [m] int64 positions in ``shaded`` of the corrected samples.
        shaded: [k] int64 numbers of samples in [0, n).
        ray_indices: [n] int64, the ray of each sample.
        segment: [k] int64, the segment of each shaded sample; those of a segment follow one another.
        weights: [k] rendering weight that each shaded sample stands for; no gradient.
        opacity: [n_rays] in [0, 1]; no gradient.
        min_opacity: The smallest divisor, positive.

    Returns:
        [n_rays, 3] colours. Differentiable once in mean and correction. On a GPU the corrections of one ray are added in any
        order.

    Raises:
        ValueError: A shape, dtype or (on the CPU) a number does not fit.
    """
    return lib.add_corrections(mean, correction, at, shaded, ray_indices, segment, weights, opacity, min_opacity)


def _fake_lobes(candidates, roughness, low, high, n_candidates):
    m = torch.library.get_ctx().new_dynamic_size() if n_candidates is None else candidates.shape[0]
    return candidates.new_empty(m), roughness.new_empty(m)


def _keep(ctx, inputs, output):
    ctx.save_for_backward(*inputs[2:8])
    ctx.min_opacity = inputs[8]


def _backward(ctx, grad):
    refuse_gradients(ctx, "add_corrections", weights=6, opacity=7)
    return grad, lib.add_corrections_backward(*ctx.saved_tensors, ctx.min_opacity, grad), *[None] * 7


register("wide_lobes", fake=_fake_lobes)
register(
    "add_corrections",
    fake=lambda mean, *rest: mean.new_empty(mean.shape),
    setup_context=_keep,
    backward=_backward,
)
register("add_corrections_backward", fake=lambda at, *rest: rest[-1].new_empty(at.shape[0], 3))
