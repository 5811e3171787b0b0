"""The shape that a training starts from: what stereo carves out of the visual hull."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.fields import SdfField
from splitnerf.render.renderer import RenderedRays
from splitnerf.render.stereo import depth_maps, grey_photos, signed_distance, solid_cells, supporting_views, surface_points

HELD_UNTIL = 0.3  # share of the run until which the surface is held near the start
SIDES_UNTIL = 0.5  # share of the run until which it is held between points on both of its sides
SHAPE_WEIGHT, POINTS_WEIGHT = 15.0, 30.0  # of the distances from the shape, and of the sides of the surface
FREE_CELLS = 1.0  # distance from the shape that costs nothing, in cells
POINTS, BEHIND = 384, 128  # random points beside the stereo's surface in each step, and those behind it
BESIDE, FREE = (0.015, 0.065), 1.0  # scene units: from the surface to points next to it, and farthest in front of it
FARTHEST = 0.1  # scene units; an error beyond it pulls no more
NEAR_VIEWS, WIDE_VIEWS = 1, 3  # photos that agree with a depth
ALIKE = 0.5  # correlation above which windows are alike
TRUSTED_SHARE = 0.75  # of the depths of windows that are alike, on which photos agree
FIT_STEPS, FIT_POINTS, FIT_RATE = 200, 8192, 0.01
NEAR_CELLS = 4.0  # half the points of a fit lie within so many cells of the surface
FIT_EIKONAL = 0.1


class StartShape(NamedTuple):
    """A shape as a grid of distances.

    Attributes:
        distance: [r, r, r] signed distances at the cells' centres over [x, y, z], scene units, negative inside.
        box: Half size of the cube that the cells cover, scene units.
        points: [m, 3] points of the surface by depths on which photos agree, scene units.
        towards: [m, 3] unit directions from the points to the cameras that see them.
    """

    distance: Tensor
    box: float
    points: Tensor
    towards: Tensor

    @property
    def cell(self) -> float:
        """The edge of a cell, scene units."""
        return 2 * self.box / len(self.distance)

    def at(self, positions: Tensor) -> Tensor:
        """[n] distances at positions [n, 3], read linearly."""
        places = (positions / self.box).view(1, -1, 1, 1, 3)
        grid = self.distance.permute(2, 1, 0)[None, None]
        return F.grid_sample(grid, places, padding_mode="border", align_corners=False).view(-1)

    def drawn(self, generator: torch.Generator) -> Tensor:
        """[POINTS, 3] random places on the rays of random points: the first third behind the surface, the others in
        front of it."""
        draw = {"generator": generator, "device": self.points.device}
        chosen, random = torch.randint(len(self.points), (POINTS,), **draw), torch.rand(POINTS, **draw)
        along = BESIDE[0] + (BESIDE[1] - BESIDE[0]) * random
        along[:BEHIND] *= -1
        along[-BEHIND:] = BESIDE[1] + (FREE - BESIDE[1]) * random[-BEHIND:]
        return self.points[chosen] + along[:, None] * self.towards[chosen]

    def shape_loss(self, ray: RenderedRays) -> Tensor:
        """How far the rays' surface has left the shape, beyond :data:`FREE_CELLS`: the mean over the shaded samples by their
        weights, scene units."""
        away = ((ray.sdf - self.at(ray.positions.detach())).abs() - FREE_CELLS * self.cell).clamp(min=0)
        return (ray.shares @ away) / ray.shares.sum().clamp(min=1e-8)


def side_loss(sdf: Tensor) -> Tensor:
    """How deep the points of :meth:`StartShape.drawn`, of signed distances [POINTS], lie on the wrong side of the surface; the
    mean, scene units."""
    return torch.cat([sdf[:BEHIND], -sdf[BEHIND:]]).clamp(min=0, max=FARTHEST).mean()


def start_shape(photos: Dataset, hull: Tensor, config: Config) -> StartShape | None:
    """The shape that photos suggest, inside of their visual hull; None where they do not agree.

    Where most photos agree on the depths of windows that are alike, the mean of all depths counts: those of dark surfaces and of
    such without texture are noisy, but not biased, and their mean opens cavities down to the floor. On glossy objects photos
    do not agree, as reflections look like surfaces behind the object.

    Args:
        photos: The photos of the training.
        hull: [r, r, r] bool, the visual hull.
        config: The run's settings.
    """
    if not hull.any():
        return None
    box, grey = config.surface.box, grey_photos(photos, hull.device)
    depths, scores = depth_maps(grey, hull, box)
    grey, found = grey.spread(), depths > 0
    near, wide = supporting_views(grey, depths, found & (scores > 0))
    without = near.amax((1, 2), keepdim=True) == 0  # photos that have no neighbour so near
    agreed, alike = ((near >= NEAR_VIEWS) | without) & (wide >= WIDE_VIEWS), found & (scores > ALIKE)
    sure = agreed & alike
    if sure.sum() <= TRUSTED_SHARE * alike.sum():
        return None
    solid = solid_cells(grey, depths, found & (scores > 0), hull, box)
    if not solid.any():
        solid = hull
    wide_by = box / hull.shape[0]  # half a cell: those of the hull reach beyond the masks
    points, towards = surface_points(grey, depths, sure)
    return StartShape(signed_distance(solid, box) + wide_by, box, points, towards)


def fit_to(field: SdfField, shape: StartShape, generator: torch.Generator, config: Config) -> None:
    """Fits the open levels of a distance field to a shape."""
    steps = max(1, min(FIT_STEPS, config.run.steps // 10))
    optimiser = torch.optim.Adam(field.parameters(), lr=FIT_RATE, betas=(0.9, 0.99), eps=1e-15)
    near = (shape.distance.abs() < NEAR_CELLS * shape.cell).nonzero()
    draw = {"generator": generator, "device": shape.distance.device}
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = FIT_RATE * 0.1 ** (step / steps)
        at = near[torch.randint(len(near), (FIT_POINTS // 2,), **draw)]
        positions = torch.cat([
            (at + torch.rand(at.shape, **draw)) * shape.cell - shape.box,
            shape.box * (2 * torch.rand(FIT_POINTS - len(at), 3, **draw) - 1),
        ])  # fmt: skip
        sample = field.sample(positions)
        error = (sample.sdf - shape.at(positions)).abs().mean()
        slope = (sample.gradient.norm(dim=1) - 1).square().mean()
        optimiser.zero_grad(set_to_none=True)
        (error + FIT_EIKONAL * slope).backward()
        optimiser.step()
    optimiser.zero_grad(set_to_none=True)
