"""Triangle meshes of the zero level set: marching cubes on the blocks of nodes near it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from splitnerf import _core

BLOCK = _core.MESH_BLOCK
COARSEST = 8  # blocks along the edge of the cubes that are classified first
LIPSCHITZ = 1.5
CHUNK = 1 << 16  # points evaluated at a time


class EmptyMesh(RuntimeError):
    """The field has no zero level set inside the box."""


def extract_mesh(
    sdf: Callable[[Tensor], Tensor], box: float, resolution: int, *, dense: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Marching cubes over [-box, box]^3, closed at the border: vertices [n, 3] float32 and outward faces [m, 3] int32. Raises
    EmptyMesh where no node is inside the surface, and RuntimeError where the field is not finite.

    The grid is refined from coarse to fine. A cube of nodes contains no surface if the distance at its centre is larger
    than 1.5 times its half diagonal; all its nodes get the centre's sign. Other cubes are halved, down to blocks of 4^3
    nodes whose nodes are all evaluated. Then further blocks are evaluated as long as the surface runs into them. So the
    mesh equals that of the dense grid, except for components of which no block was found.

    Args:
        sdf: A function from points [n, 3] to signed distances [n], negative inside.
        resolution: The number of nodes along an edge.
        dense: Whether to evaluate all nodes.
    """
    grid = _NodeGrid(sdf, box, resolution)
    index = np.zeros((grid.n_blocks,) * 3, np.int32) if dense else grid.near_blocks()
    active = np.flatnonzero(index.reshape(-1) == 0)
    values = grid.block_values(active)
    while True:
        order = np.argsort(active)
        active, values = active[order], values[order]
        index.reshape(-1)[active] = np.arange(len(active), dtype=np.int32)
        opened = _core.blocks_to_open(values, index)
        if len(opened) == 0:
            break
        active, values = np.concatenate([active, opened]), np.concatenate([values, grid.block_values(opened)])
    vertices, faces = _core.marching_cubes(values, index, -box - grid.spacing, grid.spacing)
    if len(faces) == 0:
        raise EmptyMesh("the surface is empty: nothing inside the box has a negative distance")
    return vertices, faces


class _NodeGrid:
    """resolution^3 nodes over the box in a shell of outside nodes, which closes whatever reaches the border. Nodes are counted from
    0 in the shell; those of the box are 1 .. resolution, and all beyond are outside."""

    def __init__(self, sdf: Callable[[Tensor], Tensor], box: float, resolution: int):
        self.sdf, self.box, self.resolution = sdf, box, resolution
        self.spacing = 2.0 * box / (resolution - 1)
        self.n_coarse = math.ceil((resolution + 2) / (BLOCK * COARSEST))
        self.n_blocks = self.n_coarse * COARSEST

    def evaluate(self, positions: np.ndarray) -> np.ndarray:
        """The field at [n, 3] positions, float32 [n]."""
        points = torch.from_numpy(positions.astype(np.float32))
        with torch.no_grad():
            values = torch.cat([self.sdf(chunk) for chunk in points.split(CHUNK)]).numpy()
        if not np.isfinite(values).all():
            raise RuntimeError("the signed distance field is not finite: the training diverged")
        return values

    def near_blocks(self) -> np.ndarray:
        """[n_blocks]^3 int32: 0 where a block may hold surface, else the sign of its nodes."""
        index = np.zeros((self.n_coarse,) * 3, np.int32)
        size = BLOCK * COARSEST
        while True:
            cubes = np.argwhere(index == 0)
            index[tuple(cubes.T)] = self.classify(cubes * size, size)
            if size == BLOCK:
                return index
            size //= 2
            index = index.repeat(2, 0).repeat(2, 1).repeat(2, 2)

    def classify(self, first: np.ndarray, size: int) -> np.ndarray:
        """0 for the cubes of size^3 nodes from node `first` [n, 3] on that may hold surface, else their sign."""
        low, high = np.maximum(first, 1), np.minimum(first + size - 1, self.resolution)
        signs = np.full(len(first), _core.OUTSIDE_BLOCK, np.int32)
        met = (low <= high).all(axis=1)
        low, high, first = low[met], high[met], first[met]
        distance = self.evaluate(((low + high) / 2 - 1) * self.spacing - self.box)
        reach = LIPSCHITZ * 0.5 * self.spacing * np.linalg.norm(high - low, axis=1)
        whole = ((low == first) & (high == first + size - 1)).all(axis=1)  # no node of the shell
        inside = (distance < -reach) & whole
        signs[met] = np.where(distance > reach, _core.OUTSIDE_BLOCK, np.where(inside, _core.INSIDE_BLOCK, 0))
        return signs

    def block_values(self, blocks: np.ndarray) -> np.ndarray:
        """[n, 4, 4, 4] float32 values of the nodes of blocks given by flat index."""
        values = np.full((len(blocks), BLOCK, BLOCK, BLOCK), self.spacing, np.float32)
        offsets = np.indices((BLOCK,) * 3).reshape(3, -1).T
        for start in range(0, len(blocks), CHUNK // BLOCK**3):
            rows = slice(start, start + CHUNK // BLOCK**3)
            first = np.stack(np.unravel_index(blocks[rows], (self.n_blocks,) * 3), axis=1) * BLOCK
            nodes = (first[:, None, :] + offsets).reshape(-1, 3)
            met = ((nodes >= 1) & (nodes <= self.resolution)).all(axis=1)
            values[rows].reshape(-1)[met] = self.evaluate((nodes[met] - 1) * self.spacing - self.box)
        return values
