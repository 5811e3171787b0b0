"""Detail as fine as the photos: the texture of the albedo, larger if need be, from the pixels of all photos.

A photo shows a point of albedo a (of metals: F0) with the colour c = D a + S, where D and S, which are light, vary slowly along
the surface. Over a window of the texture, whose means within the photo are c' and a', therefore c - c' = D (a - a'). Of c' the
share f = D a' / c' is proportional to the albedo: all of it where the texel is metal, else what the known light lets a diffuse
surface of albedo a' scatter. So a photo tells

    a = a' (1 + (c / c' - 1) / f),

with the level and the tint of the fit, to which it adds what is smaller than a window. A texel gets the mean over the photos.
Photos held out then say, window by window, whether they show what was added, too: a reflection they do not.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.asset import Asset, unit
from splitnerf.data.dataset import Dataset, spread
from splitnerf.data.environment import turn_environment
from splitnerf.data.images import srgb_to_linear
from splitnerf.export.bake import nearest_rows, rasterise
from splitnerf.ops import MeshScene
from splitnerf.ops.shading import monte_carlo_light
from splitnerf.ops.visibility import TexturedSurface, incoming_light
from splitnerf.refinement.fit import MIN_TONE, srgb_slope
from splitnerf.refinement.light import footprints, read
from splitnerf.refinement.pixels import HELD_OUT, MIN_ALPHA
from splitnerf.refinement.texels import bilinear_footprints, charts, texels_per_pixel
from splitnerf.render.seen import in_view

# Widths of a texel in the photos' pixels: up to which a texture is fine enough, and below which photos tell less than the fit.
FINE_ENOUGH, LEAST_WIDTH = 1.5, 0.75
WINDOW = 4  # half the texels of the fit along the edge of a window
GRAZING = 0.15  # cosine of a line of sight and the normal below which a photo says nothing of a texel
LEAST_SHARE = 0.15  # f is never below it
MOST_CONTRAST = 4.0  # c / c' is never above it
DARK = 1e-4  # linear colours and albedos below it count as this
PATCH = 4  # texels of the fit along the edge of a patch whose scattered light is found
DIRECTIONS = 48  # by which it is
MAX_BOUNCES, CLAMP_INDIRECT = 2, 10.0
OFFSET = 1e-3  # of a line of sight from the surface, as a share of the asset's extent
MOST_TURNS = 8  # rotations over which a turning light is averaged
CONFIRMED = 0.25  # part of what was added that photos held out must show; where they show less, less is kept
FITTED = 0.8  # share of the time for the photos that are not held out


class Shown(NamedTuple):
    """What a photo shows: rows [r] of texels, their linear colours [r, 3], and its pixels [r, 1] on a unit of their surface."""

    rows: Tensor
    colours: Tensor
    pixels: Tensor


class Told(NamedTuple):
    """What a photo tells of the texels that it shows, [r, 3] each: the albedo a, the share f, and the derivative D."""

    albedo: Tensor
    share: Tensor
    slope: Tensor


class Windows:
    """Means over square windows of the texture, within a chart each. They overlap by half and weigh their texels less and less
    towards their edges, so that what is read varies smoothly.

    Args:
        index, chart: [m] a texel's row * size + column, and the number of its chart.
        size: Texels along the edge of the texture.
        edge: Half the texels along the edge of a window.
    """

    def __init__(self, index: np.ndarray, chart: np.ndarray, size: int, edge: int):
        n, keys, self._weights = size // edge + 2, [], []
        x, y = (index % size + 0.5) / edge + 0.5, (index // size + 0.5) / edge + 0.5
        for right in (0, 1):
            for below in (0, 1):
                column, row = x.astype(np.int64) + right, y.astype(np.int64) + below
                keys.append((chart * n + row) * n + column)
                weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
                self._weights.append(torch.from_numpy(weight.astype(np.float32)[:, None]))
        unique, numbers = np.unique(np.concatenate(keys), return_inverse=True)
        self.count, self._numbers = len(unique), torch.from_numpy(numbers.reshape(4, -1))

    def sums(self, rows: Tensor, values: Tensor) -> Tensor:
        """[windows, c] the weighted sums of values [r, c] of texels."""
        total = values.new_zeros(self.count, values.shape[1])
        for number, weight in zip(self._numbers, self._weights):
            total.index_add_(0, number[rows], values * weight[rows])
        return total

    def read(self, rows: Tensor, table: Tensor) -> Tensor:
        """[r, c] the values of a table [windows, c] at texels."""
        return sum(table[number[rows]] * weight[rows] for number, weight in zip(self._numbers, self._weights))

    def means(self, rows: Tensor, values: Tensor) -> Tensor:
        """[r, c] the means of values [r, c] of texels around each of them."""
        sums = self.sums(rows, torch.cat([torch.ones(len(rows), 1), values], dim=1))
        return self.read(rows, sums[:, 1:] / sums[:, :1].clamp(min=1e-9))


class FineTexels:
    """The covered texels of a finer texture of `size` texels along an edge, m of them, with what the fit knows there: `albedo`
    [m, 3], `metallic` [m, 1], `scattered` [m, 3], the linear radiance that a diffuse surface of that albedo scatters in the light
    [h, 2 h, 3], and `windows` of twice WINDOW texels of the fit."""

    def __init__(self, asset: Asset, light: Tensor, size: int):
        m, covered = asset.materials[0], rasterise(asset.uv, asset.triangles, size)
        of_texels = partial(covered.interpolate, faces=asset.triangles)
        corners, uv = asset.vertices[asset.triangles], of_texels(asset.uv)
        faces = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        self.positions, self.normals = (
            torch.from_numpy(x) for x in (of_texels(asset.vertices), faces[covered.triangle])
        )
        self.scene, self._nearest = MeshScene(asset.vertices, asset.triangles), nearest_rows(covered.index, size)
        self.offset = OFFSET * float(np.ptp(asset.vertices, axis=0).max())
        self.albedo = read_texture(m.albedo_texture, uv)
        self.metallic = read_texture(m.roughness_metallic_texture, uv)[:, 1:]
        before = m.albedo_texture.shape[0]
        self.scattered = self.albedo * read_texture(scattered_light(asset, self.scene, light, before // PATCH), uv)
        chart = charts(asset)[asset.triangles[covered.triangle, 0]]
        self.windows = Windows(covered.index, chart, size, WINDOW * size // before)

    def shown_in(self, dataset: Dataset, view: int) -> Shown:
        """The texels that a photo shows, and that its mask covers."""
        photo, size = dataset.images[view], torch.from_numpy(dataset.sizes[view])
        pose, lens = (torch.from_numpy(x[view]).float() for x in (dataset.world_poses, dataset.intrinsics))
        seen = in_view(self.scene, self.positions, self.normals, (pose, lens, size), self.offset, GRAZING)
        planes = np.concatenate([srgb_to_linear(photo[..., :3]), photo[..., 3:]], axis=2)
        planes = torch.from_numpy(planes).permute(2, 0, 1)[None]
        at = seen.at / size.flip(0) * 2 - 1
        colours = F.grid_sample(planes, at[None, None], align_corners=False)[0, :, 0].T
        pixels = seen.cosine * (lens[0] / seen.distance).square()
        rows = colours[:, 3] >= MIN_ALPHA
        return Shown(seen.rows[rows], colours[rows, :3], pixels[rows, None])

    def tells(self, shown: Shown) -> Told:
        """What a photo tells of the texels that it shows."""
        rows = shown.rows
        means = self.windows.means(rows, torch.cat([shown.colours, self.albedo[rows], self.scattered[rows]], dim=1))
        colour, albedo, scattered = (part.clamp(min=DARK) for part in means.split(3, dim=1))
        metallic = self.metallic[rows]
        share = metallic + (1 - metallic) * (scattered / colour).clamp(LEAST_SHARE, 1.0)
        contrast = (shown.colours / colour).clamp(max=MOST_CONTRAST) - 1
        return Told(albedo * (1 + contrast / share), share, share * colour / albedo)

    def texture(self, values: Tensor) -> np.ndarray:
        """The image [size, size, 3] of texels' values [m, 3]; outside the charts that of the nearest inside."""
        return values.numpy()[self._nearest]


