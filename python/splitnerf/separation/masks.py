"""Masks and surroundings of photos by a trained radiance field and the region of the object in it."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import directions_of_texels
from splitnerf.data.images import srgb_to_linear
from splitnerf.render.rays import image_rays
from splitnerf.separation.field import RadianceField
from splitnerf.separation.region import Region

SAMPLES = 64, 32  # of a ray, of the first search and of the second
CHUNK = 4096  # rays
LONGEST = 800  # edge of a mask in pixels
COARSER = 4  # factor by which the first mask is smaller
UNDECIDED = 0.02  # a coarse pixel is decided where it and its neighbours are this near to 0 or to 1
POINTS = 5000  # surface points of a photo, about
HEIGHT = 64  # of the map of the surroundings
PATCHES = 16  # from pole to pole, in which points are counted
FEW = 8  # points in a patch that tell it fully
CLIPPED = 0.97  # sRGB


def coverage(field: RadianceField, region: Region, rays_o: Tensor, rays_d: Tensor) -> Tensor:
    """[n] the share of each ray's colour that comes from the region."""
    found = []
    for o, d in zip(rays_o.split(CHUNK), rays_d.split(CHUNK)):
        rendered = field.render(o, d, *SAMPLES)
        points = o[:, None] + rendered.distances[..., None] * d[:, None]
        found.append((rendered.weights * region.holds(points)).sum(1))
    return torch.cat(found)


@torch.no_grad()
def surface_points(field: RadianceField, dataset: Dataset) -> np.ndarray:
    """[n, 3] the points that the photos show, scene units: where half of a ray's light is gone."""
    points = []
    stride = max(1, round(math.sqrt(dataset.height * dataset.width / POINTS)))
    for rays_o, rays_d in view_rays(dataset, stride):
        for o, d in zip(rays_o.split(CHUNK), rays_d.split(CHUNK)):
            rendered = field.render(o, d, *SAMPLES)
            at = (rendered.weights.cumsum(1) < 0.5).sum(1, keepdim=True).clamp(max=SAMPLES[1] - 1)
            points.append(o + rendered.distances.gather(1, at) * d)
    return torch.cat(points).numpy()


def view_rays(dataset: Dataset, stride: float):
    """The rays of each view, through the pixels of an image that is smaller by a factor."""
    height, width = mask_size(dataset.height / stride, dataset.width / stride)
    scale = torch.tensor([width / dataset.width, height / dataset.height] * 2)
    for pose, intrinsics in zip(torch.from_numpy(dataset.poses), torch.from_numpy(dataset.intrinsics)):
        yield image_rays(pose, intrinsics * scale, height, width)


def mask_size(height: float, width: float) -> tuple[int, int]:
    """Height and width of the masks of images of this size."""
    scale = min(1.0, LONGEST / max(height, width))
    return max(1, round(height * scale)), max(1, round(width * scale))


@torch.no_grad()
def find_mask(field: RadianceField, region: Region, dataset: Dataset, index: int) -> np.ndarray:
    """[h, w] the coverage of a view by the object, in [0, 1]: first coarsely, then fully where it changes."""
    view = dataset.select([index])
    height, width = mask_size(view.height, view.width)
    small = mask_size(height / COARSER, width / COARSER)
    (coarse_rays,) = view_rays(view, view.height / small[0])
    coarse = coverage(field, region, *coarse_rays).view(1, 1, *mask_size(small[0], small[1]))
    spread = max_pool2d(coarse, 3, 1, 1), -max_pool2d(-coarse, 3, 1, 1)
    open_ = ((spread[0] > UNDECIDED) & (spread[1] < 1 - UNDECIDED)).float()
    mask = (interpolate(coarse, (height, width), mode="bilinear", align_corners=False)[0, 0] > 0.5).float().view(-1)
    chosen = interpolate(open_, (height, width), mode="nearest")[0, 0].view(-1).nonzero().squeeze(1)
    ((rays_o, rays_d),) = view_rays(view, view.height / height)
    if len(chosen):
        mask[chosen] = coverage(field, region, rays_o[chosen], rays_d[chosen])
    return mask.view(height, width).clamp(0, 1).numpy()


@torch.no_grad()
def surroundings(field: RadianceField, region: Region, points: np.ndarray) -> np.ndarray:
    """[HEIGHT, 2 HEIGHT, 4] the linear radiance that reaches the object's middle, and how well photos tell it, in [0, 1].

    Args:
        field: The field.
        region: The object, through which the rays pass.
        points: [n, 3] what the photos show, see :func:`surface_points`.
    """
    middle = region.middle()
    directions = torch.from_numpy(directions_of_texels(HEIGHT)[0].reshape(-1, 3).astype(np.float32))
    colours = [
        field.render(middle.expand_as(d), d, *SAMPLES, hidden=region.holds).colour for d in directions.split(CHUNK)
    ]
    colour = torch.cat(colours).clamp(0, 1).numpy()
    seen = points[~region.holds(torch.from_numpy(points)).numpy()] - middle.numpy()
    seen = seen / np.linalg.norm(seen, axis=1, keepdims=True).clip(1e-9)
    row = (np.arccos(seen[:, 2].clip(-1, 1)) / np.pi * PATCHES).astype(int).clip(0, PATCHES - 1)
    column = ((0.5 - np.arctan2(seen[:, 1], seen[:, 0]) / (2 * np.pi)) * 2 * PATCHES).astype(int) % (2 * PATCHES)
    counts = np.bincount(row * 2 * PATCHES + column, minlength=2 * PATCHES**2).reshape(PATCHES, 2 * PATCHES)
    counts = counts.repeat(HEIGHT // PATCHES, 0).repeat(HEIGHT // PATCHES, 1).ravel()
    known = np.minimum(1, counts / FEW) * (colour.max(1) < CLIPPED)
    return np.column_stack([srgb_to_linear(colour), known]).reshape(HEIGHT, 2 * HEIGHT, 4).astype(np.float32)
