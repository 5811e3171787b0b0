"""The pre-integrated light g(w, rho) as texels: filtered maps and spherical harmonics of one environment."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.devices import tensor_cores
from splitnerf.fields.light import Light, leaf_of
from splitnerf.ops import (
    SparseMap,
    light_averages,
    light_filters,
    light_lookup,
    light_sum_of_levels,
    sh_projection,
    sparse_product,
    zonal_factors,
)

CHAIN = (0.1, 0.15, 0.2, 0.3, 0.4)  # roughness of the filtered maps, but for lobes narrower than a texel
BASE_NODE = 0.05  # up to this roughness the texels stand unfiltered
LOBE_WIDTH = 2.57  # of ggx_alpha
SH_NODE = 0.5  # from it on spherical harmonics
TEXELS_PER_ALPHA = 5.0  # a map of resolution m = TEXELS_PER_ALPHA / ggx_alpha resolves its own lobe
SH_RESOLUTION = 64  # of the averages that the harmonics are taken from, at most
ZONAL_ROWS = 129
LOG_LIMIT = 12.0


class PyramidFilters(NamedTuple):
    """The fixed linear maps of one resolution, shared by all lights that have it.

    Attributes:
        sum_of_levels: Parameters to log-radiance of the texels.
        averages: Texels to texels and averages.
        lobes: Averages to the filtered maps.
        projection: [169, m^2], averages of resolution m to spherical harmonics.
        projected: Rows of the averages that the projection reads.
        resolutions, nodes, zonal: What :func:`splitnerf.ops.light_lookup` takes.
    """

    sum_of_levels: SparseMap
    averages: SparseMap
    lobes: SparseMap
    projection: Tensor
    projected: slice
    resolutions: Tensor
    nodes: Tensor
    zonal: Tensor

    def to(self, device: torch.device) -> PyramidFilters:
        """Copies on a device; resolutions and nodes stay on the CPU, where the lookup wants them."""
        sparse = (SparseMap(*(part.to(device) for part in matrix)) for matrix in self[:3])
        return PyramidFilters(
            *sparse, self.projection.to(device), self.projected, self.resolutions, self.nodes, self.zonal.to(device)
        )


@functools.lru_cache(maxsize=4)
def filters_on(resolution: int, device: torch.device) -> PyramidFilters:
    """:func:`pyramid_filters` on a device, copied once."""
    with torch.inference_mode(False):
        return pyramid_filters(resolution).to(device)


@functools.lru_cache(maxsize=2)
def pyramid_filters(resolution: int) -> PyramidFilters:
    """The maps for ``resolution`` texels along the edge, a power of 2 >= 16. Computed once, in double precision.

    Raises:
        ValueError: It is another number.
    """
    if resolution < 16 or resolution & (resolution - 1):
        raise ValueError(f"LightPyramid: resolution must be a power of 2, at least 16, got {resolution}")
    with torch.inference_mode(False):  # whoever asks first, autograd may keep them later
        chain = [(chain_resolution(resolution, rho), rho) for rho in CHAIN if is_resolved(resolution, rho)]
        side, skipped = resolution, 0
        while side > SH_RESOLUTION:
            skipped, side = skipped + side * side, side // 2
        return PyramidFilters(
            light_sum_of_levels(resolution), light_averages(resolution), light_filters(resolution, chain),
            sh_projection(side, cells=side < resolution), slice(skipped, skipped + side * side),
            torch.tensor([resolution] + [m for m, _ in chain]),
            torch.tensor([BASE_NODE, *(rho for _, rho in chain), SH_NODE], dtype=torch.float64),
            zonal_factors(SH_NODE, ZONAL_ROWS),
        )  # fmt: skip


def chain_resolution(resolution: int, roughness: float) -> int:
    """The power of 2 that resolves the lobe, at most the texels' own resolution."""
    wanted = TEXELS_PER_ALPHA / roughness**2
    return min(resolution, 1 << math.ceil(math.log2(wanted)))