def read_texture(texture: np.ndarray, uv: np.ndarray) -> Tensor:
    """[n, c] the values of a square texture at uv [n, 2]: bilinear."""
    return read(torch.from_numpy(texture).flatten(0, 1), *bilinear_footprints(uv, texture.shape[0]))


def scattered_light(asset: Asset, scene: MeshScene, light: Tensor, size: int) -> np.ndarray:
    """[size, size, 3] the linear radiance that a diffuse surface of albedo 1 would scatter, texel by texel."""
    covered, m = rasterise(asset.uv, asset.triangles, size), asset.materials[0]
    straight = np.float32([[[0, 0, 1]]]) if m.normal_texture is None else m.normal_texture
    maps = (m.albedo_texture, m.roughness_metallic_texture, straight)
    surface = TexturedSurface(
        scene, *(torch.from_numpy(x) for x in (asset.normals, asset.tangents, asset.uv.astype(np.float32), *maps))
    )
    positions, normals = (
        torch.from_numpy(covered.interpolate(x, asset.triangles)) for x in (asset.vertices, asset.normals)
    )
    normals = F.normalize(normals, dim=1)
    ones = torch.ones(len(normals), 1)
    arriving = incoming_light(
        surface,
        light,
        positions,
        geometric_normals=normals,
        normals=normals,
        view_dirs=normals,
        albedo=ones.expand(-1, 3),
        roughness=ones,
        metallic=0 * ones,
        n_directions=DIRECTIONS,
        max_bounces=MAX_BOUNCES,
        clamp_indirect=CLAMP_INDIRECT,
    )
    at = footprints(light.shape[0], arriving.directions.reshape(-1, 3))
    sky = read(light.reshape(-1, 3), *at).view_as(arriving.directions)
    radiance = sky * arriving.visible[..., None] + arriving.sent
    sums = monte_carlo_light(normals, normals, ones, arriving.directions, arriving.pdf, radiance)
    return sums.diffuse.numpy()[nearest_rows(covered.index, size)]


