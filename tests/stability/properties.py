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
    """

    name: str
    check: Callable[[Draw, int], tuple[Tensor, Rows]]
    statement: str
    size: int = 1
    chunk: int = 1 << 13


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
    visible, arriving = ops.visibility.cached_visibility(cache(), rows["positions"], rows["normals"], torch.ones(8, 3))
    found = (o_d, o_s, i_d, i_s, visible, arriving)
    return torch.stack([finite_in(x, 0.0, 1.0) for x in found]).amax(0) - 1e-5, rows


def marched(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Samples ascend, lie in the box and in cells that are not empty, and keep to the step and the limit."""
    box, step, side, limit = 1.0, 1 / 32, 16, 40
    cells = torch.where(draw.chance(0.5, side, side, side), 1, 0).to(torch.uint8)
    targets = torch.round(draw.uniform(n, 3, low=-1, high=1) * side / 2) * 2 / side
    directions = draw.directions(n)
    origins = targets - directions * draw.mixed((0.0, 1e-7, 1.0, 3.0, 1e4), draw.uniform(n, 1, high=4))
    rows = {
        "rays_o": origins.float(),
        "rays_d": directions.float(),
        "jitter": draw.shares(n).clamp(max=1 - 6e-8).float(),
    }
    found = ops.march_rays(rows["rays_o"], rows["rays_d"], rows["jitter"], cells, box=box, step=step, max_samples=limit)
    ray, start = found.ray_indices, found.t_starts.double()
    point = rows["rays_o"].double()[ray] + rows["rays_d"].double()[ray] * (start + step / 2)[:, None]
    reach = rows["rays_o"].double().norm(dim=1)[ray] + 1
    slack = 4e-7 * reach
    outside = (point.abs().amax(1) - box) / slack - 1
    length = ((found.t_ends.double() - start) - step).abs() / slack - 1
    backwards = torch.zeros_like(start)
    backwards[1:] = torch.where(ray[1:] == ray[:-1], step - slack[1:] - (start[1:] - start[:-1]), -1.0)
    worst = torch.full((n,), -1.0, dtype=torch.float64)
    violation = torch.stack([outside, length, backwards]).amax(0) + 0 * start
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
    Property("march_rays", marched, "in the box, ascending by the step, at most as many as asked for"),
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
    draw, total, done, broken, worst = Draw(seed), max(1, cases // claim.size), 0, 0, {}
    while done < total:
        n = min(claim.chunk, total - done)
        violation, rows = claim.check(draw, n)
        wrong = ~(violation <= 0)
        if bool(wrong.any()) and not worst:
            first = int(torch.nonzero(wrong)[0])
            worst = {name: x[first : first + 1] for name, x in rows.items()}
        broken, done = broken + int(wrong.sum()), done + n
    return Verdict(claim, done * claim.size, broken, worst)
