"""The pre-integrated light g(w, rho): what all lights share, the network, and the pyramid of texels."""

from __future__ import annotations

import abc
import copy
import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.devices import tensor_cores
from splitnerf.ops.light import (
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


class LightTexels(NamedTuple):
    """The environment as a partition of the sphere into texels: their middles `directions` [t, 3] unit, `solid_angles` [t] in sr,
    which sum to 4 pi, and `radiance` [t, 3], the mean linear radiance of each."""

    directions: Tensor
    solid_angles: Tensor
    radiance: Tensor


class CellLight(NamedTuple):
    """The environment reduced to k cells of the sphere: `radiance` [k, 3], the linear mean of each, and `solid_angles` [k] in sr,
    in sum 4 pi."""

    radiance: Tensor
    solid_angles: Tensor


class EvaluatedLight:
    """A light evaluated once for all steps until its parameters move; a call looks up g(w, rho).

    Gradients of lookups accumulate at :attr:`leaves` over all steps that share this object, until :meth:`backward`
    passes them on to the light's parameters.

    Args:
        parts: What steps share of the light's evaluation, see :meth:`Light.parts`.

    Attributes:
        leaves: Copies of the parts and of the cells' radiance, where gradients accumulate; () where every backward pass
            reaches the parameters.
        cells: The light of cells; None where no sum over cells is needed.
    """

    def __init__(self, light: Light, parts: tuple[Tensor, ...] = ()):
        self.light, self._roots = light, parts
        gathers = any(part.requires_grad for part in parts)
        self._parts = tuple(map(_leaf_of, parts)) if gathers else parts
        self.leaves = self._parts if gathers else ()
        self.cells: CellLight | None = None

    def with_cells(self, cells: CellLight) -> EvaluatedLight:
        """This light, with the light of cells that was computed from it."""
        self.cells = cells
        if self.leaves:
            self.cells = cells._replace(radiance=_leaf_of(cells.radiance))
            self._roots, self.leaves = (*self._roots, cells.radiance), (*self.leaves, self.cells.radiance)
        return self

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""
        return self.light.look_up(self._parts, directions, roughness)

    def partition(self, at_least: int, device: torch.device) -> LightTexels:
        """The environment as texels, see :meth:`Light.partition`."""
        return self.light.partition(at_least, device, self._parts)

    def turned(self, turns: Tensor) -> Callable[[Tensor, Tensor], Tensor]:
        """The light of n points of its own frame each: called as the light is, with directions [m n, 3] of the points' world;
        `turns` [n, 3, 3] are the rotations from there to the light's frame."""

        def look_up(directions: Tensor, roughness: Tensor) -> Tensor:
            of_points = directions.view(len(directions) // max(1, len(turns)), len(turns), 3, 1)
            return self((turns @ of_points).view(-1, 3), roughness)

        return look_up

    def with_leaves(self, leaves: Sequence[Tensor]) -> EvaluatedLight:
        """A copy that reads other leaves; its gradients accumulate there and stop."""
        other, n = copy.copy(self), len(self._parts)
        other._roots, other.leaves, other._parts = (), tuple(leaves), tuple(leaves[:n]) or self._parts
        if len(leaves) > n:
            other.cells = self.cells._replace(radiance=leaves[n])
        return other

    def backward(self) -> None:
        """Passes the accumulated gradients on to the light's parameters. Call it once, before the parameters move."""
        n = len(self._parts)
        for part in slice(n, None), slice(n):  # the cells were computed from the other leaves
            given = [(x, leaf.grad) for x, leaf in zip(self._roots[part], self.leaves[part]) if leaf.grad is not None]
            if given:
                torch.autograd.backward(*map(list, zip(*given)))

    def zero_grad(self) -> None:
        """Drops the accumulated gradients."""
        for leaf in self.leaves:
            leaf.grad = None


def _leaf_of(value: Tensor) -> Tensor:
    """A leaf tensor with the same values; gradients accumulate there and stop."""
    return value.detach().requires_grad_()


def mean_over(light: Callable[[Tensor, Tensor], Tensor], turns: Tensor) -> Callable[[Tensor, Tensor], Tensor]:
    """The mean light of a world that was rotated by each of `turns` [k, 3, 3] in turn; called as the light is."""
    return lambda directions, roughness: sum(light(directions @ turn.T, roughness) for turn in turns) / len(turns)


class Light(nn.Module, abc.ABC):
    """The pre-integrated light g(w, rho): the environment filtered by the lobe of roughness rho.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. A subclass defines :meth:`forward`, which is
    differentiable in its parameters, in directions and in roughness; one whose evaluation steps can share overrides
    :meth:`parts` and the methods that read them.

    Attributes:
        needs_consistency_loss: Whether g(w, rho) agrees with g(w, 0) only through ``losses.light_loss``. False where
            they agree by construction.

    Source: SplitNeRF Eq. (8)-(11).
    """

    needs_consistency_loss = True

    @abc.abstractmethod
    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""

    def parts(self) -> tuple[Tensor, ...]:
        """What lookups share until the parameters move; here nothing."""
        return ()

    def look_up(self, parts: tuple[Tensor, ...], directions: Tensor, roughness: Tensor) -> Tensor:
        """The result of :meth:`forward` from the result of :meth:`parts`."""
        return self(directions, roughness)

    def partition(self, at_least: int, device: torch.device, parts: tuple[Tensor, ...] | None = None) -> LightTexels:
        """The environment as texels on the light's device: those that the light consists of, or else at least so many, each the
        light about its middle. The radiance is differentiable; equal calls return the same directions. `parts` is what
        :meth:`parts` returns; None: it is computed."""
        directions, solid_angles = equirect_texels(math.ceil(math.sqrt(at_least / 2)), device)
        return LightTexels(directions, solid_angles, self(directions, texel_roughness(solid_angles)))

    def evaluate(self) -> EvaluatedLight:
        """The light, evaluated once for all steps until its parameters move."""
        return EvaluatedLight(self, self.parts())

    @torch.no_grad()
    def panorama(self, height: int, roughness: float = 0.0) -> Tensor:
        """[height, 2 height, 3] equirectangular radiance at one roughness (z up, centre column along +x)."""
        parameter = next(self.parameters())
        flat = panorama_directions(height, parameter.device).reshape(-1, 3).to(parameter.dtype)
        rho, light = torch.full_like(flat[:, :1], roughness), self.evaluate()
        return torch.cat([light(d, r) for d, r in zip(flat.split(1 << 16), rho.split(1 << 16))]).view(height, -1, 3)


def panorama_directions(height: int, device: torch.device | str = "cpu") -> Tensor:
    """[height, 2 height, 3] unit directions of an equirectangular map's texel centres."""
    return torch.from_numpy(_core.equirect_directions(height, 2 * height)).to(device=device, dtype=torch.float32)


@functools.lru_cache(maxsize=4)
def equirect_texels(height: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """The middles [2 height^2, 3] and the solid angles [2 height^2] of an equirectangular map's texels."""
    with torch.inference_mode(False):
        directions = panorama_directions(height, device).reshape(-1, 3)
        areas = (1.0 - directions[:, 2] ** 2).clamp(min=0.0).sqrt()
        return directions, areas * (4.0 * math.pi / areas.sum())


def texel_roughness(solid_angles: Tensor) -> Tensor:
    """[t, 1] the roughness whose lobe has the mean solid angle of t texels of the sphere."""
    return torch.full_like(solid_angles[:, None], lobe_roughness(4.0 * math.pi / len(solid_angles)))


def lobe_roughness(solid_angle: float) -> float:
    """The roughness, at most 1, whose pre-integration lobe has this solid angle (sr): 4 pi a^2 if narrow, with ggx_alpha = a."""
    return min((solid_angle / (4.0 * math.pi)) ** 0.25, 1.0)


class LightMlp(Light):
    """g(w, rho): radiance of the environment filtered by the lobe of roughness rho, never negative.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. The inputs are sines and cosines of 2^k w and
    of 2^k rho; the output layer reads them again beside the last hidden layer.

    Args:
        width, n_layers: The units of a hidden ReLU layer, and the number of these layers.
        direction_frequencies, roughness_frequencies: The numbers of octaves k of the two encodings.
        activation: The output's activation: ``softplus`` (the paper) or ``exp`` of a value clamped to [-12, 12], with
            which few units represent bright lamps.

    Source: SplitNeRF Eq. (8)-(9) and its supplement.
    """

    def __init__(
        self, width: int, n_layers: int, direction_frequencies: int, roughness_frequencies: int, activation: str
    ):
        super().__init__()
        self.activation = activation
        self.register_buffer("direction_scales", 2.0 ** torch.arange(direction_frequencies), persistent=False)
        self.register_buffer("roughness_scales", 2.0 ** torch.arange(roughness_frequencies), persistent=False)
        n_inputs = 6 * direction_frequencies + 2 * roughness_frequencies
        self.hidden = nn.ModuleList(nn.Linear(n_inputs if i == 0 else width, width) for i in range(n_layers))
        self.out = nn.Linear(width + n_inputs, 3)
        nn.init.normal_(self.out.weight, std=0.01)
        start = 0.5
        nn.init.constant_(self.out.bias, math.log(math.expm1(start)) if activation == "softplus" else math.log(start))

    def encode(self, directions: Tensor, roughness: Tensor) -> Tensor:
        w = (directions[:, :, None] * self.direction_scales).flatten(1)
        r = roughness * self.roughness_scales
        return torch.cat([w.sin(), w.cos(), r.sin(), r.cos()], dim=1)

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        encoded = self.encode(directions, roughness)
        h = encoded
        for layer in self.hidden:
            h = F.relu(layer(h))
        raw = self.out(torch.cat([h, encoded], dim=1))
        return F.softplus(raw) if self.activation == "softplus" else torch.exp(raw.clamp(-12.0, 12.0))


class PyramidFilters(NamedTuple):
    """The fixed linear maps of one resolution, shared by all lights of that resolution."""

    sum_of_levels: SparseMap  # from parameters to the texels' log-radiance
    averages: SparseMap  # from texels to the texels followed by their averages
    lobes: SparseMap  # from these averages to the filtered maps
    projection: Tensor  # [169, m^2], from averages of resolution m to spherical harmonics
    projected: slice  # the rows of the averages that the projection reads
    resolutions: Tensor  # like nodes and zonal an argument of splitnerf.ops.light.light_lookup
    nodes: Tensor
    zonal: Tensor

    def to(self, device: torch.device) -> PyramidFilters:
        """A copy on a device; resolutions and nodes stay on the CPU, as the lookup requires."""
        moved = ("sum_of_levels", "averages", "lobes", "projection", "zonal")
        return self._replace(**{name: getattr(self, name).to(device) for name in moved})


@functools.lru_cache(maxsize=4)
def filters_on(resolution: int, device: torch.device) -> PyramidFilters:
    """The result of :func:`pyramid_filters` on a device, copied there once."""
    with torch.inference_mode(False):
        return pyramid_filters(resolution).to(device)


@functools.lru_cache(maxsize=2)
def pyramid_filters(resolution: int) -> PyramidFilters:
    """The linear maps for ``resolution`` texels along the edge, computed once, in double precision. Raises ValueError where that is
    not a power of 2 or is below 16."""
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
    """Mean directions [n^2, 3] and solid angles [n^2] of an octahedral map's texels, row by row, from parts of du dv / |p|^3."""
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
        self.texels = nn.Parameter(torch.zeros(len(pyramid_filters(resolution).sum_of_levels.rows.images), 3))
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

    def parts(self) -> tuple[Tensor, Tensor]:
        """All maps [texels, 3] and the harmonics' coefficients [169, 3], computed from the current parameters."""
        radiance = self.radiance()
        averages = sparse_product(self.filters.averages, radiance)
        levels = torch.cat([radiance, sparse_product(self.filters.lobes, averages)])
        # Three rows times the matrix: several times faster, forward and backward, than the matrix times three columns.
        with tensor_cores(False):
            sh = averages[self.filters.projected].T.contiguous() @ self.filters.projection.T
        return levels, sh.T.contiguous()

    def look_up(self, parts: tuple[Tensor, ...], directions: Tensor, roughness: Tensor) -> Tensor:
        filters = self.filters
        return light_lookup(directions, roughness, *parts, filters.resolutions, filters.nodes, filters.zonal)

    def partition(self, at_least: int, device: torch.device, parts: tuple[Tensor, ...] | None = None) -> LightTexels:
        """The unfiltered texels, divided into equal squares until they are at least so many."""
        n = self.resolution
        radiance = self.radiance() if parts is None else parts[0][: n * n]
        while n * n < at_least:
            radiance = radiance.view(n, 1, n, 1, 3).expand(n, 2, n, 2, 3).reshape(4 * n * n, 3)
            n *= 2
        return LightTexels(*octahedral_texels(n, device), radiance)

    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0. Each call computes all maps."""
        return self.look_up(self.parts(), directions, roughness)
