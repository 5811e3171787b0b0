"""The demo scene: a copper ball, a blue torus and a striped clay bowl on a stone plinth, under a procedural sky.

Everything is built in memory and rendered by the project's own path tracer, so that `splitnerf demo` needs no
download and has the full truth (materials, normals, light, mesh) to compare with.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from splitnerf.data.environment import directions_of_texels
from splitnerf.relight.studio import direction, smoothstep, soft_box

from splitnerf_tools.synth.rendering import orbit, spiral
from splitnerf_tools.synth.writer import SceneWriter

CAMERA_DISTANCE = 3.0
CAMERA_ANGLE_X = 0.69  # radians; frames the unit sphere from CAMERA_DISTANCE
PLINTH_TOP = -0.24


@dataclass(frozen=True)
class DemoScene:
    """One triangle mesh with a material at each vertex.

    Attributes:
        vertices: [n, 3] float32, z up, inside the unit sphere.
        triangles: [m, 3] int32, counter-clockwise seen from outside.
        normals: [n, 3] float32 unit shading normals, from the shapes' equations.
        albedo: [n, 3] float32 linear, in [0, 1].
        roughness: [n] float32 perceptual, in [0, 1].
        metallic: [n] float32, 0 or 1.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    roughness: np.ndarray
    metallic: np.ndarray


def build_scene() -> DemoScene:
    """Builds the demo mesh: four closed parts that touch, each with its own material."""
    lift = 0.004  # the parts sink this deep into the plinth, so that no light passes below them
    ball = _moved(_ball(0.34), (-0.30, -0.14, PLINTH_TOP + 0.34 - lift))
    bowl = _moved(_bowl(outer=0.30, inner=0.24), (0.26, 0.34, PLINTH_TOP + 0.30 - lift))
    torus = _moved(_torus(0.20, 0.09), (0.32, -0.32, PLINTH_TOP + 0.09 - lift))
    plinth = _plinth(radius=0.84, height=0.18, bevel=0.035)

    # An inlaid ring gives the plinth a change of material that no shape announces.
    radius = np.hypot(plinth[0][:, 0], plinth[0][:, 1])
    inlay = (np.abs(radius - 0.74) < 0.027) & (plinth[2][:, 2] > 0.99)
    stripes = np.sin(60 * bowl[0][:, 2]) > 0
    stone, bronze = (0.50, 0.46, 0.40), (0.28, 0.075, 0.05)
    plinth_albedo = np.where(inlay[:, None], bronze, stone)
    plinth_roughness = np.where(inlay, 0.35, 0.65)

    parts = [
        (ball, (0.95, 0.60, 0.42), 0.25, 1.0),
        (bowl, np.where(stripes[:, None], (0.72, 0.42, 0.10), (0.62, 0.58, 0.50)), 0.85, 0.0),
        (torus, (0.035, 0.13, 0.42), 0.15, 0.0),
        (plinth, plinth_albedo, plinth_roughness, 0.0),
    ]
    counts = [len(shape[0]) for shape, *_ in parts]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])

    def stack(values, width):
        return np.concatenate([np.broadcast_to(v, (n, *width)) for v, n in zip(values, counts)]).astype(np.float32)

    return DemoScene(
        vertices=np.concatenate([shape[0] for shape, *_ in parts]).astype(np.float32),
        triangles=np.concatenate([shape[1] + start for (shape, *_), start in zip(parts, starts)]).astype(np.int32),
        normals=np.concatenate([shape[2] for shape, *_ in parts]).astype(np.float32),
        albedo=stack([p[1] for p in parts], (3,)),
        roughness=stack([p[2] for p in parts], ()),
        metallic=stack([p[3] for p in parts], ()),
    )


def build_environment(height: int = 128) -> np.ndarray:
    """Builds the light: a blue sky, a softened sun, warm ground and two soft boxes.

    Returns:
        [height, 2 height, 3] float32 linear radiance, equirectangular (the centre column looks along +x).
    """
    d, _ = directions_of_texels(height)
    up = d[..., 2:]

    zenith, horizon, ground = np.array([0.14, 0.25, 0.52]), np.array([0.50, 0.53, 0.57]), np.array([0.17, 0.12, 0.08])
    sky = horizon + (zenith - horizon) * np.clip(up, 0, 1) ** 0.5
    earth = ground * (1 - 0.5 * np.clip(-up, 0, 1))
    radiance = earth + (sky - earth) * smoothstep(-0.04, 0.04, up)

    sun = direction(azimuth=35, elevation=48)
    radiance = radiance + np.array([80.0, 67.0, 50.0]) * np.exp((d @ sun - 1) / np.radians(4.0) ** 2)[..., None]
    radiance = radiance + np.array([1.6, 1.0, 0.5]) * soft_box(d, direction(azimuth=-105, elevation=28), 0.36, 0.26)
    radiance = radiance + np.array([0.5, 0.9, 1.4]) * soft_box(d, direction(azimuth=160, elevation=40), 0.24, 0.40)
    return radiance.astype(np.float32)


