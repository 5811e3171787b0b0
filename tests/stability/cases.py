"""Adversarial inputs: values at which formulas of rendering break, crossed with ordinary ones.

Everything is drawn in float64 and rounded to float32 last, so that both precisions are asked the same numbers.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

ROUGHNESS = (0.0, 1e-7, 1e-4, 1e-2, 0.0447, 0.1, 0.3, 0.35, 0.4, 0.5, 1 - 6e-8, 1.0)
COSINES = (0.0, 1e-7, -1e-7, 1e-38, 1e-4, -1e-4, 1e-2, 0.5, 1 - 1e-7, 1.0, -1.0)
RADIANCE = (0.0, 1e-38, 1e-30, 1e-8, 1.0, 1e6, 1e30)
SHARES = (0.0, 1e-45, 1e-38, 1e-7, 0.5, 1 - 6e-8, 1.0)
SIZES = (1e-38, 1e-20, 1e-12, 1e-7, 1e-4, 1.0, 1e4, 1e6)


class Draw:
    """A seeded source of adversarial numbers, float64 on the CPU, each of them a float32 number.

    Args:
        seed: Of all that is drawn.
    """

    def __init__(self, seed: int):
        self.generator = torch.Generator().manual_seed(seed)

    def uniform(self, *shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=self.generator, dtype=torch.float64)

    def normal(self, *shape: int) -> Tensor:
        return torch.randn(*shape, generator=self.generator, dtype=torch.float64)

    def pick(self, values: tuple[float, ...], *shape: int) -> Tensor:
        """One of the values for each number."""
        which = torch.randint(len(values), shape, generator=self.generator)
        return torch.tensor(values, dtype=torch.float64)[which]

    def chance(self, share: float, *shape: int) -> Tensor:
        return torch.rand(*shape, generator=self.generator) < share

    def mixed(self, values: tuple[float, ...], ordinary: Tensor, share: float = 0.5) -> Tensor:
        """The ordinary numbers, a share of them replaced by one of the values, or by its neighbour in float32."""
        extreme = self.pick(values, *ordinary.shape).float()
        towards = torch.where(self.chance(0.5, *ordinary.shape), math.inf, -math.inf).float()
        neighbour = torch.nextafter(extreme, towards).abs().copysign(extreme)
        extreme = torch.where(self.chance(0.2, *ordinary.shape), neighbour, extreme).double()
        return torch.where(self.chance(share, *ordinary.shape), extreme, ordinary)

    def logarithmic(self, low: float, high: float, *shape: int) -> Tensor:
        return torch.exp(self.uniform(*shape, low=math.log(low), high=math.log(high)))

    def signs(self, *shape: int) -> Tensor:
        return self.pick((-1.0, 1.0), *shape)

    def roughness(self, n: int) -> Tensor:
        """[n, 1] in [0, 1]: the extremes, the nodes of the split-sum table, and numbers between."""
        nodes = torch.round(self.uniform(n, 1) * 31) / 31
        ordinary = torch.where(self.chance(0.2, n, 1), nodes, self.uniform(n, 1))
        return self.mixed(ROUGHNESS, ordinary).clamp(0, 1)

    def radiance(self, *shape: int, top: float = 1e30) -> Tensor:
        """Numbers >= 0 from nothing to ``top``; a third of the rows are ordinary, as is most light."""
        wild = self.mixed(tuple(x for x in RADIANCE if x <= top), self.logarithmic(1e-10, min(top, 1e10), *shape))
        calm = self.chance(0.33, shape[0], *[1] * (len(shape) - 1))
        return torch.where(calm, self.uniform(*shape), wild)

    def shares(self, *shape: int) -> Tensor:
        """Numbers in [0, 1]."""
        return self.mixed(SHARES, self.uniform(*shape)).clamp(0, 1)

    def directions(self, n: int) -> Tensor:
        """[n, 3] unit: anywhere, along axes and diagonals, and close to these."""
        anywhere = self.normal(n, 3)
        lattice = self.pick((-1.0, 0.0, 1.0), n, 3)
        lattice[:, 2] = torch.where(lattice.abs().sum(1) == 0, 1.0, lattice[:, 2])
        close = lattice + self.pick((0.0, 1e-7, 1e-4, 1e-2), n, 1) * self.normal(n, 3)
        return unit(torch.where(self.chance(0.5, n, 1), close, anywhere))

    def at_cosine(self, axes: Tensor) -> Tensor:
        """[n, 3] unit directions whose cosine to the axes is extreme in half of the rows."""
        n = len(axes)
        cosine = self.mixed(COSINES, self.uniform(n, 1, low=-1, high=1)).clamp(-1, 1)
        side = self.normal(n, 3)
        side = unit(side - (side * axes).sum(1, keepdim=True) * axes)
        return unit(cosine * axes + torch.sqrt((1 - cosine * cosine).clamp(min=0)) * side)

    def vectors(self, n: int) -> Tensor:
        """[n, 3] of extreme lengths, a tenth of them of length 0."""
        size = self.mixed(SIZES, self.logarithmic(1e-3, 1e3, n, 1))
        return torch.where(self.chance(0.1, n, 1), 0.0, size * self.directions(n))


def unit(x: Tensor) -> Tensor:
    """x / |x| over the last axis; 0 stays 0."""
    return x / x.norm(dim=-1, keepdim=True).clamp(min=1e-300)
