"""The pixels of photos that show the object alone, with rays through their filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, srgb_to_linear
from splitnerf.data.pixels import per_channel

MIN_ALPHA = 0.99  # of a pixel that the object covers
MOST = 1 << 25  # covered pixels of a fit, about: 1.4 GB
NEARBY = 0.01  # pixels to either side over which a density is a mean
HELD_OUT, BLOCK = 8, 8  # one in so many photos or blocks is held out; pixels along the edge of a block
SATURATED = 254.5 / 255.0  # share of a photo's largest sRGB value from which on it is a lower bound


@dataclass
class Pixels:
    """Covered pixels of all photos.

    Attributes:
        view: [n] int64, the number of the photo.
        centre: [n, 2] float32, (x, y) of the pixel's centre.
        target: [n, 3] float32 linear radiance.
        brightest: [n, 3] float32 the largest linear radiance of the pixel and those of its eight neighbours that the
            object covers.
        saturated: [n, 3] bool, whether the photo only gives a lower bound.
        poses: [views, 3, 4] float32 camera-to-world, OpenGL axes, the data's world frame.
        intrinsics: [views, 4] float32 fx, fy, cx, cy in pixels.
    """

    view: np.ndarray
    centre: np.ndarray
    target: np.ndarray
    brightest: np.ndarray
    saturated: np.ndarray
    poses: np.ndarray
    intrinsics: np.ndarray

    def __len__(self) -> int:
        return len(self.view)

    def rays(self, index: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays through pixels [k], at offsets [k, s, 2] from their centres in pixels: origins and unit directions, [k, s, 3]
        float32 each, world frame."""
        return self.rays_through(self.view[index], self.centre[index, None] + offsets)

    def rays_through(self, view: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rays of photos [k] through points [k, s, 2] of their images, see :meth:`rays`."""
        fx, fy, cx, cy = (self.intrinsics[view, i, None] for i in range(4))
        x, y = np.moveaxis(points, -1, 0)
        local = np.stack([(x - cx) / fx, -(y - cy) / fy, -np.ones_like(x)], axis=-1)
        pose = self.poses[view]
        directions = local @ pose[:, :, :3].swapaxes(1, 2)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        origins = np.broadcast_to(pose[:, None, :, 3], directions.shape)
        return np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32)


def pixels_of(dataset: Dataset, choose: Callable[[int], np.ndarray], most: int) -> Pixels:
    """Pixels of a split, photo by photo: those [H, W] bool that `choose` returns for the number of a photo, or a random share where
    there are more than about `most`: a pixel takes 43 bytes."""
    chosen, count = [], 0
    for i in range(len(dataset)):
        mask = choose(i)
        chosen.append(np.packbits(mask))  # an eighth of a byte a pixel
        count += np.count_nonzero(mask)
    share, random, size = min(1.0, most / max(count, 1)), np.random.default_rng(0), dataset.height * dataset.width
    white = linear_to_srgb((1 / per_channel(dataset.exposures)).astype(np.float32))
    shapes, kinds = ((0,), (0, 2), (0, 3), (0, 3), (0, 3)), (np.int64, np.float32, np.float32, np.float32, bool)
    parts = [tuple(map(np.zeros, shapes, kinds))]  # where no pixel is chosen
    for i, bits in enumerate(chosen):
        numbers = np.flatnonzero(np.unpackbits(bits, count=size))
        numbers = numbers[random.random(len(numbers)) < share] if share < 1 else numbers
        if len(numbers) == 0:
            continue
        photo, (row, column) = dataset.images[i], np.divmod(numbers, dataset.width)
        colours, brightest = photo[row, column, :3], brightest_around(photo)[row, column]
        parts.append(
            (
                np.full(len(numbers), i),
                np.stack([column, row], axis=1).astype(np.float32) + 0.5,
                srgb_to_linear(colours),
                srgb_to_linear(brightest),
                colours >= SATURATED * white[i],
            )
        )
    arrays = (np.concatenate(of_parts) for of_parts in zip(*parts))
    return Pixels(*arrays, dataset.world_poses[:, :3].astype(np.float32), dataset.intrinsics)


def brightest_around(photo: np.ndarray) -> np.ndarray:
    """[H, W, 3] the largest values of each pixel of a photo [H, W, 4] and its eight neighbours, where the object covers
    them."""
    covered = torch.from_numpy(photo[..., :3] * (photo[..., 3:] >= MIN_ALPHA)).permute(2, 0, 1)
    return F.max_pool2d(covered, kernel_size=3, stride=1, padding=1).permute(1, 2, 0).numpy()


def covered_pixels(dataset: Dataset) -> Pixels:
    """The pixels of a split that the object covers, or a random share of them."""
    return pixels_of(dataset, lambda i: dataset.images[i, ..., 3] >= MIN_ALPHA, MOST)


def held_out(pixels: Pixels) -> np.ndarray:
    """[n] bool, the pixels by which a fit is judged and not made: those of every eighth photo or, of fewer than 16 photos,
    of an eighth of the photos' blocks; where these hold all pixels or none, every eighth pixel."""
    views = np.unique(pixels.view)
    if len(views) >= 2 * HELD_OUT:
        return np.isin(pixels.view, views[HELD_OUT // 2 :: HELD_OUT])
    column, row = np.floor(pixels.centre / BLOCK).astype(np.int64).T
    held = (column + 3 * row + 5 * pixels.view) % HELD_OUT == 0
    return held if held.any() and not held.all() else np.arange(len(pixels)) % HELD_OUT == HELD_OUT - 1


class PixelFilter:
    """Offsets drawn with the density of Blender's default filter, a Blackman-Harris window of 3 pixels."""

    WIDTH = 3  # pixels
    N_QUANTILES = 4096

    def density(self, offsets: np.ndarray) -> np.ndarray:
        """[...] the density per square pixel of offsets [..., 2] from a pixel's centre, by differences of its
        quantiles."""
        quantiles = self._at(np.arange(self.N_QUANTILES) / self.N_QUANTILES).astype(np.float64)
        quantiles = np.append(quantiles, self.WIDTH / 2)
        below, above = (
            np.interp(offsets + side, quantiles, np.linspace(0, 1, len(quantiles))) for side in (-NEARBY, NEARBY)
        )
        return ((above - below) / (2 * NEARBY)).prod(axis=-1)

    def draw(self, n: int, generator: np.random.Generator) -> np.ndarray:
        """[n, 2] float32 independent offsets from the pixels' centres, in pixels."""
        return self._at(generator.random((n, 2)))

    def spread(self, n: int, n_rays: int, generator: np.random.Generator) -> np.ndarray:
        """[n, n_rays, 2] float32 offsets, those of a pixel a lattice with a random shift: for means with little noise. Source:
        Cranley and Patterson 1976; Roberts 2018 (the lattice)."""
        lattice = np.arange(n_rays)[:, None] * [0.7548776662466927, 0.5698402909980532]
        return self._at((lattice + generator.random((n, 1, 2))) % 1.0)

    @staticmethod
    def _at(u: np.ndarray) -> np.ndarray:
        return _core.pixel_filter_offsets(u.astype(np.float32).reshape(-1)).reshape(u.shape)
