"""Built-in shapes for data with known truth: hollow, thin, pierced or touching, as scanned files seldom are.

Each shape is a signed distance, negative inside, of points [n, 3] with z up: one closed body in [-1, 1]^3 without inner
faces. Away from the surface a distance may be half too large, as :func:`splitnerf.export.meshing.extract_mesh` allows.
"""

from __future__ import annotations

import numpy as np
import torch
from splitnerf.data.asset import Asset, Material
from splitnerf.export.meshing import extract_mesh

RESOLUTION = 192  # nodes along an edge of the mesher's grid: five or more across a wall
BOX = 1.02
PALETTE = np.array([(0.62, 0.20, 0.14), (0.78, 0.70, 0.52), (0.12, 0.30, 0.46)])  # linear albedos: clay, cream, blue
DARKEST = 0.1
MATERIALS = {"matte": (0.8, 0.0), "glossy": (0.25, 0.0), "metal": (0.3, 1.0)}
"""Roughness and metallic by name."""


# ---- parts and how they are put together ----


def cut(a: np.ndarray, b: np.ndarray, edge: float) -> np.ndarray:
    """What is in both a and b; where their surfaces meet at a right angle, the edge is round with this radius."""
    x, y = a + edge, b + edge
    return np.hypot(np.maximum(x, 0), np.maximum(y, 0)) + np.minimum(np.maximum(x, y), 0) - edge


def joined(a: np.ndarray, b: np.ndarray, edge: float) -> np.ndarray:
    """What is in a or b; the groove between them is round with this radius."""
    return -cut(-a, -b, edge)


def hollow(solid: np.ndarray, beyond: np.ndarray, wall: float) -> np.ndarray:
    """The outermost `wall` of a solid, open where `beyond` is positive; the rim is half round."""
    return cut(np.abs(solid + wall / 2) - wall / 2, beyond, wall / 2)


def block(q: np.ndarray, half: tuple[float, ...], edge: float) -> np.ndarray:
    """A box about the origin with rounded edges, in as many dimensions as q [n, d] has."""
    beside = np.abs(q) - (np.array(half) - edge)
    return np.linalg.norm(np.maximum(beside, 0), axis=1) + np.minimum(beside.max(axis=1), 0) - edge


def ellipsoid(p: np.ndarray, radii: tuple[float, float, float]) -> np.ndarray:
    """Exact to first order at the surface."""
    scaled = np.linalg.norm(p / np.array(radii), axis=1)
    return scaled * (scaled - 1) / np.maximum(np.linalg.norm(p / np.square(radii), axis=1), 1e-9)


def from_axis(p: np.ndarray) -> np.ndarray:
    """[n] distances from the z axis."""
    return np.hypot(p[:, 0], p[:, 1])


# ---- shapes ----


def bowl(p: np.ndarray) -> np.ndarray:
    """Half a sphere, open above."""
    return hollow(np.linalg.norm(p, axis=1) - 0.95, p[:, 2], 0.08)


def mug(p: np.ndarray) -> np.ndarray:
    """A cylinder with a floor and a handle, open above."""
    x, y, z = p.T
    solid = block(np.column_stack([from_axis(p), z - 0.4]), (0.55, 1.0), 0.1)
    handle = np.hypot(np.hypot(x - 0.55, np.maximum(np.abs(z) - 0.12, 0)) - 0.27, y) - 0.045
    outside = np.maximum(handle, -solid - 0.04)  # ends in the middle of the wall
    return joined(hollow(solid, z - 0.6, 0.08), outside, 0.03)


def box(p: np.ndarray) -> np.ndarray:
    """Open above, without a lid."""
    return hollow(block(p - (0, 0, 0.5), (0.7, 0.5, 0.95), 0.06), p[:, 2] - 0.4, 0.08)


def vase(p: np.ndarray) -> np.ndarray:
    """A belly on a flat foot, under a narrow neck that widens upward."""
    z, r = p[:, 2], from_axis(p)
    belly = cut(np.hypot(r, z + 0.3) - 0.6, -0.8 - z, 0.05)
    neck = np.maximum(r - np.hypot(0.17, 0.45 * (z - 0.4)), -0.15 - z)
    return hollow(joined(belly, neck, 0.15), z - 0.9, 0.07)


