"""Writes meshes as PLY, faces outward."""

from __future__ import annotations

import os

import numpy as np
import trimesh

from splitnerf.data.images import linear_to_srgb, to_uint8
from splitnerf.files import atomic_path


def write_mesh_ply(
    path: str | os.PathLike, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None = None
) -> None:
    """Writes a binary PLY in the frame of the vertices, atomically.

    Args:
        path: The file, with the suffix .ply.
        vertices: [n, 3] in the data's world, z up.
        faces: [m, 3] vertex indices; their order is reversed where the signed volume is negative.
        colors: [n, 3] linear in [0, 1], stored sRGB-encoded in 8 bit as viewers expect; None for none.

    Raises:
        RuntimeError: The mesh is degenerate or empty.
        OSError: The file cannot be written.
    """
    vertices, faces = _checked(path, vertices, faces)
    if colors is not None:
        colors = to_uint8(linear_to_srgb(_per_vertex(path, "colors", colors, vertices)))
    mesh = trimesh.Trimesh(vertices, faces, vertex_colors=colors, process=False)
    with atomic_path(path) as temporary:
        temporary.write_bytes(mesh.export(file_type="ply"))


def _checked(path: str | os.PathLike, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns float64 vertices and faces wound outward."""
    vertices, faces = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    valid = vertices.ndim == faces.ndim == 2 and vertices.shape[1:] == faces.shape[1:] == (3,) and len(faces) > 0
    if not valid or not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        raise RuntimeError(f"{path}: degenerate or empty mesh, nothing written")
    centred = vertices - vertices.mean(axis=0)
    a, b, c = (centred[faces[:, i]] for i in range(3))
    crosses = np.cross(b - a, c - a)
    if not np.abs(crosses).max() > 0:
        raise RuntimeError(f"{path}: degenerate or empty mesh, nothing written")
    return vertices, faces[:, ::-1] if (a * crosses).sum() < 0 else faces


def _per_vertex(path: str | os.PathLike, name: str, values: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    values = np.asarray(values, dtype=np.float64)
    if values.shape != vertices.shape or not np.isfinite(values).all():
        raise RuntimeError(f"{path}: {name} must be finite [{len(vertices)}, 3], got {list(values.shape)}")
    return values
