"""The pre-integrated light g(w, rho) from texels: filtered maps and spherical harmonics of one environment map."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf.devices import tensor_cores
from splitnerf.fields.light import Light, LightTexels, leaf_of
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

CHAIN = (0.1, 0.15, 0.2, 0.3, 0.4)  # roughness of the filtered maps whose lobe is wider than a texel
BASE_NODE = 0.05  # up to this roughness the texels are read unfiltered
LOBE_WIDTH = 2.57  # full width of the lobe at half its height, in units of ggx_alpha
SH_NODE = 0.5  # spherical harmonics from this roughness on
TEXELS_PER_ALPHA = 5.0  # a map of resolution m = TEXELS_PER_ALPHA / ggx_alpha resolves its own lobe
SH_RESOLUTION = 64  # largest resolution of the averages that the harmonics are computed from
ZONAL_ROWS = 129
LOG_LIMIT = 12.0
TEXEL_PARTS = 4  # parts of a texel along its edge, for its solid angle


class PyramidFilters(NamedTuple):
    """The fixed linear maps of one resolution, shared by all lights of that resolution.

    Attributes:
        sum_of_levels: The map from parameters to the texels' log-radiance.
        averages: The map from texels to the texels followed by their averages.
        lobes: The map from these averages to the filtered maps.
        projection: [169, m^2], the map from averages of resolution m to spherical harmonics.
        projected: The rows of the averages that the projection reads.
        resolutions, nodes, zonal: The arguments of :func:`splitnerf.ops.light_lookup` with these names.
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
        """A copy on a device; resolutions and nodes stay on the CPU, as the lookup requires."""
        sparse = (SparseMap(*(part.to(device) for part in matrix)) for matrix in self[:3])
        return PyramidFilters(
            *sparse, self.projection.to(device), self.projected, self.resolutions, self.nodes, self.zonal.to(device)
        )


@functools.lru_cache(maxsize=4)
def filters_on(resolution: int, device: torch.device) -> PyramidFilters:
    """The result of :func:`pyramid_filters` on a device, copied there once."""
    with torch.inference_mode(False):
        return pyramid_filters(resolution).to(device)


@functools.lru_cache(maxsize=2)
def pyramid_filters(resolution: int) -> PyramidFilters:
    """The linear maps for ``resolution`` texels along the edge, a power of 2 >= 16; computed once, in double precision.

    Raises:
        ValueError: The resolution is not a power of 2 or is below 16.
    """
    if resolution < 16 or resolution & (resolution - 1):
        raise ValueError(f"LightPyramid: resolution must be a power of 2, at least 16, got {resolution}")
    with torch.inference_mode(False):  # a first call in inference mode must not make inference tensors
        chain = [(chain_resolution(resolution, rho), rho) for rho in CHAIN if is_resolved(resolution, rho)]
        side, skipped = resolution, 0
        while side > SH_RESOLUTION:
            skipped, side = skipped + side * side, side // 2
        return PyramidFilters(
            light_sum_of_levels(resolution),
            light_averages(resolution),
            light_filters(resolution, chain),
            sh_projection(side, cells=side < resolution),
            slice(skipped, skipped + side * side),
            torch.tensor([resolution] + [m for m, _ in chain]),
            torch.tensor([BASE_NODE, *(rho for _, rho in chain), SH_NODE], dtype=torch.float64),
            zonal_factors(SH_NODE, ZONAL_ROWS),
        )


