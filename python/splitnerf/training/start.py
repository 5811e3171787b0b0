"""The shape that a training starts from: what stereo carves out of the visual hull."""

from __future__ import annotations

import numpy as np
import torch
from scipy import ndimage
from scipy.spatial import cKDTree
from torch import Tensor
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.export.meshing import EmptyMesh, extract_mesh
from splitnerf.fields import SdfField
from splitnerf.ops import MeshScene
from splitnerf.render.rays import image_rays
from splitnerf.render.renderer import RenderedRays
from splitnerf.render.stereo import (
    EDGE,
    FIRST_EDGE,
    MOST_VIEWS,
    GreyPhotos,
    depth_maps,
    fused_distances,
    grey_photos,
    refined_depths,
    spread_out,
)

HELD_UNTIL = 0.7  # share of the run until which the surface is held near the start
SHAPE_WEIGHT = 15.0  # of the distances from the shape
FREE_CELLS = 0.5  # distance from the shape that costs nothing, in cells
NEAR_CELLS = 4.0  # from the surface to the points at which the field is compared with it
CENTRES = 0.2  # cells by which the nearest centre on the other side is farther than the surface, on average
POINTS = 384  # such points in each step
ALIKE = 0.5  # correlation from which a depth is trusted whole
MARGIN = 0.2  # of correlations, by which a clear depth stands out
# Of the object's pixels that must be clear; finer windows are clear by chance, too. A shape of fewer clear pixels is tried.
CLEAR_SHARE, CLEAR_SHARE_FINE, CLEAR_SHARE_TRIED = 0.25, 0.4, 0.15
FULL, FULL_FINE = 0.55, 0.35  # of the hull: what fills more is no hollow thing, and a sphere does as well or better
# Part of the free windows' mean correlation that those which follow the result must have: measured 0.97 to 1.06, of metal bowls and mugs
# 0.83 to 0.89, of boombox 0.81 to 0.84. A shape of less is tried.
FOLLOWED, FOLLOWED_TRIED = 0.95, 0.8
# Minutes of training from which on photos are compared, which takes 3 to 30 s of a core, and shapes that are not sure tried, which takes 40. A
# sphere alone brought boombox in half a minute to 26.4 dB of relit views, not 23.4, and a knot of metal in one to 29.0, not 20.0.
COMPARED_FROM, TRIED_FROM = 0.6, 2.5
FOLLOWING = 0.06, 0.0125  # reach and step of the depths next to the result
GUESSED = 0.01  # weight of a depth that no correlation supports
FIRST_TRUNCATION, FIRST_BLUR = 0.12, 1.0  # of the depths that are compared first, scene units and cells
# Edge of the photos; reach of the depths around the surface, their step, the truncation, scene units; blur in cells.
PASSES = (*[(FIRST_EDGE, 0.3, 0.04, 0.12, 1.0)] * 4, (EDGE, 0.15, 0.025, 0.08, 0.7), (EDGE, 0.06, 0.0125, 0.06, 0.7))
# The same for surfaces whose texture shows near the photos' own size alone; the photos that get depths, and those that tell.
FINE_EDGE, FINE_VIEWS, FINE_PROBES = 300, 25, 6
FINE_PASSES = (
    (FINE_EDGE, 0.2, 0.03, 0.12, 1.0),
    (FINE_EDGE, 0.15, 0.025, 0.1, 1.0),
    (FINE_EDGE, 0.06, 0.0125, 0.06, 0.7),
)
FIT_STEPS, FIT_POINTS, FIT_RATE = 200, 8192, 0.01


