"""A painted ball on a painted table, photographed: closed forms in place of photos."""

from pathlib import Path

import numpy as np
from blender_data import look_at
from PIL import Image

BALL, RADIUS = np.array([0.0, 0.0, 0.5]), 0.5
TABLE_RADIUS, TURNTABLE_RADIUS = 1.6, 0.9
CAMERA = (400.0, 400, 300)  # focal length, width and height in pixels


def noise(points: np.ndarray, frequency: float, seed: int) -> np.ndarray:
    """[..., 3] smooth random colours in [0, 1] at points [..., 3]: trilinear between random values of a lattice."""
    lattice = np.random.default_rng(seed).random((16, 16, 16, 3))
    at = points * frequency
    cell = np.floor(at).astype(int)
    share = at - cell
    total = np.zeros(points.shape)
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(np.array(corner) == 1, share, 1 - share).prod(axis=-1, keepdims=True)
        total += weight * lattice[tuple(np.moveaxis((cell + corner) % 16, -1, 0))]
    return total


def spots(points: np.ndarray, frequency: float, seed: int) -> np.ndarray:
    """[..., 3] random colours with edges."""
    return 1 / (1 + np.exp(-30 * (noise(points, frequency, seed) - 0.5)))


def ring(n: int, distance: float = 3.0) -> np.ndarray:
    """[n, 4, 4] camera-to-world, OpenGL axes, of cameras around the ball, higher and lower in turn."""
    poses = []
    for i in range(n):
        azimuth, height = 2 * np.pi * i / n, np.radians(38 + 12 * np.sin(6 * np.pi * i / n))
        back = np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
        poses.append(look_at(BALL + distance * back, BALL))
    return np.array(poses)


def painted(points: np.ndarray, seed: int, frequency: float = 5.0) -> np.ndarray:
    """[..., 3] spots of three sizes."""
    return sum(spots(points, 2.0**k * frequency, seed + k) for k in range(3)) / 3


def surface_colours(at_table: np.ndarray, rays: np.ndarray, table: np.ndarray, frequency: float = 5.0) -> np.ndarray:
    """[..., 3] sRGB colours of points of the table where a ray meets it, else of what is far away."""
    colour = 0.3 + 0.2 * noise(rays, 2.0, 9)
    colour[table] = painted(at_table[table], 1, frequency) * [1.0, 1.0, 0.5]
    return colour


def photograph(
    pose: np.ndarray, focal: float, width: int, height: int, frequency: float = 5.0, turntable: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """A photo [h, w, 3] uint8 with the principal point in its middle, and the ball's mask [h, w] bool. On a turntable all
    that is around the table stands still before the camera, and has edges."""
    y, x = np.mgrid[:height, :width] + 0.5
    local = np.stack([(x - width / 2) / focal, -(y - height / 2) / focal, -np.ones_like(x)], axis=-1)
    rays = local @ pose[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    origin = pose[:3, 3]
    radius = TURNTABLE_RADIUS if turntable else TABLE_RADIUS
    along = -((origin - BALL) * rays).sum(-1)
    inside = RADIUS**2 - (((origin - BALL) ** 2).sum() - along**2)
    ball = inside > 0
    at_ball = origin + (along - np.sqrt(np.maximum(inside, 0)))[..., None] * rays
    at_table = origin - (origin[2] / rays[..., 2])[..., None] * rays
    table = (rays[..., 2] < 0) & (np.linalg.norm(at_table[..., :2], axis=-1) < radius)
    colour = surface_colours(at_table, rays, table, frequency)
    if turntable:
        colour[~table] = painted(local[~table], 3, 8.0)
    colour[ball] = painted(at_ball[ball], 5) * [1.0, 0.4, 0.2]
    return (255 * colour.clip(0, 1) + 0.5).astype(np.uint8), ball


def write_photos(folder: Path, n: int, turntable: bool = False) -> np.ndarray:
    """Writes `p_NN.png`; returns the poses."""
    folder.mkdir(parents=True)
    poses = ring(n)
    for i, pose in enumerate(poses):
        Image.fromarray(photograph(pose, *CAMERA, turntable=turntable)[0]).save(folder / f"p_{i:02d}.png")
    return poses
