"""The asset of a run in training: its surface in few triangles, with materials at their corners."""

from __future__ import annotations

import numpy as np
import torch
from splitnerf.data.asset import Asset, Material
from splitnerf.data.normalisation import transform_points
from splitnerf.export.meshing import extract_mesh
from splitnerf.export.scene import surface_of
from splitnerf.export.surface import surface_materials
from splitnerf.render.model import SceneModel

RESOLUTION = 128  # nodes along an edge of the box
LEVELS = 64  # of roughness and metallic
LINEAR = 9729  # glTF's filter; smaller pictures of the texture would mix its far ends


@torch.no_grad()
def training_asset(model: SceneModel, world_from_box: np.ndarray, resolution: int = RESOLUTION) -> Asset:
    """The surface of a scene in the data's world, z up.

    Albedo is a colour at each vertex. Roughness and metallic are its texture coordinates: the texture holds at each
    place the pair that stands for it, so that they vary linearly over a triangle as the colour does.

    Args:
        model: The scene; it is not changed.
        world_from_box: [4, 4], see :class:`splitnerf.data.dataset.Dataset`.
        resolution: Nodes along an edge of the box.

    Raises:
        EmptyMesh: The surface is empty.
        RuntimeError: A field is not finite.
    """
    surface = surface_of(model)
    vertices, faces = extract_mesh(surface.sdf, model.config.constants.box, resolution)
    albedo, roughness, metallic, normals = surface_materials(surface, vertices)
    pairs = np.clip(np.column_stack([roughness, metallic]), 0, 1)
    steps = np.linspace(0, 1, LEVELS, dtype=np.float32)
    all_pairs = np.stack(np.meshgrid(steps, steps), axis=2)  # roughness grows to the right, metallic downwards
    return Asset(
        name="growing",
        vertices=transform_points(world_from_box, vertices),
        triangles=faces,
        normals=normals,
        material_ids=np.zeros(len(faces), np.int32),
        colors=np.clip(albedo, 0, 1),
        uv=((pairs * (LEVELS - 1) + 0.5) / LEVELS).astype(np.float32),
        materials=[Material(metallic=1.0, roughness_metallic_texture=all_pairs)],
    )