def is_resolved(resolution: int, roughness: float) -> bool:
    """Whether the lobe, 2.57 ggx_alpha wide at half its height, spans a texel of sqrt(4 pi) / n on average."""
    return LOBE_WIDTH * roughness**2 * resolution >= math.sqrt(4.0 * math.pi)


class LightPyramid(Light):
    """g(w, rho) = the environment's texels, filtered by the exact lobe. Consistent by construction.

    The environment is an octahedral map of n^2 texels whose log-radiance is a sum of levels 4^2, 8^2, ...,
    n^2, clamped to [-12, 12]. Maps for those of rho = .1, .15, .2, .3, .4 whose lobe spans a texel, and
    spherical harmonics of degree 12 for rho >= .5, are fixed linear maps of the texels' radiance. Between
    nodes g is linear in rho; up to .05 the texels stand unfiltered.

    Args:
        resolution: n, a power of 2 >= 16; 64 resolves 3 degrees.
        start: Radiance at the start.

    Source: SplitNeRF Eq. (8)-(11), with the paper's mip-map ablation in mind.
    """

    needs_consistency_loss = False

    def __init__(self, resolution: int = 64, start: float = 0.5):
        super().__init__()
        self.resolution = resolution
        self.texels = nn.Parameter(torch.zeros(len(pyramid_filters(resolution).sum_of_levels.transposed_offsets) - 1, 3))
        with torch.no_grad():
            self.texels[: 4 * 4] = math.log(start)

    @property
    def filters(self) -> PyramidFilters:
        """The linear maps, where the texels are."""
        return filters_on(self.resolution, self.texels.device)

    def radiance(self) -> Tensor:
        """[n^2, 3] radiance of the texels."""
        return torch.exp(sparse_product(self.filters.sum_of_levels, self.texels).clamp(-LOG_LIMIT, LOG_LIMIT))

    def chain(self) -> tuple[Tensor, Tensor]:
        """All maps [texels, 3] and the harmonics' coefficients [169, 3], as they follow from the parameters now."""
        radiance = self.radiance()
        averages = sparse_product(self.filters.averages, radiance)
        levels = torch.cat([radiance, sparse_product(self.filters.lobes, averages)])
        # Three rows times a matrix, forward and backward: several times faster than the matrix times three columns.
        with tensor_cores(False):
            sh = averages[self.filters.projected].T.contiguous() @ self.filters.projection.T
        return levels, sh.T.contiguous()

    def evaluate(self) -> FilteredLight:
        """The filtered maps as they stand; their gradients gather until they are handed back in one pass."""
        return FilteredLight(self.filters, *self.chain())

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0. Computes all maps for this one call."""
        return lookup(self.filters, self.chain(), directions, roughness)


class FilteredLight:
    """The filtered maps of one moment, see :class:`splitnerf.fields.light.LightMaps`.

    Args:
        filters: The fixed linear maps of the resolution.
        levels: [texels, 3] the filtered maps.
        harmonics: [169, 3] coefficients for the rough end.
    """

    def __init__(self, filters: PyramidFilters, levels: Tensor, harmonics: Tensor):
        self._filters, self._roots = filters, (levels, harmonics)
        self.leaves: tuple[Tensor, ...] = tuple(map(leaf_of, self._roots)) if levels.requires_grad else ()

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        return lookup(self._filters, self.leaves or self._roots, directions, roughness)

    def backward(self) -> None:
        given = [(root, leaf.grad) for root, leaf in zip(self._roots, self.leaves) if leaf.grad is not None]
        if given:
            torch.autograd.backward(*map(list, zip(*given)))

    def with_leaves(self, leaves: Sequence[Tensor]) -> FilteredLight:
        copy = FilteredLight(self._filters, *(root.detach() for root in self._roots))
        copy.leaves = tuple(leaves)
        return copy


def lookup(filters: PyramidFilters, chain: Sequence[Tensor], directions: Tensor, roughness: Tensor) -> Tensor:
    """Radiance [n, 3] >= 0 of filtered maps and harmonics, for directions [n, 3] unit and roughness [n, 1] in [0, 1]."""
    return light_lookup(directions, roughness, *chain, filters.resolutions, filters.nodes, filters.zonal)
