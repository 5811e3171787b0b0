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
from splitnerf.fields.light import CellLight, EvaluatedLight, LightMaps, lobe_roughness
from splitnerf.fields.occlusion import Occlusion, OcclusionModel, OcclusionQuery, RaySegments, TracedBits
from splitnerf.ops import MeshScene, VisibilityCache, cached_occlusion, cached_visibility

TEXELS_PER_CELL = 8  # of the light, for its mean over a direction's cell
LOBE_DIRECTIONS = 15  # within the lobe that a sum over the directions resolves
SHADED_CHUNK = 1 << 15  # vertices shaded at a time


def bit_counts(words: Tensor) -> Tensor:
    """How many bits of [n, k] int32 words are set, [n]."""
    bits = np.unpackbits(words.contiguous().numpy().view(np.uint8).reshape(len(words), -1), axis=1)
    return torch.from_numpy(bits.sum(axis=1, dtype=np.int64))


class VisibilityBits(OcclusionModel):
    """o_d and o_s from what each mesh vertex sees in a fixed set of directions, and the light of what it does not see.

    Nothing is learned here and nothing is part of the state: :meth:`use` takes the cache of a traced mesh, :meth:`set_light`
    the current light, :meth:`refresh` the light that the vertices send out. No gradient flows through the factors.

    Args:
        n_directions: Fibonacci directions over the sphere, a multiple of 32.
        offset: Rays start this far off a vertex along its normal, scene units.
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.
        indirect: Keep which vertex each blocked ray meets.
        open_below: A mesh none of whose vertices has a larger share of its directions blocked is taken to see the whole sky:
            its factors are 1, and nothing is looked up. 0: never.
    """

    def __init__(self, n_directions: int, offset: float, n_channels: int, indirect: bool, open_below: float = 0.0):
        super().__init__(n_channels)
        self.offset, self.indirect, self.open_below = offset, indirect, open_below
        directions = torch.from_numpy(_core.fibonacci_sphere(n_directions)).float()
        height = math.ceil(math.sqrt(TEXELS_PER_CELL * n_directions / 2))
        texels = torch.from_numpy(_core.equirect_directions(height, 2 * height)).float().reshape(-1, 3)
        self._texel_roughness = lobe_roughness(4.0 * math.pi / len(texels))
        constants = {
            "directions": directions,
            "light": torch.ones_like(directions),
            "_texels": texels,
            "_cell": torch.cat([(part @ directions.T).argmax(1) for part in texels.split(4096)]),
            "_solid_angle": (1.0 - texels[:, 2:] ** 2).clamp(min=0.0).sqrt(),  # up to a factor
        }
        for name, value in constants.items():
            self.register_buffer(name, value, persistent=False)
        self.cache: VisibilityCache | None = None
        self.radiance: Tensor | None = None

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor) -> TracedBits:
        """What every vertex of a mesh sees, traced on the CPU; see :meth:`OcclusionModel.trace`."""
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
        """Reads from these bits from now on. What the vertices send out is unknown until :meth:`refresh`."""
        super().use(traced)
        self.cache, self.is_unoccluded = traced.cache.to(self.directions.device), traced.is_unoccluded
        self.radiance = None

    @torch.no_grad()
    def set_light(self, light: EvaluatedLight) -> None:
        """Takes the light that weighs the factors, its mean over each direction's cell."""
        self.light.copy_((light.cells or self.cell_light(light.maps)).radiance)

    def cached_light(self) -> dict[str, Tensor | None]:
        """The sky's light of each direction [k, 3], and what each vertex sends out [n, 3] or None."""
        return {"sky": self.light, "sent": self.radiance}

    def restore_light(self, cached: dict[str, Tensor | None]) -> None:
        """Puts back what :meth:`cached_light` returned, on a mesh of as many vertices."""
        self.light.copy_(cached["sky"])
        self.radiance = None if cached["sent"] is None else cached["sent"].to(self.light.device)

    def cell_light(self, light: LightMaps) -> CellLight:
        """The light's mean over each direction's cell, differentiable in the light."""
        radiance = light(self._texels, torch.full_like(self._solid_angle, self._texel_roughness))
        weighted = torch.cat([radiance * self._solid_angle, self._solid_angle], dim=1)
        sums = weighted.new_zeros(len(self.directions), 4).index_add(0, self._cell, weighted)
        power = weighted[:, :3].detach().sum(1, keepdim=True)
        centres = torch.zeros_like(self.directions).index_add(0, self._cell, self._texels * power)
        area = sums[:, 3].detach()
        return CellLight(sums[:, :3] / sums[:, 3:], F.normalize(centres, dim=1), area * (4.0 * math.pi / area.sum()))

    @property
    def summed_from(self) -> float:
        """Roughness from which a sum over the directions resolves the lobe, whose effective number of them is 3 k a^2
        (see :func:`splitnerf.ops.cached_occlusion`)."""
        return (LOBE_DIRECTIONS / (3.0 * len(self.directions))) ** 0.25

    def visibility(self, positions: Tensor, normals: Tensor) -> tuple[Tensor, Tensor | None]:
        """The share [n, k] of the light from each direction that arrives at points, and what the mesh sends from there,
        [n, k, 3] or None. Below the horizon both mean nothing."""
        if self.is_unoccluded:
            return positions.new_ones(len(positions), len(self.directions)), None
        return cached_visibility(self.cache, positions, normals, self.radiance)

    @torch.no_grad()
    def refresh(self, shade: Callable[[Tensor, Tensor], Tensor]) -> None:
        """Shades the vertices anew: ``shade(positions, normals)`` is their radiance [n, 3] along the normal.

        The shading itself reads the radiance of the former refresh: a bounce is added each time.
        """
        if self.indirect and self.cache is not None and not self.is_unoccluded:
            parts = zip(self.cache.vertices.split(SHADED_CHUNK), self.cache.normals.split(SHADED_CHUNK))
            radiance = torch.cat([shade(x, n) for x, n in parts])
            self.radiance = radiance if self.radiance is None else self.radiance.copy_(radiance)

    @torch.no_grad()
    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """The factors at points, or those of the leaders for the whole of their segments."""
        if segments is not None:
            leaders = self.answer(OcclusionQuery(*(part[segments.leaders] for part in query)), None)
            return Occlusion(*(None if part is None else part[segments.segment] for part in leaders))
        o_d, o_s, i_d, i_s = cached_occlusion(
            self.cache, query.positions, query.normals, query.lobe_dirs, query.roughness, self.light, self.radiance
        )
        if self.n_channels == 1:
            o_d, o_s = o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True)
        return Occlusion(o_d, o_s, i_d, i_s)
