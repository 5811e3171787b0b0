"""Makes a small textured asset from a full-resolution mesh and the fields that it was extracted from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from splitnerf.data.asset import Asset, Material
from splitnerf.data.tangents import vertex_tangents
from splitnerf.export.bake import UnwrappedMesh, bake
from splitnerf.export.simplify import decimate, is_closed
from splitnerf.export.surface import Surface, surface_normals, to_level_set
from splitnerf.export.unwrap import unwrap

MIN_AGREEMENT = 0.2  # least cosine between the field's and the faces' normal; below it the faces' normal is used


@dataclass(frozen=True)
class TexturedAsset:
    """A mesh with baked textures.

    Attributes:
        asset: The mesh in the surface's frame, with albedo, roughness-metallic and normal textures.
        occlusion: [h, w] texture in [0, 1], 1 = open.
        watertight: Whether the mesh was closed before the charts cut it.
    """

    asset: Asset
    occlusion: np.ndarray
    watertight: bool


def textured_asset(
    name: str,
    vertices: np.ndarray,
    faces: np.ndarray,
    surface: Surface,
    *,
    n_faces: int,
    texture_size: int,
    spacing: float,
    occlusion_offset: float,
    on_surface: np.ndarray | None = None,
    tell: Callable[[float, str], None] = lambda share, what: None,
) -> TexturedAsset:
    """Decimates a mesh, moves its vertices back onto the surface, unwraps it and bakes its textures.

    Args:
        name: The name of the asset.
        vertices, faces: The mesh, [n, 3] and [m, 3], in the surface's frame.
        surface: The fields.
        n_faces: The number of faces to keep; 0 keeps all.
        texture_size: The number of texels along an edge.
        spacing: The spacing of the grid that the mesh was extracted from, in the surface's units; vertices and texels
            move by at most twice as much.
        occlusion_offset: The distance of an occlusion ray's start from the mesh, in the surface's units.
        on_surface: [n] bool, the vertices that are of the zero level set. The others, a cap's, stay where they are,
            with the mesh's normals. None: all.
        tell: Called before each part with the share of the time that is used by then, about, and the part's name.

    Raises:
        RuntimeError: The texture is too small, or a field is not finite.
    """
    reach = 2.0 * spacing
    tell(0.0, "fewer faces")
    on_surface = np.ones(len(vertices), bool) if on_surface is None else on_surface
    nearest = cKDTree(vertices)
    vertices, faces = decimate(vertices, faces, n_faces)
    on_surface = on_surface[nearest.query(vertices)[1]]
    vertices = np.where(on_surface[:, None], to_level_set(surface, vertices, reach), vertices)
    normals = vertex_normals(surface, vertices, faces, on_surface)
    watertight = is_closed(faces)
    tell(0.2, "texture coordinates")
    origins, faces, uv = unwrap(vertices, faces, texture_size)
    vertices, normals, on_surface = vertices[origins], normals[origins], on_surface[origins]
    mesh = UnwrappedMesh(vertices, faces, normals, vertex_tangents(vertices, faces, normals, uv), uv)
    tell(0.7, "textures")
    maps = bake(mesh, surface, texture_size, reach=reach, offset=occlusion_offset, on_surface=on_surface)
    material = Material(
        name=name,
        roughness=1.0,
        metallic=1.0,
        albedo_texture=maps.albedo,
        roughness_metallic_texture=maps.roughness_metallic,
        normal_texture=maps.normal,
    )
    asset = Asset(
        name=name,
        vertices=vertices,
        triangles=faces,
        normals=normals,
        material_ids=np.zeros(len(faces), np.int32),
        materials=[material],
        uv=uv,
        tangents=mesh.tangents,
    )
    return TexturedAsset(asset, maps.occlusion, watertight)


def vertex_normals(
    surface: Surface, vertices: np.ndarray, faces: np.ndarray, on_surface: np.ndarray | bool = True
) -> np.ndarray:
    """[n, 3] float32 unit gradients of the field at the vertices; the faces' normals where the two disagree, and where
    vertices are not on its level set."""
    fine = surface_normals(surface, vertices)
    coarse = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals, dtype=np.float32)
    agree = ((fine * coarse).sum(axis=1, keepdims=True) > MIN_AGREEMENT) & np.reshape(on_surface, (-1, 1))
    known = np.linalg.norm(coarse, axis=1, keepdims=True) > 0.5
    fallback = np.where(known, coarse, np.float32([0, 0, 1]))
    return np.where(agree | (~known & (np.linalg.norm(fine, axis=1, keepdims=True) > 0.5)), fine, fallback)