def shell(p: np.ndarray) -> np.ndarray:
    """A cockle's shell: thin, ribbed from a point of its rim, opening to the side and up."""
    x, y, z = np.array([(0.6, 0, -0.8), (0, 1, 0), (0.8, 0, 0.6)]) @ p.T
    from_hinge, angle = np.hypot(x + 1.1, y), np.arctan2(y, x + 1.1)
    ribs = 0.018 * from_hinge * np.cos(24 * angle)
    return hollow(ellipsoid(np.column_stack([x, y, z]), (0.9, 0.78, 0.6)) - ribs, z - 0.1, 0.06)


def rings(p: np.ndarray) -> np.ndarray:
    """Three tori, each resting on a wider one."""
    z, r = p[:, 2], from_axis(p)
    wide, middle = np.hypot(r - 0.7, z + 0.4) - 0.2, np.hypot(r - 0.52, z + 0.1) - 0.17
    return joined(joined(wide, middle, 0.03), np.hypot(r - 0.36, z - 0.14) - 0.14, 0.03)


def plinth(p: np.ndarray) -> np.ndarray:
    """A ball that touches the square plinth under it."""
    ball = np.linalg.norm(p - (0, 0, 0.15), axis=1) - 0.45
    return joined(ball, block(p - (0, 0, -0.49), (0.6, 0.6, 0.2), 0.04), 0.02)


def mask(p: np.ndarray) -> np.ndarray:
    """Half an ellipsoid with a nose and two holes for eyes, open behind."""
    x, y, z = p.T
    face = joined(ellipsoid(p, (0.7, 0.5, 0.95)), ellipsoid(p - (0, -0.42, -0.1), (0.14, 0.23, 0.34)), 0.1)
    eyes = np.hypot(0.8 * (np.abs(x) - 0.29), 1.25 * (z - 0.2)) - 0.13
    return cut(hollow(face, y, 0.07), -eyes, 0.03)


SHAPES = {f.__name__: f for f in (bowl, mug, box, vase, shell, rings, plinth, mask)}


# ---- assets ----


def shape_asset(shape: str, material: str, resolution: int = RESOLUTION) -> Asset:
    """A built-in shape as a mesh with albedos at its vertices. Raises KeyError where the shape or the material is unknown.

    Args:
        shape: One of `SHAPES`.
        material: One of `MATERIALS`.
        resolution: Nodes along an edge of the mesher's grid.
    """
    distance, (roughness, metallic) = SHAPES[shape], MATERIALS[material]
    vertices, triangles = extract_mesh(lambda p: torch.from_numpy(distance(p.numpy())), BOX, resolution)
    p, step = vertices.astype(np.float64), BOX / resolution
    slopes = np.column_stack([distance(p + step * axis) - distance(p - step * axis) for axis in np.eye(3)])
    normals = (slopes / np.linalg.norm(slopes, axis=1, keepdims=True)).astype(np.float32)
    materials = [Material(material, roughness=roughness, metallic=metallic)]
    return Asset(shape, vertices, triangles, normals, np.zeros(len(triangles), np.int32), materials, colors=pattern(p))


def pattern(p: np.ndarray) -> np.ndarray:
    """Linear albedos [n, 3] float32 at points, 0.1 to 0.8: clouds of three colours, dappled with small spots."""
    large, middle, small = noise(p, 5, 1), noise(p, 14, 2), noise(p, 36, 3)
    colours = PALETTE[0] + large[:, None] * (PALETTE[1] - PALETTE[0])
    colours += middle[:, None] * (PALETTE[2] - colours)
    return np.maximum(colours * (0.6 + 0.4 * small[:, None]), DARKEST).astype(np.float32)


def noise(p: np.ndarray, frequency: float, seed: int) -> np.ndarray:
    """[n] smooth noise in [0, 1]: waves in 16 directions with this number of radians a unit of length."""
    draw = np.random.default_rng(seed)
    directions = draw.normal(size=(16, 3))
    directions *= frequency / np.linalg.norm(directions, axis=1, keepdims=True)
    return 0.5 + 0.5 * np.tanh(np.cos(p @ directions.T + draw.uniform(0, 2 * np.pi, 16)).sum(axis=1) / 2)
