"""Depth from photos alone: each photo's pixels are compared with its neighbours' at many depths.

A distance field moves where colours change nearby, so it never opens a cavity that it began as a solid: a lid, far from the
floor behind it, shows no direction in which it should move. Stereo compares all depths at once, and needs neither materials nor light.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.dataset import Dataset
from splitnerf.data.pixels import averaged_codes, decoded
from splitnerf.ops import CELL_EMPTY, CELL_OCCUPIED, march_rays
from splitnerf.render.rays import image_rays

MOST_PHOTOS, MOST_VIEWS = 150, 50  # that are compared, and that get depths
EDGE = 100  # pixels, about, along the shorter edge of the compared photos
STEP = 0.03  # between two depths, scene units
MOST_DEPTHS = 128
NEIGHBOURS, BEST = 6, 3  # photos compared with one, and those of them that count: others may see something in front
ANGLES = 4.0, 15.0, 45.0  # degrees between a photo and a neighbour: least, best, largest
WINDOW = 3  # pixels on each side of a compared one
VARIANCE_FLOOR = 1e-7  # of grey values, for windows without contrast
AGREE = 0.06  # scene units within which two photos' depths agree
NEAR_ANGLES, WIDE_ANGLES = (5.0, 25.0), (25.0, 75.0)  # degrees
TRUNCATION = 0.12  # scene units; surfaces farther apart do not mix


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

    def spread(self) -> GreyPhotos:
        """Those that get depths: at most :data:`MOST_VIEWS`, evenly spread."""
        chosen = spread_out(len(self.grey), MOST_VIEWS)
        return GreyPhotos(*(x[chosen] for x in self))


def spread_out(n: int, most: int) -> np.ndarray:
    """At most so many of the numbers from 0 to n - 1, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(int))


