"""Rays through drawn pixels, and what photos show there. Neither operator has a gradient."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops._library import lib, register


class PixelList(NamedTuple):
    """Pixels of a stack of photos in their order, as runs of neighbours.

    Attributes:
        last: [m] int64, the number of listed pixels up to the end of each run; empty: all pixels of the photos.
        shift: [m] int64, what is added to the rank of a listed pixel to get its number, counted through all photos.
        count: The number of listed pixels.
    """

    last: Tensor
    shift: Tensor
    count: int

    @classmethod
    def all(cls, count: int, device: torch.device) -> PixelList:
        """All pixels of photos with as many."""
        none = torch.empty(0, dtype=torch.int64, device=device)
        return cls(none, none, count)


class EdgeRuns(NamedTuple):
    """Pixels whose colour is compared whole, as runs of neighbours in their order.

    Attributes:
        starts, ends: [r] int64, the first pixel of each run and the one after its last, counted through all photos.
        shift: [r] int64, what is added to a pixel's number to get its row in `behind`.
        behind: [b, 3] uint8, sRGB of what the photo would show at these pixels without the object.
    """

    starts: Tensor
    ends: Tensor
    shift: Tensor
    behind: Tensor

    @classmethod
    def none(cls, device: torch.device) -> EdgeRuns:
        """No pixels."""
        empty = torch.empty(0, dtype=torch.int64, device=device)
        return cls(empty, empty, empty, torch.empty(0, 3, dtype=torch.uint8, device=device))


def draw_rays(
    random: Tensor,
    n_near: int,
    near: PixelList,
    known: PixelList,
    matrices: Tensor,
    origins: Tensor,
    height: int,
    width: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Rays through the middles of random pixels: `n_near` of one list, the others of another.

    The rays of a list share it out: ray i of k goes through pixel (i + u) / k of the list, u its random number. So no part of the
    photos is left out by chance, and each pixel is drawn as often as another, if u takes many more values (2^24 in float32)
    than a ray's part of the list has pixels.

    Args:
        random: [n] in [0, 1), float32 or float64.
        n_near: The number of rays through pixels of `near`, at most n.
        near, known: The lists. Numbers beyond the last pixel of the photos count as that.
        matrices: [v, 3, 3], from an image point (x, y, 1) of a view to its direction in the world, not normalised.
        origins: [v, 3] the views' centres.
        height, width: Of the photos, in pixels.

    Returns:
        rays_o, rays_d: [n, 3] origins and unit directions.
        view, index: [n] int64, the rays' views, and their pixels counted through all views.

    Raises:
        ValueError: A shape, dtype or size does not fit, or a list from which rays are drawn has no pixel.

    Source: stratified sampling (Pharr, Jakob and Humphreys, Physically Based Rendering, 4th ed., section 8.2.1).
    """
    return lib.draw_rays(random, n_near, *near, *known, matrices, origins, height, width)


def read_pixels(
    codes: Tensor, index: Tensor, view: Tensor, exposures: Tensor, backgrounds: Tensor, edges: EdgeRuns
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """What photos show at pixels, how they were exposed, and what lies behind.

    Args:
        codes: [pixels, 4] of all photos, one after the other: uint8 or int16, which holds the bits of uint16, the values times 255
            or 65535; or float32, the values.
        index, view: [n] int64, the pixels and their photos, see :func:`draw_rays`.
        exposures: [v, 3] the photos' factors, float32 or float64.
        backgrounds: [n, 3] sRGB colours.
        edges: The pixels behind which another colour lies.

    Returns:
        pixels: [n, 4] sRGB and alpha, in [0, 1] but for float32 codes, which stay as they are.
        exposure: [n, 3] the factors of each pixel's photo.
        background: [n, 3] `backgrounds`, but at the pixels of `edges` their own.
        whole: [n] bool, which pixels are among those of `edges`.

    Raises:
        ValueError: A shape or dtype does not fit, or (on the CPU) a pixel or a photo is not there.
    """
    return lib.read_pixels(codes, index, view, exposures, backgrounds, *edges)


def _fake_draw(random, n_near, *rest):
    n = random.shape[0]
    return (*(random.new_empty(n, 3) for _ in range(2)), *(random.new_empty(n, dtype=torch.int64) for _ in range(2)))


def _fake_read(codes, index, view, exposures, backgrounds, *edges):
    n = index.shape[0]
    found = [backgrounds.new_empty(n, c) for c in (4, 3, 3)]
    return *found, backgrounds.new_empty(n, dtype=torch.bool)


register("draw_rays", fake=_fake_draw)
register("read_pixels", fake=_fake_read)
