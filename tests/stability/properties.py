"""What operators must satisfy that have no float64 twin: they trace, draw or count.

A property takes (source, n) and gives [n] float64 violations, at most 0 where it holds, NaN where something is not
finite, and the inputs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
import trimesh
from splitnerf import ops
from splitnerf.ops._library import lib
from torch import Tensor

from stability.cases import Draw, unit
from stability.entry import Rows

HALF = 0.75  # half the edge of the cube that is traced
CUBE = trimesh.creation.box((2 * HALF,) * 3)
CORNERS = torch.from_numpy(np.sign(CUBE.vertices)).float()


@dataclass(frozen=True)
class Property:
    """A statement on an operator.

    Attributes:
        name: Of the operator, and of what is said about it.
        check: See above.
        statement: In words.
        size: Inputs that one case holds.
        chunk: Cases at a time.
        most: Inputs that are enough, as one takes long.
    """

    name: str
    check: Callable[[Draw, int], tuple[Tensor, Rows]]
    statement: str
    size: int = 1
    chunk: int = 1 << 13
    most: int = 10**7


@lru_cache(maxsize=1)
def cube() -> ops.MeshScene:
    return ops.MeshScene(CUBE.vertices, CUBE.faces)


def on_cube(draw: Draw, n: int) -> tuple[Tensor, Tensor]:
    """Points of the cube's surface, on vertices, edges, diagonals and anywhere, and their faces' normals."""
    axis = torch.randint(3, (n,), generator=draw.generator)
    normals = torch.zeros(n, 3, dtype=torch.float64)
    normals[torch.arange(n), axis] = draw.signs(n)
    points = draw.mixed((-1.0, 1.0, 0.0, 1 - 6e-8), draw.uniform(n, 3, low=-1, high=1)).clamp(-1, 1)
    diagonal = draw.chance(0.2, n)
    points[diagonal] = points[diagonal, :1].expand(-1, 3)
    points = torch.where(normals != 0, normals, points)
    return HALF * points, normals


def finite_in(x: Tensor, low: float, high: float) -> Tensor:
    """[n] how far the numbers of each row lie beyond [low, high]; NaN where one is not finite."""
    x = x.double().reshape(len(x), -1)
    return torch.maximum(low - x, x - high).amax(1) + 0 * x.sum(1)


def closed_cube(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    targets, normals = on_cube(draw, n)
    origins = targets + normals * draw.pick((1e-3, 0.5, 100.0), n, 1)
    inside = targets * draw.mixed((1 - 1e-3, 0.0), draw.uniform(n, 1, high=1 - 1e-3)).clamp(0, 1 - 1e-3)
    edge = (targets.abs() > HALF * (1 - 1e-5)).sum(1, keepdim=True) > 1
    parallel = draw.chance(0.5, n, 1) & ~edge  # to four of the faces; in the plane of one a ray may be either
    directions = torch.where(parallel, -normals, inside - origins)
    open_ = cube().is_open(origins.float(), directions.float())
    return open_.double(), {"origins": origins.float(), "directions": directions.float()}


def open_outside(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    points, normals = on_cube(draw, n)
    origins = points + normals * draw.pick((1e-4, 1e-2, 1.0), n, 1)
    side = unit(draw.normal(n, 3) * (normals == 0))
    directions = unit(normals + side * draw.mixed((0.0, 1e-7, 1.0, 1e3), draw.logarithmic(1e-3, 1e3, n, 1)))
    open_ = cube().is_open(origins.float(), directions.float())
    return 1.0 - open_.double(), {"origins": origins.float(), "directions": directions.float()}


@lru_cache(maxsize=1)
def chequered() -> ops.visibility.TexturedSurface:
    """The cube, its normals those of its corners, with textures of extremes."""
    n, black_and_white = len(CORNERS), (torch.arange(16).reshape(4, 4) * 5 % 3 % 2).float()
    normals = unit(CORNERS.double()).float()
    side = unit(torch.linalg.cross(normals, torch.tensor([0.0, 0.0, 1.0]).expand(n, 3)))
    tilts = torch.stack([2 * black_and_white - 1, 1 - 2 * black_and_white.T, 0 * black_and_white], -1)
    return ops.visibility.TexturedSurface(
        cube(),
        normals,
        torch.cat([side, torch.ones(n, 1)], 1),
        CORNERS[:, :2] * 0.7,
        black_and_white[..., None].expand(4, 4, 3),
        torch.stack([black_and_white.T, black_and_white], -1),
        tilts,
    )


def light_arriving(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Unit directions; finite numbers, none below 0; no light from below the triangle, or out of a convex body."""
    positions, faces = on_cube(draw, n)
    inside = draw.chance(0.5, n, 1)
    geometric = torch.where(inside, -faces, faces)
    leaning = unit(geometric + draw.pick((0.0, 1e-7, 0.9, 3.0), n, 1) * draw.directions(n))
    normals = torch.where(draw.chance(0.1, n, 1), 0.0, leaning)
    rows = {
        "positions": positions,
        "geometric_normals": geometric,
        "normals": normals,
        "view_dirs": draw.at_cosine(normals),
        "albedo": draw.shares(n, 3),
        "roughness": draw.roughness(n),
        "metallic": draw.shares(n, 1),
    }
    rows = {name: x.float() for name, x in rows.items()}
    sky = torch.full((4, 8, 3), draw.pick((0.0, 1e-38, 1.0, 1e6), 1).item())
    sky[1, 2] = max(sky[0, 0, 0].item(), 1e6 if draw.chance(0.5, 1).item() else 0.0)
    seed = int(draw.uniform(1).item() * 1e9)
    found = ops.visibility.incoming_light(chequered(), sky, **rows, n_directions=8, max_bounces=3, seed=seed)
    directions = found.directions.double()
    length = directions.norm(dim=-1)
    wrong = ((length - 1).abs() > 2e-6) & (found.pdf > 0)
    lit = (found.visible > 0) | (found.sent > 0).any(-1)
    wrong |= lit & ((directions * geometric[:, None]).sum(-1) < -1e-6) | lit & (found.pdf <= 0)
    wrong |= (found.visible > 0) & (found.sent > 0).any(-1) | (rows["normals"] == 0).all(1, keepdim=True) & (
        found.pdf > 0
    )
    limits = ((found.pdf, 3e38), (found.sent, 1e9), (found.visible, 1.0))
    broken = torch.stack([finite_in(x, 0.0, limit) for x, limit in limits]).amax(0)
    broken = torch.where(wrong.any(1), 1.0, broken)
    # beside an edge rays start past the other face
    clear = (positions.abs() < HALF * (1 - 1e-3)).sum(1) == 2
    leaks = torch.where(inside[:, 0], (found.visible > 0).any(1), (found.sent > 0).any(-1).any(1))
    return torch.where(clear & leaks, 1.0, broken), rows


