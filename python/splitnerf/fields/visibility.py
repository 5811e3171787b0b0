"""Occlusion factors and indirect light from visibility bits cached on the current mesh."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
import trimesh
from torch import Tensor
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.fields.light import CellLight, EvaluatedLight, LightMaps
from splitnerf.fields.occlusion import Occlusion, OcclusionModel, OcclusionQuery, RaySegments, TracedBits
from splitnerf.ops import MeshScene, VisibilityCache, cached_occlusion, cached_visibility

TEXELS_PER_CELL = 8  # fewest texels per direction of a light without texels of its own
LOBE_DIRECTIONS = 15  # fewest directions within a lobe that a sum over the directions resolves
SHADED_CHUNK = 1 << 15  # vertices shaded at a time


def bit_counts(words: Tensor) -> Tensor:
    """The number of set bits [n] in each row of int32 words [n, k]."""
    bits = np.unpackbits(words.contiguous().numpy().view(np.uint8).reshape(len(words), -1), axis=1)
    return torch.from_numpy(bits.sum(axis=1, dtype=np.int64))


class VisibilityBits(OcclusionModel):
    """Occlusion factors from the traced visibility of each mesh vertex, and indirect light from the blocked directions.

    The module has no parameters and no state_dict: :meth:`use` stores the cache of a traced mesh, :meth:`set_light` the
    current light, :meth:`refresh` the radiance of the vertices. No gradient flows through the factors.

    Args:
        n_directions: The number of Fibonacci directions over the sphere, a multiple of 32.
        offset: The distance of a ray's start from its vertex along the normal, scene units.
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.
        indirect: Whether the cache records the vertex that each blocked ray hits.
        open_below: A threshold on the blocked share of a vertex's directions. A mesh whose vertices are all below it
            counts as unoccluded: its factors are 1 without a lookup. 0 disables this.

    Source: SplitNeRF Eq. (12)-(15) as sums over fixed directions.
    """

    def __init__(self, n_directions: int, offset: float, n_channels: int, indirect: bool, open_below: float = 0.0):
        super().__init__(n_channels)
        self.offset, self.indirect, self.open_below = offset, indirect, open_below
        directions = torch.from_numpy(_core.fibonacci_sphere(n_directions)).float()
        for name, value in (("directions", directions), ("light", torch.ones_like(directions))):
            self.register_buffer(name, value, persistent=False)
        self._cells: tuple[Tensor, Tensor] | None = None  # the light's texels, and the cell that holds each
        self.cache: VisibilityCache | None = None
        self.radiance: Tensor | None = None

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor) -> TracedBits:
        """The visibility of every vertex of a mesh, traced on the CPU; see :meth:`OcclusionModel.trace`."""
        mesh = trimesh.Trimesh(vertices.numpy(), faces.numpy(), process=False)
        normals = torch.from_numpy(np.array(mesh.vertex_normals, dtype=np.float32))
        cache = VisibilityCache.trace(
            scene, vertices.float(), normals, float(mesh.area), self.directions.cpu(), offset=self.offset,
            with_hits=self.indirect,
        )  # fmt: skip
        open_bits, blocked_bits = (bit_counts(cache.bits[:, side]) for side in (0, 1))
        blocked = blocked_bits / (open_bits + blocked_bits).clamp(min=1)
        return TracedBits(cache, len(blocked) > 0 and blocked.max().item() < self.open_below)

    def use(self, traced: TracedBits) -> None:
        """Switches to these bits. The radiance of the vertices is unknown until :meth:`refresh`."""
        super().use(traced)
        self.cache, self.is_unoccluded = traced.cache.to(self.directions.device), traced.is_unoccluded
        self.radiance = None

    @torch.no_grad()
    def set_light(self, light: EvaluatedLight) -> None:
        """Stores the light that weighs the factors: its mean over each direction's cell."""
        self.light.copy_((light.cells or self.cell_light(light.maps)).radiance)

    def cached_light(self) -> dict[str, Tensor | None]:
        """The environment's radiance of each direction [k, 3], and the radiance of each vertex [n, 3] or None."""
        return {"sky": self.light, "sent": self.radiance}

    def restore_light(self, cached: dict[str, Tensor | None]) -> None:
        """Restores the result of :meth:`cached_light`, on a mesh with the same number of vertices."""
        self.light.copy_(cached["sky"])
        self.radiance = None if cached["sent"] is None else cached["sent"].to(self.light.device)

    def cell_light(self, light: LightMaps) -> CellLight:
        """The light's mean over each direction's cell, differentiable in the light. A texel belongs to one cell, so that
        the cells have the power of the light."""
        texels = light.partition(TEXELS_PER_CELL * len(self.directions))
        cell = self._cell_of(texels.directions)
        weighted = torch.cat([texels.radiance * texels.solid_angles[:, None], texels.solid_angles[:, None]], dim=1)
        sums = weighted.new_zeros(len(self.directions), 4).index_add(0, cell, weighted)
        power = weighted[:, :3].detach().sum(1, keepdim=True)
        centres = torch.zeros_like(self.directions).index_add(0, cell, texels.directions * power)
        return CellLight(sums[:, :3] / sums[:, 3:], F.normalize(centres, dim=1), sums[:, 3].detach())

    def _cell_of(self, texels: Tensor) -> Tensor:
        """The cell [t] int64 of each texel's direction [t, 3]: the nearest of the cells' own directions."""
        if self._cells is None or self._cells[0] is not texels:
            self._cells = texels, torch.cat([(part @ self.directions.T).argmax(1) for part in texels.split(4096)])
        return self._cells[1]

    @property
    def summed_from(self) -> float:
        """The smallest roughness at which a sum over the k directions resolves the lobe.

        A lobe of ggx_alpha = a effectively contains 3 k a^2 directions (see :func:`splitnerf.ops.cached_occlusion`).
        """
        return (LOBE_DIRECTIONS / (3.0 * len(self.directions))) ** 0.25

    def visibility(self, positions: Tensor, normals: Tensor) -> tuple[Tensor, Tensor | None]:
        """The share [n, k] in [0, 1] of the environment's light that arrives at points from each direction, and the
        light [n, k, 3] that the mesh sends from that direction, or None. Below the horizon both have no meaning."""
        if self.is_unoccluded:
            return positions.new_ones(len(positions), len(self.directions)), None
        return cached_visibility(self.cache, positions, normals, self.radiance)

    @torch.no_grad()
    def refresh(self, shade: Callable[[Tensor, Tensor], Tensor]) -> None:
        """Shades the vertices again. The shading reads the radiance of the refresh before, so that each call adds a
        bounce.

        Args:
            shade: A function from positions [n, 3] and normals [n, 3] to the radiance [n, 3] along the normals.
        """
        if self.indirect and self.cache is not None and not self.is_unoccluded:
            parts = zip(self.cache.vertices.split(SHADED_CHUNK), self.cache.normals.split(SHADED_CHUNK))
            radiance = torch.cat([shade(x, n) for x, n in parts])
            self.radiance = radiance if self.radiance is None else self.radiance.copy_(radiance)

    @torch.no_grad()
    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """The factors at points; with segments, those of each segment's leader for all of its points."""
        if segments is not None:
            leaders = self.answer(OcclusionQuery(*(part[segments.leaders] for part in query)), None)
            return Occlusion(*(None if part is None else part[segments.segment] for part in leaders))
        o_d, o_s, i_d, i_s = cached_occlusion(
            self.cache, query.positions, query.normals, query.lobe_dirs, query.roughness, self.light, self.radiance
        )
        if self.n_channels == 1:
            o_d, o_s = o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True)
        return Occlusion(o_d, o_s, i_d, i_s)
