"""Training on large photos from coarse to fine: at first on their averages."""

from __future__ import annotations

import torch

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.render.rays import PixelSource


class PhotoPyramid:
    """The photos that training draws rays from: averages of large ones until `sampling.coarse_until`, then the photos.

    A pixel of an average is the mean of its block in linear light, premultiplied: what a smaller photo would show. It says more
    of a surface that is still coarse than one pixel out of the block does, whose detail is noise for the fields.

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
        first = dataset if self.factor == 1 else dataset.averaged(self.factor, config.data.max_memory)
        self.source, self._coarse = self._source_of(first), self.factor > 1

    def at(self, progress: float) -> PixelSource:
        """Where rays are drawn from at a progress in [0, 1] that does not fall; the photos once it has reached `coarse_until`."""
        if self._coarse and progress >= self.config.sampling.coarse_until:
            self.source, self._coarse = self._source_of(self.dataset), False
        return self.source

    def _source_of(self, dataset: Dataset) -> PixelSource:
        c = self.config
        return PixelSource(dataset, c.sampling.foreground_share, self.generator, c.losses.edge_pixels)
