"""Masks and surroundings of photos by a trained radiance field and the region of the object in it."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy import ndimage
from splitnerf.data.dataset import Dataset
from splitnerf.data.environment import directions_of_texels, texels_of_directions
from splitnerf.data.images import linear_to_srgb, srgb_to_linear
from splitnerf.render.rays import image_rays
from torch import Tensor
from torch.nn.functional import interpolate, max_pool2d

from splitnerf_tools.separation.field import RadianceField
from splitnerf_tools.separation.region import Region
from splitnerf_tools.separation.walker import random_walk

SAMPLES = 64, 32  # of a ray, of the first search and of the second
CHUNK = 4096  # rays
LONGEST = 800  # edge of a mask in pixels
COARSER = 4  # factor by which the first mask is smaller
RIM, WIDEST_RIM = 3, 32  # every other pixel beside a mask in which solid cells say nothing, at least and at most
# Pixels on both sides of a mask's edge in which the background is told, and outside of it, in which lost parts are looked for.
BESIDE, OUTSIDE = 4, 10
UNLIKE = 0.15  # difference of a pixel's colour from the background's of its neighbourhood, sRGB, from which it is the object's
MISFIT = 0.1  # of the field from the photo at the outer end, root mean square in sRGB, up to which it is believed
BAND = 3  # pixels on both sides of a mask's edge, in which the photo's colours move it
HINT, CERTAIN = 0.1, 50.0  # what the mask counts there beside a neighbour of the pixel's own colour, and beyond
# Size of a mask's part, as a share of its largest, below which it goes; coverage that joins parts.
SPECK, FAINT = 0.01, 0.1
CONTRAST = 10.0  # of colours, see :func:`splitnerf_tools.separation.walker.random_walk`
UNDECIDED = 0.02  # a coarse pixel is decided where it and its neighbours are this near to 0 or to 1
POINTS, DENSE = 5000, 80000  # pixels of a photo whose points are asked for, about: of all of it, and near the foot
STEEP = 0.4  # sine of the elevation from which a camera looks at the table from above; less where few look so
AROUND = 0.2  # distance from what stands on a table within which the table is looked at closely, scene units
HEIGHT = 64  # of the map of the surroundings
PATCHES = 16  # from pole to pole, in which points are counted
FEW = 8  # points in a patch that tell it fully
CLIPPED = 0.97  # sRGB


def coverage(field: RadianceField, region: Region, rays_o: Tensor, rays_d: Tensor) -> Tensor:
    """[n] the share of each ray's colour that comes from the region."""
    found = []
    for o, d in zip(rays_o.split(CHUNK), rays_d.split(CHUNK)):
        rendered = field.render(o, d, *SAMPLES, coloured=False)
        distances = region.above_table(o, d, rendered.distances)
        found.append((rendered.weights * region.holds(o[:, None] + distances[..., None] * d[:, None])).sum(1))
    return torch.cat(found)


@torch.no_grad()
def surface_points(field: RadianceField, dataset: Dataset) -> np.ndarray:
    """[n, 3] the points that the photos show, scene units: where half of a ray's light is gone."""
    return np.concatenate(
        [_points(field, *view_rays(dataset, i, _size(dataset, i, POINTS))) for i in range(len(dataset))]
    )


@torch.no_grad()
def points_near(field: RadianceField, dataset: Dataset, region: Region) -> tuple[np.ndarray, np.ndarray]:
    """More points [n, 3] around a region where it meets its table, as seen from above, and their colours [n, 3], sRGB."""
    table, middle = region.table, region.middle()
    normal = table.upward
    cells = region.centres() - middle
    reach = float((cells - (cells @ normal)[:, None] * normal).norm(dim=1).max()) + AROUND
    centre = middle - (middle @ normal - table.offset) * normal
    points, colours = [], []
    axes = torch.from_numpy(dataset.poses[:, :3, 2])
    steep = min(STEEP, 0.7 * float((axes @ normal).median()))
    for i in range(len(dataset)):
        size = _size(dataset, i, DENSE)
        rays_o, rays_d = view_rays(dataset, i, size)
        down = (rays_d @ normal).clamp(max=-1e-6)
        meets = rays_o + ((table.offset - rays_o @ normal) / down)[:, None] * rays_d
        near = ((meets - centre).norm(dim=1) < reach) & (rays_d @ normal < -steep)
        points.append(_points(field, rays_o[near], rays_d[near]))
        rows, columns = (
            ((torch.arange(n) + 0.5) * whole / n).long() for n, whole in zip(size, dataset.sizes[i].tolist())
        )
        photo = torch.from_numpy(np.asarray(dataset.images[i, ..., :3]))[rows][:, columns].reshape(-1, 3)
        colours.append(photo[near].numpy())
    return np.concatenate(points), np.concatenate(colours)