@functools.lru_cache(maxsize=4)
def octahedral_texels(resolution: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """The mean directions [n^2, 3] and the solid angles [n^2] of an octahedral map's texels, in the order of its rows.

    A texel's solid angle is that of its parts, du dv / |p|^3 each, where p is the point of the octahedron.
    """
    with torch.inference_mode(False):
        n = TEXEL_PARTS * resolution
        axis = (torch.arange(n, dtype=torch.float64) + 0.5) * (2.0 / n) - 1.0
        v, u = torch.meshgrid(axis, axis, indexing="ij")
        z = 1.0 - u.abs() - v.abs()
        folded = [(1.0 - a.abs()) * torch.where(b < 0, -1.0, 1.0) for a, b in ((v, u), (u, v))]
        point = torch.stack([torch.where(z >= 0, u, folded[0]), torch.where(z >= 0, v, folded[1]), z])
        length = point.norm(dim=0)
        parts = torch.cat([point / length, torch.ones_like(z)[None]]) / length**3
        sums = F.avg_pool2d(parts, TEXEL_PARTS).flatten(1)
        solid_angles = sums[3] * (4.0 * math.pi / sums[3].sum())
        return F.normalize(sums[:3].T, dim=1).float().to(device), solid_angles.float().to(device)


def chain_resolution(resolution: int, roughness: float) -> int:
    """The smallest power of 2 that resolves the lobe, at most the texels' own resolution."""
    wanted = TEXELS_PER_ALPHA / roughness**2
    return min(resolution, 1 << math.ceil(math.log2(wanted)))


def is_resolved(resolution: int, roughness: float) -> bool:
    """Whether the lobe, 2.57 ggx_alpha wide at half its height, is wider than a texel, sqrt(4 pi) / n on average."""
    return LOBE_WIDTH * roughness**2 * resolution >= math.sqrt(4.0 * math.pi)


class LightPyramid(Light):
    """g(w, rho) as the environment's texels filtered with the exact lobe, so that it is consistent by construction.

    The environment is an octahedral map of n^2 texels. Its log-radiance is a sum of levels of 4^2, 8^2, ..., n^2
    texels, clamped to [-12, 12]. Filtered maps exist for rho = 0.1, 0.15, 0.2, 0.3, 0.4 where the lobe is wider than a
    texel, and spherical harmonics of degree 12 for rho >= 0.5; all are fixed linear maps of the texels' radiance.
    Between these nodes g is linear in rho; up to rho = 0.05 the texels are read unfiltered.

    Args:
        resolution: Texels along an edge, n: a power of 2 >= 16; 64 resolves 3 degrees.
        start: The radiance of all texels before training.

    Source: SplitNeRF Eq. (8)-(11); compare the paper's mip-map ablation.
    """

    needs_consistency_loss = False

    def __init__(self, resolution: int = 64, start: float = 0.5):
        super().__init__()
        self.resolution = resolution
        self.texels = nn.Parameter(
            torch.zeros(len(pyramid_filters(resolution).sum_of_levels.transposed_offsets) - 1, 3)
        )
        with torch.no_grad():
            self.texels[: 4 * 4] = math.log(start)

    @property
    def level_sizes(self) -> list[int]:
        """The number of texels of each level, from coarse to fine."""
        return [4**k for k in range(2, self.resolution.bit_length())]

    @property
    def filters(self) -> PyramidFilters:
        """The linear maps, on the texels' device."""
        return filters_on(self.resolution, self.texels.device)

    def radiance(self) -> Tensor:
        """[n^2, 3] linear radiance of the texels."""
        return torch.exp(sparse_product(self.filters.sum_of_levels, self.texels).clamp(-LOG_LIMIT, LOG_LIMIT))

    def chain(self) -> tuple[Tensor, Tensor]:
        """All maps [texels, 3] and the harmonics' coefficients [169, 3], computed from the current parameters."""
        radiance = self.radiance()
        averages = sparse_product(self.filters.averages, radiance)
        levels = torch.cat([radiance, sparse_product(self.filters.lobes, averages)])
        # Three rows times the matrix: several times faster, forward and backward, than the matrix times three columns.
        with tensor_cores(False):
            sh = averages[self.filters.projected].T.contiguous() @ self.filters.projection.T
        return levels, sh.T.contiguous()

    def evaluate(self) -> FilteredLight:
        """The filtered maps of the current parameters; they accumulate gradients and pass them on in one backward
        pass."""
        return FilteredLight(self.filters, *self.chain())

    def partition(self, at_least: int, device: torch.device) -> LightTexels:
        """The unfiltered texels of the light, see :func:`partition`."""
        return partition(self.radiance(), self.resolution, at_least, device)

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0. Each call computes all maps."""
        return lookup(self.filters, self.chain(), directions, roughness)


class FilteredLight:
    """The filtered maps of one state of the parameters, see :class:`splitnerf.fields.light.LightMaps`.

    Args:
        filters: The fixed linear maps of the resolution.
        levels: [texels, 3] linear radiance of the filtered maps, one after the other.
        harmonics: [169, 3] coefficients of the spherical harmonics for rough lobes.
    """

    def __init__(self, filters: PyramidFilters, levels: Tensor, harmonics: Tensor):
        self._filters, self._roots = filters, (levels, harmonics)
        self.leaves: tuple[Tensor, ...] = tuple(map(leaf_of, self._roots)) if levels.requires_grad else ()

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        return lookup(self._filters, self.leaves or self._roots, directions, roughness)

    def partition(self, at_least: int, device: torch.device) -> LightTexels:
        """The unfiltered texels of the light, see :func:`partition`."""
        return partition((self.leaves or self._roots)[0], int(self._filters.resolutions[0]), at_least, device)

    def backward(self) -> None:
        given = [(root, leaf.grad) for root, leaf in zip(self._roots, self.leaves) if leaf.grad is not None]
        if given:
            torch.autograd.backward(*map(list, zip(*given)))

    def with_leaves(self, leaves: Sequence[Tensor]) -> FilteredLight:
        copy = FilteredLight(self._filters, *(root.detach() for root in self._roots))
        copy.leaves = tuple(leaves)
        return copy


def partition(levels: Tensor, resolution: int, at_least: int, device: torch.device) -> LightTexels:
    """The first map of [texels, 3] levels as texels, divided into equal squares until they are ``at_least`` so many."""
    radiance, n = levels[: resolution * resolution], resolution
    while n * n < at_least:
        radiance = radiance.view(n, 1, n, 1, 3).expand(n, 2, n, 2, 3).reshape(4 * n * n, 3)
        n *= 2
    return LightTexels(*octahedral_texels(n, device), radiance)


def lookup(filters: PyramidFilters, chain: Sequence[Tensor], directions: Tensor, roughness: Tensor) -> Tensor:
    """Radiance [n, 3] >= 0 from filtered maps and harmonics, at directions [n, 3] unit and roughness [n, 1] in [0,
    1]."""
    return light_lookup(directions, roughness, *chain, filters.resolutions, filters.nodes, filters.zonal)
