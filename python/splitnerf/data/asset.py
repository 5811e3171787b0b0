"""A textured metallic-roughness mesh in the program's own conventions, wherever it came from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from splitnerf.data.json_files import read_json, write_json
from splitnerf.errors import InputError

ORIGIN = "origin.json"  # beside assets that are not where the data have them


@dataclass
class Material:
    """One glTF metallic-roughness material: each quantity is its factor times its texture.

    Textures are float32 with the top row first, sampled bilinearly at `Asset.uv`, and repeat.

    Attributes:
        albedo: (3,) linear factor in [0, 1].
        roughness: Perceptual factor in [0, 1].
        metallic: Factor in [0, 1].
        emission: (3,) linear radiance factor >= 0.
        albedo_texture: [h, w, 3] linear in [0, 1] (decoded from sRGB), or None.
        roughness_metallic_texture: [h, w, 2], in [0, 1], (roughness, metallic), or None.
        normal_texture: [h, w, 3] tangent-space normals in [-1, 1], the scale applied, y along the bitangent, or None.
        emission_texture: [h, w, 3] linear, or None.
    """

    name: str = "material"
    albedo: tuple[float, float, float] = (1.0, 1.0, 1.0)
    roughness: float = 1.0
    metallic: float = 0.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    albedo_texture: np.ndarray | None = None
    roughness_metallic_texture: np.ndarray | None = None
    normal_texture: np.ndarray | None = None
    emission_texture: np.ndarray | None = None


@dataclass
class Asset:
    """A triangle mesh with materials, in a world with z up.

    Attributes:
        vertices: [n, 3] float32.
        triangles: [m, 3] int32, counter-clockwise seen from outside.
        normals: [n, 3] float32 unit shading normals.
        uv: [n, 2] float32 texture coordinates, (0, 0) the top left corner of the texture as in glTF, or None.
        tangents: [n, 4] float32, unit tangent along +u and the sign of the bitangent, sign * cross(normal, tangent);
            or None where no material has a normal texture.
        colors: [n, 3] float32 linear factors on albedo, or None.
        materials: At least one.
        material_ids: [m] int32, the material of each triangle.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    material_ids: np.ndarray
    materials: list[Material] = field(default_factory=lambda: [Material()])
    uv: np.ndarray | None = None
    tangents: np.ndarray | None = None
    colors: np.ndarray | None = None


def read_place(folder: Path) -> tuple[np.ndarray, float] | None:
    """The point [3] of the data that is the origin of a folder's assets, and the assets' units for one of the data's; None
    where no file says it. Raises InputError where the file is damaged."""
    if not (folder / ORIGIN).is_file():
        return None
    try:
        content = read_json(folder / ORIGIN, "origin")
        origin, scale = np.array(content["origin"], np.float64), float(content.get("scale", 1.0))
    except (ValueError, TypeError, KeyError, OverflowError):
        origin, scale = np.zeros(0), 1.0
    if origin.shape != (3,) or not np.isfinite(origin).all() or not 0 < scale < math.inf:
        raise InputError(f"{folder / ORIGIN}: does not hold three numbers as 'origin', and 'scale' above 0; repair it")
    return origin, scale


def write_place(folder: Path, origin: np.ndarray, scale: float = 1.0) -> None:
    """Writes what :func:`read_place` reads; no file where nothing differs from the data."""
    meaning = "divide positions by the scale and add the origin to get those of the data"
    if origin.any() or scale != 1:
        write_json(folder / ORIGIN, {"origin": origin.tolist(), "scale": scale, "meaning": meaning})
    else:
        (folder / ORIGIN).unlink(missing_ok=True)


def check_place(folder: Path, origin: np.ndarray) -> None:
    """Raises InputError where the assets of a folder do not stand in the frame of data whose origin is a point [3] of their
    files, as `export` can place them elsewhere."""
    place, scale = read_place(folder) or (origin, 1.0)
    if scale != 1 or not np.array_equal(place, origin):
        raise InputError(
            f"{folder / ORIGIN}: the asset stands elsewhere than the photos; export one without --pivot, --scale and --height"
        )


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors [..., 3] of length 1; 0 stays 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-30)


def vertex_tangents(vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """[n, 4] float32: MikkTSpace's unit tangents, perpendicular to the normals, and the bitangent's sign, 1 or -1, of the vertices
    as they are indexed; no vertex is split.

    A triangle's tangent is the direction of growing u on it. At each of its vertices it is projected on the plane of
    the vertex normal, normalised and weighted with the corner's angle, the edges projected likewise. The bitangent,
    sign * cross(normal, tangent), points where v shrinks: up in the texture, whose (0, 0) is the top left in glTF.
    Triangles without area in the texture do not count; a vertex with no other triangles gets an arbitrary tangent.

    Args:
        vertices, triangles, normals, uv: [n, 3], [m, 3] counter-clockwise seen from outside, [n, 3] unit, and [n, 2].

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
        sides = [unit(_in_plane(corners[:, (corner + k) % 3] - corners[:, corner], normal)) for k in (1, 2)]
        angle = np.arccos(np.clip((sides[0] * sides[1]).sum(axis=1), -1.0, 1.0))
        share = unit(_in_plane(along_u, normal)) * angle[:, None]
        for axis in range(3):
            sums[:, axis] += np.bincount(vertex, share[:, axis], len(vertices))
        signs += np.bincount(vertex, angle * np.sign(area), len(vertices))

    missing = np.linalg.norm(sums, axis=1) < 1e-12
    sums[missing] = np.eye(3)[np.abs(normals[missing]).argmin(axis=1)]
    tangents = unit(_in_plane(sums, normals))
    return np.column_stack([tangents, np.where(signs < 0, -1.0, 1.0)]).astype(np.float32)


def _in_plane(vectors: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return vectors - normals * (vectors * normals).sum(axis=1, keepdims=True)
