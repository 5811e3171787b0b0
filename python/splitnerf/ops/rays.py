"""Rays through drawn pixels, and packed samples along them: marching, NeuS weights and compositing.

The samples of all rays are in one array, ray after ray; ``offsets`` [n_rays + 1] holds the first sample of each ray.

Differentiable once: ``surface_weights`` in sdf, gradient and s, ``composite`` in weights, values and opacity,
``ShadingSubset.interpolate`` in values. A second derivative raises. The others have no gradient.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.ops._library import front, lib, refuse_gradients, register


class PixelList(NamedTuple):
    """Pixels of a stack of photos in their order, as runs of neighbours.

    Attributes:
        last: [m] int64, the number of listed pixels up to the end of each run; empty: all pixels of the photos.
        shift: [m] int64, what is added to the rank of a listed pixel to get its number, counted through all photos.
        count: The number of listed pixels.
    """

    last: Tensor
    shift: Tensor
    count: int

    @classmethod
    def all(cls, count: int, device: torch.device) -> PixelList:
        """All pixels of photos with as many."""
        none = torch.empty(0, dtype=torch.int64, device=device)
        return cls(none, none, count)


class EdgeRuns(NamedTuple):
    """Pixels whose colour is compared whole, as runs of neighbours in their order.

    Attributes:
        starts, ends: [r] int64, the first pixel of each run and the one after its last, counted through all photos.
        shift: [r] int64, what is added to a pixel's number to get its row in `behind`.
        behind: [b, 3] uint8, sRGB of what the photo would show at these pixels without the object.
    """

    starts: Tensor
    ends: Tensor
    shift: Tensor
    behind: Tensor

    @classmethod
    def none(cls, device: torch.device) -> EdgeRuns:
        """No pixels."""
        empty = torch.empty(0, dtype=torch.int64, device=device)
        return cls(empty, empty, empty, torch.empty(0, 3, dtype=torch.uint8, device=device))


@front()
def draw_rays(
    random: Tensor,
    n_near: int,
    near: PixelList,
    known: PixelList,
    matrices: Tensor,
    origins: Tensor,
    height: int,
    width: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Rays through the middles of random pixels: `n_near` of one list, the others of another.

    The rays of a list share it out: ray i of k goes through pixel (i + u) / k of the list, u its random number. So no part of the
    photos is left out by chance, and each pixel is drawn as often as another, if u takes many more values (2^24 in float32)
    than a ray's part of the list has pixels.

    Args:
        random: [n] in [0, 1), float32 or float64.
        n_near: The number of rays through pixels of `near`, at most n.
        near, known: The lists. Numbers beyond the last pixel of the photos count as that.
        matrices: [v, 3, 3], from an image point (x, y, 1) of a view to its direction in the world, not normalised.
        origins: [v, 3] the views' centres.
        height, width: Of the photos, in pixels.

    Returns:
        rays_o, rays_d: [n, 3] origins and unit directions.
        view, index: [n] int64, the rays' views, and their pixels counted through all views.

    Source: stratified sampling (Pharr, Jakob and Humphreys, Physically Based Rendering, 4th ed., section 8.2.1).
    """
    return lib.draw_rays(random, n_near, *near, *known, matrices, origins, height, width)


