"""Textures of an unwrapped mesh from the fields that it approximates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt, zoom
from scipy.spatial import cKDTree

from splitnerf import _core
from splitnerf.data.asset import Asset, Material, unit
from splitnerf.export.surface import Surface, surface_materials, to_level_set
from splitnerf.ops import MeshScene, occlusion_factors

BAND = 1 << 20  # texels rasterised and evaluated at a time
OCCLUSION_SHRINK = 4  # occlusion is baked at a quarter of the size
OCCLUSION_RAYS = 64
MIN_UP = 0.02  # least z of a tangent-space normal


class Texels(NamedTuple):
    """The texels whose centres a triangle covers: `index` [k] (row * size + column), `triangle` [k], and float32
    barycentric `weights` [k, 3]."""

    index: np.ndarray
    triangle: np.ndarray
    weights: np.ndarray

    def interpolate(self, values: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Values [k, c] float32 at the texels, interpolated from per-vertex values [n, c] and not normalised."""
        corners = faces[self.triangle]
        return sum(self.weights[:, i, None] * values[corners[:, i]] for i in range(3))


def rasterise(uv: np.ndarray, faces: np.ndarray, size: int) -> Texels:
    """Finds the triangle under each texel's centre by tracing straight down onto the mesh laid flat."""
    return Texels(*map(np.concatenate, zip(*bands(uv, faces, size))))


