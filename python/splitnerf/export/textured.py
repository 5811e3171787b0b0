"""Makes a small textured asset from a full-resolution mesh and the fields that it was extracted from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
import trimesh
import xatlas
from scipy.spatial import cKDTree
from torch.nn import functional as F

from splitnerf.data.asset import Asset, vertex_tangents
from splitnerf.devices import refuse_one_processor
from splitnerf.export.bake import bake
from splitnerf.export.simplify import decimate, is_closed
from splitnerf.export.surface import CHUNK, Surface, to_level_set

PADDING = 4  # texels between charts as packed, 2 at least in the texture: the packed area is up to twice as large
CHARTS = 64  # no chart has more than 1 / CHARTS of the surface: its time rises with the square of its faces
MIN_AGREEMENT = 0.2  # least cosine between the field's and the faces' normal; below it the faces' normal is used


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
) -> tuple[Asset, np.ndarray, bool]:
    """Decimates a mesh, moves its vertices back onto the surface, unwraps it and bakes its textures: the asset in the surface's
    frame, its occlusion [h, w] in [0, 1], 1 = open, and whether the mesh was closed before the charts cut it. Raises RuntimeError
    where the texture is too small, or a field is not finite.

    Args:
        vertices, faces: The mesh, [n, 3] and [m, 3], in the surface's frame.
        n_faces: The number of faces to keep; 0 keeps all.
        texture_size: The number of texels along an edge.
        spacing: The spacing of the grid that the mesh was extracted from; vertices and texels move by at most twice as
            much.
        occlusion_offset: The distance of an occlusion ray's start from the mesh, in the surface's units, as `spacing`.
        on_surface: [n] bool, the vertices that are of the zero level set. The others, a cap's, stay where they are,
            with the mesh's normals. None: all.
        tell: Called before each part with the share of the time that is used by then, about, and the part's name.
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
    tangents, of_one = vertex_tangents(vertices, faces, normals, uv), np.zeros(len(faces), np.int32)
    asset = Asset(name, vertices, faces, normals, of_one, uv=uv, tangents=tangents)
    tell(0.7, "textures")
    material, occlusion = bake(
        asset, surface, texture_size, reach=reach, offset=occlusion_offset, on_surface=on_surface
    )
    return replace(asset, materials=[material]), occlusion, watertight


def vertex_normals(
    surface: Surface, vertices: np.ndarray, faces: np.ndarray, on_surface: np.ndarray | bool = True
) -> np.ndarray:
    """[n, 3] float32 unit gradients of the field at the vertices; the faces' normals where the two disagree, and where
    vertices are not on its level set."""
    with torch.no_grad():
        chunks = torch.from_numpy(vertices).split(CHUNK)
        fine = torch.cat([F.normalize(surface.gradient(chunk)[1], dim=1) for chunk in chunks]).numpy()
    coarse = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals, dtype=np.float32)
    agree = ((fine * coarse).sum(axis=1, keepdims=True) > MIN_AGREEMENT) & np.reshape(on_surface, (-1, 1))
    known = np.linalg.norm(coarse, axis=1, keepdims=True) > 0.5
    fallback = np.where(known, coarse, np.float32([0, 0, 1]))
    return np.where(agree | (~known & (np.linalg.norm(fine, axis=1, keepdims=True) > 0.5)), fine, fallback)


def unwrap(vertices: np.ndarray, faces: np.ndarray, texture_size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cuts a mesh, vertices [n, 3] float32 and faces [m, 3] int32, into charts and packs them into one square texture of so many
    texels along an edge, without overlap. Raises InputError where the machine has one processor.

    Returns:
        origins [k] int64, the vertex that each new one is a copy of; faces [m, 3] int32 of the new vertices; and uv [k, 2] float32
        in [0, 1], (0, 0) the top left corner.
    """
    refuse_one_processor()
    atlas = xatlas.Atlas()
    atlas.add_mesh(vertices, faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution = texture_size
    options.padding = PADDING
    options.bilinear = True
    charts = xatlas.ChartOptions()
    charts.max_chart_area = float(trimesh.Trimesh(vertices, faces, process=False).area) / CHARTS
    atlas.generate(charts, options)
    origins, new_faces, uv = atlas[0]
    texels = uv * [atlas.width, atlas.height]
    uv = texels / max(atlas.width, atlas.height)
    return origins.astype(np.int64), new_faces.astype(np.int32), uv.astype(np.float32)