def detail_size(dataset: Dataset, asset: Asset, most: int) -> int | None:
    """The edge of the texture that photos fill with detail: the present one, times a power of 2 if they need it and at most
    `most`; None where photos are too coarse, or too few to hold one out, or `most` is 0."""
    size, width = asset.materials[0].albedo_texture.shape[0], 1.0 / texels_per_pixel(dataset, asset)
    if most == 0 or width < LEAST_WIDTH or len(dataset) <= HELD_OUT // 2:
        return None
    while width > FINE_ENOUGH and 2 * size <= most:
        size, width = 2 * size, width / 2
    return size


def mean_light(light: np.ndarray, turns: np.ndarray | None) -> Tensor:
    """[h, 2 h, 3] the light, its mean over the photos where it turns with them."""
    if turns is None:
        return torch.from_numpy(light)
    chosen = turns[spread(range(len(turns)), MOST_TURNS)]
    return torch.from_numpy(np.mean([turn_environment(light, turn) for turn in chosen], axis=0, dtype=np.float32))


@torch.no_grad()
def with_detail(
    dataset: Dataset, asset: Asset, light: np.ndarray, size: int, seconds: float, show: Callable[[float], None]
) -> Asset:
    """The asset with an albedo texture as fine as the photos.

    Args:
        dataset: The photos, more than HELD_OUT / 2.
        asset: An asset with one material, textured with albedo, roughness-metallic and normals.
        light: [h, 2 h, 3] linear radiance.
        size: The edge of the new texture, the present one or a multiple of it.
        seconds: After which no further photo is read; those that were are spread over all.
        show: Called with the share of the photos that were read.
    """
    n, started = len(dataset), time.monotonic()
    order = np.argsort(np.arange(n) * 0.6180339887 % 1)  # any first part is spread over all
    held = order[HELD_OUT // 2 :: HELD_OUT]
    texels = FineTexels(asset, mean_light(light, dataset.light_turns), size)
    sums, weights = torch.zeros_like(texels.albedo), torch.zeros(len(texels.albedo), 1)
    for count, view in enumerate(np.setdiff1d(order, held, assume_unique=True)):
        if count and time.monotonic() - started > FITTED * seconds:
            break
        shown = texels.shown_in(dataset, view)
        told = texels.tells(shown)
        weight = shown.pixels * told.share.mean(1, keepdim=True).square()
        sums.index_add_(0, shown.rows, weight * told.albedo)
        weights.index_add_(0, shown.rows, weight)
        show(count / n)
    added = torch.where(weights > 0, sums / weights.clamp(min=1e-20), texels.albedo).clamp(0, 1) - texels.albedo
    shown_too = confirmed(texels, dataset, held, added, started + seconds)
    kept = texels.windows.read(torch.arange(len(added)), (shown_too / CONFIRMED).clamp(0, 1))
    material = replace(asset.materials[0], albedo_texture=texels.texture(texels.albedo + kept * added))
    return replace(asset, materials=[material])


def confirmed(texels: FineTexels, dataset: Dataset, views: np.ndarray, added: Tensor, until: float) -> Tensor:
    """[windows, 1] the part of what was added to the albedo [m, 3] that photos show: the factor on it that leaves their colours
    the least squared error in sRGB; that of all windows where the photos say little of one."""
    products, squares = torch.zeros(texels.windows.count, 1), torch.zeros(texels.windows.count, 1)
    for count, view in enumerate(views):
        if count and time.monotonic() > until:
            break
        shown = texels.shown_in(dataset, view)
        told, rows = texels.tells(shown), shown.rows
        slope = told.slope * srgb_slope(shown.colours.clamp(min=MIN_TONE))
        missing, more = (slope * x for x in (told.albedo - texels.albedo[rows], added[rows]))
        products += texels.windows.sums(rows, (missing * more).sum(1, keepdim=True))
        squares += texels.windows.sums(rows, more.square().sum(1, keepdim=True))
    usual = 0.5 * squares.mean() + 1e-12
    of_all = products.sum() / squares.sum().clamp(min=1e-12)
    return (products + usual * of_all) / (squares + usual)
