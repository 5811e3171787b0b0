"""The rays of training steps."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.pixels import at_unit_exposure
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import ProbePoints


class Batch(NamedTuple):
    """The rays of one step, and the photos' values at their pixels.

    Attributes:
        rays_o, rays_d: [n, 3] origins (scene units) and unit directions.
        target: [n, 4] sRGB values of the photos as they are, straight alpha; at an exposure of 1 where samples are added as sRGB.
        background: [n, 3] random sRGB colours in [0, 1), behind the photo and the rendering alike; of whole pixels what the
            photo would show without the object.
        whole: [n] bool, the pixels along the masks' edges, whose colours are compared whole.
        jitter: [n] offsets of each ray's samples in [0, 1), as shares of a sample's length.
        view: [n] int64, the photos' numbers.
        exposure: [n, 3] the factors of the photos' linear values.
        probes: Other points that the losses evaluate.
    """

    rays_o: Tensor
    rays_d: Tensor
    target: Tensor
    background: Tensor
    whole: Tensor
    jitter: Tensor
    view: Tensor
    exposure: Tensor
    probes: ProbePoints

    @property
    def rays(self) -> tuple[Tensor, Tensor, Tensor]:
        """Origins, directions and jitter."""
        return self.rays_o, self.rays_d, self.jitter


def draw_batch(source: PixelSource, n_rays: int, config: Config, exposures: Tensor) -> Batch:
    """Rays through ``n_rays`` random pixels, drawn by the source's generator; `exposures` [views, 3] are the photos'.

    Where samples are added as sRGB, colours at another exposure are not known: the photos are brought to an exposure of 1.
    """
    g = source.generator
    drawn = source.draw(n_rays)
    target, exposure = drawn.pixels, exposures[drawn.view]
    random = torch.rand(4, n_rays, generator=g, device=g.device)
    jitter, background = random[0], random[1:].reshape(n_rays, 3)
    if source.edges is None:
        whole = torch.zeros(n_rays, dtype=torch.bool, device=g.device)
    else:
        whole, behind = source.edges.at(drawn.index)
        background = torch.where(whole[:, None], behind, background)
    if config.shading.compositing == "srgb":
        target = torch.cat([at_unit_exposure(target[:, :3], exposure), target[:, 3:]], dim=1)
        background = torch.where(whole[:, None], at_unit_exposure(background, exposure), background)
        exposure = torch.ones_like(exposure)
    return Batch(
        drawn.rays_o, drawn.rays_d, target, background, whole, jitter, drawn.view, exposure, draw_probes(config, g)
    )


def draw_probes(config: Config, generator: torch.Generator) -> ProbePoints:
    """Random points for the eikonal loss and for the smoothness loss, in addition to the samples of the rays."""
    c, device = config, generator.device
    n_beside = c.losses.smoothness_points if c.losses.smoothness_weight else 0
    anywhere, shifts = (torch.empty(n, 3, device=device) for n in (c.losses.eikonal_points, n_beside))
    return ProbePoints(
        anywhere.uniform_(-c.surface.box, c.surface.box, generator=generator),
        torch.rand(n_beside, generator=generator, device=device),
        shifts.normal_(0.0, c.losses.smoothness_radius, generator=generator),
    )