def write_demo_dataset(
    out: Path, *, size: int = 100, n_train: int = 60, n_test: int = 8, spp: int = 64, seed: int = 0
) -> Path:
    """Renders the demo scene and writes it as a dataset with truth.

    The folder is in the layout "blender" of :mod:`splitnerf_tools.synth.writer`, without relit views.

    Args:
        out: The folder to write to; made where it is missing.
        size: Width and height of the images in pixels.
        n_train: Number of training views.
        n_test: Number of test views.
        spp: Paths a pixel.
        seed: Seed of the renderings; the same seed writes the same data.

    Returns:
        `out` as a Path.

    Raises:
        OSError: A file cannot be written.
    """
    from splitnerf import _core

    writer = SceneWriter(out, CAMERA_ANGLE_X)
    demo, environment = build_scene(), writer.light(build_environment())
    scene = _core.Scene(demo.vertices, demo.triangles)
    focal = 0.5 * size / np.tan(0.5 * CAMERA_ANGLE_X)
    train, test = spiral(n_train, CAMERA_DISTANCE, (4, 72)), orbit(n_test, CAMERA_DISTANCE, 30, start=0.25)
    for split, poses in (("train", train), ("test", test)):
        for i, pose in enumerate(poses):
            images = _core.render(
                scene,
                demo.albedo,
                demo.roughness,
                demo.metallic,
                environment,
                pose[:3].astype(np.float32),
                focal,
                focal,
                size / 2,
                size / 2,
                size,
                size,
                normals=demo.normals,
                spp=spp,
                clamp_indirect=1.0,
                seed=((seed * 2 + (split == "test")) * 65536 + i) % (1 << 31),
            )
            writer.view(split, i, pose, images)
    writer.mesh(demo.vertices, demo.triangles)
    writer.close()
    return Path(out)


# ---- shapes: (vertices [n, 3], triangles [m, 3], normals [n, 3]), centred at the origin, outward ----

Shape = tuple[np.ndarray, np.ndarray, np.ndarray]


def _ball(radius: float) -> Shape:
    sphere = trimesh.creation.icosphere(subdivisions=5)
    return sphere.vertices * radius, sphere.faces, np.array(sphere.vertices)


def _torus(major: float, minor: float) -> Shape:
    n_major, n_minor = 160, 80
    turns = [np.arange(n) * 2 * np.pi / n for n in (n_major, n_minor)]
    u, v = np.meshgrid(*turns, indexing="ij")
    normals = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], axis=-1).reshape(-1, 3)
    centres = np.stack([np.cos(u), np.sin(u), np.zeros_like(u)], axis=-1).reshape(-1, 3) * major
    return centres + minor * normals, _grid_triangles(n_major, n_minor, wrap_columns=True), normals


def _plinth(*, radius: float, height: float, bevel: float) -> Shape:
    """A disc with rounded rims below PLINTH_TOP."""
    top, bottom, flat = PLINTH_TOP, PLINTH_TOP - height, radius - bevel
    profile = [(r, bottom, 0.0, -1.0) for r in np.linspace(0, flat, 24)]
    for centre, start in ((bottom + bevel, -np.pi / 2), (top - bevel, 0.0)):
        profile += _arc(flat, centre, bevel, start, start + np.pi / 2)
    return _revolved(profile + [(r, top, 0.0, 1.0) for r in np.linspace(flat, 0, 160)])


def _bowl(*, outer: float, inner: float) -> Shape:
    """Half a hollow ball below the origin, with a round rim."""
    wall = 0.5 * (outer - inner)
    below, rim, within = (
        (0.0, 0.0, outer, -np.pi / 2, 0.0),
        (outer - wall, 0.0, wall, 0.0, np.pi),
        (0.0, 0.0, inner, 0.0, -np.pi / 2),
    )
    inside = [(r, z, -normal_r, -normal_z) for r, z, normal_r, normal_z in _arc(*within, n=96)]
    return _revolved(_arc(*below, n=96) + _arc(*rim, n=24) + inside)


Profile = list[tuple[float, float, float, float]]  # radius, z, and the normal's parts along both


def _arc(r: float, z: float, radius: float, start: float, end: float, n: int = 8) -> Profile:
    """Points of a circle about (r, z), between two angles from the horizontal."""
    turns = [(np.cos(angle), np.sin(angle)) for angle in np.linspace(start, end, n)]
    return [(r + radius * c, z + radius * s, c, s) for c, s in turns]


def _revolved(points: Profile) -> Shape:
    """A profile from pole to pole, turned about z."""
    n_turn = 256
    # Where two parts of a profile meet both name the same ring once.
    repeats = [i > 0 and np.allclose(p, points[i - 1], atol=1e-9) for i, p in enumerate(points)]
    profile = np.array([p for p, repeat in zip(points, repeats) if not repeat])
    turn = np.arange(n_turn) * 2 * np.pi / n_turn
    r, z, normal_r, normal_z = (profile[None, :, k] for k in range(4))
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    vertices = np.stack(np.broadcast_arrays(r * c, r * s, z), axis=-1).reshape(-1, 3)
    normals = np.stack(np.broadcast_arrays(normal_r * c, normal_r * s, normal_z), axis=-1).reshape(-1, 3)
    # Each pole is one vertex, and the cells that meet there are single triangles.
    triangles = _grid_triangles(n_turn, len(profile), wrap_columns=False)
    column = triangles % len(profile)
    triangles = np.where((column == 0) | (column == len(profile) - 1), column, triangles)
    proper = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return vertices, triangles[proper], normals


def _grid_triangles(n_rows: int, n_columns: int, *, wrap_columns: bool) -> np.ndarray:
    """Two triangles for each cell of a grid of vertices whose rows wrap around."""
    i, j = np.meshgrid(np.arange(n_rows), np.arange(n_columns if wrap_columns else n_columns - 1), indexing="ij")
    i, j = i.ravel(), j.ravel()
    a, b = i * n_columns + j, (i + 1) % n_rows * n_columns + j
    c, d = (i + 1) % n_rows * n_columns + (j + 1) % n_columns, i * n_columns + (j + 1) % n_columns
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _moved(shape: Shape, offset: tuple[float, float, float]) -> Shape:
    return shape[0] + np.array(offset), shape[1], shape[2]
