"""Occlusion factors and indirect light from visibility bits cached on the current mesh."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import torch
import trimesh
from torch import Tensor
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.fields.light import CellLight, EvaluatedLight, LightMaps, LightTexels, lobe_roughness, texel_roughness
from splitnerf.fields.occlusion import (
    Emitters,
    MaterialsAt,
    Occlusion,
    OcclusionModel,
    OcclusionQuery,
    RaySegments,
    Reflect,
    TracedBits,
)
from splitnerf.ops import (
    MeshScene,
    SparseMap,
    VisibilityCache,
    cached_occlusion,
    cached_visibility,
    light_queries,
    sparse_product,
)

TEXELS_PER_CELL = 8  # fewest texels per direction of a light without texels of its own
LOBE_DIRECTIONS = 15  # fewest directions within a lobe that a sum over the directions resolves
DIM = 1e-12  # power of a cell, W / m^2, below which its direction is that of its centre
SHADED_CHUNK = {"cpu": 1 << 15, "cuda": 1 << 20}  # vertices or emitters shaded at a time


class Cells(NamedTuple):
    """Which texels of a light lie in which of k cells.

    Attributes:
        texels: [t, 3] the texels' directions.
        cell: [t] int64, the cell of each texel.
        means: The [k, t] matrix that takes the mean over the texels of each cell, by their solid angles.
        solid_angles: [k] solid angles of the cells, sr.
    """

    texels: Tensor
    cell: Tensor
    means: SparseMap
    solid_angles: Tensor


def bit_counts(words: Tensor) -> Tensor:
    """The number of set bits [n] in each row of int32 words [n, k]."""
    bits = np.unpackbits(words.contiguous().numpy().view(np.uint8).reshape(len(words), -1), axis=1)
    return torch.from_numpy(bits.sum(axis=1, dtype=np.int64))


def emitters_of(cache: VisibilityCache) -> tuple[Tensor, Emitters]:
    """The emitters of a traced mesh, and the hits [n, k] int32 as numbers of emitters in place of vertices."""
    n_directions = len(cache.directions)
    vertex, direction = (cache.hits >= 0).nonzero().unbind(1)
    keys, row = torch.unique(cache.hits[vertex, direction].long() * n_directions + direction, return_inverse=True)
    rows = torch.full_like(cache.hits, -1)
    rows[vertex, direction] = row.int()
    vertices, directions = keys // n_directions, keys % n_directions
    view_dirs, normals = -cache.directions[directions], cache.normals[vertices]
    cosine = (normals * view_dirs).sum(1, keepdim=True)
    mirror = 2.0 * cosine * normals - view_dirs
    nearest = torch.cat(
        [(part @ cache.directions.T).argmax(1) for part in mirror.split(SHADED_CHUNK["cpu"])] or [directions]
    )
    return rows, Emitters(vertices, directions, rows[vertices, nearest].long(), cosine > 0)


class VisibilityBits(OcclusionModel):
    """Occlusion factors from the traced visibility of each mesh vertex, and indirect light from the blocked directions.

    The sphere is divided into cells, those of the directions nearest to `centres`. The light of a cell, and the rays
    traced towards it, come from one direction: that of the cell's light when the mesh was made (:meth:`aim`).

    The module has no parameters and no state_dict: :meth:`use` stores the cache of a traced mesh, :meth:`set_light` the
    current light, :meth:`refresh` the radiance of the emitters. No gradient flows through the factors.

    Args:
        n_directions: The number of cells, one about each point of a Fibonacci sphere; a multiple of 32.
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
        for name in ("centres", "directions", "aims"):
            self.register_buffer(name, directions.clone(), persistent=False)
        self.register_buffer("light", torch.ones_like(directions), persistent=False)
        self._cells: Cells | None = None
        self.cache: VisibilityCache | None = None
        self.emitters: Emitters | None = None
        self.radiance: Tensor | None = None  # of each emitter

    @torch.no_grad()
    def aim(self, light: EvaluatedLight) -> None:
        """Aims each cell's direction at its light, so that a lamp's shadow falls where the lamp stands."""
        if self.turns is not None:  # a lamp stands elsewhere in each photo
            self.aims = self.centres.clone()
            return
        texels = light.maps.partition(TEXELS_PER_CELL * len(self.centres), self.centres.device)
        power = texels.radiance.sum(1, keepdim=True) * texels.solid_angles[:, None]
        cell = self._cells_of(texels).cell
        towards = torch.zeros_like(self.centres).index_add(0, cell, texels.directions * power)
        self.aims = F.normalize(towards + DIM * self.centres, dim=1)

    def trace(self, scene: MeshScene, vertices: Tensor, faces: Tensor) -> TracedBits:
        """The visibility of every vertex of a mesh, traced on the CPU; see :meth:`OcclusionModel.trace`."""
        mesh = trimesh.Trimesh(vertices.numpy(), faces.numpy(), process=False)
        normals = torch.from_numpy(np.array(mesh.vertex_normals, dtype=np.float32))
        cache = VisibilityCache.trace(
            scene,
            vertices.float(),
            normals,
            float(mesh.area),
            self.aims.cpu(),
            offset=self.offset,
            with_hits=self.indirect,
        )
        open_bits, blocked_bits = (bit_counts(cache.bits[:, side]) for side in (0, 1))
        blocked = blocked_bits / (open_bits + blocked_bits).clamp(min=1)
        is_unoccluded = len(blocked) > 0 and blocked.max().item() < self.open_below
        if not self.indirect:
            return TracedBits(cache, is_unoccluded, None)
        rows, emitters = emitters_of(cache)
        return TracedBits(dataclasses.replace(cache, hits=rows), is_unoccluded, emitters)

    def use(self, traced: TracedBits) -> None:
        """Switches to these bits. The radiance of the emitters is unknown until :meth:`refresh`."""
        super().use(traced)
        self.cache, self.is_unoccluded, self.emitters = traced.to(self.directions.device)
        self.directions.copy_(self.cache.directions)
        self.radiance = None

    @torch.no_grad()
    def set_light(self, light: EvaluatedLight) -> None:
        """Stores the light that weighs the factors: its mean over each direction's cell."""
        self.light.copy_((light.cells or self.cell_light(light.maps)).radiance)

    def cached_light(self) -> dict[str, Tensor | None]:
        """The environment's radiance of each direction [k, 3], the directions of the traced rays [k, 3], and the
        radiance [p, 3] and the numbers [p] of the emitters, or None for both."""
        emitters = None if self.radiance is None else self._emitter_numbers()
        return {"sky": self.light, "aims": self.directions, "sent": self.radiance, "emitters": emitters}

    def restore_light(self, cached: dict[str, Tensor | None]) -> None:
        """Restores the result of :meth:`cached_light`, on the same mesh traced in the same directions.

        Emitters that are not stored keep the radiance that they have: another machine's rays may hit a few others.
        """
        self.light.copy_(cached["sky"])
        stored = cached["emitters"]
        if stored is None or self.emitters is None:
            self.radiance = None
        else:
            stored, ours = stored.to(self.light.device), self._emitter_numbers()
            radiance = self.light.new_zeros(len(ours), 3) if self.radiance is None else self.radiance.clone()
            radiance[torch.isin(ours, stored)] = cached["sent"].to(radiance.device)[torch.isin(stored, ours)]
            self.radiance = radiance

    def restore_aims(self, cached: dict[str, Tensor | None]) -> None:
        """Restores the directions in which a mesh is traced from :meth:`cached_light`."""
        self.aims = cached["aims"].to(self.centres.device)

    def _emitter_numbers(self) -> Tensor:
        """A number [p] int64 of each emitter, ascending: k times its vertex plus its direction."""
        return self.emitters.vertices * len(self.directions) + self.emitters.directions

    def cell_light(self, light: LightMaps) -> CellLight:
        """The light's mean over each direction's cell, differentiable in the light. A texel belongs to one cell, so
        that the cells have the power of the light."""
        texels = light.partition(TEXELS_PER_CELL * len(self.centres), self.centres.device)
        if self.turns is not None:
            mean = EvaluatedLight(light).mean_over(self.turns)
            texels = texels._replace(radiance=mean(texels.directions, texel_roughness(texels.solid_angles)))
        cells = self._cells_of(texels)
        return CellLight(sparse_product(cells.means, texels.radiance), self.directions, cells.solid_angles)

    @torch.no_grad()
    def _cells_of(self, texels: LightTexels) -> Cells:
        """The cells of these texels: each belongs to the nearest of the cells' centres."""
        directions, areas, _ = texels
        if self._cells is None or self._cells.texels is not directions:
            cell = torch.cat([(part @ self.centres.T).argmax(1) for part in directions.split(4096)])
            solid_angles = areas.new_zeros(len(self.centres)).index_add(0, cell, areas)
            weights, order = areas / solid_angles[cell], cell.argsort(stable=True)
            starts = F.pad(cell.bincount(minlength=len(self.centres)).cumsum(0), (1, 0))
            every = torch.arange(len(cell) + 1, device=cell.device)
            means = SparseMap(starts, order.int(), weights[order], every, cell.int(), weights)
            self._cells = Cells(directions, cell, means, solid_angles)
        return self._cells

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
    def refresh(self, light: EvaluatedLight, materials: MaterialsAt, reflect: Reflect) -> None:
        """Shades the emitters again. They receive the radiance of the refresh before, so that each call adds a bounce.

        An emitter reflects towards the one direction that it is seen from. Its specular light is the environment's, or
        that of the emitter that it sees in the mirror direction. Seen from behind it is black.
        """
        if self.emitters is None or self.is_unoccluded:
            return
        light = light if self.turns is None else light.mean_over(self.turns)
        x, n, chunk = self.cache.vertices, self.cache.normals, SHADED_CHUNK[self.light.device.type]
        at_vertices = [torch.cat(parts) for parts in zip(*map(materials, x.split(chunk)))]
        o_d, _, i_d, _ = cached_occlusion(self.cache, x, n, n, at_vertices[1], self.light, self.radiance)
        diffuse = o_d * light(n, torch.ones_like(n[:, :1])) + (0.0 if i_d is None else i_d)
        before = x.new_zeros(1, 3) if self.radiance is None else F.pad(self.radiance, (0, 0, 0, 1))
        blur = lobe_roughness(4.0 * math.pi / len(self.centres)) ** 4  # a ray stands for all of its cell
        parts = []
        for vertices, directions, mirrored, facing in zip(*(part.split(chunk) for part in self.emitters)):
            here, views = [part[vertices] for part in at_vertices], -self.directions[directions]
            lobes = light_queries(n[vertices], views, here[1])[0][: len(views)]
            sky = light(lobes, (here[1] ** 4 + blur).sqrt().sqrt())
            seen = before[mirrored.clamp(max=len(before) - 1)]
            specular = torch.where(mirrored[:, None] < 0, sky, seen)
            parts.append(reflect(n[vertices], views, here, specular, diffuse[vertices]) * facing)
        radiance = torch.cat(parts) if parts else x.new_zeros(0, 3)
        self.radiance = radiance if self.radiance is None else self.radiance.copy_(radiance)

    @torch.no_grad()
    def answer(self, query: OcclusionQuery, segments: RaySegments | None) -> Occlusion:
        """The factors at points. With segments, all points of one have the factors of its representative."""
        if segments is not None:
            chosen = (x.index_select(0, segments.representatives) for x in query[1:])
            answers = self.answer(OcclusionQuery((), *chosen), None)
            known = [part for part in answers if part is not None]
            return Occlusion(*(part.index_select(0, segments.segment) for part in known))
        o_d, o_s, i_d, i_s = cached_occlusion(
            self.cache, query.positions, query.normals, query.lobe_dirs, query.roughness, self.light, self.radiance
        )
        if self.n_channels == 1:
            o_d, o_s = o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True)
        return Occlusion(o_d, o_s, i_d, i_s)
