"""The interface of all light models, and the evaluated light that steps share."""

from __future__ import annotations

import abc
import functools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from splitnerf import _core

SAMPLES_RATE = 0.03  # update rate of the running means that decide the light loss's number of directions
FEWEST_SAMPLES = 64


class LightSamples:
    """Chooses the number of directions for the light's consistency loss: the noise of the loss's integrals is kept at a
    given share of the squared error that the loss measures.

    Noise and error are running means, because in many steps no direction hits a small lamp.
    """

    def __init__(self) -> None:
        self.variance = self.squared_error = 0.0

    def learn(self, noise: float, squared_error: float, n: int) -> None:
        """Updates the running means with one step: the variance of its integrals over n directions, and its squared
        error."""
        rate = SAMPLES_RATE if self.squared_error else 1.0
        self.variance += rate * (noise * n - self.variance)
        self.squared_error += rate * (squared_error - self.squared_error)

    def state(self) -> Tensor:
        """The two running means [2] float64, for a checkpoint."""
        return torch.tensor([self.variance, self.squared_error], dtype=torch.float64)

    def restore(self, state: Sequence[float]) -> None:
        """Restores the running means that :meth:`state` returned."""
        self.variance, self.squared_error = state

    def count(self, share: float, most: int) -> int:
        """The number of directions for the next step, in [64, ``most``]; ``most`` before the first step.

        Args:
            share: The target ratio of noise to squared error, positive.
            most: The largest number of directions.
        """
        if not self.squared_error:
            return most
        return int(min(most, max(FEWEST_SAMPLES, self.variance / (share * self.squared_error))))


class LightTexels(NamedTuple):
    """The environment as a partition of the sphere into texels.

    Attributes:
        directions: [t, 3] unit, the middle of each texel.
        solid_angles: [t] sr; they sum to 4 pi.
        radiance: [t, 3] mean linear radiance of each texel.
    """

    directions: Tensor
    solid_angles: Tensor
    radiance: Tensor


class LightMaps(Protocol):
    """The light g(w, rho) in a form ready for lookups, valid until its parameters move.

    Attributes:
        leaves: Tensors that accumulate the gradients of lookups; () where every backward pass reaches the parameters.
    """

    leaves: tuple[Tensor, ...]

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""

    def partition(self, at_least: int, device: torch.device) -> LightTexels:
        """The environment as texels on the light's device: those that the light consists of, or else at least so many,
        each the light about its middle. The radiance is differentiable; equal calls return the same directions."""

    def backward(self) -> None:
        """Passes the accumulated gradients from the leaves on to the parameters; call it once."""

    def with_leaves(self, leaves: Sequence[Tensor]) -> LightMaps:
        """The same light, read from other leaves."""


class CellLight(NamedTuple):
    """The environment reduced to k directions, each of which represents one cell of the sphere.

    Attributes:
        radiance: [k, 3] mean linear radiance of each cell.
        directions: [k, 3] unit, a direction in each cell, which represents it.
        solid_angles: [k] solid angles of the cells, sr; they sum to 4 pi.
    """

    radiance: Tensor
    directions: Tensor
    solid_angles: Tensor


