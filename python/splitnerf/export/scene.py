"""Writes what a trained scene holds as files: the surface as a mesh, textured or not, and the light."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import trimesh
from torch import Tensor

from splitnerf.data.asset import Asset
from splitnerf.data.images import linear_to_srgb, to_uint8, write_image
from splitnerf.data.normalisation import transform_plane, transform_points
from splitnerf.data.truth import read_mesh
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.simplify import capped, drop_floaters_and_cavities, drop_unseen, is_closed
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
    (that of `mesh` where no format has textures) and whether it is closed; the number of floating, enclosed or unseen components
    that were removed; and the point [3] of the data's world that is the origin of the files, and their units for one of it."""

    mesh: trimesh.Trimesh
    n_faces: int
    watertight: bool
    n_dropped: int
    origin: np.ndarray
    scale: float


@dataclass(frozen=True)
class Placing:
    """Where files have the asset: its foot, the middle of its lowest height, at the origin, or as the data have it; and their
    units for one of the data's, or those of its whole height."""

    foot: bool = False
    scale: float = 1.0
    height: float | None = None

    def of(self, vertices: np.ndarray) -> tuple[np.ndarray, float]:
        """The origin [3] and the scale for an asset with vertices [n, 3] in the data's world."""
        low, high = (end.astype(np.float64) for end in (vertices.min(axis=0), vertices.max(axis=0)))
        origin = np.array([*(0.5 * (low + high))[:2], low[2]]) if self.foot else np.zeros(3)
        return origin, self.scale if self.height is None else self.height / max(high[2] - low[2], 1e-30)


def write_textured(
    out: Path, formats: Sequence[str], asset: Asset, occlusion: np.ndarray, placing: Placing
) -> tuple[np.ndarray, float]:
    """Writes mesh.glb, mesh.obj, mesh.usdz as requested; returns the origin and the scale of the files."""
    origin, scale = placing.of(asset.vertices)
    if placing != Placing():
        asset = dataclasses.replace(asset, vertices=((asset.vertices - origin) * scale).astype(np.float32))
    if "glb" in formats:
        write_glb(out / "mesh.glb", asset, occlusion)
    if "obj" in formats:
        write_obj(out / "mesh.obj", asset)
    if "usdz" in formats:
        write_usdz(out / "mesh.usdz", asset, occlusion)
    return origin, scale


def write_delivered(
    run: Path, out: Path, formats: Sequence[str], asset: Asset, occlusion: np.ndarray, placing: Placing
) -> Exported:
    """Writes what :func:`write_assets` writes of the asset and the light that a run's refinement delivered. Raises InputError where
    the run's mesh.ply cannot be read, or a format needs a package that is not installed."""
    if "usdz" in formats:
        require_usd()
    origin, scale = write_textured(out, formats, asset, occlusion, placing)
    mesh = read_mesh(run / "mesh.ply")
    if "ply" in formats:
        placed = mesh.copy().apply_translation(-origin).apply_scale(scale)
        with atomic_path(out / "mesh.ply") as temporary:
            temporary.write_bytes(placed.export(file_type="ply"))
    for name in ("environment.exr", "environment.hdr"):
        with atomic_path(out / name) as temporary:
            shutil.copyfile(run / name, temporary)
    _, corners = np.unique(asset.vertices, axis=0, return_inverse=True)
    closed = is_closed(corners.reshape(-1)[asset.triangles])
    return Exported(mesh, len(asset.triangles), closed, 0, origin, scale)


