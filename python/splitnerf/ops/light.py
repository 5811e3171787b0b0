"""The pre-integrated light: its Monte Carlo estimate, and the explicit light's linear maps, lookup and prior.

Maps of the sphere are octahedral, +z in the centre of the square, texel (i, j) at row j n + i of an
[n^2, 3] tensor; see ``cpp/include/splitnerf/octahedral.h``.

Source: SplitNeRF Eq. (11); Praun and Hoppe 2003 (the map); Ramamoorthi and Hanrahan 2001 (harmonics of the rough end).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.ops._library import front, lib, refuse_gradients, register


@front(query_dirs=1, roughness=1)
def prefilter_light(query_dirs: Tensor, roughness: Tensor, *, light_dirs: Tensor, light: Tensor) -> Tensor:
    r"""Estimates gbar(w_s, rho) from light samples that all queries share.

    .. math::

       \bar g(w_s, \rho) = \frac{\sum_i D(w_i, w_s, \rho)\, L_i\, (w_i \cdot w_s)^+}{\sum_i D(w_i, w_s, \rho)\, (w_i \cdot w_s)^+}

    The light directions should cover the sphere uniformly (:func:`fibonacci_directions` with a random rotation). The weights of
    the s n pairs are never stored: memory is O(s + n).

    Args:
        query_dirs: [s, 3] unit directions w_s.
        roughness: [s, 1] perceptual roughness in [0, 1].
        light_dirs: [n, 3] unit directions w_i, n > 0.
        light: [n, 3] radiance L_i at rho = 0.

    Returns:
        [s, 3] radiance; 0 for a query with no light direction above its horizon.
    """
    return lib.prefilter_light(query_dirs, roughness, light_dirs, light)[0]


def fibonacci_directions(n: int, generator: torch.Generator | None = None, dtype=torch.float32) -> Tensor:
    """[n, 3] directions of a uniform lattice on the sphere under a random rotation (Haar measure).

    At equal n the error of gbar is 2 to 10 times smaller than with independent directions. The result is on the
    generator's device.
    """
    device = torch.device("cpu") if generator is None else generator.device
    lattice = torch.from_numpy(_core.fibonacci_sphere(n)).to(device=device, dtype=dtype)
    q, r = torch.linalg.qr(torch.randn(3, 3, dtype=dtype, generator=generator, device=device))
    rotation = q * torch.sign(torch.diagonal(r))
    return (lattice[:, :, None] * rotation).sum(1)


@front(axes=1, roughness=1)
def sample_ggx_lobe(axes: Tensor, roughness: Tensor, n_samples: int, seed: int = 0) -> Tensor:
    """Directions with density proportional to D(w)(w.axis)+, for lobes so narrow that a shared set would miss them.

    The plain mean of the light over the directions estimates gbar, because the density is exact. Each axis
    gets a random shift by the seed, so that the mean is unbiased. No gradient.

    Args:
        axes: [s, 3] unit axes of the lobes.
        roughness: [s, 1] perceptual roughness in [0, 1].
        n_samples: The number of directions per axis.
        seed: The seed of the random shifts.

    Returns:
        [s, n_samples, 3] unit directions.
    """
    return lib.sample_ggx_lobe(axes, roughness, n_samples, seed)


def _keep_prefilter(ctx, inputs, output):
    query_dirs, roughness, light_dirs, _ = inputs
    ctx.save_for_backward(query_dirs, roughness, light_dirs, output[1])


def _prefilter_backward(ctx, grad_gbar, grad_total):
    query_dirs, roughness, light_dirs, total = ctx.saved_tensors
    refuse_gradients(ctx, "prefilter_light", query_dirs=0, roughness=1, light_dirs=2)
    return None, None, None, lib.prefilter_light_backward(query_dirs, roughness, total, grad_gbar, light_dirs)


register(
    "prefilter_light",
    fake=lambda query_dirs, roughness, light_dirs, light: (
        query_dirs.new_empty(query_dirs.shape),
        query_dirs.new_empty(query_dirs.shape[0]),
    ),
    setup_context=_keep_prefilter,
    backward=_prefilter_backward,
)
register(
    "prefilter_light_backward",
    fake=lambda query_dirs, roughness, total, grad_gbar, light_dirs: light_dirs.new_empty(light_dirs.shape),
)
register("sample_ggx_lobe", fake=lambda axes, roughness, n_samples, seed: axes.new_empty(axes.shape[0], n_samples, 3))


class SparseRows(NamedTuple):
    """A sparse matrix by rows. Of one that F mirror images leave as it is, it holds one row of each F.

    Attributes:
        offsets: [rows + 1] int64, the index of each row's first entry.
        columns: [entries] int32 column indices.
        weights: [entries] values.
        places: [rows, F] int32, the rows of the whole matrix that the images of each row are; F is 1 or 4.
        images: [columns, F] int32, the images of each column.
    """

    offsets: Tensor
    columns: Tensor
    weights: Tensor
    places: Tensor
    images: Tensor


class SparseMap(NamedTuple):
    """A sparse matrix by rows, and its transpose by rows for the backward pass; see :class:`SparseRows`."""

    rows: SparseRows
    transposed: SparseRows

    def to(self, to: torch.device | torch.dtype) -> SparseMap:
        """A copy on a device, or with weights of another type."""
        kept = isinstance(to, torch.device)
        return SparseMap(
            *(SparseRows(*(x.to(to) if kept or x.is_floating_point() else x for x in part)) for part in self)
        )


def sparse_map(parts: list[tuple], sides: tuple[list[int], list[int]] | None = None) -> SparseMap:
    """Stacks matrices of equal width, given as ``_core`` returns them: (offsets, columns, weights, n_columns). `sides`: the edges
    of the octahedral maps that rows and columns are, where the parts hold one row of each four mirror images; None: they hold all
    rows."""
    starts = np.cumsum([0] + [len(columns) for _, columns, _, _ in parts])
    offsets = np.concatenate([[0]] + [part[0][1:] + start for part, start in zip(parts, starts)])
    columns, weights = (np.concatenate([part[k] for part in parts]) for k in (1, 2))
    if sides is None:
        images = [np.arange(n, dtype=np.int32)[:, None] for n in (len(offsets) - 1, parts[0][3])]
        places = images
    else:
        images = [mirror_images(s) for s in sides]
        places = [x[quarter(s)] for x, s in zip(images, sides)]
    # The image that takes an entry's column into the quarter takes its row to a row of the transpose's entry.
    number, image = (np.empty(len(images[1]), np.int32) for _ in range(2))
    for k in range(places[1].shape[1]):
        number[places[1][:, k]], image[places[1][:, k]] = np.arange(len(places[1])), k
    rows = places[0][np.repeat(np.arange(len(offsets) - 1), np.diff(offsets)), image[columns]]
    order = np.argsort(number[columns], kind="stable")
    transposed_offsets = np.concatenate([[0], np.cumsum(np.bincount(number[columns], minlength=len(places[1])))])

    def held(offsets, columns, weights, places, images):
        arrays = offsets.astype(np.int64), columns, weights.astype(np.float32), places, images
        return SparseRows(*(torch.from_numpy(np.ascontiguousarray(x)) for x in arrays))

    return SparseMap(
        held(offsets, columns, weights, places[0], images[1]),
        held(transposed_offsets, rows[order], weights[order], places[1], images[0]),
    )


def mirror_images(sides: list[int]) -> np.ndarray:
    """[texels, 4] int32, for texels of octahedral maps, one map after the other: the texels themselves, and those at the other
    sign of the first axis, of the second, and of both."""
    maps, start = [], 0
    for side in sides:
        numbers = start + np.arange(side * side, dtype=np.int32).reshape(side, side)
        flipped = numbers, numbers[:, ::-1], numbers[::-1], numbers[::-1, ::-1]
        maps.append(np.stack([x.ravel() for x in flipped], axis=1))
        start += side * side
    return np.concatenate(maps)


def quarter(sides: list[int]) -> np.ndarray:
    """The numbers of the texels of which all others are :func:`mirror_images`."""
    texels = [np.arange(side * side).reshape(side, side)[: side // 2, : side // 2].ravel() for side in sides]
    return np.concatenate([x + start for x, start in zip(texels, np.cumsum([0] + [side * side for side in sides]))])


def light_sum_of_levels(resolution: int) -> SparseMap:
    """The [n^2, 4^2 + 8^2 + ... + n^2] matrix that adds bilinearly interpolated levels of log-radiance, coarse to
    fine."""
    return sparse_map([_core.light_sum_of_levels(resolution)])


def light_averages(resolution: int) -> SparseMap:
    """The [n^2 + (n/2)^2 + ... + 8^2, n^2] matrix from texels to the texels and their averages by solid angle."""
    return sparse_map([_core.light_averages(resolution)])


def light_filters(resolution: int, targets: list[tuple[int, float]]) -> SparseMap:
    """The matrix from the averages of :func:`light_averages` to gbar(w, rho) at the texel centres of octahedral maps.

    Each row holds the integrals of ``D (w.w_s)+`` over cells, divided by their sum, so that a constant light is
    preserved. Cells are larger where the lobe varies slowly. The lobe is not truncated. A quarter of the rows is stored: the
    others are mirror images.

    Args:
        resolution: Texels along an edge, n: a power of 2 >= 8.
        targets: The even resolution m and the roughness rho of each map, which has m^2 rows.

    Source: SplitNeRF Eq. (11).
    """
    parts = [_core.light_filter(resolution, m, rho) for m, rho in targets]
    averaged = [resolution]
    while sum(side * side for side in averaged) < parts[0][3]:
        averaged.append(averaged[-1] // 2)
    return sparse_map(parts, ([m for m, _ in targets], averaged))


def sh_projection(resolution: int, cells: bool) -> Tensor:
    """The [169, n^2] float32 matrix from texels to spherical harmonics.

    The light is bilinear between the texels' centres or, with ``cells``, constant in each texel.
    """
    return torch.from_numpy(_core.sh_projection(resolution, cells)).to(torch.float32)


def zonal_factors(start: float, n_rows: int) -> Tensor:
    """[n_rows, 13] float32 factors by which the lobe D cos scales each degree, for roughness ``start`` to 1."""
    return torch.from_numpy(_core.zonal_factors(start, n_rows)).to(torch.float32)


@front()
def sparse_product(matrix: SparseMap, values: Tensor) -> Tensor:
    """The product of a matrix with values [columns, 3] -> [rows, 3]. Differentiable in ``values``, any number of times.

    On the CPU indices are checked to lie in range. That ``places`` name each row once is not: the maps above do.
    """
    return lib.sparse_product(*matrix.rows, *matrix.transposed, values)


@front(directions=1, roughness=1)
def light_lookup(
    directions: Tensor, roughness: Tensor, levels: Tensor, sh: Tensor, resolutions: Tensor, nodes: Tensor, zonal: Tensor
) -> Tensor:
    r"""g(w, rho) from filtered maps and spherical harmonics.

    Below ``nodes[0]`` g is the first map; between nodes g is linear in rho between their maps; from the last node on
    :math:`g = \sum_{lm} zonal_l(\rho)\, sh_{lm}\, Y_{lm}(w)`. Maps are read bilinearly, also across the seams of the octahedron.
    Spherical harmonics ring around strong lamps: where their sum x is below e, a thousandth of the mean light, it is
    replaced by e exp(x/e - 1), and so is its gradient.

    Differentiable once in directions (tangentially in the maps), roughness, levels and sh.

    Args:
        directions: [n, 3] unit directions w.
        roughness: [n, 1] perceptual roughness; values above 1 count as 1.
        levels: [sum of r_k^2, 3] radiance of the maps, one after the other.
        sh: [169, 3] spherical harmonics of the radiance; the coefficient of (l, m) is in row l^2 + l + m.
        resolutions: [K] int64 resolutions r_k of the maps; always on the CPU.
        nodes: [K + 1] float64, ascending: the roughness of each map, then that of the harmonics; always on the CPU.
        zonal: [rows, 13] factors of the degrees at roughness nodes[K] to 1, evenly spaced.

    Returns:
        [n, 3] radiance. A NaN direction or roughness gives NaN.
    """
    return lib.light_lookup(directions, roughness, levels, sh, resolutions, nodes, zonal)


def _map_backward(ctx, grad):
    refuse_gradients(ctx, "sparse_product", weights=2, transposed_weights=7)
    rows, transposed = ctx.saved_tensors[:5], ctx.saved_tensors[5:]
    return *[None] * 10, lib.sparse_product(*transposed, *rows, grad)


register(
    "sparse_product",
    fake=lambda *inputs: inputs[10].new_empty(inputs[3].numel(), 3),
    setup_context=lambda ctx, inputs, output: ctx.save_for_backward(*inputs[:10]),
    backward=_map_backward,
)
register(
    "light_lookup",
    fake=lambda directions, *rest: directions.new_empty(directions.shape),
    gradients="directions roughness levels sh",
)


@front()
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

    Source: our own; Student's t distribution with 3 degrees of freedom.
    """
    return lib.light_prior(texels, list(level_sizes))


register("light_prior", fake=lambda texels, level_sizes: texels.new_empty(()), gradients="texels")
