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
    """One triangle mesh with a material at each vertex."""

    vertices: np.ndarray  # [n, 3] float32, z up, inside the unit sphere
    triangles: np.ndarray  # [m, 3] int32, counter-clockwise seen from outside
    normals: np.ndarray  # [n, 3] float32 unit shading normals
    albedo: np.ndarray  # [n, 3] float32 linear, in [0, 1]
    roughness: np.ndarray  # [n] float32 perceptual, in [0, 1]
    metallic: np.ndarray  # [n] float32, 0 or 1


def build_scene() -> DemoScene:
    """Builds the demo mesh: four closed parts that touch, each with its own material."""
    lift = 0.004  # the parts sink this deep into the plinth, so that no light passes below them
    ball = _moved(trimesh.creation.icosphere(5, 0.34), -0.30, -0.14, PLINTH_TOP + 0.34 - lift)
    bowl = _moved(_bowl(outer=0.30, inner=0.24), 0.26, 0.34, PLINTH_TOP + 0.30 - lift)
    torus = _moved(trimesh.creation.torus(0.20, 0.09, 160, 80), 0.32, -0.32, PLINTH_TOP + 0.09 - lift)
    plinth = _plinth(radius=0.84, height=0.18, bevel=0.035)

    # An inlaid ring gives the plinth a change of material that no shape announces.
    radius = np.hypot(*plinth.vertices[:, :2].T)
    inlay = (np.abs(radius - 0.74) < 0.027) & (plinth.vertex_normals[:, 2] > 0.99)
    stripes = np.sin(60 * bowl.vertices[:, 2]) > 0
    stone, bronze = (0.50, 0.46, 0.40), (0.28, 0.075, 0.05)
    plinth_albedo = np.where(inlay[:, None], bronze, stone)
    plinth_roughness = np.where(inlay, 0.35, 0.65)

    parts = [
        (ball, (0.95, 0.60, 0.42), 0.25, 1.0),
        (bowl, np.where(stripes[:, None], (0.72, 0.42, 0.10), (0.62, 0.58, 0.50)), 0.85, 0.0),
        (torus, (0.035, 0.13, 0.42), 0.15, 0.0),
        (plinth, plinth_albedo, plinth_roughness, 0.0),
    ]
    counts = [len(shape.vertices) for shape, *_ in parts]
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])

    def stack(values, width):
        return np.concatenate([np.broadcast_to(v, (n, *width)) for v, n in zip(values, counts)]).astype(np.float32)

    return DemoScene(
        vertices=np.concatenate([shape.vertices for shape, *_ in parts]).astype(np.float32),
        triangles=np.concatenate([shape.faces + start for (shape, *_), start in zip(parts, starts)]).astype(np.int32),
        normals=np.concatenate([shape.vertex_normals for shape, *_ in parts]).astype(np.float32),
        albedo=stack([p[1] for p in parts], (3,)),
        roughness=stack([p[2] for p in parts], ()),
        metallic=stack([p[3] for p in parts], ()),
    )


def build_environment(height: int = 128) -> np.ndarray:
    """[height, 2 height, 3] float32 linear radiance, equirectangular, +x in the middle: sky, sun, warm ground, two soft boxes."""
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
    """Renders the demo scene and writes it as a dataset with truth; returns `out`. Raises OSError where a file cannot be written.

    The folder is in the layout "blender" of :mod:`splitnerf_tools.synth.writer`, without relit views.

    Args:
        out: The folder to write to; made where it is missing.
        size: Width and height of the images in pixels.
        spp: Paths a pixel.
        seed: Seed of the renderings; the same seed writes the same data.
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


# ---- shapes, closed and outward ----


def _plinth(*, radius: float, height: float, bevel: float) -> trimesh.Trimesh:
    """A disc with rounded rims below PLINTH_TOP."""
    top, bottom, flat = PLINTH_TOP, PLINTH_TOP - height, radius - bevel
    below, above = ([(r, z) for r in np.linspace(0, flat, n, endpoint=False)] for z, n in ((bottom, 23), (top, 159)))
    rims = [_arc(flat, z, bevel, a, a + np.pi / 2) for z, a in ((bottom + bevel, -np.pi / 2), (top - bevel, 0.0))]
    return trimesh.creation.revolve([*below, *rims[0], *rims[1], *above[::-1]], sections=256)


def _bowl(*, outer: float, inner: float) -> trimesh.Trimesh:
    """Half a hollow ball below the origin, with a round rim."""
    wall = 0.5 * (outer - inner)
    outside, inside = _arc(0.0, 0.0, outer, -np.pi / 2, 0.0, n=96), _arc(0.0, 0.0, inner, 0.0, -np.pi / 2, n=96)
    rim = _arc(outer - wall, 0.0, wall, 0.0, np.pi, n=48)
    return trimesh.creation.revolve([*outside, *rim[1:-1], *inside], sections=256)


def _arc(r: float, z: float, radius: float, start: float, end: float, n: int = 16) -> list[tuple[float, float]]:
    """Points (radius, z) of a circle about (r, z), between two angles from the horizontal."""
    return [(r + radius * np.cos(angle), z + radius * np.sin(angle)) for angle in np.linspace(start, end, n)]


def _moved(shape: trimesh.Trimesh, *offset: float) -> trimesh.Trimesh:
    return shape.apply_translation(offset)
