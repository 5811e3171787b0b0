"""The environment map as unknowns: log radiance, a sum of levels from coarse to fine."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

LOG_LIMIT = 12.0


class EnvironmentLight:
    """An equirectangular map whose log radiance is a sum of levels, each twice as fine as the one before.

    Args:
        radiance: [h, 2 h, 3] linear radiance to start from, h = 8 * 2^k.
    """

    def __init__(self, radiance: Tensor):
        height = radiance.shape[0]
        n_levels = int(math.log2(height // 8)) + 1
        self.levels = [torch.zeros(3, 8 << k, 16 << k) for k in range(n_levels)]
        self.levels[-1] = radiance.clamp(min=math.exp(-LOG_LIMIT)).log().permute(2, 0, 1).contiguous()
        for level in self.levels:
            level.requires_grad_(True)

    def log_radiance(self) -> Tensor:
        """[3, h, 2 h]."""
        total = self.levels[0]
        for level in self.levels[1:]:
            padded = F.pad(F.pad(total[None], (1, 1, 0, 0), mode="circular"), (0, 0, 1, 1), mode="replicate")
            up = F.interpolate(padded, scale_factor=2, mode="bilinear", align_corners=False)[0, :, 2:-2, 2:-2]
            total = up + level
        return total.clamp(-LOG_LIMIT, LOG_LIMIT)

    def radiance(self) -> Tensor:
        """[h, 2 h, 3] linear radiance."""
        return self.log_radiance().exp().permute(1, 2, 0).contiguous()


def look_up(radiance: Tensor, directions: Tensor) -> Tensor:
    """Bilinear radiance [n, 3] of an equirectangular map [h, w, 3] from directions [n, 3]."""
    height, width = radiance.shape[:2]
    u = 0.5 - torch.atan2(directions[:, 1], directions[:, 0]) / (2 * math.pi)
    v = torch.atan2(directions[:, :2].norm(dim=1), directions[:, 2]) / math.pi
    x, y = u * width - 0.5, (v * height - 0.5).clamp(0, height - 1)
    left, top = x.floor(), y.floor()
    fx, fy = (x - left)[:, None], (y - top)[:, None]
    x0, y0 = left.long() % width, top.long()
    x1, y1 = (x0 + 1) % width, (y0 + 1).clamp(max=height - 1)
    table = radiance.reshape(-1, 3)
    at = lambda row, column: table.index_select(0, row * width + column)  # noqa: E731
    return (at(y0, x0) * (1 - fx) + at(y0, x1) * fx) * (1 - fy) + (at(y1, x0) * (1 - fx) + at(y1, x1) * fx) * fy
