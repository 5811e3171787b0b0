"""What a run leaves for its user: previews, meshes, the environment, the evaluation and the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
import trimesh

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, over_background, write_image
from splitnerf.data.truth import load_scene_truth, load_view_truths
from splitnerf.evaluate.lpips import Distance
from splitnerf.evaluate.protocol import evaluate_maps
from splitnerf.export.environment import write_environment
from splitnerf.export.mesh import write_mesh_glb, write_mesh_ply
from splitnerf.export.meshing import drop_floaters, extract_mesh
from splitnerf.fields.sdf import unit_normals
from splitnerf.ops import fibonacci_directions, prefilter_light
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import render_view

REPORT_ROUGHNESS = (0.0, 0.25, 0.5, 1.0)


def render_maps(model: SceneModel, grid: OccupancyGrid, dataset: Dataset, index: int) -> dict[str, np.ndarray]:
    """All maps of one view as float32 arrays, see :func:`splitnerf.render.renderer.render_view`."""
    maps = render_view(
        model, grid.cells, torch.from_numpy(dataset.poses[index]), torch.from_numpy(dataset.intrinsics[index]),
        dataset.height, dataset.width,
    )  # fmt: skip
    return {name: value.numpy() for name, value in maps.items()}


def write_preview(run: Path, model: SceneModel, grid: OccupancyGrid, dataset: Dataset, step: int) -> None:
    """``previews/step_NNNNNN.png``: the first view's photo, render, albedo and normals side by side."""
    maps = render_maps(model, grid, dataset, 0)
    photo = over_background(dataset.images[0, ..., :3], dataset.images[0, ..., 3])
    panels = [photo] + [
        over_background(rgb, maps["alpha"])
        for rgb in (maps["rgb"], linear_to_srgb(maps["albedo"]), 0.5 * maps["normal"] + 0.5)
    ]
    write_image(run / "previews" / f"step_{step:06d}.png", np.concatenate(panels, axis=1).astype(np.float32))


def write_assets(run: Path, model: SceneModel, dataset: Dataset) -> trimesh.Trimesh:
    """Writes mesh.ply, mesh.glb, environment.exr and environment.hdr, in the data's own world frame.

    Returns:
        The mesh.

    Raises:
        EmptyMesh: The surface is empty.
    """
    c = model.config
    vertices, faces = drop_floaters(*extract_mesh(model.sdf_field.sdf, c.box, c.export_resolution))
    albedo, roughness, metallic, normals = vertex_materials(model, vertices)
    world = dataset.transform_to_world(vertices)
    write_mesh_ply(run / "mesh.ply", world, faces, albedo)
    write_mesh_glb(run / "mesh.glb", world, faces, normals, albedo, float(roughness.mean()), float(metallic.mean()))
    write_environment(run, model.light.panorama(c.export_environment_height).numpy())
    return trimesh.Trimesh(world, faces, process=False)


@torch.no_grad()
def vertex_materials(model: SceneModel, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """albedo [n, 3] linear, roughness [n], metallic [n] and normals [n, 3] at points of the internal frame."""
    rows = []
    for points in torch.from_numpy(vertices).split(1 << 15):
        field = model.surface(points)
        albedo, roughness, metallic = model.material(model.head_inputs(points, field.outputs, field.features))
        rows.append(torch.cat([albedo, roughness, metallic, unit_normals(field.gradient)], dim=1))
    table = torch.cat(rows).numpy()
    return table[:, :3], table[:, 3], table[:, 4], table[:, 5:]


@torch.no_grad()
def light_panels(model: SceneModel, height: int = 64, n_samples: int = 32768) -> list[dict]:
    """g(w, rho) beside its Monte Carlo estimate from g(w, 0), as [height, 2 height, 3] maps."""
    from splitnerf.fields.light import panorama_directions

    sources = fibonacci_directions(n_samples, torch.Generator().manual_seed(0))
    light = torch.cat([model.light(d, torch.zeros(len(d), 1)) for d in sources.split(1 << 15)])
    queries = panorama_directions(height).reshape(-1, 3)
    panels = []
    for roughness in REPORT_ROUGHNESS:
        g = model.light.panorama(height, roughness)
        g_bar = g
        if roughness > 0:
            g_bar = prefilter_light(queries, torch.full((len(queries), 1), roughness), sources, light).view_as(g)
        panels.append({"roughness": roughness, "g": g.numpy(), "g_bar": g_bar.numpy()})
    return panels


def evaluate_scene(
    model: SceneModel,
    grid: OccupancyGrid,
    test: Dataset,
    mesh: trimesh.Trimesh | None,
    seconds: float,
    relight: dict | None = None,
    distance: Distance | None = None,
) -> tuple[dict, list[dict[str, np.ndarray]]]:
    """Renders all test views and scores them; see :func:`splitnerf.evaluate.protocol.evaluate_maps`.

    Returns:
        The contents of evaluation.json and the rendered maps.
    """
    predictions = [render_maps(model, grid, test, i) for i in range(len(test))]
    truth = load_scene_truth(test.root)
    light = model.light.panorama(model.config.export_environment_height).numpy()
    result = evaluate_maps(
        predictions, test, load_view_truths(test), light, truth.light, mesh, truth.mesh, round(seconds, 1),
        relight=relight, distance=distance,
    )  # fmt: skip
    return result, predictions
