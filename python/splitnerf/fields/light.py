"""What every model of the light offers."""

from __future__ import annotations

import abc
import math

import torch
from torch import Tensor, nn

from splitnerf import _core

SAMPLES_RATE = 0.03  # of the running means that decide how many directions the light loss takes
FEWEST_SAMPLES = 64


class LightSamples:
    """How many directions the light's consistency loss takes: so many that the noise of its integrals makes up the share
    of the squared error that they are to tell that is asked for.

    Both are running means, as a lamp that few directions meet is seen in few steps.
    """

    def __init__(self) -> None:
        self.variance = self.squared_error = 0.0

    def learn(self, noise: float, squared_error: float, n: int) -> None:
        """Takes the variance of one step's integrals over n directions, and the squared error."""
        rate = SAMPLES_RATE if self.squared_error else 1.0
        self.variance += rate * (noise * n - self.variance)
        self.squared_error += rate * (squared_error - self.squared_error)

    def count(self, share: float, most: int) -> int:
        """Directions of the next step for noise of this share, 64 to ``most``; before the first step the most."""
        if not self.squared_error:
            return most
        return int(min(most, max(FEWEST_SAMPLES, self.variance / (share * self.squared_error))))


class Light(nn.Module, abc.ABC):
    """The pre-integrated light g(w, rho): the environment filtered by the lobe of roughness rho.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. A subclass defines
    :meth:`forward`, differentiable in its parameters, in directions and in roughness.

    Attributes:
        needs_consistency_loss: Whether only ``losses.light_loss`` ties g(w, rho) to g(w, 0). False where
            that holds by construction.
        loss_samples: How many light directions that loss takes. Not part of a checkpoint.

    Source: SplitNeRF Eq. (8)-(11).
    """

    needs_consistency_loss = True

    def __init__(self) -> None:
        super().__init__()
        self.loss_samples = LightSamples()

    @abc.abstractmethod
    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""

    def collect(self, on: bool = True) -> None:
        """From now on gradients may stop short of the parameters until :meth:`deliver`, or, off, no longer; here they never
        do."""

    def deliver(self) -> None:
        """Takes gradients that have come together since :meth:`collect` to the parameters."""

    def forget(self) -> None:
        """Drops gradients that have come together."""

    def prepare(self) -> None:
        """Computes now what all uses of the light share as it stands."""

    def stand_in(self, value: Tensor) -> tuple[Tensor, object]:
        """What takes the place of a value computed from the light until the next :meth:`deliver`, and a token that is the
        same as long as it may. Here that is the value itself, for one backward pass."""
        return value, object()

    def stands(self, token: object) -> bool:
        """Whether a stand-in with this token still may be used."""
        return False

    @torch.no_grad()
    def panorama(self, height: int, roughness: float = 0.0) -> Tensor:
        """[height, 2 height, 3] equirectangular radiance at one roughness (z up, centre column along +x)."""
        parameter = next(self.parameters())
        flat = panorama_directions(height, parameter.device).reshape(-1, 3).to(parameter.dtype)
        rho = torch.full_like(flat[:, :1], roughness)
        return torch.cat([self(d, r) for d, r in zip(flat.split(1 << 16), rho.split(1 << 16))]).view(height, -1, 3)


def panorama_directions(height: int, device: torch.device | str = "cpu") -> Tensor:
    """[height, 2 height, 3] unit directions of an equirectangular map's texel centres."""
    return torch.from_numpy(_core.equirect_directions(height, 2 * height)).to(device=device, dtype=torch.float32)


def lobe_roughness(solid_angle: Tensor | float) -> Tensor | float:
    """Roughness whose pre-integration lobe has this effective solid angle, 4 pi a^2 for narrow ones; at most 1."""
    roughness = (solid_angle / (4.0 * math.pi)) ** 0.25
    return roughness.clamp(max=1.0) if isinstance(roughness, Tensor) else min(roughness, 1.0)
