"""The inputs of operators at the sizes of a training step on a GPU."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
import trimesh
from torch import Tensor
from torch.nn import functional as F

from splitnerf.fields.light_pyramid import pyramid_filters
from splitnerf.fields.sdf import SdfField
from splitnerf.ops import CELL_EMPTY, CELL_OCCUPIED, CELL_OPAQUE, HashGridSpec, MeshScene, VisibilityCache, brdf_lut
from splitnerf.ops import fibonacci_directions

lib = torch.ops.splitnerf
BOX, RADIUS, SHELL = 1.5, 0.7, 0.3  # the surface is a ball, and its samples lie in a shell about it
S, ANNEAL, MIN_TRANSMITTANCE = 60.0, 1.0, 1e-3
SEARCH = 0.65  # of a sample's length: the search asks for about 50,000 distances, as a training's does
CORNERS = 8


@dataclass(frozen=True)
class Sizes:
    """How much there is of everything; the defaults are a step of preset `fast` in the middle of a training."""

    rays: int = 2900
    per_ray: int = 11  # samples
    beside: int = 6144  # points of the field that are no samples
    points: int = 9000  # shaded
    segments: int = 3200  # of rays, for which the caches are read
    levels: int = 16
    log2_table: int = 19
    width: int = 64
    outputs: int = 13
    queries: int = 8192
    directions: int = 256  # of the bits
    light_resolution: int = 128
    subdivisions: int = 5  # of the mesh, 2 x 10242 vertices
    entropy: int = 1024
    smooth: int = 4096  # points beside samples
    cells: int = 128

    @property
    def samples(self) -> int:
        return self.rays * self.per_ray

    @property
    def field_points(self) -> int:
        return self.samples + self.beside

    @property
    def spec(self) -> HashGridSpec:
        return HashGridSpec(self.levels, 2, 32, 1.3195079, self.log2_table)

    @property
    def features(self) -> int:
        return self.spec.n_outputs

    def encode(self, numbers: int) -> int:
        """Of a point: 6 for its place in a cell and, for each corner, 2 for its weight and 2 for each number gathered."""
        return self.levels * (6 + CORNERS * (2 + 2 * numbers))

    @property
    def layer(self) -> int:
        """Of a point: a matrix [width, 3 + features] with a vector."""
        return 2 * self.width * (3 + self.features)


TINY = Sizes(
    rays=24, per_ray=8, beside=9, points=40, segments=30, levels=3, log2_table=8, width=16, outputs=5, queries=20,
    directions=64, light_resolution=16, subdivisions=1, entropy=12, smooth=14, cells=12,
)  # fmt: skip


def unit(x: Tensor) -> Tensor:
    return F.normalize(x, dim=-1)


class Rays(NamedTuple):
    origins: Tensor
    directions: Tensor
    jitter: Tensor
    t: Tensor  # [samples], of their middles
    offsets: Tensor
    positions: Tensor
    step: float


class World:
    """What the inputs are taken from, on the CPU in float32, made when asked for.

    Args:
        sizes: How much of it.
    """

    def __init__(self, sizes: Sizes):
        self.sizes = sizes

    def generator(self, seed: int) -> torch.Generator:
        return torch.Generator().manual_seed(seed)

    def rand(self, *shape: int, seed: int = 0) -> Tensor:
        return torch.rand(*shape, generator=self.generator(seed))

    def randn(self, *shape: int, seed: int = 0) -> Tensor:
        return torch.randn(*shape, generator=self.generator(seed))

    @functools.cached_property
    def rays(self) -> Rays:
        """Rays from around the ball to it, their samples side by side across its surface."""
        s = self.sizes
        origins = 3.0 * unit(self.randn(s.rays, 3))
        aims = 0.6 * unit(self.randn(s.rays, 3, seed=1)) * self.rand(s.rays, 1, seed=2)
        directions, step = unit(aims - origins), SHELL / s.per_ray
        b = (origins * directions).sum(1, keepdim=True)
        hit = -b - (b * b - 9.0 + RADIUS**2).clamp(min=0).sqrt()
        t = (hit + step * (torch.arange(s.per_ray) - s.per_ray / 2 + 0.5)).reshape(-1)
        offsets = s.per_ray * torch.arange(s.rays + 1)
        index = torch.arange(s.rays).repeat_interleave(s.per_ray)
        positions = origins[index] + directions[index] * t[:, None]
        return Rays(origins, directions, self.rand(s.rays, seed=3), t, offsets, positions, step)

    @functools.cached_property
    def network(self) -> tuple:
        torch.manual_seed(0)
        field = SdfField(self.sizes.spec, BOX, self.sizes.width, self.sizes.outputs, RADIUS)
        network = field.network()._replace(n_active=self.sizes.levels)
        table = 1e-3 * self.randn(*network.table.shape, seed=4)
        hidden = torch.cat([network.hidden[:, :3], self.randn(self.sizes.width, self.sizes.features, seed=5)], 1)
        return network._replace(table=table, hidden=hidden).arguments()

    @functools.cached_property
    def positions(self) -> Tensor:
        """Where the field is asked for: at the rays' samples, and anywhere, but off the cells' faces, where roundings choose a cell."""
        x = torch.cat([self.rays.positions, (2 * self.rand(self.sizes.beside, 3, seed=62) - 1) * BOX])
        resolutions = torch.tensor([level[0] for level in self.sizes.spec.levels()])
        at = (x.double() / (2 * BOX) + 0.5)[:, None] * resolutions[:, None]
        off = ((at - at.round()).abs() > 1e-6 * resolutions[:, None]).all(2).all(1)
        return torch.where(off[:, None], x, x[off][0])

    def field(self) -> tuple:
        table, hidden, hidden_bias, out, out_bias, *numbers = self.network
        lengths = [weights.norm(dim=1, keepdim=True) for weights in (hidden, out)]
        return self.positions, table, hidden, lengths[0], hidden_bias, out, lengths[1], out_bias, *numbers

    @functools.cached_property
    def cells(self) -> Tensor:
        n = self.sizes.cells
        centres = ((torch.arange(n) + 0.5) / n - 0.5) * 2 * BOX
        x, y, z = torch.meshgrid(centres, centres, centres, indexing="ij")
        outside = (x * x + y * y + z * z).sqrt() - RADIUS
        state = torch.where(outside.abs() < SHELL / 2 + BOX / n, CELL_OCCUPIED, CELL_EMPTY)
        return torch.where(outside < -SHELL, CELL_OPAQUE, state).to(torch.uint8)

    @property
    def shaded(self) -> Tensor:
        """Every few samples, as many as points."""
        return torch.arange(self.sizes.points) * (self.sizes.samples // self.sizes.points)

    def row_arrays(self, n: int) -> list[Tensor]:
        """Normals, outputs and features of so many samples."""
        return [self.randn(n, columns, seed=68) for columns in (3, 13, self.sizes.features)]

    def drawing(self) -> tuple:
        """Most rays near masks that cover every second half row of 100 photos of 400 x 400 pixels."""
        runs, r = torch.arange(100 * 400, dtype=torch.int64), self.sizes.rays
        near, none = (200 * (runs + 1), 200 * runs, 200 * len(runs)), torch.empty(0, dtype=torch.int64)
        cameras = self.randn(100, 3, 3, seed=62), self.randn(100, 3, seed=63)
        return self.rand(r, seed=64), r * 3 // 4, *near, none, none, 100 * 400 * 400, *cameras, 400, 400

    def reading(self) -> tuple:
        """Bytes of 100 photos of 400 x 400 pixels, a tenth of them at edges."""
        r, photos = self.sizes.rays, torch.arange(16, dtype=torch.uint8).view(4, 4).repeat(100 * 400 * 400 // 4, 1)
        index, starts = torch.randint(len(photos), (r,), generator=self.generator(69)), 400 * torch.arange(100 * 400)
        behind = photos[: 40 * len(starts), :3].contiguous()
        edges = starts, starts + 40, -360 * torch.arange(100 * 400), behind
        return photos, index, index // 400**2, self.rand(100, 3, seed=70), self.rand(r, 3, seed=71), *edges

    def probes(self) -> tuple:
        return self.rand(3 * self.sizes.smooth + 4 * self.sizes.smooth, seed=72), self.sizes.smooth, BOX, 0.01

    def composing(self) -> tuple:
        return self.weights, self.randn(self.sizes.samples, 3), self.rays.offsets, self.rand(self.sizes.rays, seed=73), 1e-4

    def placing(self) -> tuple:
        r, m = self.rays, self.sizes.entropy
        indices = torch.arange(self.sizes.rays).repeat_interleave(self.sizes.per_ray)
        probes = self.rand(m, 3, seed=65), self.rand(m, seed=66), self.rand(m, 3, seed=67)
        return r.origins, r.directions, indices, r.t, r.t + SHELL / self.sizes.per_ray, r.offsets, *probes, self.sizes.samples

    def sampling(self) -> tuple:
        rules = (SEARCH * self.rays.step, 1024, S, ANNEAL, 1e-3, MIN_TRANSMITTANCE, 0.1, 1.25, 0)
        return *self.rays[:3], self.cells, *self.network, *rules

    @functools.cached_property
    def distances(self) -> Tensor:
        return self.rays.positions.norm(dim=1) - RADIUS

    def neus(self) -> tuple:
        half = 0.4 * self.rays.step
        return self.distances + half, self.distances - half, torch.tensor(S), self.rays.offsets, MIN_TRANSMITTANCE

    def surface(self) -> tuple:
        gradient = unit(self.rays.positions) + 0.1 * self.randn(self.sizes.samples, 3, seed=10)
        sharp = torch.tensor(S)
        numbers = (torch.tensor(self.rays.step), torch.tensor(ANNEAL), MIN_TRANSMITTANCE, self.sizes.samples)
        outputs = torch.cat([self.distances[:, None], self.randn(self.sizes.samples, 12, seed=68)], 1)
        return outputs, gradient, self.rays.directions, sharp, self.rays.offsets, *numbers

    @functools.cached_property
    def weights(self) -> Tensor:
        return lib.neus_weights(*self.neus())[0]

    def spreading(self) -> tuple:
        return self.weights, self.rays.t, self.rays.offsets, self.rays.jitter, 2.5, 4, -1, -1, torch.tensor(0.04)

    def interpolation(self) -> tuple:
        """Values of the shaded samples, and between which two each sample lies."""
        shaded, first, second, share = lib.spread_samples(*self.spreading())[:4]
        return self.randn(len(shaded), 8, seed=11), first, second, share

    def interpolation_backward(self) -> tuple:
        values, first, second, share = self.interpolation()
        return self.randn(len(first), 8, seed=12), first, second, share, values

    def shading(self) -> tuple:
        """Normals, views, albedo, roughness, metallic."""
        p = self.sizes.points
        normals = unit(self.randn(p, 3, seed=13))
        views = unit(normals + 0.7 * unit(self.randn(p, 3, seed=14)))
        return normals, views, self.rand(p, 3, seed=15), 0.1 + 0.8 * self.rand(p, 1, seed=16), self.rand(p, 1, seed=17)

    def threes(self, n: int) -> list[Tensor]:
        return [0.1 + self.rand(self.sizes.points, 3, seed=18 + i) for i in range(n)]

    def split_sum(self) -> tuple:
        return *self.shading(), *self.threes(4), brdf_lut(), 0, True, None, None

    def query(self) -> tuple:
        normals, views, _, roughness, _ = self.shading()
        return normals, views, roughness, brdf_lut(), True

    def pyramid(self) -> tuple:
        """Lobes of the shaded points, then their normals for all of the light."""
        maps = pyramid_filters(self.sizes.light_resolution)
        normals, views, _, roughness, _ = self.shading()
        normals, roughness = torch.cat([views, normals]), torch.cat([roughness, torch.ones_like(roughness)])
        n_texels = int((maps.resolutions**2).sum())
        harmonics = 0.1 * self.randn(len(maps.projection), 3, seed=36)
        return normals, roughness, self.rand(n_texels, 3, seed=35), harmonics, maps.resolutions, maps.nodes, maps.zonal

    def averaging(self) -> tuple:
        matrix = pyramid_filters(self.sizes.light_resolution).averages
        return *matrix, self.rand(len(matrix.transposed_offsets) - 1, 3, seed=37)

    def shared_directions(self) -> tuple:
        p, k = self.sizes.segments, self.sizes.directions
        normals, views, _, roughness, _ = (x[:p] for x in self.shading())
        seen = self.rand(p, k, seed=44), 0.2 * self.rand(p, k, 3, seed=45)
        around = fibonacci_directions(k, self.generator(42)), torch.full((k,), 4 * math.pi / k)
        return normals, views, roughness, *around, self.rand(k, 3, seed=43), *seen

    @functools.cached_property
    def cache(self) -> VisibilityCache:
        """Of two balls that touch, in the middle of each other's sky."""
        ball = trimesh.creation.icosphere(self.sizes.subdivisions, RADIUS)
        mesh = trimesh.util.concatenate([ball, ball.copy().apply_translation((0.0, 0.0, 2 * RADIUS))])
        vertices, normals = (torch.tensor(x.copy()).float() for x in (mesh.vertices, mesh.vertex_normals))
        directions = fibonacci_directions(self.sizes.directions, self.generator(46))
        scene = MeshScene(vertices.numpy(), mesh.faces)
        return VisibilityCache.trace(scene, vertices, normals, mesh.area, directions, with_hits=True)

    def near_the_mesh(self) -> tuple:
        normals = unit(self.randn(self.sizes.segments, 3, seed=47))
        c = self.cache
        kept = (c.vertices, c.normals, c.starts, c.order, c.radius, c.bits, c.hits)
        return RADIUS * normals, normals, *kept, self.rand(len(c.vertices), 3, seed=48), c.directions

    def occlusion(self) -> tuple:
        at, normals, *cache = self.near_the_mesh()
        lobes = unit(normals + 0.3 * self.randn(*normals.shape, seed=49))
        light = self.rand(self.sizes.directions, 3, seed=50)
        return at, normals, lobes, self.rand(len(at), 1, seed=51), *cache, light

    def pixels(self) -> tuple:
        r = self.sizes.rays
        numbers = self.rand(r, 3, seed=52), self.rand(r, seed=53), self.rand(r, 4, seed=54), self.rand(r, 3, seed=55)
        return *numbers, self.rand(r, seed=58) < 0.1, 0.8 + 0.4 * self.rand(r, 3, seed=59), True

    def normals_beside(self) -> tuple:
        """Gradients of all samples, then of points beside some of them."""
        n, m = self.sizes.samples, self.sizes.smooth
        gradients = unit(self.randn(n + m, 3, seed=56)) * (0.9 + 0.2 * self.rand(n + m, 1, seed=57))
        return gradients, self.weights, torch.randint(n, (m,), generator=self.generator(58))

    def texels(self) -> tuple:
        """Of a light's levels from 4 x 4 texels on."""
        sizes = [4**k for k in range(2, self.sizes.light_resolution.bit_length())]
        return self.randn(sum(sizes), 3, seed=75), sizes

    def materials(self) -> tuple:
        p = self.sizes.points
        return self.rand(p, 3, seed=59), self.rand(p, 1, seed=60), self.rand(p, seed=61), False