@front()
def read_pixels(
    codes: Tensor, index: Tensor, view: Tensor, exposures: Tensor, backgrounds: Tensor, edges: EdgeRuns
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """What photos show at pixels, how they were exposed, and what lies behind.

    Args:
        codes: [pixels, 4] of all photos, one after the other: uint8 or int16, which holds the bits of uint16, the values times 255
            or 65535; or float32, the values.
        index, view: [n] int64, the pixels and their photos, see :func:`draw_rays`.
        exposures: [v, 3] the photos' factors, float32 or float64.
        backgrounds: [n, 3] sRGB colours.
        edges: The pixels behind which another colour lies.

    Returns:
        pixels: [n, 4] sRGB and alpha, in [0, 1] but for float32 codes, which stay as they are.
        exposure: [n, 3] the factors of each pixel's photo.
        background: [n, 3] `backgrounds`, but at the pixels of `edges` their own.
        whole: [n] bool, which pixels are among those of `edges`.
    """
    return lib.read_pixels(codes, index, view, exposures, backgrounds, *edges)


def _fake_draw(random, n_near, *rest):
    n = random.shape[0]
    return (*(random.new_empty(n, 3) for _ in range(2)), *(random.new_empty(n, dtype=torch.int64) for _ in range(2)))


def _fake_read(codes, index, view, exposures, backgrounds, *edges):
    n = index.shape[0]
    found = [backgrounds.new_empty(n, c) for c in (4, 3, 3)]
    return *found, backgrounds.new_empty(n, dtype=torch.bool)


register("draw_rays", fake=_fake_draw)
register("read_pixels", fake=_fake_read)


CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE = 0, 1, 2


class PackedSamples(NamedTuple):
    """Samples of a batch of rays.

    Attributes:
        ray_indices: [n] int64, the ray of each sample.
        t_starts, t_ends: [n] distances along the ray to the start and the end of each sample, scene units.
        offsets: [n_rays + 1] int64; the samples of ray r have the indices offsets[r] to offsets[r + 1] - 1.
    """

    ray_indices: Tensor
    t_starts: Tensor
    t_ends: Tensor
    offsets: Tensor

    @property
    def middles(self) -> Tensor:
        """[n] distances along the ray to the samples' midpoints, scene units."""
        return 0.5 * (self.t_starts + self.t_ends)

    def extended(self, n: int) -> PackedSamples:
        """These samples followed by n samples of padding, which belong to no ray; their ``ray_indices`` are 0."""
        return self if n == 0 else PackedSamples(*(F.pad(x, (0, n)) for x in self[:3]), self.offsets)


@front()
def march_rays(
    rays_o: Tensor, rays_d: Tensor, jitter: Tensor, cells: Tensor, *, box: float, step: float, max_samples: int = 1024
) -> PackedSamples:
    """Steps rays through an occupancy grid and keeps the samples in occupied cells.

    Args:
        rays_o, rays_d: [n_rays, 3] origins (scene units) and unit directions. Origins may lie outside the box.
        jitter: [n_rays] offsets of each ray's lattice of samples in [0, 1), as shares of the step.
        cells: [r, r, r] uint8 over [x, y, z]: CELL_EMPTY is skipped, CELL_OCCUPIED is sampled, CELL_OPAQUE ends the ray
            (it is so deep inside that nothing behind it is visible).
        box: The half size of the cube that the cells cover, scene units.
        step: The length of a sample, scene units.
        max_samples: The largest number of samples of one ray.

    Returns:
        PackedSamples, front to back along each ray.
    """
    return PackedSamples(*lib.march_rays(rays_o, rays_d, jitter, cells, box, step, max_samples))


@front()
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
    n_samples: int | None = None,
) -> tuple[Tensor, Tensor, Tensor]:
    r"""Normals and rendering weights of samples, from the distance and its gradient at the samples' midpoints.

    With :math:`n = \nabla f / |\nabla f|` and the ray's direction d, both ends are estimated from the middle:

    .. math::

       f_{prev}, f_{next} &= f \mp \tfrac{1}{2}\, c(d \cdot n)\, step \\
       c(x) &= -\left[(1 - anneal) \max(0, \tfrac{1}{2} - \tfrac{x}{2}) + anneal\, \max(0, -x)\right]

    With :math:`\Phi(f) = 1 / (1 + e^{-s f})` the opacity of a sample is

    .. math:: \alpha = \max\left(0, \frac{\Phi(f_{prev}) - \Phi(f_{next})}{\Phi(f_{prev})}\right) .

    It is computed in log space, as the optical depth :math:`\tau = \ln(1 + (e^a - 1) \Phi(-f_{prev}))`,
    :math:`a = s \max(0, f_{prev} - f_{next})`; the transmittance is :math:`e^{-\sum \tau}`. A field gradient shorter than 0.001 gets
    no gradient in the backward pass.

    Args:
        sdf, gradient: [n] signed distances (scene units), or [n, c] with the distances in the first column, and their gradients
            [n, 3].
        rays_d: [n_rays, 3] unit directions.
        s: [] sharpness of the density, positive.
        offsets: [n_rays + 1] int64, see :class:`PackedSamples`.
        step: The length of a sample, scene units; a number or a tensor [].
        anneal: The annealing of the cosine: 0 at the start of a training, 1 when done; a number or a tensor [].
        min_transmittance: The transmittance below which samples get weight 0, in [0, 1); it also bounds the error of a pixel.
        n_samples: Only so many of the first points are samples, as if the others were not there; None: all.

    Returns:
        normals [n_samples, 3], weights [n_samples] and opacity [n_rays]. Differentiable once in sdf,
        gradient and s.

    Source: NeuS Eq. (13) and its released code's estimate of both ends from one evaluation.
    """
    n_samples = -1 if n_samples is None else n_samples
    numbers = _as_tensor(step, sdf), _as_tensor(anneal, sdf), min_transmittance, n_samples
    return lib.surface_weights(sdf, gradient, rays_d, s, offsets, *numbers)


