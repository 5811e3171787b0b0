"""Adversarial inputs: values at which formulas of rendering break, crossed with ordinary ones.

Everything is drawn in float64 and rounded to float32 last, so that both precisions are asked the same numbers.
"""

import math

import torch
from reference import facing
from torch import Tensor
from torch.nn import functional as F

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


def directions_of(x: Tensor) -> Tensor:
    """[n, 3] the unit directions of float32 vectors; that of 0 is z."""
    found = unit(x.double())
    return torch.where((found == 0).all(1, keepdim=True), torch.tensor([0.0, 0.0, 1.0], dtype=found.dtype), found)


def drawn_directions(
    normals: Tensor, view_dirs: Tensor, roughness: Tensor, share: float, n_samples: int, seed: int = 0
) -> tuple[Tensor, Tensor]:
    """Directions [n, k, 3] and their densities [n, k]: a share by the visible normals, then the rest by the cosine.

    Either part is a lattice with a random shift for each point; the density is that of both parts together.

    Source: Heitz 2018; Dupuy and Benyoub 2023 (visible normals); Veach 1997 (balance heuristic).
    """
    generator, golden = torch.Generator().manual_seed(seed), (5**0.5 - 1) / 2
    normals, _ = facing(normals, view_dirs)
    tangent = F.normalize(
        torch.linalg.cross(normals, normals.roll(1, 1) * torch.tensor([1.0, -1.0, 1.0]).to(normals)), dim=1
    )
    frame = torch.stack([tangent, torch.linalg.cross(normals, tangent), normals], 2)  # its columns are the axes
    view, alpha = (view_dirs[:, None] @ frame), (roughness**2).clamp(min=2e-3)[..., None]

    def lattice(count: int) -> tuple[Tensor, Tensor]:
        steps = torch.arange(count, dtype=normals.dtype)
        first, second = torch.rand(2, len(normals), 1, generator=generator, dtype=normals.dtype)
        return torch.frac((steps + 0.5) / max(count, 1) + first), 2 * math.pi * (steps * golden + second)

    def around(height: Tensor, angle: Tensor) -> Tensor:
        radius = (1 - height**2).clamp(min=0).sqrt()
        return torch.stack([radius * angle.cos(), radius * angle.sin(), height], -1)

    count = round(share * n_samples)
    u, angle = lattice(count)
    stretched = F.normalize(torch.cat([alpha * view[..., :2], view[..., 2:]], -1), dim=-1)
    cap = around((1 - u) * (1 + stretched[..., 2]) - stretched[..., 2], angle) + stretched
    half = F.normalize(torch.cat([alpha * cap[..., :2], cap[..., 2:].clamp(min=0)], -1), dim=-1)
    mirrored = 2 * (view * half).sum(-1, keepdim=True) * half - view
    u, angle = lattice(n_samples - count)
    local = torch.cat([mirrored, around(u.sqrt(), angle)], 1)

    a2, n_v = alpha[..., 0] ** 2, view[..., 2].clamp(min=1e-4)
    apart = F.normalize(local + view, dim=-1) - torch.tensor([0.0, 0.0, 1.0]).to(local)
    apart = apart.square().sum(-1)
    d = a2 / (math.pi * (a2 + (1 - a2) * apart * (1 - apart / 4)) ** 2)
    visible = d / (2 * (n_v + (a2 + (1 - a2) * n_v**2).sqrt()))
    density = count / n_samples * visible + (1 - count / n_samples) * local[..., 2] / math.pi
    return local @ frame.transpose(1, 2), torch.where(local[..., 2] > 0, density, 0)
