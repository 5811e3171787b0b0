"""Pixels near the masks' edges: the photo's colours, and the background behind the object there."""

from __future__ import annotations

import itertools

import numpy as np
import torch

from splitnerf.data.pixels import averaged_codes, decoded
from splitnerf.ops import EdgeRuns
from splitnerf.render.masks import joined, runs_of, widened

PARTLY = 0.02, 0.98  # a pixel of a coverage in between lies on an edge
BRIGHTEST = 250  # of 255: a brighter background may be clipped, so that the mask decides where the edge is


class EdgePixels:
    """The pixels within a band along the edges of the masks, where a mask is not trusted to a pixel.

    There a pixel's colour is compared including the background: the object over the colour behind it, which is filled
    in from outside the band. 24 bytes a run of neighbours and 3 a pixel.

    Args:
        photos: The result of :func:`edge_of` for each photo.
        n_pixels: The number of pixels of a photo.
        device: The device of lookups.

    Attributes:
        runs: The pixels and the colours behind the object there, at the photos' own exposures.
    """

    def __init__(
        self, photos: list[tuple[tuple[np.ndarray, np.ndarray], np.ndarray]], n_pixels: int, device: torch.device
    ):
        starts, ends = joined([runs for runs, _ in photos], n_pixels)
        before = np.cumsum(ends - starts) - (ends - starts)
        behind = np.concatenate([behind for _, behind in photos])
        self.runs = EdgeRuns(*(torch.from_numpy(x).to(device) for x in (starts, ends, before - starts, behind)))

    def __len__(self) -> int:
        return len(self.runs.behind)


def edge_of(
    colours: np.ndarray, alpha: np.ndarray, known: np.ndarray | None, width: int
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """The pixels of a photo within a band along its mask's edges as runs (see :func:`splitnerf.render.masks.runs_of`),
    and the sRGB colours [k, 3] uint8 behind the object there. Pixels in front of a clipped background are left out.

    Args:
        colours: [H, W, 3] sRGB, whole numbers or floats in [0, 1].
        alpha: [H, W] the mask, in [0, 1].
        known: [H, W] bool, the valid pixels; None for all.
        width: The pixels on each side of an edge.
    """
    near, behind = edge_mask(colours, alpha, known, width)
    return runs_of(torch.from_numpy(near)), behind


def edge_mask(
    colours: np.ndarray, alpha: np.ndarray, known: np.ndarray | None, width: int
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels [H, W] bool and the colours [k, 3] of :func:`edge_of`, with the same arguments."""
    near, outside = band(alpha, width)
    if known is not None:
        near, outside = near & known, outside & known
    place, behind = filled_in(colours, near, outside, width)
    scale = 255 if colours.dtype.kind == "f" else 255 / np.iinfo(colours.dtype).max
    behind = (behind * np.float32(scale) + np.float32(0.5)).astype(np.uint8)
    certain = behind.max(axis=1) < BRIGHTEST
    near = np.zeros_like(near)
    near.reshape(-1)[place[certain]] = True
    return near, behind[certain]


def average_with_edges(photo: np.ndarray, factor: int, known: np.ndarray | None, width: int) -> np.ndarray:
    """Averages a photo down as :class:`EdgePixels` compares it.

    Along the mask's edges and outside of the mask, a pixel is the mean of object and background. The other pixels that
    the object covers in part are means of the object alone: there the mask decides where the edge is.

    Args:
        photo: [H, W, 4] sRGB of a whole photo, and its mask.
        factor: The edge of a block in pixels, at least 2.
        known: [H // factor, W // factor] bool, the valid averages; None for all.
        width: The pixels of the average on each side of an edge.

    Returns:
        [H // factor, W // factor, 4] uint16.
    """
    result, whole = (averaged_codes(photo, factor, object_alone=alone) for alone in (True, False))
    whole, alpha = whole[..., :3], decoded(result[..., 3])
    shown = edge_mask(whole, alpha, known, width)[0] | (alpha <= PARTLY[0])
    result[shown, :3] = whole[shown]
    return result


def band(alpha: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """[H, W] bool each: the pixels within `width` of the edge of a mask [H, W], and those more than twice as far
    outside it, which the object does not touch where the mask is wrong by no more than the band is wide."""
    inside, partly = torch.from_numpy(alpha > 0.5), torch.from_numpy((alpha > PARTLY[0]) & (alpha < PARTLY[1]))
    near = (widened(inside, width) & widened(~inside, width)) | partly
    return near.numpy(), (~widened(inside | partly, 2 * width) & ~near).numpy()


def filled_in(colours: np.ndarray, near: np.ndarray, outside: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels [k] of a band that have some outside within reach, and their mean colour [k, 3], weighted by a
    Gaussian, over every third pixel in both directions.

    Args:
        colours: [H, W, 3].
        near, outside: [H, W] bool.
        size: Half the width of the band in pixels, which is the Gaussian's deviation.
    """
    height, width = near.shape
    reach = 3 * (size + 1)
    step = np.arange(-reach, reach + 1, 3)
    weights = np.exp(-0.5 * (step[:, None] ** 2 + step**2) / size**2).astype(np.float32).ravel()
    place = np.flatnonzero(near)
    total, sums = np.zeros(len(place), np.float32), np.zeros((len(place), 3), np.float32)
    row, column = place // width, place % width
    for (dy, dx), weight in zip(itertools.product(step, step), weights):
        y, x = (row + dy).clip(0, height - 1), (column + dx).clip(0, width - 1)
        at = outside[y, x].nonzero()[0]
        total[at] += weight
        sums[at] += weight * colours[y[at], x[at]]
    seen = total > 0
    return place[seen], sums[seen] / total[seen, None]
