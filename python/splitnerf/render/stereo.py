"""Shape from photos alone, without materials and light: the visual hull of the masks, and depths, at which a photo is like its neighbours."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.dataset import Dataset
from splitnerf.data.pixels import averaged_codes, decoded
from splitnerf.ops import march_rays
from splitnerf.ops.rays import CELL_EMPTY, CELL_OCCUPIED
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.rays import image_rays, projected

MOST_PHOTOS, MOST_VIEWS = 150, 50  # that are compared, and that get depths
EDGE, FIRST_EDGE = 100, 50  # pixels, about, along the shorter edge of the compared photos, and of those compared first
STEP = 0.04  # between the depths that are compared first, scene units
MOST_DEPTHS = 128
NEIGHBOURS, BEST = 6, 3  # photos compared with one, and those of them that count: others may see something in front
ANGLES = 4.0, 15.0, 45.0  # degrees between a photo and a neighbour: least, best, largest
WINDOW = 3  # pixels on each side of a compared one
VARIANCE_FLOOR = 1e-7  # of the product of two windows' variances of grey values, for windows without contrast
ELSEWHERE = 0.1  # scene units from a depth to others that are no part of the same peak
HIDDEN = 0.1  # scene units behind a photo's surface from which a point counts as hidden
WRONG_MASKS = 0.03  # share of the views that may miss a cell of the visual hull
PRIOR_WEIGHT = 0.05  # of what was known before, beside one pixel's correlation


def visual_hull(resolution: int, box: float, masks: Tensor, poses: Tensor, intrinsics: Tensor) -> Tensor:
    """[r, r, r] bool: the cells whose centre, within about a cell, projects into the mask of every view that sees it,
    except for a few (:data:`WRONG_MASKS`): one mask that is cut short must not cut the object.

    Args:
        resolution: Cells along an edge.
        box: Half size of the cube, scene units.
        masks: [n, H, W] in [0, 1], or bool.
        poses: [n, 4, 4] camera-to-world, OpenGL axes.
        intrinsics: [n, 4] fx, fy, cx, cy in the masks' pixels.
    """
    grid = OccupancyGrid(resolution, box, device=masks.device)
    centres, cell = grid.centres(), 2 * box / resolution
    n, height, width = masks.shape
    allowed = int(WRONG_MASKS * n)
    misses, sights = torch.zeros(2, len(centres), dtype=torch.int32, device=masks.device)
    for i in range(n):
        inside = (misses <= allowed).nonzero().squeeze(1)
        camera = (centres[inside] - poses[i, :3, 3]) @ poses[i, :3, :3]
        depth = -camera[:, 2]
        # The mask is widened by a cell's size in pixels, so that thin parts keep their cells.
        radius = int(math.ceil(float(intrinsics[i, 0]) * cell / max(1e-3, float(depth.median())))) if len(depth) else 0
        wide = widened(masks[i] > 0, radius)
        column, row = projected(camera, intrinsics[i]).floor().long().unbind(1)
        seen = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        misses[inside[seen]] += ~wide[row[seen], column[seen]]
        sights[inside[seen]] += 1
    return (misses <= WRONG_MASKS * sights).view((resolution,) * 3)


def widened(mask: Tensor, radius: int) -> Tensor:
    """[H, W] bool, the pixels within `radius` of one of `mask` [H, W] along rows and columns. A mask that was widened by r, moved
    by up to r + 1 to both sides, leaves no gap: a few moves make any radius."""
    for axis in (0, 1):
        reached = 0
        while reached < min(radius, mask.shape[axis]):
            step = min(radius - reached, reached + 1)
            wide, size = mask.clone(), mask.shape[axis] - step
            if size > 0:
                wide.narrow(axis, step, size).logical_or_(mask.narrow(axis, 0, size))
                wide.narrow(axis, 0, size).logical_or_(mask.narrow(axis, step, size))
            mask, reached = wide, reached + step
    return mask


class GreyPhotos(NamedTuple):
    """Small grey photos with their masks and cameras.

    Attributes:
        grey: [n, h, w] sRGB, 0 outside of the masks.
        masks: [n, h, w] bool.
        poses: [n, 4, 4] camera-to-world, OpenGL axes, scene units.
        intrinsics: [n, 4] fx, fy, cx, cy in these photos' pixels.
    """

    grey: Tensor
    masks: Tensor
    poses: Tensor
    intrinsics: Tensor

    def spread(self, most: int = MOST_VIEWS) -> GreyPhotos:
        """Those that get depths: at most so many, evenly spread."""
        chosen = spread_out(len(self.grey), most)
        return GreyPhotos(*(x[chosen] for x in self))


def spread_out(n: int, most: int) -> np.ndarray:
    """At most so many of the numbers from 0 to n - 1, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))


