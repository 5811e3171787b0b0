"""The pre-integrated light g(w, rho) as texels: filtered maps and spherical harmonics of one environment."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import torch
from torch import Tensor, nn

from splitnerf.devices import tensor_cores
from splitnerf.fields.light import Light
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


class PyramidMaps(NamedTuple):
    """The fixed linear maps of one resolution, shared by all lights that have it.

    Attributes:
        sum_of_levels: Parameters to log-radiance of the texels.
        averages: Texels to texels and averages.
        filters: Averages to the filtered maps.
        projection: [169, m^2], averages of resolution m to spherical harmonics.
        projected: Rows of the averages that the projection reads.
        resolutions, nodes, zonal: What :func:`splitnerf.ops.light_lookup` takes.
    """

    sum_of_levels: SparseMap
    averages: SparseMap
    filters: SparseMap
    projection: Tensor
    projected: slice
    resolutions: Tensor
    nodes: Tensor
    zonal: Tensor

    def to(self, device: torch.device) -> PyramidMaps:
        """Copies on a device; resolutions and nodes stay on the CPU, where the lookup wants them."""
        sparse = (SparseMap(*(part.to(device) for part in matrix)) for matrix in self[:3])
        return PyramidMaps(
            *sparse, self.projection.to(device), self.projected, self.resolutions, self.nodes, self.zonal.to(device)
        )


@functools.lru_cache(maxsize=4)
def maps_on(resolution: int, device: torch.device) -> PyramidMaps:
    """:func:`pyramid_maps` on a device, copied once."""
    with torch.inference_mode(False):
        return pyramid_maps(resolution).to(device)


@functools.lru_cache(maxsize=2)
def pyramid_maps(resolution: int) -> PyramidMaps:
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
        return PyramidMaps(
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

    They are computed when first asked for and shared by all calls until a parameter changes, a backward
    pass has used up their graph, or gradients are wanted that they do not carry. Losses of several calls in
    one step therefore go into one ``backward``. Writing through ``.data``, or by a fused optimiser without a
    backward pass or :meth:`deliver` before it, goes unseen: change parameters under ``no_grad``. After
    :meth:`collect` gradients add up at the maps until :meth:`deliver` takes them on to the parameters, so that several steps
    share one pass through the linear maps.

    Args:
        resolution: n, a power of 2 >= 16; 64 resolves 3 degrees.
        start: Radiance at the start.

    Source: SplitNeRF Eq. (8)-(11), with the paper's mip-map ablation in mind.
    """

    needs_consistency_loss = False

    def __init__(self, resolution: int = 64, start: float = 0.5):
        super().__init__()
        self.resolution = resolution
        self.texels = nn.Parameter(torch.zeros(len(pyramid_maps(resolution).sum_of_levels.transposed_offsets) - 1, 3))
        with torch.no_grad():
            self.texels[: 4 * 4] = math.log(start)
        self._cached: tuple | None = None
        self._collects = False
        self._held: tuple | None = None  # state, maps and harmonics, and the leaves that stand for them
        self._stand_ins: list[tuple[Tensor, Tensor]] = []
        self._leaves: list[Tensor] = []  # of the maps, the harmonics and the stand-ins: always the same memory

    def __getstate__(self) -> dict:
        return {
            **self.__dict__,
            "_cached": None,
            "_collects": False,
            "_held": None,
            "_stand_ins": [],
            "_leaves": [],
        }  # copies start anew

    @property
    def maps(self) -> PyramidMaps:
        """The linear maps, where the texels are."""
        return maps_on(self.resolution, self.texels.device)

    def radiance(self) -> Tensor:
        """[n^2, 3] radiance of the texels."""
        return torch.exp(sparse_product(self.maps.sum_of_levels, self.texels).clamp(-LOG_LIMIT, LOG_LIMIT))

    def chain(self) -> tuple[Tensor, Tensor]:
        """All maps [texels, 3] and the harmonics' coefficients [169, 3], as they follow from the parameters now."""
        state = self._state()
        wanted = torch.is_grad_enabled() and self.texels.requires_grad
        inference = torch.is_inference_mode_enabled()
        if self._held is not None and self._held[0] != state:  # gradients of maps that are no more
            self._held, self._stand_ins = None, []
        if self._held is not None:
            leaves = self._held[-2:]
            return leaves if wanted else tuple(leaf.detach() for leaf in leaves)
        if self._cached is not None:
            cached_state, cached_inference, levels, sh = self._cached
            if cached_state == state and inference >= cached_inference and levels.requires_grad >= wanted:
                return (levels, sh) if wanted else (levels.detach(), sh.detach())
        levels, sh = self._compute()
        if self._collects and wanted:
            self._held = state, levels, sh, self._leaf(0, levels), self._leaf(1, sh)
            return self._held[-2:]
        self._cached = (state, inference, levels, sh)
        if wanted:
            levels.register_hook(self._forget)
            sh.register_hook(self._forget)
        return levels, sh

    def _compute(self) -> tuple[Tensor, Tensor]:
        radiance = self.radiance()
        averages = sparse_product(self.maps.averages, radiance)
        levels = torch.cat([radiance, sparse_product(self.maps.filters, averages)])
        # Three rows times a matrix, forward and backward: several times faster than the matrix times three columns.
        with tensor_cores(False):
            sh = averages[self.maps.projected].T.contiguous() @ self.maps.projection.T
        return levels, sh.T.contiguous()

    def collect(self, on: bool = True) -> None:
        """From now on the gradients of backward passes stop at the maps and add up there; off: they no longer do."""
        self._collects, self._held, self._stand_ins, self._cached, self._leaves = on, None, [], None, []

    def _leaf(self, i: int, value: Tensor) -> Tensor:
        """The i-th leaf, with this value and no gradient so far."""
        assert i <= len(self._leaves), "leaves are asked for in one order"
        if i < len(self._leaves):
            leaf = self._leaves[i]
            leaf.grad.zero_()
            with torch.no_grad():
                return leaf.copy_(value)
        leaf = value.detach().clone().requires_grad_()
        leaf.grad = torch.zeros_like(leaf)
        self._leaves.append(leaf)
        return leaf

    def forget(self) -> None:
        for leaf in self._leaves:
            leaf.grad.zero_()

    def prepare(self) -> None:
        self.chain()

    def deliver(self) -> None:
        """Takes the gradients that have come together to the parameters; what is asked for next is computed anew."""
        if self._held is None:
            return
        for value, leaf in self._stand_ins:
            value.backward(leaf.grad)
        _, levels, sh, *leaves = self._held
        self._held, self._stand_ins, self._cached = None, [], None
        torch.autograd.backward([levels, sh], [leaf.grad for leaf in leaves])

    def stand_in(self, value: Tensor) -> tuple[Tensor, object]:
        if not self._collects or not value.requires_grad:
            return super().stand_in(value)
        leaf = self._leaf(2 + len(self._stand_ins), value)
        self._stand_ins.append((value, leaf))
        return leaf, self._held

    def stands(self, token: object) -> bool:
        return self._held is not None and token is self._held and self._held[0] == self._state()

    def _state(self) -> tuple[int, int]:
        return self.texels._version, self.texels.data_ptr()

    def _forget(self, grad: Tensor) -> None:
        self._cached = None

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""
        maps = self.maps
        return light_lookup(directions, roughness, *self.chain(), maps.resolutions, maps.nodes, maps.zonal)
