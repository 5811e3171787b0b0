"""Triangle meshes of the zero level set."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from skimage.measure import marching_cubes
from torch import Tensor

BLOCK = 8
LIPSCHITZ = 1.5
MIN_COMPONENT = 0.01  # of the faces of the largest one


class EmptyMesh(RuntimeError):
    """The field has no zero level set inside the box."""


@torch.no_grad()
def extract_mesh(sdf: Callable[[Tensor], Tensor], box: float, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Marching cubes over [-box, box]^3, closed at the border, with outward faces.

    The field is evaluated in blocks of 8^3 nodes; a block whose centre is farther from zero than
    1.5 times its half diagonal holds no surface and takes its centre's value.

    Args:
        sdf: [n, 3] -> [n], negative inside.
        box: Half size of the cube, scene units.
        resolution: Nodes along an edge, rounded up to a multiple of 8.

    Returns:
        vertices [n, 3] float32 and faces [m, 3] int32.

    Raises:
        EmptyMesh: Nothing is inside.
    """
    n_blocks = math.ceil(resolution / BLOCK)
    n = n_blocks * BLOCK
    spacing = 2.0 * box / (n - 1)
    axis = torch.arange(n) * spacing - box
    centre = axis.view(n_blocks, BLOCK).mean(1)
    centres = torch.stack(torch.meshgrid(centre, centre, centre, indexing="ij"), -1).reshape(-1, 3)
    coarse = torch.cat([sdf(chunk) for chunk in centres.split(1 << 16)])
    half_diagonal = math.sqrt(3.0) * 0.5 * BLOCK * spacing
    near = (coarse.abs() < LIPSCHITZ * half_diagonal).nonzero().squeeze(1)
    values = coarse.view(-1, 1).expand(-1, BLOCK**3).clone()
    offset = (torch.arange(BLOCK) - 0.5 * (BLOCK - 1)) * spacing
    offsets = torch.stack(torch.meshgrid(offset, offset, offset, indexing="ij"), -1).reshape(-1, 3)
    for chunk in near.split(256) if len(near) else ():
        points = centres[chunk][:, None, :] + offsets
        values[chunk] = sdf(points.reshape(-1, 3)).view(len(chunk), -1)
    grid = values.view(n_blocks, n_blocks, n_blocks, BLOCK, BLOCK, BLOCK).permute(0, 3, 1, 4, 2, 5).reshape(n, n, n)
    # A shell of outside nodes closes whatever reaches the border.
    volume = np.pad(grid.numpy(), 1, constant_values=spacing)
    if not np.isfinite(volume).all():
        raise RuntimeError("the signed distance field is not finite: the training diverged")
    if volume.min() >= 0.0:
        raise EmptyMesh("the surface is empty: nothing inside the box has a negative distance")
    vertices, faces, _, _ = marching_cubes(volume, 0.0, gradient_direction="descent")
    vertices = (vertices - 1.0) * spacing - box
    return vertices.astype(np.float32), np.ascontiguousarray(faces, dtype=np.int32)


def drop_floaters(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Removes connected components with less than 1 % of the largest one's faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(edges), bool), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    count = np.bincount(label[faces[:, 0]], minlength=label.max() + 1)
    keep = count[label[faces[:, 0]]] >= MIN_COMPONENT * count.max()
    used, new_faces = np.unique(faces[keep], return_inverse=True)
    return vertices[used], new_faces.reshape(-1, 3).astype(np.int32)