def occlusion_inputs(draw: Draw, n: int) -> tuple[Rows, Tensor]:
    positions, normals = on_cube(draw, n)
    lobes = draw.at_cosine(normals)
    size = draw.pick((0.0, 1e-38, 1.0, 1e30), 1).item()
    sky = torch.full((4, 8, 3), size)
    sky[1, 2] = max(size, 1e6 if draw.chance(0.5, 1).item() else size)
    rows = {"positions": positions, "normals": normals, "lobe_dirs": lobes, "roughness": draw.roughness(n)}
    return {name: x.float() for name, x in rows.items()}, sky


def factors(rows: Rows, sky: Tensor, low: float, high: float) -> Tensor:
    """[n] how far the occlusion factors lie beyond [low, high]."""
    found = ops.occlusion_factors(cube(), **rows, environment=sky, n_diffuse_rays=8, n_specular_rays=8, n_channels=3)
    return torch.stack([finite_in(x, low, high) for x in found]).amax(0) - 1e-6


def shares(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    rows, sky = occlusion_inputs(draw, n)
    return factors(rows, sky, 0.0, 1.0), rows


def all_blocked(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    rows, sky = occlusion_inputs(draw, n)
    rows |= {"positions": 0.5 * rows["positions"], "lobe_dirs": rows["normals"]}
    return factors(rows, sky, 0.0, 0.0), rows


def pixels_read(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Codes of 8, 16 and 32 bits stand for their values, at edges with the colour behind."""
    codes = torch.randint(0, 65536, (120, 4), generator=draw.generator)
    codes[::7] = torch.tensor([0, 1, 32768, 65535])
    index = torch.randint(120, (n,), generator=draw.generator)
    view, exposures = index // 40, draw.radiance(3, 3).float()
    edges = torch.tensor([3, 60]), torch.tensor([9, 100]), torch.tensor([-3, -54])
    behind = torch.randint(256, (46, 3), generator=draw.generator).to(torch.uint8)
    random = draw.shares(n, 3).float()
    at_edge = ((index >= 3) & (index < 9)) | ((index >= 60) & (index < 100))
    row = torch.where(at_edge, index + torch.where(index < 9, -3, -54), 0)
    background = torch.where(at_edge[:, None], behind[row].double() / 255, random)
    apart = torch.zeros(n, dtype=torch.float64)
    stored = (codes.to(torch.uint8), 255), (codes.short(), 65535), (draw.radiance(120, 4).float(), 1)
    for bits, most in stored:
        values = {255: codes % 256, 65535: codes, 1: bits}[most].double()[index] / most
        pixels, exposure, beside, whole = ops.rays.read_pixels(
            bits, index, view, exposures, random, ops.rays.EdgeRuns(*edges, behind)
        )
        wrong = (exposure != exposures[view]).any(1) | (whole != at_edge)
        off = torch.cat([pixels - values, beside - background], 1).abs() / torch.cat([values, background], 1).clamp(
            min=1e-30
        )
        apart = torch.maximum(apart, torch.where(wrong, 1.0, off.amax(1)))
    return apart - 2e-7, {"index": index, "background": random}


@lru_cache(maxsize=3)
def sheet(thickness: float) -> ops.sdf.SdfNetwork:
    """|z| - thickness / 2 as two softplus units: a sheet with a surface on either side."""
    spec = ops.HashGridSpec(n_levels=1, n_features=2, base_resolution=4, growth=2.0, log2_table_size=9)
    hidden = torch.zeros(2, 3 + spec.n_outputs)
    hidden[0, 2], hidden[1, 2] = 1.0, -1.0
    zeros, bias = torch.zeros(spec.n_entries, spec.n_features), torch.tensor([-thickness / 2])
    return ops.sdf.SdfNetwork(spec, 1, zeros, hidden, torch.zeros(2), torch.ones(1, 2), bias, 1e5, 1.0)


def sampled(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """No ray jumps over a thin sheet, grazing ones either; samples ascend and lie in the box."""
    step, s, thickness = 1 / 128, draw.pick((200.0, 2000.0, 8000.0), 1).item(), draw.pick((5e-4, 2e-3, 2e-2), 1).item()
    targets = torch.cat([draw.mixed((0.0, 1e-7), draw.uniform(n, 2, low=-0.9, high=0.9)), torch.zeros(n, 1)], 1)
    slope = draw.mixed((0.1, 1.0), draw.logarithmic(0.1, 10, n, 1)) * draw.signs(n, 1)
    side = unit(torch.cat([draw.normal(n, 2), torch.zeros(n, 1)], 1))
    directions = unit(side + slope * torch.tensor([0.0, 0.0, 1.0]))
    origins = targets - directions * draw.mixed((0.1, 1.0, 3.0), draw.uniform(n, 1, low=0.1, high=4))
    jitter = draw.shares(n).clamp(max=1 - 6e-8)
    rows = {"rays_o": origins.float(), "rays_d": directions.float(), "jitter": jitter.float()}
    cells = torch.full((16, 16, 16), ops.rays.CELL_OCCUPIED, dtype=torch.uint8)
    limits = {"min_weight": 1e-3, "min_transmittance": 1e-4, "reach": 7 / s, "lipschitz": 1.25}
    found, _, _ = ops.sdf.sample_rays(**rows, cells=cells, network=sheet(thickness), step=step, s=s, **limits)
    ray, middle = found.ray_indices, found.middles.double()
    point = rows["rays_o"].double()[ray] + rows["rays_d"].double()[ray] * middle[:, None]
    nearest = torch.full((n,), torch.inf, dtype=torch.float64).scatter_reduce(0, ray, point[:, 2].abs(), "amin")
    wrong = torch.zeros(n, dtype=torch.float64)
    backwards = (ray[1:] == ray[:-1]) & (found.t_starts.diff() < 0.99 * step)
    bad = (point.abs().amax(1) > 1 + step) | torch.nn.functional.pad(backwards, (1, 0))
    wrong = wrong.scatter_reduce(0, ray, bad.double(), "amax")
    return torch.maximum(wrong, nearest - step - thickness), rows


@lru_cache(maxsize=1)
def cache() -> ops.visibility.VisibilityCache:
    vertices = HALF * CORNERS
    directions = ops.fibonacci_directions(64, torch.Generator().manual_seed(0))
    return ops.visibility.VisibilityCache.trace(
        cube(), vertices, unit(vertices.double()).float(), 24 * HALF**2, directions, with_hits=True
    )


def bits_apart(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """No direction is open and blocked; those within the horizon of the normal are one of both."""
    positions, normals = (x.float() for x in on_cube(draw, n))
    directions = cache().directions
    bits, hits = ops.visibility.visibility_bits(cube(), positions, normals, directions, 1e-3, with_hits=True)
    marks = (bits[..., None] >> torch.arange(32) & 1).reshape(n, 2, -1).bool()
    cosine = normals.double() @ directions.double().T
    wrong = (marks[:, 0] & marks[:, 1]) | ((cosine > 1e-6) & ~marks.any(1)) | ((cosine < -1e-6) & marks.any(1))
    wrong |= (hits >= 0) != marks[:, 1]
    wrong |= (cosine > 1e-3) & marks[:, 1]  # from a face of a convex body nothing is blocked
    return wrong.any(1).double(), {"positions": positions, "normals": normals}


def cached(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    rows, _ = occlusion_inputs(draw, n)
    light = torch.full((64, 3), draw.pick((0.0, 1e-38, 1.0, 1e30), 1).item())
    light[3] = max(1e6, light[0, 0].item()) if draw.chance(0.5, 1).item() else light[3]
    o_d, o_s, i_d, i_s = ops.visibility.cached_occlusion(cache(), **rows, light=light, radiance=torch.ones(8, 3))
    return torch.stack([finite_in(x, 0.0, 1.0) for x in (o_d, o_s, i_d, i_s)]).amax(0) - 1e-5, rows


def seen(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Shares of the sky; what the mesh sends fills up the rest at most."""
    positions, normals = (x.float() for x in on_cube(draw, n))
    visible, arriving = ops.visibility.cached_visibility(cache(), positions, normals, torch.ones(8, 3))
    apart = finite_in(visible + arriving.mean(-1), 0.0, 1.0)
    return torch.maximum(apart, finite_in(torch.stack([visible, arriving.mean(-1)], 1), 0.0, 1.0)) - 1e-5, {
        "positions": positions,
        "normals": normals,
    }


def vertices_in_grids(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Each level lists every vertex once, and those of one cell in one bucket."""
    radius, n_levels = draw.pick((1e-6, 0.1, 1e3), 1).item(), 3
    corner = torch.round(draw.uniform(n, 3, low=-4, high=4)) * 2 * radius
    x = draw.mixed((0.0, 1e-38, -1e-7, 1e6, 1e30, -1e30), draw.normal(n, 3), 0.2)
    x = torch.where(draw.chance(0.3, n, 1), corner, x).float()
    starts, order = lib.vertex_grids(x, radius, n_levels)
    inverse, wrong = torch.tensor(0.5) / torch.tensor(radius).float(), torch.zeros(n, dtype=torch.bool)
    for first, listed, size in zip(starts.view(n_levels, -1), order.view(n_levels, -1).long(), (1, 2, 4)):
        bucket = torch.empty(n, dtype=torch.int64)
        bucket[listed] = torch.searchsorted(first.contiguous(), torch.arange(n, dtype=first.dtype), right=True) - 1
        _, cell = torch.unique((x * (inverse / size)).clamp(-1e9, 1e9).floor(), dim=0, return_inverse=True)
        of_cell = torch.zeros(n, dtype=torch.int64).scatter_(0, cell, bucket)[cell]
        wrong |= (bucket != of_cell) | (listed.bincount(minlength=n) != 1) | bool((first.diff() < 0).any())
    return wrong.double(), {"vertices": x}


def rays_drawn(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Each ray goes through a pixel of its part of its list, from its view's centre, with length 1."""
    height, width, n_near = 8, 11, int(n * draw.uniform(1).item())
    random = draw.shares(n).clamp(max=1 - 6e-8).float()
    matrices = (draw.pick((1e-4, 1.0, 1e4), 3, 1, 1) * (torch.eye(3) + 0.3 * draw.normal(3, 3, 3))).float()
    origins = draw.pick((0.0, 1e-38, 1.0, 1e6), 3, 3).float()
    near = ops.rays.PixelList(torch.tensor([4, 5, 40]), torch.tensor([10, 30, 200]), 40)
    known = ops.rays.PixelList.all(3 * height * width, torch.device("cpu"))
    rays_o, rays_d, view, index = ops.rays.draw_rays(random, n_near, near, known, matrices, origins, height, width)
    i, beside = torch.arange(n), torch.arange(n) < n_near
    listed = torch.cat([torch.arange(10, 14), torch.tensor([34]), torch.arange(205, 240)])
    rank = torch.where(beside, torch.searchsorted(listed, index), index)
    part = torch.where(beside, 40 / max(n_near, 1), 3 * height * width / max(n - n_near, 1))
    place = (torch.where(beside, i, i - n_near) + random.double()) * part
    border = (place - place.round()).abs() < 1e-4
    off = (rank - place.floor()).abs() > border.long()
    point = torch.stack([index % width + 0.5, index // width % height + 0.5, torch.ones(n)], 1).double()
    products = matrices.double()[view] * point[:, None]
    along, size = products.sum(2), products.abs().sum(2).norm(dim=1)
    apart = (rays_d.double() - unit(along)).norm(dim=1) - 1e-6 * size / along.norm(dim=1)
    wrong = (view != index // (height * width)) | (rays_o != origins[view]).any(1) | (index >= 3 * height * width)
    return torch.where(wrong | off, 1.0, apart), {"random": random, "matrices": matrices[view]}


def marched(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Samples ascend, lie in the box and in cells that are not empty, and keep to the step and the limit."""
    box, step, side, limit = 1.0, 1 / 32, 16, 40
    cells = torch.where(draw.chance(0.5, side, side, side), 1, 0).to(torch.uint8)
    targets = torch.round(draw.uniform(n, 3, low=-1, high=1) * side / 2) * 2 / side
    directions = draw.directions(n)
    origins = targets - directions * draw.mixed((0.0, 1e-7, 1.0, 3.0, 1e4), draw.uniform(n, 1, high=4))
    jitter = draw.shares(n).clamp(max=1 - 6e-8).float()
    rows = {"rays_o": origins.float(), "rays_d": directions.float(), "jitter": jitter}
    found = ops.march_rays(rows["rays_o"], rows["rays_d"], rows["jitter"], cells, box=box, step=step, max_samples=limit)
    ray, start = found.ray_indices, found.t_starts.double()
    point = rows["rays_o"].double()[ray] + rows["rays_d"].double()[ray] * (start + step / 2)[:, None]
    reach = rows["rays_o"].double().norm(dim=1)[ray] + 1
    slack = 4e-7 * reach
    outside = (point.abs().amax(1) - box) / slack - 1
    length = ((found.t_ends.double() - start) - step).abs() / slack - 1
    backwards = torch.zeros_like(start)
    backwards[1:] = torch.where(ray[1:] == ray[:-1], step - slack[1:] - (start[1:] - start[:-1]), -1.0)
    place = (point + box) * (side / (2 * box))
    within = ((place - place.round()).abs() > side * slack[:, None]).all(1)  # no rounding leads to the next cell
    empty = within & (cells[place.long().clamp(0, side - 1).unbind(1)] == 0)
    worst = torch.full((n,), -1.0, dtype=torch.float64)
    violation = torch.stack([outside, length, backwards, empty.double()]).amax(0) + 0 * start
    worst = worst.scatter_reduce(0, ray, violation, "amax")
    counts = found.offsets.diff()
    return torch.where(counts > limit, 1.0, worst), rows


def spread(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Shares in [0, 1], neighbours in order, and interpolated constants that stay themselves."""
    samples = 8
    weights = draw.shares(n * samples).float()
    starts = torch.arange(samples).repeat(n).float() / 8
    offsets = torch.arange(n + 1) * samples
    packed = ops.rays.PackedSamples(torch.arange(n).repeat_interleave(samples), starts, starts + 0.125, offsets)
    found = ops.rays.spread_samples(weights, packed, 3, draw.shares(n).clamp(max=1 - 6e-8).float(), 1.0)
    constant = found.interpolate(torch.full((len(found.shaded), 1), 3.0))
    wrong = finite_in(found.share.reshape(n, samples), 0.0, 1.0)
    wrong = torch.maximum(wrong, (constant.reshape(n, samples).double() - 3).abs().amax(1) - 1e-6)
    drawn = torch.bincount(found.shaded // samples, minlength=n)
    return torch.where((drawn < 1) | (found.first > found.second).reshape(n, samples).any(1), 1.0, wrong), {
        "weights": weights.reshape(n, samples)
    }


def lobe_samples(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Unit vectors above the horizon whose cosines follow the distribution of D cos: a shifted lattice in its CDF."""
    count = 8
    axes, roughness = draw.directions(n).float(), draw.roughness(n).float()
    found = ops.light.sample_ggx_lobe(axes, roughness, count, int(draw.uniform(1).item() * 1e9)).double()
    a = (roughness.double() ** 2).clamp(min=1e-4)
    apart = (found - unit(axes.double())[:, None]).square().sum(-1)  # 2 (1 - cosine)
    cosine, b = 1 - apart / 2, (1 - a * a) / 2
    y, top = b * cosine.clamp(min=0) / (a * a + b * apart / 2), b / (a * a)
    difference = lambda y: torch.where(y < 1e-3, y * y / 2 - y**3 / 3 + y**4 / 4, y - torch.log1p(y))
    cdf = torch.where(b < 1e-3, cosine.clamp(min=0) ** 2, difference(y) / difference(top))
    lattice = (1 - cdf) * count
    phase = torch.frac(lattice - lattice[:, :1] + count + 0.5) - 0.5
    # a direction is off by 2^-23, which is 2^-23 / a of the lobe's width
    bent = phase.abs().amax(1) / count - (1e-5 + 4e-7 / a[:, 0])
    length = (found.norm(dim=-1) - 1).abs().amax(1) - 1e-6
    below = -cosine.amin(1) - 1e-6
    return torch.stack([bent, length, below]).amax(0), {"axes": axes, "roughness": roughness}


PROPERTIES = (
    Property(
        "MeshScene.is_open, closed", closed_cube, "no ray into a closed cube leaks, through vertices and edges either"
    ),
    Property("MeshScene.is_open, open", open_outside, "every ray away from a face of a convex body is open"),
    Property("occlusion_factors", shares, "in [0, 1] under black, dim, bright and single lights", chunk=1024),
    Property("occlusion_factors, blocked", all_blocked, "0 where all rays are blocked, in black light too", chunk=1024),
    Property(
        "incoming_light",
        light_arriving,
        "finite, from above both horizons, and from the sky or the mesh alone; none into a closed body",
        size=8,
        chunk=1024,
    ),
    Property(
        "visibility_bits",
        bits_apart,
        "open or blocked above the horizon, neither below; a convex body blocks nothing",
        chunk=1024,
    ),
    Property("cached_occlusion", cached, "in [0, 1], the mesh's own light too, under black and single lights"),
    Property("cached_visibility", seen, "open and blocked shares of each direction sum up to at most 1"),
    Property("vertex_grids", vertices_in_grids, "every level lists each vertex once, those of one cell together"),
    Property(
        "draw_rays", rays_drawn, "unit, through a pixel of the ray's own part of its list, from its view's centre"
    ),
    Property("read_pixels", pixels_read, "codes of 8, 16 and 32 bits are the values they stand for"),
    Property("march_rays", marched, "in the box, ascending by the step, at most as many as asked for"),
    Property("sample_rays", sampled, "no ray jumps over a sheet 1/15 of a step thick; in the box, ascending"),
    Property("spread_samples", spread, "shares in [0, 1]; every ray has a sample; constants stay themselves", size=8),
    Property("sample_ggx_lobe", lobe_samples, "unit, above the horizon, evenly spaced in the CDF of D cos", size=8),
)


@dataclass(frozen=True)
class Verdict:
    """What became of a property: cases, how many broke it, and the worst of them."""

    claim: Property
    cases: int
    broken: int
    worst: Rows

    @property
    def holds(self) -> bool:
        return self.broken == 0


def verify(claim: Property, cases: int, seed: int = 0) -> Verdict:
    draw, total, done, broken, worst = Draw(seed), max(1, min(cases, claim.most) // claim.size), 0, 0, {}
    while done < total:
        n = min(claim.chunk, total - done)
        violation, rows = claim.check(draw, n)
        wrong = ~(violation <= 0)
        if bool(wrong.any()) and not worst:
            first = int(torch.nonzero(wrong)[0])
            worst = {name: x[first : first + 1] for name, x in rows.items()}
        broken, done = broken + int(wrong.sum()), done + n
    return Verdict(claim, done * claim.size, broken, worst)
