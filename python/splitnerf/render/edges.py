"""Pixels beside the masks' edges: what the photo shows there, and what it would show without the object."""

from __future__ import annotations

import numpy as np
import torch
from scipy.ndimage import binary_dilation
from torch import Tensor

from splitnerf.data.dataset import Dataset

PARTLY = 0.02, 0.98  # coverage between which a pixel lies on an edge
NEIGHBOURS = 1 << 20  # pixels that are averaged at once


class EdgePixels:
    """The pixels within a band along the edges of the masks, where a mask is not trusted to a pixel.

    There a pixel's colour is compared whole: with the object's over the colour of what lies behind it, which is filled in from
    outside the band.

    Args:
        numbers: [k] int64, ascending, the pixels, counted through all photos.
        behind: [k, 3] the sRGB colours behind the object, at the photos' own exposures.
    """

    def __init__(self, numbers: Tensor, behind: Tensor):
        self.numbers, self.behind = numbers, behind

    @classmethod
    def of(cls, dataset: Dataset, width: int, device: torch.device) -> EdgePixels | None:
        """The pixels of a split whose photos keep their colours outside the masks; None where no mask has an edge.

        Args:
            dataset: The split.
            width: The pixels on each side of an edge.
            device: Where the pixels are looked up.
        """
        numbers, behind, n_pixels = [], [], dataset.height * dataset.width
        for i in range(len(dataset)):
            near, outside = band(dataset.images[i, ..., 3], width)
            if dataset.known is not None:
                near, outside = near & dataset.known[i], outside & dataset.known[i]
            place, colour = filled_in(dataset.images.codes[i, ..., :3], near, outside, width)
            numbers.append(place + i * n_pixels)
            behind.append(colour)
        if not any(map(len, numbers)):
            return None
        scale = 1.0 if dataset.images.codes.dtype.kind == "f" else 1 / np.iinfo(dataset.images.codes.dtype).max
        colours = np.concatenate(behind) * np.float32(scale)
        return cls(torch.from_numpy(np.concatenate(numbers)).to(device), torch.from_numpy(colours).to(device))

    def __len__(self) -> int:
        return len(self.numbers)

    def at(self, index: Tensor) -> tuple[Tensor, Tensor]:
        """Which of the pixels [n] are among these, [n] bool, and the colours [n, 3] behind the object there."""
        place = torch.searchsorted(self.numbers, index).clamp(max=len(self) - 1)
        return self.numbers[place] == index, self.behind[place]


def band(alpha: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """[H, W] bool each: the pixels within `width` of the edge of a mask [H, W], and those more than twice as far outside it, which
    the object does not touch where the mask is wrong by no more than the band is wide."""
    inside, partly = alpha > 0.5, (alpha > PARTLY[0]) & (alpha < PARTLY[1])
    square = np.ones((3, 3), bool)
    near = (binary_dilation(inside, square, width) & binary_dilation(~inside, square, width)) | partly
    return near, ~binary_dilation(inside, square, 2 * width) & ~near


def filled_in(colours: np.ndarray, near: np.ndarray, outside: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels [k] of a band that have some outside within reach, and their mean colour [k, 3], weighted by a Gaussian.

    Args:
        colours: [H, W, 3].
        near, outside: [H, W] bool.
        size: Half the width of the band in pixels, which is the Gaussian's deviation.
    """
    height, width = near.shape
    step = np.arange(-3 * size - 2, 3 * size + 3)
    weight = np.exp(-0.5 * (step[:, None] ** 2 + step**2) / size**2).astype(np.float32).ravel()
    place = np.flatnonzero(near)
    kept, found = [], []
    for chosen in np.array_split(place, max(1, len(place) * len(weight) // NEIGHBOURS)):
        row = (chosen[:, None] // width + step).clip(0, height - 1)[:, :, None]
        column = (chosen[:, None] % width + step).clip(0, width - 1)[:, None, :]
        weights = outside[row, column].reshape(-1, len(weight)) * weight
        total = weights.sum(1)
        seen = total > 0
        sums = np.einsum("kn,knc->kc", weights[seen], colours[row[seen], column[seen]].reshape(-1, len(weight), 3))
        kept.append(chosen[seen])
        found.append(sums / total[seen, None])
    return np.concatenate(kept), np.concatenate(found).astype(np.float32)