class EvaluatedLight:
    """The evaluated light, shared by all steps until its parameters move.

    A call looks up the radiance. Gradients accumulate at :attr:`leaves` over all steps that share this object, until
    :meth:`backward` passes them on to the light's parameters.

    Args:
        maps: The maps that lookups read.
        cells: The light of the cells, computed from the maps; None where no sum over cells is needed.
    """

    def __init__(self, maps: LightMaps, cells: CellLight | None = None):
        self.maps, self.cells = maps, cells
        self._cell_root: Tensor | None = None  # the computed radiance that the cells' leaf copies
        self._cell_leaves: tuple[Tensor, ...] = ()
        if cells is not None and maps.leaves:
            self._cell_root, leaf = cells.radiance, leaf_of(cells.radiance)
            self.cells, self._cell_leaves = cells._replace(radiance=leaf), (leaf,)

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""
        return self.maps(directions, roughness)

    def turned(self, turns: Tensor) -> Callable[[Tensor, Tensor], Tensor]:
        """The light of n points of its own frame each: called as the light is, with directions [m n, 3] of the points' world.

        Args:
            turns: [n, 3, 3] rotations from the points' world to the light's frame.
        """

        def look_up(directions: Tensor, roughness: Tensor) -> Tensor:
            of_points = directions.view(len(directions) // max(1, len(turns)), len(turns), 3, 1)
            return self((turns @ of_points).view(-1, 3), roughness)

        return look_up

    def mean_over(self, turns: Tensor) -> Callable[[Tensor, Tensor], Tensor]:
        """The mean light of a world that was rotated by each of `turns` [k, 3, 3] in turn; called as the light is."""
        return lambda directions, roughness: sum(self(directions @ turn.T, roughness) for turn in turns) / len(turns)

    @property
    def leaves(self) -> tuple[Tensor, ...]:
        """Tensors that accumulate gradients; () where gradients reach the parameters directly."""
        return (*self.maps.leaves, *self._cell_leaves)

    @property
    def constants(self) -> tuple[Tensor, ...]:
        """Tensors that lookups read but that have no gradient."""
        return () if self.cells is None else self.cells[1:]

    def with_tensors(self, leaves: Sequence[Tensor], constants: Sequence[Tensor]) -> EvaluatedLight:
        """A copy that reads other leaves and constants; its gradients accumulate at those leaves and stop there."""
        n = len(self.maps.leaves)
        copy = EvaluatedLight(self.maps.with_leaves(leaves[:n]))
        copy._cell_leaves = tuple(leaves[n:])
        if self.cells is not None:
            copy.cells = CellLight(*copy._cell_leaves or (self.cells.radiance,), *constants)
        return copy

    def backward(self) -> None:
        """Passes the accumulated gradients on to the light's parameters. Call it once, before the parameters move."""
        if self._cell_root is not None and self.cells.radiance.grad is not None:
            self._cell_root.backward(self.cells.radiance.grad)
        self.maps.backward()

    def zero_grad(self) -> None:
        """Drops the accumulated gradients."""
        for leaf in self.leaves:
            leaf.grad = None


def leaf_of(value: Tensor) -> Tensor:
    """A leaf tensor with the same values; gradients accumulate there and stop."""
    return value.detach().requires_grad_()


class Light(nn.Module, abc.ABC):
    """The pre-integrated light g(w, rho): the environment filtered by the lobe of roughness rho.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. A subclass defines :meth:`forward`, which is
    differentiable in its parameters, in directions and in roughness. It may override :meth:`evaluate`, which returns
    the part of the computation that steps can share.

    Attributes:
        leaves: See :class:`LightMaps`; () here.
        needs_consistency_loss: Whether g(w, rho) agrees with g(w, 0) only through ``losses.light_loss``. False where
            they agree by construction.
        loss_samples: The choice of the number of light directions for that loss.

    Source: SplitNeRF Eq. (8)-(11).
    """

    needs_consistency_loss = True

    def __init__(self) -> None:
        super().__init__()
        self.loss_samples = LightSamples()

    @abc.abstractmethod
    def forward(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""

    leaves: tuple[Tensor, ...] = ()

    def evaluate(self) -> LightMaps:
        """The light ready for lookups: here the module itself, since every backward pass reaches its parameters."""
        return self

    def partition(self, at_least: int, device: torch.device) -> LightTexels:
        """The light about the middles of an equirectangular map's texels, see :class:`LightMaps`."""
        directions, solid_angles = equirect_texels(math.ceil(math.sqrt(at_least / 2)), device)
        return LightTexels(directions, solid_angles, self(directions, texel_roughness(solid_angles)))

    def backward(self) -> None:
        """Does nothing: no gradients accumulate here."""

    def with_leaves(self, leaves: Sequence[Tensor]) -> LightMaps:
        """The module itself, which has no leaves."""
        return self

    @torch.no_grad()
    def panorama(self, height: int, roughness: float = 0.0) -> Tensor:
        """[height, 2 height, 3] equirectangular radiance at one roughness (z up, centre column along +x)."""
        parameter = next(self.parameters())
        flat = panorama_directions(height, parameter.device).reshape(-1, 3).to(parameter.dtype)
        rho, maps = torch.full_like(flat[:, :1], roughness), self.evaluate()
        return torch.cat([maps(d, r) for d, r in zip(flat.split(1 << 16), rho.split(1 << 16))]).view(height, -1, 3)


def panorama_directions(height: int, device: torch.device | str = "cpu") -> Tensor:
    """[height, 2 height, 3] unit directions of an equirectangular map's texel centres."""
    return torch.from_numpy(_core.equirect_directions(height, 2 * height)).to(device=device, dtype=torch.float32)


@functools.lru_cache(maxsize=4)
def equirect_texels(height: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """The middles [2 height^2, 3] and the solid angles [2 height^2] of an equirectangular map's texels."""
    with torch.inference_mode(False):
        directions = panorama_directions(height, device).reshape(-1, 3)
        areas = (1.0 - directions[:, 2] ** 2).clamp(min=0.0).sqrt()
        return directions, areas * (4.0 * math.pi / areas.sum())


def texel_roughness(solid_angles: Tensor) -> Tensor:
    """[t, 1] the roughness whose lobe has the mean solid angle of t texels of the sphere."""
    return torch.full_like(solid_angles[:, None], lobe_roughness(4.0 * math.pi / len(solid_angles)))


def lobe_roughness(solid_angle: Tensor | float) -> Tensor | float:
    """The roughness, at most 1, whose pre-integration lobe has this effective solid angle (sr).

    A narrow lobe with ggx_alpha = a has the solid angle 4 pi a^2.
    """
    roughness = (solid_angle / (4.0 * math.pi)) ** 0.25
    return roughness.clamp(max=1.0) if isinstance(roughness, Tensor) else min(roughness, 1.0)
