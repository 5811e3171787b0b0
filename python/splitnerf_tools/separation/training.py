"""The training of the radiance field."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import torch
from splitnerf.data.dataset import Dataset
from splitnerf.data.pixels import at_unit_exposure, per_channel
from splitnerf.training.batches import PixelSource
from torch.nn.functional import smooth_l1_loss

from splitnerf_tools.separation.field import RadianceField, search_loss, spread_loss

RAYS = 1024  # of a step
FIRST, SECOND = 64, 32  # samples of a ray
SPREAD_WEIGHT = 0.01
RATE, LAST_RATE = 1e-2, 0.03  # the learning rate, and its share at the end
WARM_UP = 100  # steps


def train_field(
    dataset: Dataset, *, steps: int, minutes: float, seed: int, report: Callable[[float, str], None]
) -> RadianceField:
    """Trains a field on whole photos. Raises RuntimeError where numbers are no longer finite.

    Args:
        dataset: The photos; their alpha is not used.
        minutes: The time after which the training ends; 0: it makes all steps.
        report: Called with the share done and what to tell of it.
    """
    torch.manual_seed(seed)
    source = PixelSource(dataset, 0.0, torch.Generator().manual_seed(seed))
    exposures = torch.from_numpy(per_channel(dataset.exposures).astype("float32"))
    field = RadianceField()
    optimiser = torch.optim.Adam(field.parameters(), lr=RATE, betas=(0.9, 0.99), eps=1e-15, fused=True)
    started, share, step, error = time.monotonic(), 0.0, 0, None
    while share < 1.0:
        for group in optimiser.param_groups:
            group["lr"] = RATE * min(1.0, (step + 1) / WARM_UP) * LAST_RATE**share
        rays_o, rays_d, pixels, view, *_ = source.draw(RAYS)
        colour = at_unit_exposure(pixels[:, :3], exposures[view]).clamp(max=1)
        rendered = field.render(rays_o, rays_d, FIRST, SECOND, jitter=True)
        apart = rendered.colour - colour
        loss = smooth_l1_loss(rendered.colour, colour, beta=0.1)
        loss = loss + search_loss(rendered) + SPREAD_WEIGHT * spread_loss(rendered)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        step += 1
        squared = float(apart.detach().square().mean())
        if not math.isfinite(squared):
            raise RuntimeError(
                f"the field of what is around the object is no longer finite at step {step}; try another --seed"
            )
        error = squared if error is None else 0.98 * error + 0.02 * squared
        used = (time.monotonic() - started) / (60 * minutes) if minutes else 0.0
        share = min(1.0, max(step / steps, used))
        report(share, f"step {step} PSNR {-10 * math.log10(max(error, 1e-10)):.2f} dB")
    return field
