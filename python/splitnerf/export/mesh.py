"""Writes meshes as PLY and GLB, faces outward, GLB y up with linear vertex colours."""

from __future__ import annotations

import json
import os
import struct

import numpy as np
import trimesh

from splitnerf.data.images import atomic_path, linear_to_srgb, to_uint8

FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def write_mesh_ply(
    path: str | os.PathLike, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None = None
) -> None:
    """Writes a binary PLY in the frame of the vertices, atomically.

    Args:
        path: Ends in .ply.
        vertices: [n, 3] in the data's world, z up.
        faces: [m, 3] vertex indices; turned outward where the signed volume is negative.
        colors: [n, 3] linear in [0, 1], stored sRGB-encoded in 8 bit as viewers expect; None for none.

    Raises:
        RuntimeError: Degenerate or empty mesh.
        OSError: The file cannot be written.
    """
    vertices, faces = _checked(path, vertices, faces)
    if colors is not None:
        colors = to_uint8(linear_to_srgb(_per_vertex(path, "colors", colors, vertices)))
    mesh = trimesh.Trimesh(vertices, faces, vertex_colors=colors, process=False)
    with atomic_path(path) as temporary:
        temporary.write_bytes(mesh.export(file_type="ply"))


def write_mesh_glb(
    path: str | os.PathLike,
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    albedo: np.ndarray,
    roughness: float,
    metallic: float,
) -> None:
    """Writes a binary glTF 2.0 with albedo as vertex colours and one roughness and metallic, atomically.

    z up becomes y up, (x, y, z) -> (x, z, -y). COLOR_0 is linear, as glTF demands, in normalised 16 bit; viewers
    multiply it with the base colour factor, which is 1.

    Args:
        path: Ends in .glb.
        vertices: [n, 3] in the data's world, z up.
        faces: [m, 3] vertex indices; turned outward where the signed volume is negative.
        normals: [n, 3] outward, of any non-zero length.
        albedo: [n, 3] linear in [0, 1].
        roughness: Perceptual, in [0, 1].
        metallic: In [0, 1].

    Raises:
        RuntimeError: Degenerate or empty mesh, or non-finite attributes.
        OSError: The file cannot be written.
    """
    vertices, faces = _checked(path, vertices, faces)
    normals = _per_vertex(path, "normals", normals, vertices)
    albedo = _per_vertex(path, "albedo", albedo, vertices)
    if not np.isfinite([roughness, metallic]).all():
        raise RuntimeError(f"{path}: roughness and metallic must be finite, got {roughness} and {metallic}")
    positions = _y_up(vertices)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 1e-12, normals / np.maximum(lengths, 1e-12), [0, 0, 1])
    colours = np.concatenate([np.clip(albedo, 0, 1), np.ones((len(albedo), 1))], axis=1)
    arrays = [
        (positions, FLOAT, "VEC3", ARRAY_BUFFER),
        (_y_up(normals), FLOAT, "VEC3", ARRAY_BUFFER),
        (np.rint(colours * 65535).astype("<u2"), UNSIGNED_SHORT, "VEC4", ARRAY_BUFFER),
        (faces.reshape(-1).astype("<u4"), UNSIGNED_INT, "SCALAR", ELEMENT_ARRAY_BUFFER),
    ]
    views, accessors, offset = [], [], 0
    for index, (array, component, kind, target) in enumerate(arrays):
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": array.nbytes, "target": target})
        accessors.append({"bufferView": index, "componentType": component, "count": len(array), "type": kind})
        offset += array.nbytes
    accessors[0] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    accessors[2]["normalized"] = True
    document = {
        "asset": {"version": "2.0", "generator": "SplitNeRF"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "object"}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3, "material": 0}]}
        ],
        "materials": [
            {
                "name": "object",
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1.0, 1.0, 1.0, 1.0],
                    "roughnessFactor": float(np.clip(roughness, 0, 1)),
                    "metallicFactor": float(np.clip(metallic, 0, 1)),
                },
            }
        ],
        "buffers": [{"byteLength": offset}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + offset))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", offset, b"BIN\0"))
        for array, *_ in arrays:
            file.write(array.tobytes())


def _y_up(vectors: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], axis=1), dtype="<f4")


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
