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

from splitnerf.data.normalisation import transform_points
from splitnerf.export.environment import write_environment
from splitnerf.export.glb import write_glb
from splitnerf.export.mesh import write_mesh_ply
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.obj import write_obj
from splitnerf.export.simplify import capped, drop_floaters_and_cavities, is_closed
from splitnerf.export.surface import Surface, surface_materials
from splitnerf.export.textured import textured_asset
from splitnerf.export.usdz import require_usd, write_usdz
from splitnerf.progress import Progress
from splitnerf.render.model import ENVIRONMENT_ROWS, SceneModel
from splitnerf.render.seen import Cameras, seen_vertices

FORMATS = ("glb", "ply", "obj", "usdz")


@dataclass(frozen=True)
class Exported:
    """The result of an export.

    Attributes:
        mesh: The mesh before decimation, in the data's world.
        n_faces: The number of faces of the textured mesh; that of `mesh` where no format has textures.
        watertight: Whether the mesh of `n_faces` is closed.
        n_dropped: The number of removed floating or enclosed components.
    """

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
    """Writes mesh.ply, mesh.glb, mesh.obj, mesh.usdz as requested, environment.exr and environment.hdr.

    All files are in the data's own world frame; GLB, OBJ and USDZ are decimated, textured and y up. The PLY holds the
    extracted mesh with vertex colours. What no photo shows is a cap between its edges.

    Args:
        out: The folder.
        model: The scene.
        box_from_world: [4, 4], see :class:`splitnerf.data.dataset.Dataset`.
        cameras: Those of the photos.
        formats: The names of the formats, out of :data:`FORMATS`.
        resolution, n_faces, texture_size: The sizes of grid, mesh and textures; None for the values of the group
            `export`.

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
            write_mesh_ply(out / "mesh.ply", mesh.vertices, faces, surface_materials(surface, vertices)[0])
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
