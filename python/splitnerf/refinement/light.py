"""The environment map as unknowns: log radiance, a sum of levels from coarse to fine."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.sparse import csr_array
from torch import Tensor
from torch.nn import functional as F

LOG_LIMIT = 12.0


class EnvironmentLight:
    """An equirectangular map whose log radiance is a sum of levels, each twice as fine as the one before; it starts from linear
    `radiance` [h, 2 h, 3], h = 8 * 2^k."""

    def __init__(self, radiance: Tensor):
        self.set_radiance(radiance)

    def set_radiance(self, radiance: Tensor) -> None:
        """Takes the map [h, 2 h, 3]."""
        self.set_log_radiance(radiance.clamp(min=math.exp(-LOG_LIMIT)).log().permute(2, 0, 1))

    def set_log_radiance(self, map_: Tensor) -> None:
        """Takes the map whose log radiance is [3, h, 2 h]: a level holds what the mean over larger texels leaves."""
        map_ = map_.clamp(-LOG_LIMIT, LOG_LIMIT)
        n_levels = int(math.log2(map_.shape[1] // 8)) + 1
        maps = [F.avg_pool2d(map_, 1 << k) for k in reversed(range(n_levels))]
        self.levels = [maps[0]] + [fine - doubled(coarse) for coarse, fine in zip(maps, maps[1:])]

    @property
    def height(self) -> int:
        """Rows of the map."""
        return self.levels[-1].shape[1]

    def radiance(self) -> Tensor:
        """[h, 2 h, 3] linear radiance."""
        return radiance_of(self.levels)


def radiance_of(levels: list[Tensor]) -> Tensor:
    """[h, 2 h, 3] the linear radiance of levels from coarse to fine."""
    return sum_of_levels(levels).exp().permute(1, 2, 0).contiguous()


def doubled(level: Tensor) -> Tensor:
    """[3, 2 h, 2 w] a map [3, h, w] at twice the resolution, bilinear."""
    padded = F.pad(F.pad(level[None], (1, 1, 0, 0), mode="circular"), (0, 0, 1, 1), mode="replicate")
    return F.interpolate(padded, scale_factor=2, mode="bilinear", align_corners=False)[0, :, 2:-2, 2:-2]


def sum_of_levels(levels: list[Tensor]) -> Tensor:
    """[3, h, w] the map of which levels are the parts, from coarse to fine."""
    total = levels[0]
    for level in levels[1:]:
        total = doubled(total) + level
    return total


def footprints(height: int, directions: Tensor) -> tuple[Tensor, Tensor]:
    """The four texels [n, 4], row * width + column, around directions [n, 3] of a map [h, 2 h], and their shares [n, 4]."""
    width = 2 * height
    u = 0.5 - torch.atan2(directions[:, 1], directions[:, 0]) / (2 * math.pi)
    v = torch.atan2(directions[:, :2].norm(dim=1), directions[:, 2]) / math.pi
    x, y = u * width - 0.5, (v * height - 0.5).clamp(0, height - 1)
    left, top = x.floor(), y.floor()
    fx, fy = x - left, y - top
    x0, y0 = left.long() % width, top.long()
    x1, y1 = (x0 + 1) % width, (y0 + 1).clamp(max=height - 1)
    texels = torch.stack([y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1], dim=1)
    return texels, torch.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], dim=1)


def read(table: Tensor, texels: Tensor, shares: Tensor) -> Tensor:
    """[n, 3] the values of a flat map [t, 3] at footprints: bilinear."""
    return F.embedding_bag(texels, table, per_sample_weights=shares, mode="sum")


def read_adjoint(values: Tensor, texels: Tensor, shares: Tensor, n_texels: int) -> Tensor:
    """[t, 3] the sums of values [n, 3] by their footprints' shares: the transpose of :func:`read`."""
    places = texels.numpy().astype(np.int32).ravel(), np.arange(0, texels.numel() + 1, 4, np.int32)
    return torch.from_numpy(csr_array((shares.numpy().ravel(), *places), (len(values), n_texels)).T @ values.numpy())
