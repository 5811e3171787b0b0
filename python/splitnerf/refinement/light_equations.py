"""Gauss-Newton steps of the light: equations from the photos, and a prior that makes it as smooth and grey as they allow. A pixel is a
linear function of the light, whose unknowns are the levels of log radiance. Bounded curvature: Levenberg 1944; Marquardt 1963.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.environment import directions_of_texels, seen_at
from splitnerf.refinement.conjugate_gradients import conjugate_gradients
from splitnerf.refinement.light import EnvironmentLight, read, read_adjoint, sum_of_levels

WEIGHT = 1e-7  # of the prior, relative to the mean squared error of the photos in sRGB units
BRIGHTNESS = 0.5  # deviation of the mean of the channels' log radiance from the coarser levels, on each level
COLOUR = 0.4  # deviation of a channel's log radiance from that mean on the coarsest level; half of it on each next one
TAILS = 3.0  # degrees of freedom of Student's t distribution
WEIGHT_SEEN = 1e-3  # of the light that photos show, relative to the same error
SEEN = 0.2  # deviation of its log radiance
DARK = 1e-3  # radiance below it counts as dark
N_PROBES = 4  # random vectors by which the diagonal is estimated
DAMPING = 0.1  # share of a diagonal bound of the whole curvature (its rows' sums) that is added to that of some rays
N_ITERATIONS = 15
LARGEST = 0.5  # change of log radiance in a step: beyond it the photos are no linear function of it


class Rows(NamedTuple):
    """How the colours of n rays depend on the light of their k directions.

    Attributes:
        texels, shares: [n k, 4] see :func:`splitnerf.refinement.light.footprints`.
        slopes: [n, k, 3] derivatives of a colour by the environment's radiance.
        weights: [n, 3] of the squared errors.
    """

    texels: Tensor
    shares: Tensor
    slopes: Tensor
    weights: Tensor


class LightEquations:
    """The observations of a light since its last step.

    Args:
        light: The light that :meth:`step` moves.
        share_of_rows: The share of the rays from which the curvature comes.
        surroundings: [h, 2 h, 4] what the photos show around the object, see :class:`splitnerf.data.dataset.Dataset`,
            or None.
    """

    def __init__(self, light: EnvironmentLight, share_of_rows: float = 0.08, surroundings: np.ndarray | None = None):
        self.light, self.share_of_rows = light, share_of_rows
        self._seen = None if surroundings is None else seen_texels(light.height, surroundings)
        self._sizes = [level.numel() for level in light.levels]
        self._shapes = [level.shape for level in light.levels]
        self._n_texels = self._sizes[-1] // 3
        self.clear()

    def clear(self) -> None:
        """Forgets the observations."""
        self.gradient, self.bound = torch.zeros(self._n_texels, 3), torch.zeros(self._n_texels, 3)
        self.n_batches, self.rows = 0, []

    def add(self, rows: Rows, sky: Tensor, residual: Tensor) -> None:
        """Adds a batch of n rays: `sky` [n, k, 3] is the light's radiance in their directions, `residual` [n, 3] are predicted
        minus observed colours, their noise independent of the slopes'."""
        texels, shares, slopes, weights = rows
        back = slopes * (weights * residual / len(slopes))[:, None]
        self.gradient += read_adjoint(back.reshape(-1, 3), texels, shares, self._n_texels)
        bound = slopes.abs() * ((slopes.abs() * sky).sum(1) * weights / len(slopes))[:, None]
        self.bound += read_adjoint(bound.reshape(-1, 3), texels, shares, self._n_texels)
        self.n_batches += 1
        n, k = max(1, int(len(slopes) * self.share_of_rows)), slopes.shape[1]
        self.rows.append(Rows(texels[: n * k], shares[: n * k], slopes[:n], weights[:n]))

    def _levels(self, vector: Tensor) -> list[Tensor]:
        return [part.view(shape) for part, shape in zip(vector.split(self._sizes), self._shapes)]

    def _synthesis(self, vector: Tensor) -> Tensor:
        """[t, 3] the map of levels that stand in one vector."""
        return sum_of_levels(self._levels(vector)).flatten(1).T

    def _adjoint(self, table: Tensor) -> Tensor:
        """The transpose of the synthesis."""
        with torch.enable_grad():
            at = torch.zeros(sum(self._sizes), requires_grad=True)
            return torch.autograd.grad((self._synthesis(at) * table).sum(), at)[0]

    def _precisions(self, vector: Tensor) -> tuple[Tensor, Tensor]:
        """Weights of the squared deviations in brightness and in colour; those of the tails are smaller."""
        parts = []
        for number, level in enumerate(self._levels(vector)):
            mean, colour = parts_of(level, number)
            brightness = WEIGHT / (BRIGHTNESS**2 + mean.square() / TAILS)
            parts.append(
                [brightness, WEIGHT / ((COLOUR / 2**number) ** 2 + colour.square().mean(0, keepdim=True) / TAILS)]
            )
        return tuple(torch.cat([part.expand(3, -1, -1).flatten() for part in kind]) for kind in zip(*parts))

    def _prior(self, vector: Tensor, precisions: tuple[Tensor, Tensor]) -> Tensor:
        """The gradient of the prior with given precisions, linear in the vector."""
        split = [parts_of(level, number) for number, level in enumerate(self._levels(vector))]
        brightness = torch.cat([mean.expand(3, -1, -1).flatten() for mean, _ in split])
        colour = torch.cat([colour.flatten() for _, colour in split])
        return precisions[0] * brightness + precisions[1] * colour

    @torch.no_grad()
    def step(self, share: float) -> float:
        """Moves the light by a share of the Gauss-Newton step and forgets the observations; returns the root mean square of
        the change of log radiance."""
        rows = Rows(*(torch.cat(part) for part in zip(*self.rows)))
        n, k, _ = rows.slopes.shape
        radiance = self.light.radiance().view(-1, 3)
        now = torch.cat([level.flatten() for level in self.light.levels])
        damping = DAMPING * self.bound * radiance / self.n_batches
        away, held = self._from_seen(radiance)

        def curvature(vector: Tensor) -> Tensor:
            change = read(self._synthesis(vector) * radiance, rows.texels, rows.shares).view(n, k, 3)
            seen = (rows.slopes * change).sum(1) * rows.weights / n
            back = (rows.slopes * seen[:, None]).reshape(-1, 3)
            table = read_adjoint(back, rows.texels, rows.shares, self._n_texels) * radiance
            return self._adjoint(table + (damping + held) * self._synthesis(vector))

        precisions = self._precisions(now)
        before = 1.0 / (self._diagonal(curvature) + WEIGHT / BRIGHTNESS**2)
        down = self._adjoint(self.gradient * radiance / self.n_batches + held * away) + self._prior(now, precisions)
        step = conjugate_gradients(
            lambda x: curvature(x) + self._prior(x, precisions), lambda x: before * x, -down, N_ITERATIONS
        )
        change = (self._synthesis(step) * share).clamp(-LARGEST, LARGEST)
        self.light.set_log_radiance((self._synthesis(now) + change).T.reshape(self._shapes[-1]))
        self.clear()
        return float(change.square().mean().sqrt())

    def _from_seen(self, radiance: Tensor) -> tuple[Tensor, Tensor]:
        """Log radiance of the texels [t, 3] minus what photos show, and the weights of its squares."""
        if self._seen is None:
            return torch.zeros_like(radiance), torch.zeros_like(radiance)
        target, known = self._seen
        away = radiance.log() - target
        return away, WEIGHT_SEEN * known / (SEEN**2 + away.square() / TAILS)

    def _diagonal(self, curvature: Callable[[Tensor], Tensor]) -> Tensor:
        """An estimate of the curvature's diagonal, smoothed over neighbours. Source: Bekas, Kokiopoulou and Saad 2007."""
        random, total = torch.Generator().manual_seed(0), torch.zeros(sum(self._sizes))
        for _ in range(N_PROBES):
            signs = torch.randint(0, 2, total.shape, generator=random).float() * 2 - 1
            total += signs * curvature(signs) / N_PROBES
        levels = [F.avg_pool2d(level.clamp(min=0), 3, 1, 1, count_include_pad=False) for level in self._levels(total)]
        return torch.cat([(level + 0.01 * level.mean()).flatten() for level in levels])


def seen_texels(height: int, surroundings: np.ndarray) -> tuple[Tensor, Tensor]:
    """The log radiance [t, 3] that photos show in the directions of a map's texels, and their weights [t, 1]: how well
    it is known, times the texel's share of the sphere."""
    directions, areas = (part.reshape(height * 2 * height, -1) for part in directions_of_texels(height))
    radiance, known = seen_at(surroundings, directions)
    target = np.log(np.maximum(radiance, DARK))
    weights = known[:, None] * areas / (4 * np.pi)
    return torch.from_numpy(target.astype(np.float32)), torch.from_numpy(weights.astype(np.float32))


def parts_of(level: Tensor, number: int) -> tuple[Tensor, Tensor]:
    """Deviations of a level [3, h, w] in brightness [1, h, w] and colour [3, h, w]; of the coarsest from its mean."""
    if number == 0:
        level = level - level.mean((1, 2), keepdim=True)
    mean = level.mean(0, keepdim=True)
    return mean, level - mean
