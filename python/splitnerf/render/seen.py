"""Which parts of a mesh the photos show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
import trimesh
from torch import Tensor

from splitnerf.data.dataset import Dataset
from splitnerf.ops import MeshScene
from splitnerf.render.rays import projected

GRAZING = 0.05  # cosine between the surface's normal and a line of sight below which a photo does not show it


class Cameras(NamedTuple):
    """The cameras of photos.

    Attributes:
        poses: [n, 4, 4] float32 camera-to-world, OpenGL axes, scene units.
        intrinsics: [n, 4] float32 fx, fy, cx, cy, pixels.
        sizes: [n, 2] int64 height and width, pixels.
    """

    poses: Tensor
    intrinsics: Tensor
    sizes: Tensor

    @classmethod
    def of(cls, photos: Dataset) -> Cameras:
        """The cameras of a data set."""
        poses, intrinsics = (torch.from_numpy(x).float() for x in (photos.poses, photos.intrinsics))
        return cls(poses, intrinsics, torch.from_numpy(photos.sizes).long())


def seen_vertices(vertices: np.ndarray, faces: np.ndarray, cameras: Cameras, offset: float) -> np.ndarray:
    """[n] bool, whether a photo shows a vertex: within its frame, from the front, with nothing of the mesh in between.

    Args:
        vertices, faces: The mesh, [n, 3] float32 scene units, and [m, 3], outward.
        cameras: The photos' cameras.
        offset: How far in front of the surface a line of sight begins, scene units.
    """
    scene = MeshScene(vertices, faces)
    normals = np.asarray(trimesh.Trimesh(vertices, faces, process=False).vertex_normals, np.float32)
    starts, seen = vertices + offset * normals, np.zeros(len(vertices), bool)
    for pose, lens, size in zip(*cameras):
        places = torch.from_numpy(starts[~seen]) - pose[:3, 3]
        in_camera = places @ pose[:3, :3]
        at = projected(in_camera, lens)
        in_frame = (in_camera[:, 2] < 0) & (at > 0).all(1) & (at < size.flip(0)).all(1)
        to_camera = -places / places.norm(dim=1, keepdim=True)
        in_front = (to_camera.numpy() * normals[~seen]).sum(1) > GRAZING
        rows = np.flatnonzero(in_frame.numpy() & in_front)
        candidates = np.flatnonzero(~seen)[rows]
        hit, _, _ = scene.trace_closest(starts[candidates], to_camera.numpy()[rows])
        seen[candidates[hit < 0]] = True
    return majority(faces, seen)


def majority(faces: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """[n] bool, the majority over the corners of a vertex's faces, because a ray in a million slips between two
    faces."""
    votes = np.bincount(faces.ravel(), 2.0 * flags[faces].sum(1).repeat(3) - 3.0, minlength=len(flags))
    return np.where(votes == 0, flags, votes > 0)
