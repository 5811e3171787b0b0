"""Masks of many large photos: dilation, and runs of pixels."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from splitnerf.ops import PixelList


def widened(mask: Tensor, radius: int) -> Tensor:
    """[H, W] bool, the pixels within `radius` of one of `mask` [H, W] along rows and columns.

    A mask that was widened by r, moved by up to r + 1 to both sides, leaves no gap: a few moves make any radius.
    """
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


def reduced(mask: Tensor, factor: int) -> Tensor:
    """[H // factor, W // factor] bool, the blocks with a pixel of `mask` [H, W] in them; incomplete blocks are
    cropped."""
    height, width = mask.shape[0] // factor, mask.shape[1] // factor
    blocks = mask[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return blocks.any(dim=3).any(dim=1)


def pixel_list(runs: list[tuple[np.ndarray, np.ndarray]], n_pixels: int, device: torch.device) -> PixelList:
    """The pixels in runs (see :func:`runs_of`) of photos with as many pixels: 16 bytes a run in place of 8 a pixel."""
    starts, ends = joined(runs, n_pixels)
    last = np.cumsum(ends - starts)
    of_runs = (torch.from_numpy(x).to(device) for x in (last, ends - last))
    return PixelList(*of_runs, int(last[-1]) if len(last) else 0)


def joined(runs: list[tuple[np.ndarray, np.ndarray]], n_pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """The runs of photos with as many pixels, their pixels counted through all photos."""
    starts, ends = (np.concatenate([run[k] + i * n_pixels for i, run in enumerate(runs)]) for k in (0, 1))
    return starts, ends


def runs_of(mask: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """The first pixels of the runs of ones in a mask [H, W] bool, row by row, and the pixels after their last."""
    flat = mask.cpu().numpy().reshape(-1)
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    changes = np.concatenate([[0] if flat[0] else [], changes, [len(flat)] if flat[-1] else []]).astype(np.int64)
    return changes[::2], changes[1::2]
