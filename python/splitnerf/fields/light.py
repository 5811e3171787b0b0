"""What every model of the light offers, and the light as it stands at one moment."""

from __future__ import annotations

import abc
import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import torch
from torch import Tensor, nn

from splitnerf import _core

SAMPLES_RATE = 0.03  # of the running means that decide how many directions the light loss takes
FEWEST_SAMPLES = 64


class LightSamples:
    """How many directions the light's consistency loss takes: as many as keep the noise of its integrals at a given share of
    the squared error that the loss measures.

    Both are running means, as a lamp that few directions meet is seen in few steps.
    """

    def __init__(self) -> None:
        self.variance = self.squared_error = 0.0

    def learn(self, noise: float, squared_error: float, n: int) -> None:
        """Takes the variance of one step's integrals over n directions, and the squared error."""
        rate = SAMPLES_RATE if self.squared_error else 1.0
        self.variance += rate * (noise * n - self.variance)
        self.squared_error += rate * (squared_error - self.squared_error)

    def state(self) -> Tensor:
        """[2] float64, what a checkpoint keeps."""
        return torch.tensor([self.variance, self.squared_error], dtype=torch.float64)

    def restore(self, state: Sequence[float]) -> None:
        """Goes on from what :meth:`state` returned."""
        self.variance, self.squared_error = state

    def count(self, share: float, most: int) -> int:
        """Directions of the next step for noise of this share, 64 to ``most``; before the first step the most."""
        if not self.squared_error:
            return most
        return int(min(most, max(FEWEST_SAMPLES, self.variance / (share * self.squared_error))))


class LightMaps(Protocol):
    """The light g(w, rho) as it stands, until its parameters move.

    Attributes:
        leaves: Tensors at which the gradients of lookups gather; () where every backward pass reaches the parameters.
    """

    leaves: tuple[Tensor, ...]

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""

    def backward(self) -> None:
        """Hands the gradients that have gathered at the leaves to the parameters, once."""

    def with_leaves(self, leaves: Sequence[Tensor]) -> LightMaps:
        """The same light, read from other leaves."""


class CellLight(NamedTuple):
    """The environment as a fixed set of directions sees it, each of which stands for a cell of the sphere.

    Attributes:
        radiance: [k, 3], the mean over a direction's cell.
        directions: [k, 3] unit, the cell's centre of power: a small lamp shines from where it is.
        solid_angles: [k] sr; they sum to 4 pi.
    """

    radiance: Tensor
    directions: Tensor
    solid_angles: Tensor


class EvaluatedLight:
    """The light as it stands, shared by all that read it until its parameters move.

    Calls look the light up. Gradients gather at :attr:`leaves`, over as many steps as share this value, until
    :meth:`backward` hands them to the light's parameters.

    Args:
        maps: What lookups read.
        cells: The light of the cells, computed from the maps; None where nobody sums over cells.
    """

    def __init__(self, maps: LightMaps, cells: CellLight | None = None):
        self.maps, self.cells = maps, cells
        self._cell_root: Tensor | None = None  # what the leaf of the cells stands for
        self._cell_leaves: tuple[Tensor, ...] = ()
        if cells is not None and maps.leaves:
            self._cell_root, leaf = cells.radiance, leaf_of(cells.radiance)
            self.cells, self._cell_leaves = cells._replace(radiance=leaf), (leaf,)

    def __call__(self, directions: Tensor, roughness: Tensor) -> Tensor:
        """directions [n, 3] unit, roughness [n, 1] in [0, 1] -> radiance [n, 3] >= 0."""
        return self.maps(directions, roughness)

    @property
    def leaves(self) -> tuple[Tensor, ...]:
        """Tensors at which gradients gather, () where they reach the parameters at once."""
        return (*self.maps.leaves, *self._cell_leaves)

    @property
    def constants(self) -> tuple[Tensor, ...]:
        """Tensors that are read and have no gradient."""
        return () if self.cells is None else self.cells[1:]

    def with_tensors(self, leaves: Sequence[Tensor], constants: Sequence[Tensor]) -> EvaluatedLight:
        """The same light, read from other leaves and constants; its gradients gather there and go no farther."""
        n = len(self.maps.leaves)
        copy = EvaluatedLight(self.maps.with_leaves(leaves[:n]))
        copy._cell_leaves = tuple(leaves[n:])
        if self.cells is not None:
            copy.cells = CellLight(*copy._cell_leaves or (self.cells.radiance,), *constants)
        return copy

    def backward(self) -> None:
        """Hands the gradients that have gathered to the light's parameters. Call it once, before they move."""
        if self._cell_root is not None and self.cells.radiance.grad is not None:
            self._cell_root.backward(self.cells.radiance.grad)
        self.maps.backward()

    def zero_grad(self) -> None:
        """Drops the gradients that have gathered."""
        for leaf in self.leaves:
            leaf.grad = None


def leaf_of(value: Tensor) -> Tensor:
    """The same numbers as a leaf, at which gradients stop."""
    return value.detach().requires_grad_()


class Light(nn.Module, abc.ABC):
    """The pre-integrated light g(w, rho): the environment filtered by the lobe of roughness rho.

    g(w, 0) is the environment itself and g(n, 1) the irradiance over pi. A subclass defines :meth:`forward`, which is
    differentiable in its parameters, in directions and in roughness, and :meth:`evaluate`, what of it steps can share.

    Attributes:
        needs_consistency_loss: Whether only ``losses.light_loss`` ties g(w, rho) to g(w, 0). False where
            that holds by construction.
        loss_samples: How many light directions that loss takes.

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
        """The light as it stands: here the module itself, whose every backward pass reaches the parameters."""
        return self

    def backward(self) -> None:
        """Does nothing: no gradients gather here."""

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


def lobe_roughness(solid_angle: Tensor | float) -> Tensor | float:
    """Roughness whose pre-integration lobe has this effective solid angle, 4 pi a^2 for narrow ones; at most 1."""
    roughness = (solid_angle / (4.0 * math.pi)) ** 0.25
    return roughness.clamp(max=1.0) if isinstance(roughness, Tensor) else min(roughness, 1.0)
