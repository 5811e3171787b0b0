"""Which samples of a ray are shaded, and what the others get."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.ops import PackedSamples


def spread_by_weight(weights: Tensor, samples: PackedSamples, per_ray: int, phase: Tensor) -> Tensor:
    """Indices [m] of `per_ray` samples of each ray, systematically drawn in proportion to their weights.

    The weights of a ray are laid end to end; a sample is drawn where one of `per_ray` evenly spaced marks falls on it, so
    that a sample of more than 1 / per_ray of the ray's weight always is, and every ray with samples has one. No gradient.

    Args:
        weights: [n].
        samples: The packed samples.
        per_ray: Marks on a ray.
        phase: [n_rays] in [0, 1), where the marks begin.

    Source: Systematic sampling; Kitagawa 1996, for weights.
    """
    with torch.no_grad():
        rays, share = samples.ray_indices, weights.double()
        total = share.cumsum(0)
        before = torch.cat([total.new_zeros(1), total])[samples.offsets[:-1]]
        scale = per_ray / (torch.cat([total.new_zeros(1), total])[samples.offsets[1:]] - before).clamp(min=1e-12)
        end = (total - before[rays]) * scale[rays] + phase.double()[rays]
        return (torch.floor(end) > torch.floor(end - share * scale[rays])).nonzero().squeeze(1)


class Between(NamedTuple):
    """Each sample as a point between two shaded ones of its ray.

    Attributes:
        first, second: [n] positions in the list of the shaded.
        share: [n] of the second, in [0, 1]; beyond the ends the nearest counts alone.
    """

    first: Tensor
    second: Tensor
    share: Tensor

    def interpolate(self, values: Tensor) -> Tensor:
        """[n, c] of values [m, c] at the shaded samples."""
        return torch.lerp(values[self.first], values[self.second], self.share[:, None])

    def gather(self, weights: Tensor, m: int) -> Tensor:
        """The transpose: how much [m] the shaded samples count for if the samples count for weights [n]."""
        first = torch.zeros(m).index_add(0, self.first, weights * (1.0 - self.share))
        return first.index_add(0, self.second, weights * self.share)


def between_shaded(shaded: Tensor, samples: PackedSamples) -> Between:
    """Where each sample lies between the shaded samples [m], ascending, of which every ray with samples has one."""
    rays, middle = samples.ray_indices, 0.5 * (samples.t_starts + samples.t_ends)
    n, m = len(rays), len(shaded)
    count = torch.zeros(n, dtype=torch.int64)
    count[shaded] = 1
    until = count.cumsum(0)  # shaded samples up to and with this one
    first = (until - 1).clamp(min=0)
    second = (until - count).clamp(max=m - 1)
    first = torch.where((until > 0) & (rays[shaded[first]] == rays), first, second)
    second = torch.where(rays[shaded[second]] == rays, second, first)
    t_first, t_second = middle[shaded[first]], middle[shaded[second]]
    span = t_second - t_first
    share = torch.where(span > 0, (middle - t_first) / span.clamp(min=1e-12), torch.zeros_like(span)).clamp(0.0, 1.0)
    return Between(first, second, share)