def write_assets(
    out: Path,
    model: SceneModel,
    box_from_world: np.ndarray,
    cameras: Cameras,
    *,
    formats: Sequence[str] = ("glb", "ply"),
    name: str = "object",
    placing: Placing = Placing(),
    ground: np.ndarray | None = None,
) -> Exported:
    """Writes mesh.ply, mesh.glb, mesh.obj, mesh.usdz as requested, environment.exr and environment.hdr into a folder. Raises
    EmptyMesh where the surface is empty, InputError where a format needs a package that is not installed, and RuntimeError where a
    field is not finite.

    The sizes of grid, mesh and textures are those of the model's settings, group `export`. All files are in the data's
    own world frame, or as `placing` says; the light does not change. GLB, OBJ and USDZ are decimated, textured and y
    up. The PLY holds the extracted mesh with vertex colours. What none of the photos' cameras sees is a cap between its
    edges.

    Args:
        box_from_world: [4, 4], see :class:`splitnerf.data.dataset.Dataset`.
        formats: Out of :data:`FORMATS`.
        name: What the mesh, its material and its images are called.
        ground: See :class:`splitnerf.data.dataset.Dataset`; the asset ends there.
    """
    c = model.config
    resolution = c.export.resolution
    if "usdz" in formats:
        require_usd()
    surface = surface_of(model)
    if ground is not None:
        surface = above(surface, transform_plane(box_from_world, ground))
    with Progress(0.0, leave=False, at_once=True) as bar:
        bar.show(0.0, f"export, surface on a grid of {resolution}^3")
        vertices, faces, n_dropped = drop_floaters_and_cavities(*extract_mesh(surface.sdf, c.constants.box, resolution))
        spacing = 2.0 * c.constants.box / (resolution - 1)
        seen = seen_vertices(vertices, faces, cameras, 0.25 * spacing)
        vertices, faces, seen, n_unseen = drop_unseen(vertices, faces, seen)
        vertices, faces, on_surface = capped(vertices, faces, seen)
        world_from_box = np.linalg.inv(box_from_world)
        mesh = trimesh.Trimesh(transform_points(world_from_box, vertices), faces, process=False)
        n_textured, watertight, (origin, scale) = len(faces), is_closed(faces), placing.of(mesh.vertices)
        if set(formats) - {"ply"}:
            asset, occlusion, watertight = textured_asset(
                name,
                vertices,
                faces,
                surface,
                n_faces=c.export.faces,
                texture_size=c.export.texture_size,
                spacing=spacing,
                occlusion_offset=c.constants.occlusion_offset,
                on_surface=on_surface,
                tell=lambda share, part: bar.show(0.1 + 0.8 * share, f"export, {part}"),
            )
            bar.show(0.9, "export, files")
            asset = dataclasses.replace(asset, vertices=transform_points(world_from_box, asset.vertices))
            origin, scale = write_textured(out, formats, asset, occlusion, placing)
            n_textured = len(asset.triangles)
        if "ply" in formats:
            placed = trimesh.Trimesh((mesh.vertices - origin) * scale, faces, process=False)
            write_mesh_ply(out / "mesh.ply", placed, surface_materials(surface, vertices)[0])
        write_environment(out, model.light.panorama(ENVIRONMENT_ROWS).cpu().numpy())
    return Exported(mesh, n_textured, watertight, n_dropped + n_unseen, origin, scale)


def write_mesh_ply(path: Path, mesh: trimesh.Trimesh, albedo: np.ndarray | None = None) -> None:
    """Writes a binary PLY atomically; albedo [n, 3], linear in [0, 1], is stored sRGB-encoded in 8 bit, as viewers
    expect."""
    colors = None if albedo is None else to_uint8(linear_to_srgb(albedo))
    coloured = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colors, process=False)
    with atomic_path(path) as temporary:
        temporary.write_bytes(coloured.export(file_type="ply"))


def write_environment(folder: Path, radiance: np.ndarray) -> None:
    """Writes `environment.exr` (half where the range allows, else float) and `environment.hdr` of linear radiance [H, W, 3],
    finite and >= 0, equirectangular: u = 0.5 - atan2(y, x)/(2 pi), v = acos(z)/pi from the top."""
    half = bool(radiance.max() <= np.finfo(np.float16).max)
    write_image(folder / "environment.exr", radiance, half=half)
    write_image(folder / "environment.hdr", radiance)


def above(surface: Surface, plane: np.ndarray) -> Surface:
    """A surface cut off at a plane [4], in its own frame; the cut faces down, its materials are those that the fields have there."""
    normal, offset = torch.tensor(plane[:3]).float(), float(plane[3])

    def gradient(points: Tensor) -> tuple[Tensor, Tensor]:
        depth, (sdf, slope) = offset - points @ normal, surface.gradient(points)
        return torch.maximum(sdf, depth), torch.where((depth > sdf)[:, None], -normal, slope)

    return dataclasses.replace(
        surface, sdf=lambda points: torch.maximum(surface.sdf(points), offset - points @ normal), gradient=gradient
    )


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
