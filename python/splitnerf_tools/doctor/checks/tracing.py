"""Checks of what is traced on the CPU."""

from __future__ import annotations

import math

import numpy as np
import torch

from splitnerf.ops import MeshScene
from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, axis, check, column, sphere

FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def square() -> MeshScene:
    """A square around the z axis; as it stands, a face of a cube around the origin."""
    return MeshScene(np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], np.float32), FACES)


def meets(directions: torch.Tensor) -> torch.Tensor:
    """Whether rays from the origin meet the square."""
    return directions[..., :2].abs().amax(-1) < directions[..., 2]


@check
def trace_visibility():
    """A cube's face hides a sixth of the directions from its centre."""
    scene, directions = square(), sphere(4096)
    visible = lib.trace_visibility(scene.handle, torch.zeros_like(directions), directions, math.inf)
    yield visible, ~meets(directions)
    yield visible.double().mean(), 5 / 6


@check
def visibility_bits():
    """The same face, in bits of the directions above the horizon."""
    scene, directions = square(), sphere(64)
    bits, hits = lib.visibility_bits(scene.handle, torch.zeros(1, 3), axis(0.0, 0.0, 1.0, 1), directions, 0.0, True)
    blocked, above = meets(directions), directions[:, 2] > 0
    yield (bits[0, :, :, None] >> torch.arange(32) & 1).flatten(1), torch.stack([above & ~blocked, blocked])
    yield hits[0] >= 0, blocked
    yield hits.unique(), torch.arange(-1, 4)


@check
def vertex_grids():
    """Two heaps of 16 and 22 vertices, far apart: two buckets hold them."""
    vertices = torch.cat([axis(0.0, 0.0, 0.0, 16), axis(5.0, 6.0, 7.0, N - 16)])
    starts, order = lib.vertex_grids(vertices, 0.1, 3)
    yield starts[:, [0, -1]], torch.tensor([0, N])
    yield starts.diff(dim=1).sort(descending=True).values[:, :3], torch.tensor([N - 16, 16, 0])
    yield order.sort().values, torch.arange(N)


@check
def occlusion_factors():
    """Beside the foot of an endless wall half of the light arrives, above its top all of it."""
    corners = [(0, -1e3, -1e3), (0, 1e3, -1e3), (0, 1e3, 1e3), (0, -1e3, 1e3)]
    scene = MeshScene(np.array(corners, np.float32), FACES)
    points, up = torch.tensor([[0.001, 0.0, 0.0], [0.0, 0.0, 2e3]]), axis(0.0, 0.0, 1.0, 2)
    white = torch.ones(4, 8, 3)
    factors = lib.occlusion_factors(scene.handle, points, up, up, column(1.0, 2), white, 2048, 2048, 0.0125, False, 0)
    for factor in factors:
        yield factor, torch.tensor([[0.5], [1.0]]), 4e-3


@check
def incoming_light():
    """Under a white mirror in white light: the sky where the mirror does not hide it, and in the mirror, as bright."""
    scene, k = square(), 2048
    point = torch.zeros(1, 3), *[axis(0.0, 0.0, 1.0, 1)] * 3, axis(0.5, 0.5, 0.5, 1), column(1.0, 1), column(0.0, 1)
    frame = axis(0.0, 0.0, -1.0, 4), torch.tensor([[1.0, 0.0, 0.0, 1.0]]).repeat(4, 1), torch.zeros(4, 2)
    maps = torch.ones(1, 1, 3), torch.tensor([[[0.0, 1.0]]]), torch.tensor([[[0.0, 0.0, 1.0]]])
    light = lib.incoming_light(scene.handle, *point, *frame, *maps, torch.ones(4, 8, 3), k, 3, 0.0, 0)
    directions, solid_angles, visible, sent = (x[0] for x in light)
    counts = solid_angles > 0
    yield directions.norm(dim=1), torch.ones(k)
    yield (solid_angles * directions[:, 2].clamp(min=0)).sum(), math.pi, 5e-3
    yield visible, (counts & ~meets(directions)).float()
    yield sent[counts & meets(directions)].mean(0), torch.ones(3), 5e-3
