"""The rays of training steps."""

from __future__ import annotations

import math
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
        phase: [n] in [0, 1), where the choice of each ray's shaded samples begins.
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
    phase: Tensor
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
    pixels, jitter, phase, backgrounds, chosen, probes = draw_numbers(
        source.generator, [n_rays, n_rays, n_rays, 3 * n_rays, *probe_counts(config)]
    )
    drawn = source.draw(n_rays, pixels, backgrounds.view(n_rays, 3), exposures)
    target, background, exposure = drawn.pixels, drawn.background, drawn.exposure
    if config.shading.compositing == "srgb":
        target = torch.cat([at_unit_exposure(target[:, :3], exposure), target[:, 3:]], dim=1)
        background = torch.where(drawn.whole[:, None], at_unit_exposure(background, exposure), background)
        exposure = torch.ones_like(exposure)
    return Batch(
        drawn.rays_o,
        drawn.rays_d,
        target,
        background,
        drawn.whole,
        jitter,
        phase,
        drawn.view,
        exposure,
        make_probes(config, chosen, probes),
    )


def draw_numbers(generator: torch.Generator, counts: list[int]) -> list[Tensor]:
    """Vectors of so many numbers in [0, 1), drawn together. Each begins at a multiple of 16 bytes, so that no operator copies it."""
    rooms = [-(-n // 4) * 4 for n in counts]
    parts = torch.rand(sum(rooms), generator=generator, device=generator.device).split(rooms)
    return [part[:n] for part, n in zip(parts, counts)]


def probe_counts(config: Config) -> tuple[int, int]:
    """How many numbers :func:`make_probes` takes as `chosen` and as `random`."""
    n_beside = config.constants.smoothness_points if config.losses.smoothness_weight else 0
    return n_beside, 3 * config.constants.eikonal_points + 4 * n_beside


def make_probes(config: Config, chosen: Tensor, random: Tensor) -> ProbePoints:
    """Points for the eikonal loss and for the smoothness loss, in addition to the samples of the rays.

    Args:
        chosen, random: Numbers in [0, 1), as many as :func:`probe_counts` says.
    """
    c = config
    first, u = random.split([3 * c.constants.eikonal_points, 4 * len(chosen)])
    radius, angle = torch.sqrt(-2 * torch.log1p(-u[::2])), 2 * math.pi * u[1::2]  # Box and Muller 1958
    even, odd = (radius * torch.cos(angle)).view(-1, 2), (radius * torch.sin(angle)).view(-1, 2)
    shifts = c.constants.smoothness_radius * torch.cat([even[:, :1], odd[:, :1], even[:, 1:]], dim=1)
    return ProbePoints(c.constants.box * (2 * first.view(-1, 3) - 1), chosen, shifts)