class StartShape:
    """A shape as a grid of distances.

    Args:
        distance: [r, r, r] signed distances at the cells' centres over [x, y, z], scene units, negative inside.
        trust: [r, r, r] the correlation of the photos' windows that say so, in [0, 1].
        box: Half size of the cube that the cells cover, scene units.
        is_sure: Whether the photos are clear about it.
    """

    def __init__(self, distance: Tensor, trust: Tensor, box: float, is_sure: bool = True):
        self.distance, self.trust, self.box, self.is_sure = distance, trust, box, is_sure
        self.near = (distance.abs() < NEAR_CELLS * self.cell).nonzero()  # [m, 3] cells by the surface

    @property
    def cell(self) -> float:
        """The edge of a cell, scene units."""
        return 2 * self.box / len(self.distance)

    def state(self) -> dict[str, Tensor]:
        """What a checkpoint stores."""
        return {"distance": self.distance, "trust": self.trust}

    def at(self, positions: Tensor) -> Tensor:
        """[n] distances at positions [n, 3], read linearly."""
        return read(self.distance, self.box, positions)

    def drawn(self, n: int, generator: torch.Generator) -> Tensor:
        """[n, 3] random places near the surface, on both sides."""
        draw = {"generator": generator, "device": self.distance.device}
        at = self.near[torch.randint(len(self.near), (n,), **draw)]
        return (at + torch.rand(at.shape, **draw)) * self.cell - self.box

    def left(self, sdf: Tensor, positions: Tensor) -> Tensor:
        """[n] how far signed distances [n] at positions [n, 3] have left the shape, beyond :data:`FREE_CELLS`, scene
        units, times the squared trust in it, in units of :data:`ALIKE`."""
        away = ((sdf - self.at(positions)).abs() - FREE_CELLS * self.cell).clamp(min=0)
        return away * (read(self.trust, self.box, positions) / ALIKE).clamp(max=1).square()

    def shape_loss(self, ray: RenderedRays) -> Tensor:
        """How far the rays' surface has left the shape: the mean over shaded samples by their weights, scene units."""
        return (ray.shares @ self.left(ray.sdf, ray.positions.detach())) / ray.shares.sum().clamp(min=1e-8)


def read(grid: Tensor, box: float, positions: Tensor) -> Tensor:
    """[n] values at positions [n, 3] of a grid [r, r, r] over [-box, box]^3, linear between the cells' centres."""
    places = (positions / box).view(1, -1, 1, 1, 3)
    return F.grid_sample(grid.permute(2, 1, 0)[None, None], places, padding_mode="border", align_corners=False).view(-1)


def start_shape(photos: Dataset, hull: Tensor, config: Config) -> StartShape | None:
    """The shape that photos suggest, inside of their visual hull; None where it fills the hull, or most pixels fit at many
    depths.

    First the depths of all pixels are compared, then those next to the surface that they make, more and more finely:
    there the windows follow the surface. Where small photos show no clear depths, large ones are asked, a few at first:
    the grain of clay shows near their own size alone. Objects without texture fit at all depths, and on glossy ones
    reflections look like surfaces behind the object, elsewhere in each photo: both begin with a sphere, in which shading and
    outlines carve. So do objects that fill most of their hull. In between, as inside of metal, the shape is not sure, and None
    where there is no time to try it.

    Args:
        hull: [r, r, r] bool, the visual hull of the training's photos.
    """
    if not hull.any():
        return None
    box, sizes = config.constants.box, {}

    def photos_of(edge: int) -> GreyPhotos:
        if edge not in sizes:
            sizes[edge] = grey_photos(photos, hull.device, edge)
        return sizes[edge]

    def clear_share(margins: Tensor, most: int, edge: int) -> float:
        return float((margins > MARGIN).sum() / photos_of(edge).spread(most).masks.sum())

    in_haste = 0 < config.training_minutes < TRIED_FROM
    first, most, probes, passes, full = FIRST_EDGE, MOST_VIEWS, MOST_VIEWS, PASSES, FULL
    depths, scores, margins = depth_maps(photos_of(first), hull, box)
    free, clear = scores, clear_share(margins, most, first)
    is_sure = clear > CLEAR_SHARE
    if not is_sure and min(photos.height, photos.width) >= 2 * EDGE:
        _, of_fine, margins = depth_maps(photos_of(FINE_EDGE), hull, box, FINE_PROBES)
        if is_sure := clear_share(margins, FINE_PROBES, FINE_EDGE) > CLEAR_SHARE_FINE:
            first, most, probes, passes, full = FINE_EDGE, FINE_VIEWS, FINE_PROBES, FINE_PASSES, FULL_FINE
            free, (depths, scores, _) = of_fine, depth_maps(photos_of(first), hull, box, most)
    if not is_sure and (in_haste or clear < CLEAR_SHARE_TRIED):
        return None
    weights = torch.where((depths > 0) & (scores > 0), scores, 0.0)
    spread = photos_of(first).spread(most)
    solid = blurred(fused_distances(spread, depths, weights, hull, box, FIRST_TRUNCATION)[0], FIRST_BLUR)
    if (solid < 0).sum() > full * hull.sum():
        return None
    try:
        for edge, reach, step, truncation, blur in passes:
            grey = photos_of(edge)
            base = surface_depths(solid, box, grey)
            depths, scores = refined_depths(grey, base, reach, step, most)
            base, known = base[spread_out(len(base), most)], (depths > 0) & (scores > 0)
            depths, weights = torch.where(known, depths, base), torch.where(known, scores, GUESSED * (base > 0))
            solid, trust = fused_distances(grey.spread(most), depths, weights, hull, box, truncation, solid)
            solid = blurred(solid, blur)
        base = surface_depths(solid, box, photos_of(first))
        alike = followed(photos_of(first), base, free, probes)
        is_sure = is_sure and alike >= FOLLOWED
        if alike < FOLLOWED_TRIED or (in_haste and not is_sure):
            return None
        return StartShape(exact_distances(solid, box), trust, box, is_sure)
    except EmptyMesh:
        return None


