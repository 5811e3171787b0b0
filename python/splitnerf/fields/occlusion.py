"""How much of the light arrives at points: the sky as cells, and the visibility of each from a mesh's vertices."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
import trimesh
from torch import Tensor, nn
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.fields.light import CellLight, EvaluatedLight, Light, LightTexels, mean_over, texel_roughness
from splitnerf.ops import MeshScene
from splitnerf.ops.light import SparseMap, SparseRows, sparse_product
from splitnerf.ops.rays import ShadingSubset
from splitnerf.ops.visibility import VisibilityCache, cached_occlusion, cached_visibility

TEXELS_PER_CELL = 8  # fewest texels per direction of a light without texels of its own
LOBE_DIRECTIONS = 15  # fewest directions within a lobe that a sum over the directions resolves
DIM = 1e-12  # power of a cell, W / m^2, below which its direction is that of its centre
CHUNK = 1 << 15  # emitters whose mirrors are searched at a time


class Occlusion(NamedTuple):
    """The share of the environment's light that arrives at points, and the light that arrives from the object itself.

    Attributes:
        diffuse, specular: The factors o_d and o_s, [n, 1] or [n, 3] in [0, 1], 1 = open.
        indirect_diffuse, indirect_specular: [n, 3] linear light from the object, in the normalisation of g(n, 1) and
            g(d, rho); or None.
    """

    diffuse: Tensor
    specular: Tensor
    indirect_diffuse: Tensor | None = None
    indirect_specular: Tensor | None = None


class Cells(NamedTuple):
    """Which texels of a light lie in which of k cells."""

    texels: Tensor  # [t, 3] the texels' directions
    cell: Tensor  # [t] int64, the cell of each texel
    means: SparseMap  # [k, t], takes the mean over the texels of each cell, by their solid angles
    solid_angles: Tensor  # [k] of the cells, sr


class SkyCells(nn.Module):
    """The sphere as `n_directions` cells, k, a multiple of 32: those of the directions nearest to the points of a Fibonacci sphere.

    Attributes:
        centres: [k, 3] unit; no part of the state_dict.
        turns: [m, 3, 3] rotations from the mesh's world to the light's, over which the light is averaged: that of a
            turntable is another one in each photo. None: the light stands still.
    """

    turns: Tensor | None = None

    def __init__(self, n_directions: int):
        super().__init__()
        centres = torch.from_numpy(_core.fibonacci_sphere(n_directions)).float()
        self.register_buffer("centres", centres, persistent=False)
        self._cells: Cells | None = None

    @torch.no_grad()
    def aims(self, light: EvaluatedLight) -> Tensor:
        """[k, 3] a direction for each cell, that of its light, so that a lamp's shadow falls where the lamp stands."""
        if self.turns is not None:  # a lamp stands elsewhere in each photo
            return self.centres
        texels = light.partition(TEXELS_PER_CELL * len(self.centres), self.centres.device)
        power = texels.radiance.sum(1, keepdim=True) * texels.solid_angles[:, None]
        towards = torch.zeros_like(self.centres).index_add(0, self._of(texels).cell, texels.directions * power)
        return F.normalize(towards + DIM * self.centres, dim=1)

    def light(self, light: EvaluatedLight | Light) -> CellLight:
        """The light's mean over each cell, differentiable in the light. A texel belongs to one cell, so that the cells
        have the power of the light."""
        texels = light.partition(TEXELS_PER_CELL * len(self.centres), self.centres.device)
        radiance, cells = texels.radiance, self._of(texels)
        if self.turns is not None:
            radiance = mean_over(light, self.turns)(texels.directions, texel_roughness(texels.solid_angles))
        return CellLight(sparse_product(cells.means, radiance), cells.solid_angles)

    @torch.no_grad()
    def _of(self, texels: LightTexels) -> Cells:
        """The cells of these texels: each belongs to the nearest of the cells' centres."""
        directions, areas, _ = texels
        if self._cells is None or self._cells.texels is not directions:
            cell = torch.cat([(part @ self.centres.T).argmax(1) for part in directions.split(4096)])
            solid_angles = areas.new_zeros(len(self.centres)).index_add(0, cell, areas)
            weights, order = areas / solid_angles[cell], cell.argsort(stable=True)
            starts = F.pad(cell.bincount(minlength=len(self.centres)).cumsum(0), (1, 0))
            every = torch.arange(len(cell) + 1, device=cell.device)
            texels_alone, cells_alone = (every[:n, None].int() for n in (len(cell), len(self.centres)))
            means = SparseMap(
                SparseRows(starts, order.int(), weights[order], cells_alone, texels_alone),
                SparseRows(every, cell.int(), weights, texels_alone, cells_alone),
            )
            self._cells = Cells(directions, cell, means, solid_angles)
        return self._cells

    @property
    def summed_from(self) -> float:
        """The smallest roughness at which a sum over the k cells resolves the lobe. One of ggx_alpha = a effectively contains
        3 k a^2 directions (see :func:`splitnerf.ops.visibility.cached_occlusion`)."""
        return (LOBE_DIRECTIONS / (3.0 * len(self.centres))) ** 0.25


