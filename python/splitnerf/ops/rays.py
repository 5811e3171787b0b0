"""Packed samples along rays: marching, NeuS weights and compositing.

Samples of all rays lie in one array, ray after ray; ``offsets`` [n_rays + 1] says where each begins.
``neus_weights`` is differentiable once in f_prev, f_next and s, ``surface_weights`` in sdf, gradient and s; ``composite``
once in weights and values, ``Spread.interpolate`` once in values; a second derivative raises. ``march_rays`` and ``spread_samples`` have no
gradient.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.ops._library import lib, refuse_gradients, register

CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE = 0, 1, 2


class PackedSamples(NamedTuple):
    """Samples of a batch of rays.

    Attributes:
        ray_indices: [n] int64, the ray of each sample.
        t_starts, t_ends: [n] distances along the ray, scene units.
        offsets: [n_rays + 1] int64, samples of ray r are offsets[r] to offsets[r + 1].
    """

    ray_indices: Tensor
    t_starts: Tensor
    t_ends: Tensor
    offsets: Tensor

    @property
    def middles(self) -> Tensor:
        """[n] distances along the ray."""
        return 0.5 * (self.t_starts + self.t_ends)

    def extended(self, n: int) -> PackedSamples:
        """The same with n more samples behind them that are of no ray, though ``ray_indices`` says 0."""
        return self if n == 0 else PackedSamples(*(F.pad(x, (0, n)) for x in self[:3]), self.offsets)


def march_rays(
    rays_o: Tensor, rays_d: Tensor, jitter: Tensor, cells: Tensor, box: float, step: float, max_samples: int = 1024
) -> PackedSamples:
    """Steps rays through an occupancy grid and keeps the samples in occupied cells.

    Args:
        rays_o, rays_d: [n_rays, 3]; directions unit. Origins may stand outside the box.
        jitter: [n_rays] in [0, 1): shifts each ray's lattice of samples by a fraction of the step.
        cells: [r, r, r] uint8 over [x, y, z]: CELL_EMPTY is skipped, CELL_OCCUPIED sampled, CELL_OPAQUE (so deep
            inside that nothing behind it is seen) ends the ray.
        box: Half size of the cube that the cells cover.
        step: Length of a sample, scene units.
        max_samples: Of one ray.

    Returns:
        PackedSamples, front to back.

    Raises:
        ValueError: A shape, dtype or size does not fit.
    """
    return PackedSamples(*lib.march_rays(rays_o, rays_d, jitter, cells, box, step, max_samples))


def neus_weights(
    f_prev: Tensor, f_next: Tensor, s: Tensor, offsets: Tensor, min_transmittance: float = 0.0
) -> tuple[Tensor, Tensor]:
    """Rendering weights of an SDF's samples, in log space.

    ``alpha = (Phi(f_prev) - Phi(f_next))+ / Phi(f_prev)``, ``Phi(f) = sigmoid(s f)``, computed as
    ``tau = log1p(expm1(d) sigmoid(-s f_prev))``, ``d = s (f_prev - f_next)+``; the transmittance is a sum of tau.

    Args:
        f_prev, f_next: [n] signed distance at the start and the end of each sample.
        s: [] sharpness, positive.
        offsets: [n_rays + 1] int64.
        min_transmittance: Samples behind less than this get weight 0; the pixel's error is at most this.

    Returns:
        weights [n] and opacity [n_rays], the sum of a ray's weights.

    Raises:
        ValueError: A shape, dtype or the order of the offsets does not fit.

    Source: NeuS Eq. (13); SplitNeRF Eq. (1)-(2).
    """
    return lib.neus_weights(f_prev, f_next, s, offsets, min_transmittance)


def surface_weights(
    sdf: Tensor,
    gradient: Tensor,
    rays_d: Tensor,
    s: Tensor,
    offsets: Tensor,
    *,
    step: float | Tensor,
    anneal: float | Tensor = 1.0,
    min_transmittance: float = 0.0,
) -> tuple[Tensor, Tensor, Tensor]:
    """Normals and rendering weights of samples that know the distance and its gradient in their middles.

    ``n = gradient / |gradient|``, ``half = step / 2 c(d . n)`` and :func:`neus_weights` of ``sdf -+ half``, where
    ``c(x) = -(relu(1/2 - x/2)(1 - anneal) + relu(-x) anneal)``. Where the gradient is shorter than .001 none flows back to it.

    Args:
        sdf, gradient: [n], [n, 3].
        rays_d: [n_rays, 3] unit.
        s: [] sharpness, positive.
        offsets: [n_rays + 1] int64.
        step: Length of a sample, scene units; a number or a tensor [].
        anneal: Of the cosine, 0 at the start of a training, 1 when done; a number or a tensor [].
        min_transmittance: As of :func:`neus_weights`.

    Returns:
        normals [n, 3], weights [n] and opacity [n_rays]. Differentiable once in sdf, gradient and s.

    Raises:
        ValueError: A shape, dtype or number does not fit.

    Source: NeuS Eq. (13) and its released code's estimate of both ends from one evaluation.
    """
    return lib.surface_weights(
        sdf, gradient, rays_d, s, offsets, _as_tensor(step, sdf), _as_tensor(anneal, sdf), min_transmittance
    )


def _as_tensor(value: float | Tensor, like: Tensor) -> Tensor:
    return value if isinstance(value, Tensor) else like.new_full((), value)


class ShadingSubset(NamedTuple):
    """Which samples are shaded, and between which of them each sample lies.

    Attributes:
        shaded: [m] int64, ascending indices of samples; every ray with samples has one.
        first, second: [n] int64 positions in ``shaded``: the neighbours of each sample within its stretch of the ray, equal
            beyond the ends.
        share: [n] of the second, in [0, 1], by the distance along the ray.
        heaviest: [rays with samples] int64 positions in ``shaded``: the largest weight among these.
        leaders: [stretches] int64 positions in ``shaded``: the largest weight among those of a stretch.
        stretch: [m] int64, which stretch each of ``shaded`` is of.
        sizes: [3] int64, how many shaded samples, rays with samples and stretches there are.
    """

    shaded: Tensor
    first: Tensor
    second: Tensor
    share: Tensor
    heaviest: Tensor
    leaders: Tensor
    stretch: Tensor
    sizes: Tensor

    def interpolate(self, values: Tensor) -> Tensor:
        """Values [m, c] at the shaded samples -> [n, c] at all."""
        return lib.interpolate(values, self.first, self.second, self.share)

    def gather(self, weights: Tensor) -> Tensor:
        """The transpose: what [m] the shaded samples count for where all samples count for weights [n]. No gradient."""
        return lib.interpolate_backward(weights[:, None], self.first, self.second, self.share, self.shaded)[:, 0]


def spread_samples(
    weights: Tensor, samples: PackedSamples, per_ray: int, phase: Tensor, gap: float | Tensor = math.inf,
    capacity: tuple[int, int] | None = None,
) -> ShadingSubset:  # fmt: skip
    """Draws samples of each ray in proportion to their weights, for what is asked at few of them.

    The weights of a ray are laid end to end, and a sample is drawn where one of `per_ray` evenly spaced marks falls on it:
    one of more than 1 / per_ray of the ray's weight always is. Samples more than `gap` apart may be of two surfaces: each
    stretch of the ray without such a gap has a sample drawn, and is interpolated on its own.

    Args:
        weights: [n].
        samples: The packed samples.
        per_ray: Marks on a ray; 0 draws all samples.
        phase: [n_rays] in [0, 1), where the marks begin.
        gap: Along the ray, scene units, positive; a number or a tensor [].
        capacity: Lengths of the result, for shaded samples and for stretches, whatever their number, so that the host need
            not wait for a GPU; ``heaviest`` then is [n_rays]. Entries past the count are in range and weigh nothing. Where a
            count exceeds its capacity, ``sizes`` tells so; the other results are then in range but have no meaning.

    Raises:
        ValueError: A shape, dtype or number does not fit.

    Source: Systematic resampling (Kitagawa 1996).
    """
    t = samples.middles
    if isinstance(gap, Tensor):
        t, gap = t / gap, 1.0
    return ShadingSubset(*lib.spread_samples(weights, t, samples.offsets, phase, gap, per_ray, *(capacity or ())))


def composite(weights: Tensor, values: Tensor, offsets: Tensor) -> Tensor:
    """Weighted sum of the samples' values along each ray.

    Args:
        weights: [n].
        values: [n, c].
        offsets: [n_rays + 1] int64.

    Returns:
        [n_rays, c]; 0 for a ray without samples.

    Raises:
        ValueError: A shape, dtype or the order of the offsets does not fit.
    """
    return lib.composite(weights, values, offsets)


def _fake_march(rays_o, rays_d, jitter, cells, box, step, max_samples):
    n = torch.library.get_ctx().new_dynamic_size()
    return (
        rays_o.new_empty(n, dtype=torch.int64),
        rays_o.new_empty(n),
        rays_o.new_empty(n),
        rays_o.new_empty(rays_o.shape[0] + 1, dtype=torch.int64),
    )


def _keep_weights(ctx, inputs, output):
    f_prev, f_next, s, offsets, ctx.min_transmittance = inputs
    ctx.save_for_backward(f_prev, f_next, s, offsets, output[0])


def _weights_backward(ctx, grad_weights, grad_opacity):
    f_prev, f_next, s, offsets, weights = ctx.saved_tensors
    grad_prev, grad_next, grad_s = lib.neus_weights_backward(
        f_prev, f_next, s, offsets, ctx.min_transmittance, weights, grad_weights, grad_opacity
    )
    return grad_prev, grad_next, grad_s.sum(), None, None


def _keep_composite(ctx, inputs, output):
    ctx.save_for_backward(*inputs)


def _composite_backward(ctx, grad):
    return *lib.composite_backward(*ctx.saved_tensors, grad), None


def _fake_spread(weights, t, offsets, phase, gap, per_ray, max_shaded=-1, max_stretches=-1):
    sizes = (max_shaded, phase.shape[0], max_stretches)
    if max_shaded < 0:
        sizes = (torch.library.get_ctx().new_dynamic_size() for _ in range(3))
    shaded, heaviest, leaders = (weights.new_empty(size, dtype=torch.int64) for size in sizes)
    first, second = (weights.new_empty(weights.shape, dtype=torch.int64) for _ in range(2))
    share, stretch = weights.new_empty(weights.shape), shaded.new_empty(shaded.shape)
    return shaded, first, second, share, heaviest, leaders, stretch, shaded.new_empty(3)


def _keep_interpolation(ctx, inputs, output):
    values, first, second, share = inputs
    ctx.save_for_backward(first, second, share, values)


def _interpolation_backward(ctx, grad):
    refuse_gradients(ctx, "interpolate", share=3)
    return lib.interpolate_backward(grad, *ctx.saved_tensors), None, None, None


def _keep_surface(ctx, inputs, output):
    *tensors, ctx.min_transmittance = inputs
    ctx.save_for_backward(*tensors, output[1])


def _surface_backward(ctx, grad_normals, grad_weights, grad_opacity):
    refuse_gradients(ctx, "surface_weights", rays_d=2, step=5, anneal=6)
    *tensors, weights = ctx.saved_tensors
    grad_sdf, grad_gradient, grad_s = lib.surface_weights_backward(
        *tensors,
        ctx.min_transmittance,
        weights,
        grad_normals,
        grad_weights,
        grad_opacity,
    )
    return grad_sdf, grad_gradient, None, grad_s.sum(), None, None, None, None


register("march_rays", fake=_fake_march)
register(
    "surface_weights",
    fake=lambda sdf, gradient, rays_d, *rest: (
        gradient.new_empty(gradient.shape),
        sdf.new_empty(sdf.shape),
        sdf.new_empty(rays_d.shape[0]),
    ),
    setup_context=_keep_surface,
    backward=_surface_backward,
)
register(
    "surface_weights_backward",
    fake=lambda sdf, gradient, rays_d, *rest: (
        sdf.new_empty(sdf.shape),
        gradient.new_empty(gradient.shape),
        sdf.new_empty(rays_d.shape[0]),
    ),
)
register("spread_samples", fake=_fake_spread)
register(
    "interpolate",
    fake=lambda values, first, second, share: values.new_empty(share.shape[0], values.shape[1]),
    setup_context=_keep_interpolation,
    backward=_interpolation_backward,
)
register(
    "interpolate_backward",
    fake=lambda grad, first, second, share, shaded: grad.new_empty(shaded.shape[0], grad.shape[1]),
)
register(
    "neus_weights",
    fake=lambda f_prev, f_next, s, offsets, eps: (
        f_prev.new_empty(f_prev.shape),
        f_prev.new_empty(offsets.shape[0] - 1),
    ),
    setup_context=_keep_weights,
    backward=_weights_backward,
)
register(
    "neus_weights_backward",
    fake=lambda f_prev, f_next, s, offsets, eps, weights, grad_weights, grad_opacity: (
        f_prev.new_empty(f_prev.shape),
        f_next.new_empty(f_next.shape),
        grad_opacity.new_empty(grad_opacity.shape),
    ),
)
register(
    "composite",
    fake=lambda weights, values, offsets: values.new_empty(offsets.shape[0] - 1, values.shape[1]),
    setup_context=_keep_composite,
    backward=_composite_backward,
)
register(
    "composite_backward",
    fake=lambda weights, values, offsets, grad: (weights.new_empty(weights.shape), values.new_empty(values.shape)),
)
