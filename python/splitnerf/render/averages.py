"""The photos from which training draws rays: averages of large photos."""

from __future__ import annotations

from functools import partial

import numpy as np

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.data.lens import pixel_width
from splitnerf.render.edges import average_with_edges

LEAST_EDGE = 8  # pixels along the shorter edge of an average


def training_photos(dataset: Dataset, config: Config) -> Dataset:
    """The photos themselves, or averages by the largest whole factor that `sampling.pixel_cells` allows.

    A pixel of an average is the mean of its block in linear light, as in a smaller photo, also along the masks' edges.
    Detail finer than the fields' cells is noise to them; the mean of a block has less of it than a pixel, at the same
    cost of a step.

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
    """The integer factor by which photos are averaged down for training; 1: none.

    The width of a pixel is that at the middle of the scene's box, or where the box ends for cameras within it, as a
    median over the photos.
    """
    box, most = config.constants.box, max(1, int(dataset.sizes.min()) // LEAST_EDGE)
    pixel = pixel_width(dataset.poses, dataset.intrinsics, np.zeros(3), nearest=box)
    cell = 2 * box / config.finest_cells
    return int(np.clip(config.sampling.pixel_cells * cell / pixel, 1, most))