def _size(dataset: Dataset, index: int, n: int) -> tuple[int, int]:
    """The height and width of an image of about n pixels of a view, or of its photo where that has fewer."""
    height, width = dataset.sizes[index].tolist()
    stride = max(1.0, math.sqrt(height * width / n))
    return max(1, round(height / stride)), max(1, round(width / stride))


def _points(field: RadianceField, rays_o: Tensor, rays_d: Tensor) -> np.ndarray:
    """[n, 3] where half of each ray's light is gone."""
    points = [rays_o[:0]]
    for o, d in zip(rays_o.split(CHUNK), rays_d.split(CHUNK)):
        if len(o) == 0:
            break
        rendered = field.render(o, d, *SAMPLES, coloured=False)
        at = (rendered.weights.cumsum(1) < 0.5).sum(1, keepdim=True).clamp(max=SAMPLES[1] - 1)
        points.append(o + rendered.distances.gather(1, at) * d)
    return torch.cat(points).numpy()


def view_rays(dataset: Dataset, index: int, size: tuple[int, int]) -> tuple[Tensor, Tensor]:
    """The rays of a view through the pixels of an image of it with another height and width, see
    :func:`splitnerf.render.rays.image_rays`."""
    (height, width), whole = size, dataset.sizes[index].tolist()
    scale = torch.tensor([width / whole[1], height / whole[0]] * 2)
    pose, intrinsics = (torch.from_numpy(x[index]) for x in (dataset.poses, dataset.intrinsics))
    return image_rays(pose, intrinsics * scale, height, width)


