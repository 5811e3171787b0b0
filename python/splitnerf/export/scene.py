"""Writes what a trained scene holds as files: the surface as a mesh, textured or not, and the light."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import trimesh
from torch import Tensor

from splitnerf.data.images import linear_to_srgb, to_uint8, write_image
from splitnerf.data.normalisation import transform_points
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.simplify import capped, drop_floaters_and_cavities, is_closed
from splitnerf.export.surface import Surface, surface_materials
from splitnerf.export.textured import textured_asset
from splitnerf.export.writers import require_usd, write_glb, write_obj, write_usdz
from splitnerf.files import atomic_path
from splitnerf.progress import Progress
from splitnerf.render.model import ENVIRONMENT_ROWS, SceneModel
from splitnerf.render.seen import Cameras, seen_vertices

FORMATS = ("glb", "ply", "obj", "usdz")


@dataclass(frozen=True)
class Exported:
    """What was exported: the mesh before decimation, in the data's world; the number of faces of the textured mesh
    (that of `mesh` where no format has textures) and whether it is closed; and the number of floating or enclosed
    components that were removed."""

    mesh: trimesh.Trimesh
    n_faces: int
    watertight: bool
    n_dropped: int


def write_assets(
    out: Path,
    model: SceneModel,
    box_from_world: np.ndarray,
    cameras: Cameras,
    *,
    formats: Sequence[str] = ("glb", "ply"),
    resolution: int | None = None,
    n_faces: int | None = None,
    texture_size: int | None = None,
) -> Exported:
    """Writes mesh.ply, mesh.glb, mesh.obj, mesh.usdz as requested, environment.exr and environment.hdr into a folder.

    All files are in the data's own world frame; GLB, OBJ and USDZ are decimated, textured and y up. The PLY holds the
    extracted mesh with vertex colours. What none of the photos' cameras sees is a cap between its edges.

    Args:
        box_from_world: [4, 4], see :class:`splitnerf.data.dataset.Dataset`.
        formats: Out of :data:`FORMATS`.
        resolution, n_faces, texture_size: The sizes of grid, mesh and textures; None for those of the group `export`.

    Raises:
        EmptyMesh: The surface is empty.
        InputError: A format needs a package that is not installed.
        RuntimeError: A field is not finite.
    """
    c = model.config
    resolution = c.export.resolution if resolution is None else resolution
    n_faces = c.export.faces if n_faces is None else n_faces
    if "usdz" in formats:
        require_usd()
    surface = surface_of(model)
    with Progress(0.0, leave=False, at_once=True) as bar:
        bar.show(0.0, f"export, surface on a grid of {resolution}^3")
        vertices, faces, n_dropped = drop_floaters_and_cavities(*extract_mesh(surface.sdf, c.constants.box, resolution))
        spacing = 2.0 * c.constants.box / (resolution - 1)
        seen = seen_vertices(vertices, faces, cameras, 0.25 * spacing)
        vertices, on_surface = capped(vertices, faces, seen)
        world_from_box = np.linalg.inv(box_from_world)
        mesh = trimesh.Trimesh(transform_points(world_from_box, vertices), faces, process=False)
        exported = Exported(mesh, len(faces), is_closed(faces), n_dropped)
        if "ply" in formats:
            write_mesh_ply(out / "mesh.ply", mesh, surface_materials(surface, vertices)[0])
        if set(formats) - {"ply"}:
            textured = textured_asset(
                "object",
                vertices,
                faces,
                surface,
                n_faces=n_faces,
                texture_size=texture_size or c.export.texture_size,
                spacing=spacing,
                occlusion_offset=c.constants.occlusion_offset,
                on_surface=on_surface,
                tell=lambda share, part: bar.show(0.1 + 0.8 * share, f"export, {part}"),
            )
            bar.show(0.9, "export, files")
            asset = dataclasses.replace(
                textured.asset, vertices=transform_points(world_from_box, textured.asset.vertices)
            )
            if "glb" in formats:
                write_glb(out / "mesh.glb", asset, textured.occlusion)
            if "obj" in formats:
                write_obj(out / "mesh.obj", asset)
            if "usdz" in formats:
                write_usdz(out / "mesh.usdz", asset, textured.occlusion)
            exported = Exported(mesh, len(asset.triangles), textured.watertight, n_dropped)
        write_environment(out, model.light.panorama(ENVIRONMENT_ROWS).cpu().numpy())
    return exported


def write_mesh_ply(path: Path, mesh: trimesh.Trimesh, albedo: np.ndarray | None = None) -> None:
    """Writes a binary PLY atomically; albedo [n, 3], linear in [0, 1], is stored sRGB-encoded in 8 bit, as viewers
    expect."""
    colors = None if albedo is None else to_uint8(linear_to_srgb(albedo))
    coloured = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colors, process=False)
    with atomic_path(path) as temporary:
        temporary.write_bytes(coloured.export(file_type="ply"))


def write_environment(folder: Path, radiance: np.ndarray) -> None:
    """Writes `environment.exr` (half where the range allows, else float) and `environment.hdr`.

    Args:
        folder: The run's folder.
        radiance: [H, W, 3] linear radiance, finite and >= 0, equirectangular: u = 0.5 - atan2(y, x)/(2 pi), v = acos(z)/pi from
            the top.
    """
    half = bool(radiance.max() <= np.finfo(np.float16).max)
    write_image(folder / "environment.exr", radiance, half=half)
    write_image(folder / "environment.hdr", radiance)


def surface_of(model: SceneModel) -> Surface:
    """The scene's fields as functions of points in the internal frame, on the CPU; the model's device evaluates
    them."""

    def from_cpu(field: Callable[[Tensor], Tensor | tuple]) -> Callable[[Tensor], Tensor | tuple]:
        def values_at(points: Tensor) -> Tensor | tuple:
            values = field(points.to(model.device))
            return values.cpu() if isinstance(values, Tensor) else tuple(value.cpu() for value in values)

        return values_at

    def gradient(points: Tensor) -> tuple[Tensor, Tensor]:
        field = model.surface(points)
        return field.sdf, field.gradient

    def materials(points: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        field = model.surface(points)
        material = model.material(*model.head_inputs(points, field.outputs, field.features))
        return (*material, torch.nn.functional.normalize(field.gradient, dim=1))

    return Surface(*map(from_cpu, (model.sdf_field.sdf, gradient, materials)))
