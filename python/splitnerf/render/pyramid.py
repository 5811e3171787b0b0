"""Training on large photos from coarse to fine: at first on their averages."""

from __future__ import annotations

from functools import partial

import torch

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.render.edges import average_with_edges
from splitnerf.render.rays import PixelSource


class PhotoPyramid:
    """The photos that training draws rays from: averages of large ones until `sampling.coarse_until`, then the photos.

    A pixel of an average is the mean of its block in linear light: what a smaller photo would show, also along the masks' edges.
    It says more of a surface that is still coarse than one pixel out of the block does, whose detail is noise for the fields.

    Args:
        dataset: The train split.
        config: The run's settings.
        generator: The random generator of the pixels, see :class:`splitnerf.render.rays.PixelSource`.

    Attributes:
        factor: The edge of a block in pixels of the photos; 1: there are no averages.
        source: Where rays were last drawn from.
    """

    def __init__(self, dataset: Dataset, config: Config, generator: torch.Generator):
        self.dataset, self.config, self.generator = dataset, config, generator
        until, edge = config.sampling.coarse_until, config.sampling.coarse_edge
        self.factor = max(1, min(dataset.height, dataset.width) // edge) if until > 0 else 1
        self._coarse = self.factor > 1
        self.source = self._source_of(self._averages() if self._coarse else dataset)

    def at(self, progress: float) -> PixelSource:
        """Where rays are drawn from at a progress in [0, 1] that does not fall; the photos once it has reached `coarse_until`."""
        if self._coarse and progress >= self.config.sampling.coarse_until:
            self.source, self._coarse = self._source_of(self.dataset), False
        return self.source

    def _averages(self) -> Dataset:
        c = self.config
        edges = partial(average_with_edges, width=c.losses.edge_pixels)
        compares_edges = self.dataset.whole and c.losses.edge_pixels > 0
        return self.dataset.averaged(self.factor, c.data.max_memory, edges if compares_edges else None)

    def _source_of(self, dataset: Dataset) -> PixelSource:
        c = self.config
        return PixelSource(dataset, c.sampling.foreground_share, self.generator, c.losses.edge_pixels)
