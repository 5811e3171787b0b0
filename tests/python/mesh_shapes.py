"""Meshes, and what their vertices see, for the tests of occlusion."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from op_checks import generator
from splitnerf import _core
from splitnerf.config import Config
from splitnerf.fields import VisibilityBits
from splitnerf.ops import MeshScene
from splitnerf.ops.visibility import VisibilityCache
from splitnerf.render import model as rendering
from splitnerf.render.model import SceneModel
from torch.nn import functional as F

OFFSET = 0.0125


def lattice(n: int) -> torch.Tensor:
    return torch.from_numpy(_core.fibonacci_sphere(n)).float()


def scene_of(mesh: trimesh.Trimesh) -> MeshScene:
    return MeshScene(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def corners(mesh: trimesh.Trimesh) -> tuple[torch.Tensor, torch.Tensor]:
    """The vertices of a mesh and their normals."""
    return tuple(torch.tensor(np.asarray(x), dtype=torch.float32) for x in (mesh.vertices, mesh.vertex_normals))


def bits_of(mesh: trimesh.Trimesh, directions: torch.Tensor, **options: object) -> VisibilityBits:
    """The visibility of a mesh in some directions."""
    options = {"offset": OFFSET, "n_channels": 3, "indirect": True} | options
    faces = torch.tensor(np.asarray(mesh.faces))
    return VisibilityBits.trace(scene_of(mesh), corners(mesh)[0], faces, directions, **options)


def refresh(bits: VisibilityBits, light: Callable, materials: Callable, shade: Callable) -> None:
    """A bounce of indirect light as a model computes it, of other materials and shading; for `shade` see
    :func:`splitnerf.ops.shading.split_sum_shade`."""
    scene = SimpleNamespace(config=Config(), bits=bits, cells=SimpleNamespace(turns=None), materials_at=materials)
    scene.device = torch.device("cpu")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rendering, "split_sum_shade", shade)
        SceneModel.refresh_indirect(scene, light)


def traced(model: SceneModel, mesh: trimesh.Trimesh) -> VisibilityBits:
    """The visibility of a mesh towards the middles of the model's cells."""
    vertices, faces = corners(mesh)[0], torch.tensor(np.asarray(mesh.faces))
    return model.trace(scene_of(mesh), vertices, faces, model.cells.centres)


def cache_of(mesh: trimesh.Trimesh, n: int = 256, **options: object) -> VisibilityCache:
    return VisibilityCache.trace(scene_of(mesh), *corners(mesh), mesh.area, lattice(n), **{"offset": OFFSET} | options)


def grid_mesh(size: float, cells: int, z: float = 0.0) -> trimesh.Trimesh:
    """A square in the plane z, facing up."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, cells + 1)] * 2, indexing="ij")
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    quads = np.stack([first, first + cells + 1, first + cells + 2, first + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return trimesh.Trimesh(np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1), faces, process=False)


def bowl(subdivisions: int, radius: float = 1.0) -> trimesh.Trimesh:
    """The lower half of a sphere, faces inwards."""
    ball = trimesh.creation.icosphere(subdivisions, radius)
    return trimesh.Trimesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] < 0][:, ::-1])


def between(mesh: trimesh.Trimesh, n: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Random points on the faces and their interpolated normals."""
    vertices, normals = corners(mesh)
    faces = torch.tensor(np.asarray(mesh.faces))[torch.randint(len(mesh.faces), (n,), generator=generator(1))]
    share = torch.rand(n, 3, 1, generator=generator(2))
    share = share / share.sum(1, keepdim=True)
    return (vertices[faces] * share).sum(1), F.normalize((normals[faces] * share).sum(1), dim=1)