def _as_tensor(value: float | Tensor, like: Tensor) -> Tensor:
    return value if isinstance(value, Tensor) else like.new_full((), value)


class ShadingSubset(NamedTuple):
    """The subset of m samples that are shaded, and the interpolation from it to all n samples.

    A ray consists of segments, see :func:`spread_samples`.

    Attributes:
        shaded: [m] int64, ascending indices of the shaded samples; every ray with samples has at least one.
        first, second: [n] int64 positions in ``shaded``: the shaded neighbours of each sample within its segment, equal
            beyond the segment's first and last shaded sample.
        share: [n] weight of the second neighbour in [0, 1], linear in the distance along the ray.
        heaviest: [rays with samples] int64 positions in ``shaded``: the shaded sample of the largest weight on each
            ray.
        representatives: [segments] int64 positions in ``shaded``: the shaded sample of the largest weight on each segment.
        segment: [m] int64, the segment of each shaded sample.
        sizes: [3] int64, the numbers of shaded samples, of rays with samples and of segments.
    """

    shaded: Tensor
    first: Tensor
    second: Tensor
    share: Tensor
    heaviest: Tensor
    representatives: Tensor
    segment: Tensor
    sizes: Tensor

    def interpolate(self, values: Tensor) -> Tensor:
        """Interpolates values [m, c] at the shaded samples to values [n, c] at all samples."""
        return lib.interpolate(values, self.first, self.second, self.share)

    def gather(self, weights: Tensor) -> Tensor:
        """The transpose of :meth:`interpolate`: weights [n] of all samples -> weights [m] of the shaded ones. No
        gradient."""
        return lib.interpolate_backward(weights[:, None], self.first, self.second, self.share, self.shaded)[:, 0]


@front()
def spread_samples(
    weights: Tensor,
    samples: PackedSamples,
    per_ray: int,
    phase: Tensor,
    gap: float = math.inf,
    capacity: tuple[int, int] | None = None,
    unit: Tensor | None = None,
) -> ShadingSubset:
    """Draws the samples of each ray that are shaded, in proportion to their weights.

    The weights of a ray are laid end to end, with `per_ray` evenly spaced marks on them; a sample is drawn when a mark
    falls on it. So a sample with more than 1 / per_ray of the ray's weight is always drawn. Neighbouring samples more
    than `gap` apart may lie on two surfaces, so a ray is split there into segments. Each segment gets at least one
    drawn sample and is interpolated by itself.

    Args:
        weights: [n] rendering weights.
        samples: The packed samples; their starts say how far apart they are.
        per_ray: The number of marks on a ray; 0 draws all samples.
        phase: [n_rays] position of each ray's first mark in [0, 1), as a share of the marks' spacing.
        gap: The distance along the ray at which segments are split, positive, in units of `unit`.
        capacity: Fixed lengths of the results for shaded samples and for segments, so that the host need not wait for a
            GPU's counts; ``heaviest`` is then [n_rays]. Entries past the counts are valid indices with weight 0. If a
            count exceeds its capacity, as ``sizes`` shows, all other results are in range but have no meaning. None:
            exact lengths.
        unit: [] a length in scene units; None: 1.

    Source: Systematic resampling (Kitagawa 1996).
    """
    capacity = (-1, -1) if capacity is None else capacity
    found = lib.spread_samples(weights, samples.t_starts, samples.offsets, phase, gap, per_ray, *capacity, unit)
    return ShadingSubset(*found)


