"""The photos that training draws rays from: averages of large ones."""

from __future__ import annotations

from functools import partial

import numpy as np

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.render.edges import average_with_edges

LEAST_EDGE = 8  # pixels along the shorter edge of an average


def training_photos(dataset: Dataset, config: Config) -> Dataset:
    """The photos themselves, or averages whose pixels are as wide as `sampling.pixel_cells` says, or a little less.

    A pixel of an average is the mean of its block in linear light: what a smaller photo would show, also along the masks'
    edges. What is finer than the fields' cells is noise to them: its mean says more than one pixel does, at the same cost of a
    step.

    Args:
        dataset: The train split.
        config: The run's settings.
    """
    factor = averaging_factor(dataset, config)
    if factor == 1:
        return dataset
    width = config.losses.edge_pixels
    edges = partial(average_with_edges, width=width) if dataset.whole and width > 0 else None
    return dataset.averaged(factor, config.data.max_memory, edges)


def averaging_factor(dataset: Dataset, config: Config) -> int:
    """The whole factor by which photos are averaged down for training; 1: not at all.

    The width of a pixel is that at the middle of the scene's box, as a median over the photos.
    """
    s = config.surface
    cell = 2 * s.box / (s.base_resolution * s.growth ** (s.n_levels - 1))
    pixel = np.median(np.linalg.norm(dataset.poses[:, :3, 3], axis=1) / dataset.intrinsics[:, 0])
    most = min(dataset.height, dataset.width) // LEAST_EDGE
    return int(np.clip(config.sampling.pixel_cells * cell / pixel, 1, max(1, most)))