def grey_photos(photos: Dataset, device: torch.device | str = "cpu") -> GreyPhotos:
    """At most :data:`MOST_PHOTOS` of the photos, averaged down to about :data:`EDGE` pixels."""
    chosen = spread_out(len(photos), MOST_PHOTOS)
    factor = max(1, min(photos.height, photos.width) // EDGE)
    pixels = [decoded(np.asarray(averaged_codes(photos.images.codes[i], factor))) for i in chosen]
    rgba = torch.from_numpy(np.stack(pixels)).to(device)
    poses, lenses = (torch.from_numpy(x[chosen]).float().to(device) for x in (photos.poses, photos.intrinsics))
    return GreyPhotos(rgba[..., :3].mean(-1) * rgba[..., 3], rgba[..., 3] > 0.5, poses, lenses / factor)


def angles_between(poses: Tensor) -> Tensor:
    """[n, n] degrees between cameras, seen from the origin."""
    directions = F.normalize(poses[:, :3, 3], dim=1)
    return torch.rad2deg(torch.acos((directions @ directions.T).clamp(-1, 1)))


@torch.no_grad()
def depth_maps(photos: GreyPhotos, hull: Tensor, box: float) -> tuple[Tensor, Tensor]:
    """The depth of each pixel of :meth:`GreyPhotos.spread` at which its window looks most like those of neighbouring photos.

    Args:
        photos: All photos.
        hull: [r, r, r] bool, cells of the box in which the object may be.
        box: Half size of the box, scene units.

    Returns:
        depths: [n, h, w] distances from the camera, scene units; 0 where nothing is known.
        scores: [n, h, w] mean normalised cross-correlation with the best neighbours, in [-1, 1].
    """
    cells = torch.where(hull, CELL_OCCUPIED, CELL_EMPTY).to(torch.uint8)
    angles, maps = angles_between(photos.poses), []
    for i in spread_out(len(photos.grey), MOST_VIEWS).tolist():
        away = angles[i]
        apart = (away - ANGLES[1]).abs() + torch.where(away < ANGLES[0], 360.0, 0.0)
        near = [j for j in apart.argsort()[:NEIGHBOURS].tolist() if ANGLES[0] <= away[j] < ANGLES[2]]
        maps.append(_depth_map(photos, i, near, cells, box))
    return tuple(torch.stack(x) for x in zip(*maps))


def _depth_map(photos: GreyPhotos, i: int, near: list[int], cells: Tensor, box: float) -> tuple[Tensor, Tensor]:
    """The depths and scores [h, w] of one photo."""
    grey, mask = photos.grey[i], photos.masks[i]
    height, width = grey.shape
    depths, scores = torch.zeros_like(grey), torch.full_like(grey, -1.0)
    rays_o, rays_d = image_rays(photos.poses[i], photos.intrinsics[i], height, width)
    first, last = _limits(rays_o, rays_d, cells, box)
    inside = mask & (last > 0).view_as(mask)
    if not near or not inside.any():
        return depths, scores
    rows, columns = inside.any(1).nonzero(), inside.any(0).nonzero()
    part = (
        slice(max(0, int(rows[0]) - WINDOW), int(rows[-1]) + WINDOW + 1),
        slice(max(0, int(columns[0]) - WINDOW), int(columns[-1]) + WINDOW + 1),
    )
    inside, rays_d = inside[part], rays_d.view(height, width, 3)[part]
    first, last = first.view(height, width)[part], last.view(height, width)[part]
    first = torch.where(inside, first, first[inside].mean())
    span = torch.where(inside, last - first, 0.0)
    along = STEP * torch.arange(min(MOST_DEPTHS, int(span.max() / STEP) + 2), device=grey.device)[:, None, None]
    of_photo = _Window(grey[part][None, None])
    compared = []
    for j in near:
        turned = photos.poses[j, :3, :3]
        start, directions = (rays_o[0] - photos.poses[j, :3, 3]) @ turned, rays_d @ turned
        points = start + (first + along)[..., None] * directions
        at = _projected(points, photos.intrinsics[j]) * points.new_tensor([2 / width, 2 / height]) - 1
        seen = photos.grey[j].expand(len(along), 1, height, width)
        compared.append(of_photo.correlation(F.grid_sample(seen, at, align_corners=False))[:, 0])
    score = torch.stack(compared).topk(min(BEST, len(near)), 0).values.mean(0)
    score = torch.where(along > span + STEP, -1.0, score)
    best, k = score.max(0)
    depths[part] = torch.where(inside, first + STEP * (k + _peak(score, k)), 0.0)
    scores[part] = torch.where(inside, best, -1.0)
    return depths, scores


def _limits(rays_o: Tensor, rays_d: Tensor, cells: Tensor, box: float) -> tuple[Tensor, Tensor]:
    """Where each ray enters the occupied cells first and leaves them last, [n] each; 0 for rays that miss them."""
    packed = march_rays(rays_o, rays_d, torch.full_like(rays_o[:, 0], 0.5), cells, box, STEP)
    missed = packed.offsets.diff() == 0
    ends = packed.offsets[1:].clamp(min=1) - 1
    middles = torch.cat([packed.middles, rays_o.new_zeros(1)])  # none at all is no error
    first, last = middles[packed.offsets[:-1]], middles[ends]
    return torch.where(missed, 0.0, first), torch.where(missed, 0.0, last)


def _projected(points: Tensor, intrinsics: Tensor) -> Tensor:
    """[..., 2] pixels of points [..., 3] in the camera's axes."""
    fx, fy, cx, cy = intrinsics.unbind()
    depth = (-points[..., 2]).clamp(min=1e-6)
    return torch.stack([cx + fx * points[..., 0] / depth, cy - fy * points[..., 1] / depth], -1)


class _Window:
    """Windows of a picture [1, 1, h, w], to be compared with others'."""

    def __init__(self, picture: Tensor):
        self.picture, self.mean = picture, _mean(picture)
        self.variance = (_mean(picture.square()) - self.mean.square()).clamp(min=0)

    def correlation(self, others: Tensor) -> Tensor:
        """[k, 1, h, w] normalised cross-correlation with the windows of pictures [k, 1, h, w]."""
        mean = _mean(others)
        variance = (_mean(others.square()) - mean.square()).clamp(min=0)
        shared = _mean(others * self.picture) - mean * self.mean
        return shared / (self.variance * variance + VARIANCE_FLOOR).sqrt()


def _mean(pictures: Tensor) -> Tensor:
    """Means over windows."""
    size = 2 * WINDOW + 1
    return F.avg_pool2d(F.avg_pool2d(pictures, (1, size), 1, (0, WINDOW)), (size, 1), 1, (WINDOW, 0))


def _peak(score: Tensor, k: Tensor) -> Tensor:
    """The place of the parabola's peak through a maximum at index k and its neighbours, in (-0.5, 0.5)."""
    before, here, after = (score.gather(0, (k + d).clamp(0, len(score) - 1)[None])[0] for d in (-1, 0, 1))
    return (0.5 * (before - after) / (before - 2 * here + after).clamp(max=-1e-6)).clamp(-0.5, 0.5)


@torch.no_grad()
def supporting_views(photos: GreyPhotos, depths: Tensor, known: Tensor) -> tuple[Tensor, Tensor]:
    """How many other photos found a surface at a pixel's point: [n, h, w] near by, and from far.

    A reflection looks like a surface behind the mirror, at a place that moves with the camera: photos from far disagree.

    Args:
        photos, depths: The photos that have depths, and these.
        known: [n, h, w] bool, the depths that count.
    """
    angles, (n, height, width) = angles_between(photos.poses), depths.shape
    counts = [torch.zeros_like(depths, dtype=torch.int32) for _ in range(2)]
    for i in range(n):
        rays_o, rays_d = image_rays(photos.poses[i], photos.intrinsics[i], height, width)
        points = rays_o + depths[i].reshape(-1, 1) * rays_d
        for j in range(n):
            for count, (least, most) in zip(counts, (NEAR_ANGLES, WIDE_ANGLES)):
                if least <= angles[i, j] < most:
                    apart, seen = _behind(photos, depths, known, j, points)
                    count[i] += ((apart.abs() < AGREE) & seen).view(height, width) & known[i]
    return counts[0], counts[1]


def surface_points(photos: GreyPhotos, depths: Tensor, known: Tensor) -> tuple[Tensor, Tensor]:
    """The points of known depths, scene units, and the unit directions from them to their cameras, [m, 3] each; the arguments
    are those of :func:`supporting_views`."""
    found, towards = [], []
    for i, (depth, here) in enumerate(zip(depths, known)):
        rays_o, rays_d = image_rays(photos.poses[i], photos.intrinsics[i], *depth.shape)
        here = here.reshape(-1)
        found.append((rays_o + depth.reshape(-1, 1) * rays_d)[here])
        towards.append(-rays_d[here])
    return torch.cat(found), torch.cat(towards)


def _behind(photos: GreyPhotos, depths: Tensor, known: Tensor, j: int, points: Tensor) -> tuple[Tensor, Tensor]:
    """How far the surface of photo j lies behind points [m, 3] along its rays, [m], and whether it is known, [m] bool."""
    height, width = depths.shape[1:]
    from_camera = points - photos.poses[j, :3, 3]
    in_camera = from_camera @ photos.poses[j, :3, :3]
    x, y = _projected(in_camera, photos.intrinsics[j]).floor().long().unbind(-1)
    seen = (in_camera[:, 2] < 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y = x.clamp(0, width - 1), y.clamp(0, height - 1)
    return depths[j, y, x] - from_camera.norm(dim=1), seen & known[j, y, x]


@torch.no_grad()
def solid_cells(photos: GreyPhotos, depths: Tensor, known: Tensor, hull: Tensor, box: float) -> Tensor:
    """[r, r, r] bool: the cells of the hull that the depths do not show to be empty. What no photo sees stays solid.

    A cell is solid where the mean of its truncated distances to the photos' surfaces is negative.

    Args:
        photos, depths: The photos that have depths, and these.
        hull, box: See :func:`depth_maps`.
        known: [n, h, w] bool, the depths that count.

    Source: Curless and Levoy 1996, for the mean of truncated distances.
    """
    resolution = hull.shape[0]
    axis = (torch.arange(resolution, device=hull.device) + 0.5) * (2 * box / resolution) - box
    index = hull.nonzero()
    points = axis[index]
    total, weight = torch.zeros(2, len(points), device=hull.device)
    for j in range(len(depths)):
        behind, seen = _behind(photos, depths, known, j, points)
        share = ((behind > -TRUNCATION) & seen).float()
        total += share * behind.clamp(-TRUNCATION, TRUNCATION)
        weight += share
    solid = torch.zeros_like(hull)
    solid[tuple(index.T)] = (total < 0) | (weight == 0)
    return solid


def signed_distance(solid: Tensor, box: float) -> Tensor:
    """[r, r, r] float32 signed distances at the cells' centres to the surface of solid cells [r, r, r], scene units, negative
    inside, smoothed over about a cell. Bodies under a fiftieth of the largest one are left out."""
    cells = solid.cpu().numpy()
    bodies, n = ndimage.label(cells)
    if n > 1:
        sizes = np.bincount(bodies.reshape(-1))[1:]
        cells = np.isin(bodies, 1 + np.flatnonzero(sizes > 0.02 * sizes.max()))
    outside, inside = (ndimage.distance_transform_edt(x) for x in (~cells, cells))
    distance = np.where(cells, 0.5 - inside, outside - 0.5) * (2 * box / len(cells))
    return torch.from_numpy(ndimage.gaussian_filter(distance, 1.0).astype(np.float32)).to(solid.device)