class Emitters(NamedTuple):
    """The mesh's vertices as they are seen: one row for each vertex and direction in which rays hit it."""

    vertices: Tensor  # [p] int64, the vertex
    directions: Tensor  # [p] int64, the traced direction that hits it; it is seen from the opposite direction
    mirrored: Tensor  # [p] int64, the emitter that the vertex sees in the mirror direction, -1 where that is open
    facing: Tensor  # [p, 1] bool, whether it is seen from the outside


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
    nearest = torch.cat([(part @ cache.directions.T).argmax(1) for part in mirror.split(CHUNK)] or [directions])
    return rows, Emitters(vertices, directions, rows[vertices, nearest].long(), cosine > 0)


def bit_counts(words: Tensor) -> Tensor:
    """The number of set bits [n] in each row of int32 words [n, k]."""
    bits = np.unpackbits(words.contiguous().numpy().view(np.uint8).reshape(len(words), -1), axis=1)
    return torch.from_numpy(bits.sum(axis=1, dtype=np.int64))


@dataclass
class VisibilityBits:
    """The traced visibility of a mesh's vertices, and the light that arrives there: what answers for occlusion factors
    and indirect light. No gradient flows through the factors.

    Attributes:
        cache: The visibility bits, towards one direction of each cell of :class:`SkyCells`. ``hits`` are numbers of
            emitters.
        emitters: The vertices that rays hit, each with the direction that it is hit from; None without indirect light.
        is_unoccluded: Whether the mesh blocks so little that it counts as convex: all factors are 1 without a lookup.
        n_channels: 1 averages the factors over the colour channels, 3 keeps them.
        light: [k, 3] the cells' radiance, which weighs the factors.
        radiance: [p, 3] the radiance of each emitter; None while it is not known.

    Source: SplitNeRF Eq. (12)-(15) as sums over fixed directions.
    """

    cache: VisibilityCache
    emitters: Emitters | None
    is_unoccluded: bool
    n_channels: int
    light: Tensor
    radiance: Tensor | None = None

    @staticmethod
    def trace(
        scene: MeshScene,
        vertices: Tensor,
        faces: Tensor,
        directions: Tensor,
        *,
        offset: float,
        n_channels: int,
        indirect: bool,
        open_below: float = 0.0,
    ) -> VisibilityBits:
        """The visibility of every vertex of a mesh, traced on the CPU, under a light of 1.

        Args:
            vertices, faces: [n, 3], scene units, and [m, 3], on the CPU.
            directions: [k, 3] unit, a direction for each cell.
            offset: The distance of a ray's start from its vertex along the normal, scene units.
            n_channels: 1 averages the factors over the colour channels, 3 keeps them.
            indirect: Whether the cache records the vertex that each blocked ray hits.
            open_below: A threshold on the blocked share of a vertex's directions. A mesh whose vertices are all below
                it counts as unoccluded. 0 disables this.
        """
        mesh = trimesh.Trimesh(vertices.numpy(), faces.numpy(), process=False)
        normals = torch.from_numpy(np.array(mesh.vertex_normals, dtype=np.float32))
        directions, area = directions.cpu(), float(mesh.area)
        cache = VisibilityCache.trace(
            scene, vertices.float(), normals, area, directions, offset=offset, with_hits=indirect
        )
        open_bits, blocked_bits = (bit_counts(cache.bits[:, side]) for side in (0, 1))
        blocked, emitters = blocked_bits / (open_bits + blocked_bits).clamp(min=1), None
        if indirect:
            rows, emitters = emitters_of(cache)
            cache = dataclasses.replace(cache, hits=rows)
        is_unoccluded = len(blocked) > 0 and blocked.max().item() < open_below
        return VisibilityBits(cache, emitters, is_unoccluded, n_channels, torch.ones_like(directions))

    def to(self, device: torch.device | str) -> VisibilityBits:
        """A copy on a device; tensors that already are there are not copied."""
        emitters = None if self.emitters is None else Emitters(*(part.to(device) for part in self.emitters))
        return dataclasses.replace(self, cache=self.cache.to(device), emitters=emitters, light=self.light.to(device))

    @torch.no_grad()
    def __call__(
        self,
        positions: Tensor,
        normals: Tensor,
        lobe_dirs: Tensor,
        roughness: Tensor,
        segments: ShadingSubset | None = None,
    ) -> Occlusion:
        """The factors at points of the surface; the arguments are those of :func:`splitnerf.ops.visibility.cached_occlusion`. With
        segments, all points of one have the factors of its representative."""
        if segments is not None:
            chosen = (x.index_select(0, segments.representatives) for x in (positions, normals, lobe_dirs, roughness))
            known = [part for part in self(*chosen) if part is not None]
            return Occlusion(*(part.index_select(0, segments.segment) for part in known))
        o_d, o_s, *indirect = cached_occlusion(
            self.cache,
            positions,
            normals,
            lobe_dirs=lobe_dirs,
            roughness=roughness,
            light=self.light,
            radiance=self.radiance,
        )
        if self.n_channels == 1:
            o_d, o_s = o_d.mean(-1, keepdim=True), o_s.mean(-1, keepdim=True)
        return Occlusion(o_d, o_s, *indirect)

    def visibility(self, positions: Tensor, normals: Tensor) -> tuple[Tensor, Tensor | None]:
        """The share [n, k] in [0, 1] of the environment's light that arrives at points from each direction, and the
        light [n, k, 3] that the mesh sends from that direction, or None. Below the horizon both have no meaning."""
        if self.is_unoccluded:
            return positions.new_ones(len(positions), len(self.light)), None
        return cached_visibility(self.cache, positions, normals, self.radiance)

    def set_radiance(self, radiance: Tensor) -> None:
        """Stores the radiance [p, 3] of the emitters, in the memory that recorded steps read."""
        self.radiance = radiance if self.radiance is None else self.radiance.copy_(radiance)

    def state(self) -> dict[str, Tensor | None]:
        """What a checkpoint needs in addition to the mesh, so that a resumed run has the same bits: the cells' radiance
        and the traced directions [k, 3], and the radiance [p, 3] and the numbers [p] of the emitters, or None for both."""
        emitters = None if self.radiance is None else self._emitter_numbers()
        return {"sky": self.light, "aims": self.cache.directions, "sent": self.radiance, "emitters": emitters}

    def restore(self, stored: dict[str, Tensor | None]) -> None:
        """Takes back the light of :meth:`state`, on the same mesh traced in the same directions. Emitters that are not stored keep
        the radiance that they have: another machine's rays may hit a few others."""
        self.light.copy_(stored["sky"])
        theirs = stored["emitters"]
        if theirs is None or self.emitters is None:
            self.radiance = None
        else:
            theirs, ours = theirs.to(self.light.device), self._emitter_numbers()
            radiance = self.light.new_zeros(len(ours), 3) if self.radiance is None else self.radiance.clone()
            radiance[torch.isin(ours, theirs)] = stored["sent"].to(radiance.device)[torch.isin(theirs, ours)]
            self.radiance = radiance

    def _emitter_numbers(self) -> Tensor:
        """A number [p] int64 of each emitter, ascending: k times its vertex plus its direction."""
        return self.emitters.vertices * len(self.light) + self.emitters.directions
