"""Painted tubes: closed surfaces about curves, joined into one asset with one atlas."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from splitnerf.data.asset import Asset, Material

TAU = 2 * np.pi
WIDTH = 2048  # texels of the atlas along a tube
MARGIN = 3  # texels beside each strip that continue its paint
Curve = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
Field = Callable[[np.ndarray, np.ndarray], np.ndarray]
Paint = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray | float, np.ndarray | float]]


@dataclass(frozen=True)
class Tube:
    """A closed surface about a curve; s in [0, 1] runs along it, t in [0, 1] around it.

    Attributes:
        curve: From s [n] to points and two unit vectors across the curve, each [n, 3].
        radius: The distance from the curve, of s and t.
        paint: Linear albedo [..., 3], roughness and metallic, of s and t, defined a little beyond [0, 1].
        cells: The number of quads along and around.
        texels: The texture's height in texels, for one strip.
        strips: The number of pieces that the texture is cut into along the curve.
    """

    curve: Curve
    radius: Field
    paint: Paint
    cells: tuple[int, int]
    texels: int
    strips: int = 1

    def patches(self, detail: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Per strip the parameters (s, t) [rows, columns, 2] of its vertices."""
        along, around = (max(4, round(detail * n)) for n in (self.cells[0] / self.strips, self.cells[1]))
        t = np.linspace(0, 1, around + 1)
        ends = np.linspace(0, 1, self.strips + 1)
        return [np.stack(np.meshgrid(np.linspace(*e, along + 1), t, indexing="ij"), -1) for e in zip(ends, ends[1:])]

    def points(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Positions [..., 3]."""
        centre, right, up = (v.reshape(*s.shape, 3) for v in self.curve(s.ravel()))
        across = np.cos(TAU * t)[..., None] * right + np.sin(TAU * t)[..., None] * up
        return centre + self.radius(s, t)[..., None] * across


def assemble(name: str, tubes: list[Tube], detail: float) -> Asset:
    """One mesh with one atlas: each strip of each tube is a band of texels across it."""
    scale = lambda texels: max(8, round(texels * detail))
    width, height = scale(WIDTH), sum(tube.strips * scale(tube.texels) for tube in tubes)
    albedo, orm = np.zeros((height, width, 3)), np.zeros((height, width, 2))
    vertices, uv, triangles, normals, top, start = [], [], [], [], 0, 0
    for tube in tubes:
        band, parts = scale(tube.texels), []
        for patch in tube.patches(detail):
            (s0, _), (s1, _) = patch[0, 0], patch[-1, 0]
            inner = np.array([width, band]) - 2 * MARGIN
            x, y = np.meshgrid(*((np.arange(n) + 0.5 - MARGIN) / m for n, m in zip((width, band), inner)))
            colour, rough, metal = tube.paint(s0 + (s1 - s0) * x, y)
            rows = slice(top, top + band)
            albedo[rows], orm[rows, :, 0], orm[rows, :, 1] = colour, rough, metal
            share = (patch - [s0, 0]) / [s1 - s0, 1]
            uv.append(((share * inner + MARGIN + [0, top]) / [width, height]).reshape(-1, 2))
            parts.append((tube.points(patch[..., 0], patch[..., 1]).reshape(-1, 3), quads(*patch.shape[:2])))
            top += band
        points, faces, shading = closed(parts)
        vertices, triangles, normals = [*vertices, points], [*triangles, faces + start], [*normals, shading]
        start += len(points)
    faces = np.concatenate(triangles).astype(np.int32)
    material = Material(
        name,
        metallic=1.0,
        albedo_texture=np.clip(albedo, 0, 1).astype(np.float32),
        roughness_metallic_texture=np.clip(orm, 0, 1).astype(np.float32),
    )
    vertices, normals, uv = (np.concatenate(part).astype(np.float32) for part in (vertices, normals, uv))
    return Asset(name, vertices, faces, normals, np.zeros(len(faces), np.int32), [material], uv)


def quads(rows: int, columns: int) -> np.ndarray:
    """Two triangles per cell of a grid of vertices [rows, columns]."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def closed(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joins grids of one surface, facing outward: vertices doubled at seams are equal and share a normal."""
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    points = np.concatenate([points for points, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts)])
    _, first, same = np.unique(points.round(6), axis=0, return_index=True, return_inverse=True)
    same = same.ravel()
    joined = same[faces]
    proper = (joined != np.roll(joined, 1, axis=1)).all(axis=1)
    faces, joined, points = faces[proper], joined[proper], points[first][same]
    mesh = trimesh.Trimesh(points[first], joined, process=False)
    if mesh.volume < 0:
        faces = faces[:, ::-1]
        mesh.invert()
    return points, faces, np.asarray(mesh.vertex_normals)[same]


def ring(centre: np.ndarray, axis: np.ndarray, radius: float) -> Curve:
    """A circle about an axis; the first vector across points outward."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.cross(axis, [0.3, 0.5, 0.81])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)

    def curve(s):
        out = np.cos(TAU * s)[:, None] * x + np.sin(TAU * s)[:, None] * y
        return centre + radius * out, out, np.broadcast_to(axis, out.shape)

    return curve


def through(path: Callable[[np.ndarray], np.ndarray], beside: Callable[[np.ndarray], np.ndarray]) -> Curve:
    """A curve by its points; `beside` gives vectors that are never along it."""

    def curve(s):
        along = path(s + 1e-5) - path(s - 1e-5)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        right = beside(s) - (beside(s) * along).sum(1, keepdims=True) * along
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        return path(s), right, np.cross(along, right)

    return curve


def lathe(profile: np.ndarray) -> tuple[Curve, Field]:
    """Curve and radius of a body turned about z; profile [k, 2] of (radius, z) ends on the axis."""
    steps = np.linspace(0, 1, len(profile))

    def curve(s):
        zero = np.zeros_like(s)
        centre = np.stack([zero, zero, np.interp(s, steps, profile[:, 1])], 1)
        return centre, np.broadcast_to([1.0, 0, 0], centre.shape), np.broadcast_to([0, 1.0, 0], centre.shape)

    return curve, lambda s, t: np.interp(s, steps, profile[:, 0])


def wire(radius: float) -> Field:
    """A constant radius that falls to 0 at both ends."""
    return lambda s, t: radius * np.sqrt(np.clip(np.minimum(s, 1 - s) / 0.01, 0, 1))


def noise(s: np.ndarray, t: np.ndarray, along: int, around: int, seed: int) -> np.ndarray:
    """Periodic noise in [0, 1] with frequencies up to `along` and `around`."""
    draw = np.random.default_rng(seed)
    waves = zip(draw.integers(-along, along + 1, 12), draw.integers(0, around + 1, 12), draw.uniform(0, 1, 12))
    return 0.5 + 0.5 * np.tanh(sum(np.cos(TAU * (i * s + j * t + phase)) for i, j, phase in waves) / 3)


def band(x: np.ndarray, width: float) -> np.ndarray:
    """1 at whole x, 0 farther from them than about `width` / 3, with soft edges."""
    return 1 - smooth((np.abs(np.sin(np.pi * x)) / width - 0.6) / 0.8)


def smooth(x: np.ndarray) -> np.ndarray:
    """A step from 0 to 1 as x goes from 0 to 1."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def mix(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Colours a to b, [..., 3]; each may be one colour."""
    return np.asarray(a) * (1 - share[..., None]) + np.asarray(b) * share[..., None]
