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
    """The cameras of photos: `poses` [n, 4, 4] float32 camera-to-world, OpenGL axes, scene units; `intrinsics` [n, 4] float32 fx,
    fy, cx, cy, and `sizes` [n, 2] int64 height and width, in pixels."""

    poses: Tensor
    intrinsics: Tensor
    sizes: Tensor

    @classmethod
    def of(cls, photos: Dataset) -> Cameras:
        """The cameras of a data set."""
        poses, intrinsics = (torch.from_numpy(x).float() for x in (photos.poses, photos.intrinsics))
        return cls(poses, intrinsics, torch.from_numpy(photos.sizes).long())


class InView(NamedTuple):
    """The points that a photo shows."""

    rows: Tensor  # [r] int64 their numbers
    at: Tensor  # [r, 2] float32 their image points, pixels
    cosine: Tensor  # [r] float32 of the surface's normal and the line of sight
    distance: Tensor  # [r] float32 from the camera


def in_view(
    scene: MeshScene,
    points: Tensor,
    normals: Tensor,
    camera: tuple[Tensor, Tensor, Tensor],
    offset: float,
    least: float,
) -> InView:
    """The points of a surface that a photo shows: within its frame, from the front, with nothing of the mesh in between.

    Args:
        points, normals: [n, 3] float32, the normals of unit length and outward.
        camera: Pose [4, 4], intrinsics [4] and size [2], as :class:`Cameras` has them.
        offset: How far in front of the surface a line of sight begins.
        least: Cosine of the normal and a line of sight below which the photo does not show the point.
    """
    pose, lens, size = camera
    to_camera = pose[:3, 3] - points
    distance = to_camera.norm(dim=1)
    cosine = (to_camera * normals).sum(1) / distance
    in_camera = -to_camera @ pose[:3, :3]
    at = projected(in_camera, lens)
    in_frame = (in_camera[:, 2] < 0) & (at > 0).all(1) & (at < size.flip(0)).all(1)
    rows = torch.nonzero(in_frame & (cosine > least))[:, 0]
    start = offset * normals[rows]  # off the surface: the ray alone, as the photo shows the point itself
    rows = rows[scene.is_open(points[rows] + start, to_camera[rows] - start, 1.0)]
    return InView(rows, at[rows], cosine[rows], distance[rows])


def seen_vertices(vertices: np.ndarray, faces: np.ndarray, cameras: Cameras, offset: float) -> np.ndarray:
    """[n] bool, whether a photo shows a vertex, see :func:`in_view`, of a mesh: vertices [n, 3] float32 scene units, faces [m, 3],
    outward. `offset` is how far in front of the surface a line of sight begins, scene units."""
    scene, points = MeshScene(vertices, faces), torch.from_numpy(vertices)
    normals = torch.tensor(trimesh.Trimesh(vertices, faces, process=False).vertex_normals, dtype=torch.float32)
    seen = torch.zeros(len(vertices), dtype=torch.bool)
    for camera in zip(*cameras):
        rest = torch.nonzero(~seen)[:, 0]
        seen[rest[in_view(scene, points[rest], normals[rest], camera, offset, GRAZING).rows]] = True
    return majority(faces, seen.numpy())


def majority(faces: np.ndarray, flags: np.ndarray) -> np.ndarray:
    """[n] bool, the majority over the corners of a vertex's faces, because a ray in a million slips between two faces."""
    votes = np.bincount(faces.ravel(), 2.0 * flags[faces].sum(1).repeat(3) - 3.0, minlength=len(flags))
    return np.where(votes == 0, flags, votes > 0)