@torch.no_grad()
def find_mask(field: RadianceField, region: Region, dataset: Dataset, index: int) -> np.ndarray:
    """[h, w] the coverage of a view by the object, in [0, 1]: first coarsely, then fully where it changes."""
    whole = dataset.sizes[index].tolist()
    shrink = max(1.0, max(whole) / LONGEST)
    size, small = (tuple(max(1, round(n / factor)) for n in whole) for factor in (shrink, shrink * COARSER))
    coarse = coverage(field, region, *view_rays(dataset, index, small)).view(1, 1, *small)
    most, least = max_pool2d(coarse, 3, 1, 1), -max_pool2d(-coarse, 3, 1, 1)
    half = -(-size[0] // 2), -(-size[1] // 2)
    undecided = interpolate(((most > UNDECIDED) & (least < 1 - UNDECIDED)).float(), size, mode="nearest").view(-1)
    mask = (interpolate(coarse, size, mode="bilinear", align_corners=False) > 0.5).float().view(-1)
    chosen = undecided.nonzero().squeeze(1)
    rays_o, rays_d = view_rays(dataset, index, size)
    if len(chosen):
        mask[chosen] = coverage(field, region, rays_o[chosen], rays_d[chosen])
    mask = with_mirrors(mask.view(size).clamp(0, 1), region, half, *view_rays(dataset, index, half)).numpy()
    return without_specks(at_edges(mask, _photo(dataset, index, size)))


def _photo(dataset: Dataset, index: int, size: tuple[int, int]) -> np.ndarray:
    """[h, w, 3] a photo in a smaller size, at one exposure."""
    photo = torch.from_numpy(dataset.cropped(index, dataset.images[index])[..., :3]).permute(2, 0, 1)
    return interpolate(photo[None], size, mode="area")[0].permute(1, 2, 0).numpy()


def without_specks(mask: np.ndarray) -> np.ndarray:
    """A mask [h, w] without parts that are tiny beside its largest: spots of the field's fog."""
    parts, _ = ndimage.label(mask > FAINT)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return np.where((sizes < SPECK * sizes.max())[parts] & (parts > 0), 0, mask).astype(np.float32)


def along_edges(inside: np.ndarray, width: int) -> np.ndarray:
    """[h, w] bool, the pixels within some pixels of the edges of a mask [h, w] bool; the photo's border is no edge."""
    core = ndimage.binary_erosion(inside, iterations=width, border_value=1)
    return ndimage.binary_dilation(inside, iterations=width) & ~core


def at_edges(mask: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """A mask [h, w] whose outline is moved, by a few pixels at most, to where the photo's [h, w, 3] colours change."""
    inside = mask > 0.5
    near = along_edges(inside, BAND)
    hints = np.where(near, HINT * (2 * mask - 1), np.where(inside, CERTAIN, -CERTAIN))
    shares = random_walk(hints, photo, ndimage.binary_dilation(near), CONTRAST)
    return np.where(near, shares, inside).astype(np.float32)


def with_mirrors(mask: Tensor, region: Region, half: tuple[int, int], rays_o: Tensor, rays_d: Tensor) -> Tensor:
    """A mask [h, w] with what of its outside other photos show to be solid, by rays [half, 3] through every other pixel, but for a
    rim as wide as they are vague, a cell at least: one cell beside the object is fog."""
    if not region.solid.any():
        return mask
    outside = (interpolate(mask[None, None], half, mode="area")[0, 0] < 0.5).view(-1).nonzero().squeeze(1)
    blocked = torch.zeros(half[0] * half[1])
    for chosen in outside.split(CHUNK):
        blocked[chosen] = region.blocks(rays_o[chosen], rays_d[chosen]).float()
    planes = blocked.view(1, 1, *half)
    rim = math.ceil(min(max(RIM, region.cell_pixels(half, rays_o, rays_d)), WIDEST_RIM))
    edge = 2 * rim + 1
    core = -max_pool2d(-planes, edge, 1, rim)  # opened: thin rims go
    opened = max_pool2d(core, edge, 1, rim)
    return torch.maximum(mask, interpolate(opened, mask.shape, mode="nearest")[0, 0])


@torch.no_grad()
def with_background(
    field: RadianceField, region: Region, dataset: Dataset, index: int, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The mask [h, w] of photo `index` with what beside it looks unlike its background, and the background.

    A glossy outline that mirrors the surroundings looks transparent to the field, but not like what is behind it.

    Returns:
        The mask [h, w], and [h, w, 4] in [0, 1] what the photo would show without the object, along the mask's edges: sRGB at
        the photo's exposure, and 1 where other photos tell it; else 0. They do not tell it below the object's foot, nor for a
        photo that looks unlike the field farther out.
    """
    inside = mask > 0.5
    out = ndimage.distance_transform_edt(~inside)
    near = along_edges(inside, BESIDE) | (~inside & (out <= OUTSIDE))
    if not near.any():  # the object fills the photo
        return mask, np.zeros((*mask.shape, 4), np.float32)
    chosen = torch.from_numpy(np.flatnonzero(near))
    rays_o, rays_d = view_rays(dataset, index, mask.shape)
    shown, known = np.zeros((mask.size, 3), np.float32), np.zeros(mask.size, bool)
    for part in chosen.split(CHUNK):
        o, d = rays_o[part], rays_d[part]
        shown[part] = field.render(o, d, *SAMPLES, hidden=region.holds).colour.clamp(0, 1)
        known[part] = ~region.stands_at(o, d)
    shown, known = shown.reshape(*mask.shape, 3), known.reshape(mask.shape)
    photo = _photo(dataset, index, mask.shape).clip(0, 1)
    far = near & (out > OUTSIDE - BESIDE)
    known &= far.any() and bool(np.square(shown - photo)[far].mean() < MISFIT**2)
    least, most = (filter_(shown, (3, 3, 1)) for filter_ in (ndimage.minimum_filter, ndimage.maximum_filter))
    unlike = np.sqrt(np.square(photo - photo.clip(least, most)).mean(-1)) > UNLIKE
    grown = inside | (unlike & known & (out < OUTSIDE - 1))
    parts, _ = ndimage.label(ndimage.binary_opening(grown, np.ones((3, 3))) | inside)
    added = np.isin(parts, np.unique(parts[inside])) & ~inside
    mask, inside = np.where(added, np.float32(1), mask), inside | added
    known &= along_edges(inside, BESIDE)
    exposed = linear_to_srgb(srgb_to_linear(shown) * np.float32(dataset.exposures[index])).clip(0, 1)
    return mask, np.concatenate([exposed, np.ones_like(shown[..., :1])], axis=-1) * known[..., None]


@torch.no_grad()
def surroundings(field: RadianceField, region: Region, points: np.ndarray) -> np.ndarray:
    """[HEIGHT, 2 HEIGHT, 4] the linear radiance that reaches the middle of the object, through which the rays pass, and how well
    photos tell it, in [0, 1]. `points` [n, 3] are what the photos show, see :func:`surface_points`."""
    middle = region.middle()
    directions = torch.from_numpy(directions_of_texels(HEIGHT)[0].reshape(-1, 3).astype(np.float32))
    colours = [
        field.render(middle.expand_as(d), d, *SAMPLES, hidden=region.holds).colour for d in directions.split(CHUNK)
    ]
    colour = torch.cat(colours).clamp(0, 1).numpy()
    seen = points[~region.holds(torch.from_numpy(points)).numpy()] - middle.numpy()
    counts = np.bincount(texels_of_directions(seen, PATCHES), minlength=2 * PATCHES**2).reshape(PATCHES, 2 * PATCHES)
    counts = counts.repeat(HEIGHT // PATCHES, 0).repeat(HEIGHT // PATCHES, 1).ravel()
    known = np.minimum(1, counts / FEW) * (colour.max(1) < CLIPPED)
    return np.column_stack([srgb_to_linear(colour), known]).reshape(HEIGHT, 2 * HEIGHT, 4).astype(np.float32)