def grey_photos(photos: Dataset, device: torch.device | str = "cpu", edge: int = EDGE) -> GreyPhotos:
    """At most :data:`MOST_PHOTOS` of the photos, averaged down to about `edge` pixels."""
    chosen = spread_out(len(photos), MOST_PHOTOS)
    factor = max(1, min(photos.height, photos.width) // edge)
    pixels = [decoded(np.asarray(averaged_codes(photos.images.codes[i], factor))) for i in chosen]
    rgba = torch.from_numpy(np.stack(pixels)).to(device)
    poses, lenses = (torch.from_numpy(x[chosen]).float().to(device) for x in (photos.poses, photos.intrinsics))
    return GreyPhotos(rgba[..., :3].mean(-1) * rgba[..., 3], rgba[..., 3] > 0.5, poses, lenses / factor)


def _neighbours(poses: Tensor, i: int) -> list[int]:
    """The photos to compare with photo i, by the angles between their cameras, seen from the origin."""
    directions = F.normalize(poses[:, :3, 3], dim=1)
    angles = torch.rad2deg(torch.acos((directions @ directions.T)[i].clamp(-1, 1)))
    apart = (angles - ANGLES[1]).abs() + torch.where(angles < ANGLES[0], 360.0, 0.0)
    return [j for j in apart.argsort()[:NEIGHBOURS].tolist() if ANGLES[0] <= angles[j] < ANGLES[2]]


@torch.no_grad()
def depth_maps(photos: GreyPhotos, hull: Tensor, box: float, most: int = MOST_VIEWS) -> tuple[Tensor, Tensor, Tensor]:
    """The depth of each pixel of :meth:`GreyPhotos.spread` at which its window looks most like those of neighbours.

    Args:
        photos: All photos.
        hull: [r, r, r] bool, cells of the box in which the object may be.
        box: Half size of the box, scene units.
        most: The largest number n of photos that get depths.

    Returns:
        depths: [n, h, w] distances from the camera, scene units; 0 where nothing is known.
        scores: [n, h, w] mean normalised cross-correlation with the best neighbours, in [-1, 1].
        margins: [n, h, w] by how much the score stands out from those of depths farther away than :data:`ELSEWHERE`.

    Source: Hu and Mordohai 2012, "A quantitative evaluation of confidence measures for stereo vision", for the margin.
    """
    cells = torch.where(hull, CELL_OCCUPIED, CELL_EMPTY).to(torch.uint8)
    maps = []
    for i in spread_out(len(photos.grey), most).tolist():
        rays = image_rays(photos.poses[i], photos.intrinsics[i], *photos.grey.shape[1:])
        first, last = (x.view_as(photos.grey[i]) for x in _limits(*rays, cells, box))
        maps.append(_swept(photos, i, first, last - first, STEP))
    return tuple(torch.stack(x) for x in zip(*maps))


@torch.no_grad()
def refined_depths(
    photos: GreyPhotos, base: Tensor, reach: float, step: float, most: int = MOST_VIEWS
) -> tuple[Tensor, Tensor]:
    """Depths and scores as of :func:`depth_maps`, next to a surface that is known about: the windows follow it.

    Args:
        photos: All photos.
        base: [n, h, w] the depths of that surface in all photos, scene units; 0 where it is not seen.
        reach: How far from it depths are compared, scene units; the outermost ones are no result.
        step: Between two depths, scene units.
        most: As of :func:`depth_maps`.
    """
    maps = []
    for i in spread_out(len(photos.grey), most).tolist():
        span = torch.where(base[i] > 0, 2 * reach, 0.0)
        maps.append(_swept(photos, i, base[i] - reach, span, step, base)[:2])
    return tuple(torch.stack(x) for x in zip(*maps))


def _swept(
    photos: GreyPhotos, i: int, first: Tensor, span: Tensor, step: float, base: Tensor | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """The depths, scores and margins [h, w] of one photo, compared from depths `first` [h, w] over `span` [h, w], which
    is 0 where there is nothing to compare. A photo counts as unlike where its own surface, of depths `base` [n, h, w],
    hides the middle of the span."""
    grey, (rays_o, rays_d) = photos.grey[i], image_rays(photos.poses[i], photos.intrinsics[i], *photos.grey.shape[1:])
    (height, width), near = grey.shape, _neighbours(photos.poses, i)
    depths, scores, margins = torch.zeros_like(grey), torch.full_like(grey, -1.0), torch.zeros_like(grey)
    inside = photos.masks[i] & (span > 0)
    if not near or not inside.any():
        return depths, scores, margins
    rows, columns = inside.any(1).nonzero(), inside.any(0).nonzero()
    part = (
        slice(max(0, int(rows[0]) - WINDOW), int(rows[-1]) + WINDOW + 1),
        slice(max(0, int(columns[0]) - WINDOW), int(columns[-1]) + WINDOW + 1),
    )
    inside, rays_d, first, span = inside[part], rays_d.view(height, width, 3)[part], first[part], span[part]
    first, span = torch.where(inside, first, first[inside].mean()), torch.where(inside, span, 0.0)
    along = step * torch.arange(min(MOST_DEPTHS, int(span.max() / step + 0.5) + 1), device=grey.device)[:, None, None]
    of_photo, compared = _Window(grey[part][None, None], inside[None, None].float()), []
    for j in near:
        start, turned = rays_o[0] - photos.poses[j, :3, 3], photos.poses[j, :3, :3]
        at = projected((start @ turned) + (first + along)[..., None] * (rays_d @ turned), photos.intrinsics[j])
        at = at * at.new_tensor([2 / width, 2 / height]) - 1
        others = F.grid_sample(photos.grey[j].expand(len(along), 1, height, width), at, align_corners=False)
        alike = of_photo.correlation(others)[:, 0]
        if base is not None:
            middles = rays_o[0] + (first + 0.5 * span)[..., None] * rays_d
            behind, seen = _behind(photos, base, j, middles.view(-1, 3))
            alike = torch.where(((behind < -HIDDEN) & seen).view_as(inside), -1.0, alike)
        compared.append(alike)
    score = torch.stack(compared).topk(min(BEST, len(near)), 0).values.mean(0)
    score = torch.where(along > span + 0.5 * step, -1.0, score)
    best, k = score.max(0)
    others = ((along - step * k).abs() > ELSEWHERE) & (along <= span + 0.5 * step)
    elsewhere = torch.where(others, score, -1.0).amax(0)
    margins[part] = torch.where(inside & others.any(0), best - elsewhere, 0.0)
    if base is not None:
        best = torch.where((k == 0) | (k == len(along) - 1), -1.0, best)
    depths[part] = torch.where(inside, first + step * (k + _peak(score, k)), 0.0)
    scores[part] = torch.where(inside, best, -1.0)
    return depths, scores, margins


def _limits(rays_o: Tensor, rays_d: Tensor, cells: Tensor, box: float) -> tuple[Tensor, Tensor]:
    """Where each ray enters the occupied cells first and leaves them last, [n] each; 0 for rays that miss them."""
    packed = march_rays(rays_o, rays_d, torch.full_like(rays_o[:, 0], 0.5), cells, box=box, step=STEP)
    missed = packed.offsets.diff() == 0
    ends = packed.offsets[1:].clamp(min=1) - 1
    middles = torch.cat([packed.middles, rays_o.new_zeros(1)])  # none at all is no error
    first, last = middles[packed.offsets[:-1]], middles[ends]
    return torch.where(missed, 0.0, first), torch.where(missed, 0.0, last)


class _Window:
    """The parts within a mask of windows of a picture, [1, 1, h, w] both, to be compared with others'."""

    def __init__(self, picture: Tensor, mask: Tensor):
        self.mask, self.share = mask, _mean(mask).clamp(min=1e-3)
        self.picture = picture * mask
        self.mean, self.variance = self._moments(self.picture)

    def _moments(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and variance within the mask."""
        mean = _mean(pictures) / self.share
        return mean, (_mean(pictures.square()) / self.share - mean.square()).clamp(min=0)

    def correlation(self, others: Tensor) -> Tensor:
        """[k, 1, h, w] normalised cross-correlation with the windows of pictures [k, 1, h, w]."""
        others = others * self.mask
        mean, variance = self._moments(others)
        shared = _mean(others * self.picture) / self.share - mean * self.mean
        return shared / (self.variance * variance + VARIANCE_FLOOR).sqrt()


def _mean(pictures: Tensor) -> Tensor:
    """Means over windows, 0 beside the pictures: on a CPU in a quarter of avg_pool2d's time."""
    size = 2 * WINDOW + 1
    for dim, beside in ((-1, (WINDOW, WINDOW)), (-2, (0, 0, WINDOW, WINDOW))):
        padded, n = F.pad(pictures, beside), pictures.shape[dim]
        pictures = padded.narrow(dim, 0, n).clone()
        for k in range(1, size):
            pictures += padded.narrow(dim, k, n)
    return pictures / size**2


def _peak(score: Tensor, k: Tensor) -> Tensor:
    """The place of the parabola's peak through a maximum at index k and its neighbours, in (-0.5, 0.5)."""
    before, here, after = (score.gather(0, (k + d).clamp(0, len(score) - 1)[None])[0] for d in (-1, 0, 1))
    return (0.5 * (before - after) / (before - 2 * here + after).clamp(max=-1e-6)).clamp(-0.5, 0.5)


def _behind(photos: GreyPhotos, depths: Tensor, j: int, points: Tensor) -> tuple[Tensor, Tensor]:
    """How far photo j's surface lies behind points [m, 3] along its rays, [m], and whether it has one there, [m]."""
    height, width = depths.shape[1:]
    from_camera = points - photos.poses[j, :3, 3]
    in_camera = from_camera @ photos.poses[j, :3, :3]
    x, y = projected(in_camera, photos.intrinsics[j]).floor().long().unbind(-1)
    seen = (in_camera[:, 2] < 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y = x.clamp(0, width - 1), y.clamp(0, height - 1)
    return depths[j, y, x] - from_camera.norm(dim=1), seen & (depths[j, y, x] > 0)


@torch.no_grad()
def fused_distances(
    photos: GreyPhotos,
    depths: Tensor,
    weights: Tensor,
    hull: Tensor,
    box: float,
    truncation: float,
    before: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """[r, r, r] distances to the surface of depth maps along the rays, the mean over the photos, positive outside; and
    the mean weight of the depths that say so, 0 where none does.

    Between pixels the depths are interpolated. Where they jump by more than two truncations, at an outline, a place is
    only known to be empty, and only if it lies in front of both surfaces: so thin walls stay.

    Args:
        photos, depths: The photos that have depths, and these, [n, h, w].
        weights: [n, h, w] how much the depths count; 0 where nothing is known.
        hull, box: See :func:`depth_maps`; nothing is outside of the hull.
        truncation: Scene units; farther behind a surface nothing is known, and larger distances are this one.
        before: [r, r, r] what was known before; None: the hull is solid.

    Source: Curless and Levoy 1996, for the mean of truncated distances.
    """
    resolution, index, cells = hull.shape[0], hull.nonzero(), hull.nonzero(as_tuple=True)
    points = ((torch.arange(resolution, device=hull.device) + 0.5) * (2 * box / resolution) - box)[index]
    known = torch.full_like(points[:, 0], -truncation)
    if before is not None:
        known = before[cells].clamp(-truncation, truncation)
    total, weight = PRIOR_WEIGHT * known, torch.full_like(known, PRIOR_WEIGHT)
    votes = torch.zeros_like(known)
    for j in range(len(depths)):
        behind, share = _behind_pixels(photos, depths[j], weights[j], j, points, truncation)
        total += share * behind.clamp(-truncation, truncation)
        weight += share
        votes += share > 0
    distances = torch.full(hull.shape, truncation, device=hull.device)
    trust = torch.zeros_like(distances)
    distances[cells], trust[cells] = total / weight, (weight - PRIOR_WEIGHT) / votes.clamp(min=1)
    return distances, trust


def _behind_pixels(
    photos: GreyPhotos, depths: Tensor, weights: Tensor, j: int, points: Tensor, truncation: float
) -> tuple[Tensor, Tensor]:
    """How far the surface of depths [h, w] lies behind points [m, 3] along the rays of photo j, and how much that
    counts, [m] each."""
    height, width = depths.shape
    from_camera = points - photos.poses[j, :3, 3]
    in_camera, away = from_camera @ photos.poses[j, :3, :3], from_camera.norm(dim=1)
    place = projected(in_camera, photos.intrinsics[j]) - 0.5
    corner = place.floor()
    right, below = (place - corner).unbind(-1)
    x, y = corner.long().unbind(-1)
    square = ((y, x), (y, x + 1), (y + 1, x), (y + 1, x + 1))
    corners = [(y.clamp(0, height - 1), x.clamp(0, width - 1)) for y, x in square]
    near, counts = (torch.stack([values[at] for at in corners]) for values in (depths, weights))
    shares = torch.stack([(1 - below) * (1 - right), (1 - below) * right, below * (1 - right), below * right])
    shares = shares * (counts > 0)
    total = shares.sum(0).clamp(min=1e-6)
    mean, count = (shares * near).sum(0) / total, (shares * counts).sum(0) / total
    nearest = torch.where(counts > 0, near, torch.inf).amin(0)
    farthest = torch.where(counts > 0, near, 0.0).amax(0)
    inside = (place > -1).all(1) & (place[:, 0] < width) & (place[:, 1] < height)
    jumps = farthest - nearest > 2 * truncation
    behind = torch.where(jumps, nearest, mean) - away
    seen = inside & (in_camera[:, 2] < 0) & (farthest > 0) & (behind > torch.where(jumps, truncation, -truncation))
    return torch.where(seen, behind, 0.0), torch.where(seen, count, 0.0)
