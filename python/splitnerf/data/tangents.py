"""Tangents of an indexed mesh, as normal maps in glTF expect them."""

from __future__ import annotations

import numpy as np


def vertex_tangents(vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """MikkTSpace's tangents of the vertices as they are indexed; no vertex is split.

    A triangle's tangent is the direction of growing u on it. At each of its vertices it is projected on the plane of
    the vertex normal, normalised and weighted with the corner's angle, the edges projected likewise. The bitangent,
    sign * cross(normal, tangent), points where v shrinks: up in the texture, whose (0, 0) is the top left in glTF.
    Triangles without area in the texture do not count; a vertex with no other triangles gets an arbitrary tangent.

    Args:
        vertices: [n, 3] positions.
        triangles: [m, 3] vertex indices, counter-clockwise seen from outside.
        normals: [n, 3] unit.
        uv: [n, 2] texture coordinates.

    Returns:
        [n, 4] float32, unit tangents perpendicular to the normals, and the bitangent's sign, 1 or -1.

    Source: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited" (2008), and glTF 2.0, section 3.7.2.1.
    """
    vertices, normals, uv = (np.asarray(array, dtype=np.float64) for array in (vertices, normals, uv))
    corners, texels = vertices[triangles], uv[triangles]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    (u1, v1), (u2, v2) = (texels[:, 1] - texels[:, 0]).T, (texels[:, 2] - texels[:, 0]).T
    area = u2 * v1 - u1 * v2  # twice the signed area with v upward
    along_u = (edge2 * v1[:, None] - edge1 * v2[:, None]) * np.sign(area)[:, None]

    sums = np.zeros((len(vertices), 3))
    signs = np.zeros(len(vertices))
    for corner in range(3):
        vertex = triangles[:, corner]
        normal = normals[vertex]
        sides = [_unit(_in_plane(corners[:, (corner + k) % 3] - corners[:, corner], normal)) for k in (1, 2)]
        angle = np.arccos(np.clip((sides[0] * sides[1]).sum(axis=1), -1.0, 1.0))
        share = _unit(_in_plane(along_u, normal)) * angle[:, None]
        for axis in range(3):
            sums[:, axis] += np.bincount(vertex, share[:, axis], len(vertices))
        signs += np.bincount(vertex, angle * np.sign(area), len(vertices))

    missing = np.linalg.norm(sums, axis=1) < 1e-12
    sums[missing] = np.eye(3)[np.abs(normals[missing]).argmin(axis=1)]
    tangents = _unit(_in_plane(sums, normals))
    return np.column_stack([tangents, np.where(signs < 0, -1.0, 1.0)]).astype(np.float32)


def _in_plane(vectors: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return vectors - normals * (vectors * normals).sum(axis=1, keepdims=True)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