@front()
def composite(
    weights: Tensor, values: Tensor, offsets: Tensor, opacity: Tensor | None = None, least_opacity: float = 1e-4
) -> Tensor:
    """Weighted sum of the samples' values along each ray or, with the rays' opacity o, their mean: sum / max(o, least).

    Args:
        weights: [n] rendering weights.
        values: [n, c] values of the samples.
        offsets: [n_rays + 1] int64, see :class:`PackedSamples`.
        opacity: [n_rays] what the sums are divided by; None: they are not.
        least_opacity: A smaller opacity counts as this one, and gets no gradient; positive.

    Returns:
        [n_rays, c] sums or means; 0 for a ray without samples. Differentiable once in weights, values and opacity.
    """
    return lib.composite(weights, values, offsets, opacity, least_opacity)


def _fake_packed(rays_o: Tensor, n: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """:class:`PackedSamples` of n samples without their values, for the fake implementations."""
    offsets = rays_o.new_empty(rays_o.shape[0] + 1, dtype=torch.int64)
    return offsets.new_empty(n), rays_o.new_empty(n), rays_o.new_empty(n), offsets


def _fake_spread(weights, t, offsets, phase, gap, per_ray, max_shaded=-1, max_stretches=-1, unit=None):
    sizes = (max_shaded, phase.shape[0], max_stretches)
    if max_shaded < 0:
        sizes = (torch.library.get_ctx().new_dynamic_size() for _ in range(3))
    shaded, heaviest, representatives = (weights.new_empty(size, dtype=torch.int64) for size in sizes)
    first, second = (weights.new_empty(weights.shape, dtype=torch.int64) for _ in range(2))
    share, segment = weights.new_empty(weights.shape), shaded.new_empty(shaded.shape)
    return shaded, first, second, share, heaviest, representatives, segment, shaded.new_empty(3)


def _keep_interpolation(ctx, inputs, output):
    values, first, second, share = inputs
    ctx.save_for_backward(first, second, share, values)


def _interpolation_backward(ctx, grad):
    refuse_gradients(ctx, "interpolate", share=3)
    return lib.interpolate_backward(grad, *ctx.saved_tensors), None, None, None


def _keep_surface(ctx, inputs, output):
    *tensors, ctx.min_transmittance, ctx.n_samples = inputs
    ctx.save_for_backward(*tensors, output[1])


def _surface_backward(ctx, grad_normals, grad_weights, grad_opacity):
    refuse_gradients(ctx, "surface_weights", rays_d=2, step=5, anneal=6)
    *tensors, weights = ctx.saved_tensors
    grad_sdf, grad_gradient, grad_s = lib.surface_weights_backward(
        *tensors, ctx.min_transmittance, ctx.n_samples, weights, grad_normals, grad_weights, grad_opacity
    )
    return grad_sdf, grad_gradient, None, grad_s.sum(), None, None, None, None, None


def _fake_surface(sdf, gradient, rays_d, s, offsets, step, anneal, min_transmittance, n_samples=-1):
    n = sdf.shape[0] if n_samples < 0 else n_samples
    return gradient.new_empty(n, 3), sdf.new_empty(n), sdf.new_empty(rays_d.shape[0])


register("march_rays", fake=lambda rays_o, *rest: _fake_packed(rays_o, torch.library.get_ctx().new_dynamic_size()))
register("surface_weights", fake=_fake_surface, setup_context=_keep_surface, backward=_surface_backward)
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
    "composite",
    fake=lambda weights, values, offsets, *rest: values.new_empty(offsets.shape[0] - 1, values.shape[1]),
    gradients="weights values opacity",
)