def followed(photos: GreyPhotos, base: Tensor, free: Tensor, most: int) -> float:
    """How much windows that follow a surface are alike, as a part of those that face the camera, each at its best depth: `free`
    [n, h, w], the scores of :func:`splitnerf.render.stereo.depth_maps` of the same photos; the rest as of
    :func:`splitnerf.render.stereo.refined_depths`. What a mirror shows fits at some depth in each photo, but no surface has all of
    these depths."""
    scores, on_it = refined_depths(photos, base, *FOLLOWING, most)[1], base[spread_out(len(base), most)] > 0
    means = [float(x[on_it].clamp(min=0).mean()) for x in (scores, free)]
    return means[0] / max(means[1], 1e-6)


def blurred(distances: Tensor, cells: float) -> Tensor:
    """Distances [r, r, r], smoothed over about so many cells."""
    return torch.from_numpy(ndimage.gaussian_filter(distances.cpu().numpy(), cells)).to(distances.device)


def surface_mesh(distances: Tensor, box: float, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """The zero level of distances [r, r, r] as vertices [n, 3] and faces [m, 3]."""
    grid = distances.cpu()
    return extract_mesh(lambda positions: read(grid, box, positions), box, resolution, dense=True)


def surface_depths(distances: Tensor, box: float, photos: GreyPhotos) -> Tensor:
    """[n, h, w] the distances from the cameras to the zero level of distances [r, r, r], scene units; 0 beside it."""
    vertices, faces = surface_mesh(distances, box, len(distances))
    scene, maps = MeshScene(vertices, faces), torch.zeros_like(photos.grey)
    for depths, pose, lens in zip(maps, photos.poses, photos.intrinsics):
        origins, directions = (x.cpu().numpy() for x in image_rays(pose, lens, *depths.shape))
        hit, u, v = scene.trace_closest(origins, directions)
        points = np.einsum("nk,nkx->nx", np.stack([1 - u - v, u, v], 1), vertices[faces[hit]])
        away = np.where(hit >= 0, np.linalg.norm(points - origins, axis=1), 0.0)
        depths.copy_(torch.from_numpy(away).view_as(depths))
    return maps


def exact_distances(distances: Tensor, box: float) -> Tensor:
    """[r, r, r] the distances to the nearest vertex of the zero level of truncated ones, negative inside; beyond
    :data:`NEAR_CELLS` to the nearest cell of the other side. Bodies under a fiftieth of the largest one are left out."""
    solid = (distances < 0).cpu().numpy()
    bodies, n = ndimage.label(solid)
    if n > 1:
        sizes = np.bincount(bodies.reshape(-1))[1:]
        small = solid & ~np.isin(bodies, 1 + np.flatnonzero(sizes > 0.02 * sizes.max()))
        distances = torch.where(torch.from_numpy(small).to(distances.device), distances.abs(), distances)
        solid &= ~small
    cell = 2 * box / len(solid)
    away = cell * (np.where(solid, *map(ndimage.distance_transform_edt, (solid, ~solid))) - CENTRES)
    near = away < (NEAR_CELLS + 1) * cell
    vertices, _ = surface_mesh(distances, box, 2 * len(distances))
    away[near], _ = cKDTree(vertices).query((np.argwhere(near) + 0.5) * cell - box)
    return torch.from_numpy(np.where(solid, -away, away).astype(np.float32)).to(distances.device)


def fit_to(field: SdfField, shape: StartShape, generator: torch.Generator, config: Config) -> None:
    """Fits the open levels of a distance field to a shape."""
    steps = max(1, min(FIT_STEPS, config.run.steps // 10))
    optimiser = torch.optim.Adam(field.parameters(), lr=FIT_RATE, betas=(0.9, 0.99), eps=1e-15)
    draw = {"generator": generator, "device": shape.distance.device}
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = FIT_RATE * 0.1 ** (step / steps)
        anywhere = shape.box * (2 * torch.rand(FIT_POINTS // 2, 3, **draw) - 1)
        positions = torch.cat([shape.drawn(FIT_POINTS // 2, generator), anywhere])
        optimiser.zero_grad(set_to_none=True)
        (field.sdf(positions) - shape.at(positions)).abs().mean().backward()
        optimiser.step()
    optimiser.zero_grad(set_to_none=True)