def bands(uv: np.ndarray, faces: np.ndarray, size: int) -> Iterator[Texels]:
    """The texels of :func:`rasterise`, some rows of the texture at a time."""
    flat = np.column_stack([uv * size, np.zeros(len(uv))]).astype(np.float32)
    scene = _core.Scene(flat, np.ascontiguousarray(faces, dtype=np.int32))
    rows = max(1, BAND // size)
    for start in range(0, size, rows):
        y, x = np.mgrid[start : min(start + rows, size), 0:size].reshape(2, -1)
        origins = np.column_stack([x + 0.5, y + 0.5, np.ones(len(x))]).astype(np.float32)
        down = np.broadcast_to(np.float32([0, 0, -1]), origins.shape).copy()
        triangle, u, v = scene.trace_closest(origins, down)
        hit = triangle >= 0
        weights = np.column_stack([1 - u - v, u, v])[hit]
        yield Texels(start * size + np.flatnonzero(hit), triangle[hit], weights)


def bake(
    mesh: Asset, surface: Surface, size: int, *, reach: float, offset: float, on_surface: np.ndarray | None = None
) -> tuple[Material, np.ndarray]:
    """The material with its textures, and [size, size] occlusion in [0, 1], 1 = open: the fields at each texel's point, which is
    first moved onto the zero level set along the mesh's normal. Raises RuntimeError where the texture is too small for the mesh, or
    the materials are not finite.

    The texels are evaluated in bands, so that the memory in addition to the maps does not grow with the texture. A
    texel outside the charts has the value of the nearest texel inside.

    Args:
        mesh: With uv and tangents; its materials are not read.
        size: The number of texels along an edge.
        reach: The largest distance between mesh and level set, in the surface's units, as `offset`.
        offset: The distance of an occlusion ray's start from the mesh along its normal.
        on_surface: [n] bool, the vertices of the zero level set; texels of faces with others have the mesh's normals,
            and the materials of the nearest one of these vertices. None: all.
    """
    albedo, roughness_metallic, normal = (np.zeros((size * size, width), np.float32) for width in (3, 2, 3))
    covered = np.zeros(size * size, bool)
    on_surface = np.ones(len(mesh.vertices), bool) if on_surface is None else on_surface
    known = mesh.vertices[on_surface]
    for texels in bands(mesh.uv, mesh.triangles, size):
        if len(texels.index) == 0:
            continue
        rows, normals = texels.index, texels.interpolate(mesh.normals, mesh.triangles)
        places, smooth = texels.interpolate(mesh.vertices, mesh.triangles), unit(normals)
        points = to_level_set(surface, places, reach, smooth)
        capped = np.flatnonzero(~on_surface[mesh.triangles[texels.triangle]].all(axis=1))
        if len(capped):
            points[capped] = known[cKDTree(known).query(places[capped])[1]]
        albedo[rows], roughness, metallic, fine_normals = surface_materials(surface, points)
        fine_normals[capped] = smooth[capped]
        roughness_metallic[rows] = np.column_stack([roughness, metallic])
        normal[rows] = to_tangent_space(fine_normals, normals, texels.interpolate(mesh.tangents, mesh.triangles))
        covered[rows] = True
    if not covered.any():
        raise RuntimeError(f"no texel of {size} x {size} lies in a chart; give a larger texture size")
    maps = (albedo, roughness_metallic, normal)
    row, column = nearest_texels(covered.reshape(size, size)).reshape(2, -1)[:, ~covered].astype(np.int64)
    for values in maps:
        values[~covered] = values[row * size + column]
    albedo, roughness_metallic, normal = (values.reshape(size, size, -1) for values in maps)
    material = Material(
        mesh.name,
        metallic=1.0,
        albedo_texture=albedo,
        roughness_metallic_texture=roughness_metallic,
        normal_texture=normal,
    )
    return material, bake_occlusion(mesh, size, offset)


def nearest_texels(covered: np.ndarray) -> np.ndarray:
    """[2, h, w] int32, row and column of the nearest covered texel [h, w]."""
    return distance_transform_edt(~covered, return_distances=False, return_indices=True)


def bake_occlusion(mesh: Asset, size: int, offset: float) -> np.ndarray:
    """[size, size] share of the cosine-weighted hemisphere that the mesh leaves open, baked at a quarter of the
    size."""
    small = max(1, size // OCCLUSION_SHRINK)
    texels = rasterise(mesh.uv, mesh.triangles, small)
    if len(texels.index) == 0:
        return np.ones((size, size), np.float32)
    points = torch.from_numpy(texels.interpolate(mesh.vertices, mesh.triangles))
    normals = torch.from_numpy(unit(texels.interpolate(mesh.normals, mesh.triangles)))
    open_share, _ = occlusion_factors(
        MeshScene(mesh.vertices, mesh.triangles),
        points,
        normals,
        lobe_dirs=normals,
        roughness=torch.ones(len(points), 1),
        environment=torch.zeros(2, 4, 3),
        n_diffuse_rays=OCCLUSION_RAYS,
        n_specular_rays=1,
        offset=offset,
    )
    values = open_share[:, 0].numpy()[nearest_rows(texels.index, small)]
    return np.clip(zoom(values, size / small, order=1, mode="nearest", grid_mode=True), 0, 1)


def to_tangent_space(world: np.ndarray, normals: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """World normals [n, 3] in the frames (T, sign * cross(N, T), N) of N [n, 3] and T [n, 4], interpolated and not normalised, as
    MikkTSpace's decoder takes them. Normals that face into the interpolated surface are raised above it."""
    tangent = tangents[:, :3]
    bitangent = np.sign(tangents[:, 3:]) * np.cross(normals, tangent)
    # Cramer's rule for x T + y B + z N = world
    columns = np.stack([np.cross(bitangent, normals), np.cross(normals, tangent), np.cross(tangent, bitangent)], axis=1)
    volume = (tangent * columns[:, 0]).sum(axis=1, keepdims=True)
    local = np.einsum("nij,nj->ni", columns, world) * np.where(volume < 0, -1, 1)
    local = np.where(np.abs(volume) > 1e-9, local, [0, 0, 1])
    local = unit(local)
    local[:, 2] = np.maximum(local[:, 2], MIN_UP)
    return unit(local).astype(np.float32)


def nearest_rows(index: np.ndarray, size: int) -> np.ndarray:
    """[size, size] which of the values at texels `index` [k] (row * size + column) each texel has: those of the nearest one, so
    that mip maps show no seams."""
    row_of = np.full(size * size, -1, np.int32)
    row_of[index] = np.arange(len(index), dtype=np.int32)
    row_of = row_of.reshape(size, size)
    return row_of[tuple(nearest_texels(row_of >= 0))]
