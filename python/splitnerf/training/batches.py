"""The rays of training steps."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import ProbePoints


class Batch(NamedTuple):
    """Rays of one step, and what they shall look like.

    Attributes:
        rays_o, rays_d: [n, 3].
        target: [n, 4] sRGB, straight alpha.
        background: [n, 3] sRGB behind both.
        jitter: [n] in [0, 1), of the samples.
        probes: Other points that the losses look at.
    """

    rays_o: Tensor
    rays_d: Tensor
    target: Tensor
    background: Tensor
    jitter: Tensor
    probes: ProbePoints

    @property
    def rays(self) -> tuple[Tensor, Tensor, Tensor]:
        """Origins, directions and jitter."""
        return self.rays_o, self.rays_d, self.jitter


def draw_batch(source: PixelSource, n_rays: int, config: Config) -> Batch:
    """Rays through random pixels, by the source's generator."""
    g = source.generator
    rays_o, rays_d, target = source.draw(n_rays)
    background, jitter = (torch.rand(*shape, generator=g, device=g.device) for shape in ((n_rays, 3), (n_rays,)))
    return Batch(rays_o, rays_d, target, background, jitter, draw_probes(config, g))


def draw_probes(config: Config, generator: torch.Generator) -> ProbePoints:
    """Where the eikonal loss and that of the normals' smoothness look beside the samples."""
    c = config
    n_beside = c.losses.smoothness_points if c.losses.smoothness_weight else 0
    draw = {"generator": generator, "device": generator.device}
    return ProbePoints(
        (torch.rand(c.losses.eikonal_points, 3, **draw) * 2 - 1) * c.surface.box,
        torch.rand(n_beside, **draw),
        c.losses.smoothness_radius * torch.randn(n_beside, 3, **draw),
    )
