"""Meshes for measurements."""

from __future__ import annotations

import numpy as np
import trimesh

from splitnerf_tools.bench.lights import data_folder


def armadillo() -> trimesh.Trimesh:
    """The scan of the data folder in the unit sphere, or a bumpy sphere of as many triangles."""
    path = data_folder() / "meshes" / "armadillo_ingp.obj"
    if not path.is_file():
        return trimesh.Trimesh(*bumpy_sphere(224), process=False)
    mesh = trimesh.load(path, process=False)
    mesh.apply_translation(-mesh.bounds.mean(0))
    mesh.apply_scale(1 / np.linalg.norm(mesh.vertices, axis=1).max())
    return mesh


def bumpy_sphere(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A sphere with bumps of about 2 n^2 triangles: vertices [v, 3] float32, faces [f, 3] int32."""
    polar, azimuth = np.meshgrid(
        np.linspace(0.01, np.pi - 0.01, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij"
    )
    radius = 1 + 0.15 * np.sin(9 * polar) * np.cos(11 * azimuth)
    vertices = radius[..., None] * np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1
    )
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)
