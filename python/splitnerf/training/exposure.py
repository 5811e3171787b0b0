"""The exposures of photos, learned while the scene is: no file tells them, or not exactly."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.data.tensor_files import check_tensor
from splitnerf.ops.shading import srgb_to_linear

KEEP = 0.998  # share of the sums that outlives a step
ENOUGH = 50.0  # pixels of a photo that count as much as the start
DARKEST, BRIGHTEST = 0.01, 0.95  # linear values of a photo's pixels that count
# Of the logarithms, as the rendering is not the object: measured 0.05 on two captures with known exposures.
ERROR = 0.06
COLOUR_ERROR = 0.02  # of each channel's difference from their mean: measured 0.009 on a capture of one white balance
FARTHEST = 1.0  # of a pixel's log from the rendering's: more is no exposure
COVERED = 0.95  # alpha and opacity of pixels that count
BEGIN = 0.02  # progress from which exposures are learned


class PhotoExposures:
    """The factor of each photo's linear values, per channel: what the photos' pixels have of those rendered, in the mean of the
    logarithms over the pixels of past steps.

    Their mean over the channels, and each channel's difference from it, are drawn to the start as far as their spread over the
    photos is no larger than their error (James and Stein 1961), so that what was right stays as it was. After each step the
    logarithms are moved to the mean that they had at the start: images do not tell the light's brightness from that of all
    photos.

    Args:
        dataset: The photos; their exposures are the start.
        config: The settings of the group `exposure`.
        device: The device of the training.

    Attributes:
        learned: Whether exposures are learned at all.
        factors: [n, 3] float32, of the photos' linear values.
        sums: [n, 4] float32, of the logarithms and of the pixels.
    """

    def __init__(self, dataset: Dataset, config: Config, device: torch.device):
        wanted = {"yes": True, "no": False, "auto": dataset.photographed}[config.exposure.refine]
        self.learned = wanted and config.shading.compositing == "linear"
        self.white_balance = config.exposure.white_balance
        start = torch.from_numpy(dataset.exposures).float().reshape(len(dataset), -1).expand(-1, 3)
        self.start = start.to(device).log()
        self.factors = self.start.exp()
        self.sums = torch.zeros(len(dataset), 4, device=device)

    def learn(self, view: Tensor, target: Tensor, mean: Tensor, opacity: Tensor, allowed: Tensor | None = None) -> None:
        """Takes in the pixels of a step.

        Args:
            view: [k] the photos' numbers.
            target: [k, 4] sRGB values of the photos as they are, straight alpha.
            mean: [k, 3] linear values of the rendering at an exposure of 1.
            opacity: [k] of the rendering.
            allowed: [] bool; where it is false none of the pixels counts. None: all count.
        """
        photo = srgb_to_linear(target[:, :3])
        counts = (target[:, 3] > COVERED) & (opacity.detach() > COVERED)
        counts &= ((photo > DARKEST) & (photo < BRIGHTEST)).all(1)
        counts = counts if allowed is None else counts & allowed
        difference = photo.clamp(min=DARKEST).log() - mean.detach().clamp(min=1e-4).log() - self.start[view]
        values = torch.cat([difference.clamp(-FARTHEST, FARTHEST), torch.ones_like(difference[:, :1])], dim=1)
        self.sums.mul_(KEEP).index_add_(0, view, torch.where(counts[:, None], values, 0.0))
        self._update()

    def _update(self) -> None:
        logs = self.sums[:, :3] / (self.sums[:, 3:] + ENOUGH)
        logs = logs - logs.mean(0)
        level = logs.mean(1, keepdim=True)
        found = shrunk(level, ERROR)
        if self.white_balance:
            found = found + shrunk(logs - level, COLOUR_ERROR)
        self.factors = (self.start + found).exp()

    @property
    def found(self) -> np.ndarray | None:
        """[n, 3] float64, the exposures where they are others than at the start; None where nothing was learned."""
        if not self.learned or torch.equal(self.factors, self.start.exp()):
            return None
        return self.factors.cpu().numpy().astype(np.float64)

    def restore(self, sums: Tensor) -> None:
        """Takes back the sums that a checkpoint kept. Raises ValueError where they are of other photos."""
        check_tensor("exposures", sums, tuple(self.sums.shape), torch.float32)
        self.sums = sums.to(self.sums.device)
        self._update()


def shrunk(logs: Tensor, error: float) -> Tensor:
    """Numbers [n, k] of mean 0, multiplied by one factor in [0, 1): 0 where their mean square is no larger than error²."""
    return (1 - error**2 / logs.square().mean().clamp(min=error**2)) * logs
