"""Usual values of similar texels: a prior for roughness and metallic where the photos determine them poorly."""

from __future__ import annotations

import numpy as np
import torch
from scipy.cluster.vq import kmeans2, vq
from scipy.spatial.distance import cdist
from torch import Tensor

from splitnerf.refinement.unknowns import METALLIC, ROUGHNESS

N_COLOURS, N_KINDS = 24, 160  # kinds of texels by their colour, and by colour and place
N_SEEN = 20000  # texels by which kinds and medians are found
REACH = 0.15  # deviation of the colours that count as one
NEAR = 0.08  # deviation of the places that count as one, as a share of the asset's extent
METAL = 0.5  # the usual metallic from which on a kind of texels is metal


class SimilarTexels:
    """Texels that looked alike at the start of a fit, and the gloss that is usual among them.

    The usual roughness is that of a colour. The usual metallic is that of a colour in a place, before all steps,
    because metal that the prior made would spread to its neighbours. It counts only where it is metal, for texels with
    less: a metal that mirrors little looks like a dark dielectric, which leaves islands of dielectric in metal. The
    opposite is rare. Without the place, enamel would become metal where gold elsewhere has its colour.

    Args:
        start: [m, n] the unknowns before all steps, see :mod:`splitnerf.refinement.unknowns`.
        positions: [m, 3] the texels' points.
        seed: The seed of the texels by which kinds and medians are found.
    """

    def __init__(self, start: Tensor, positions: np.ndarray, seed: int):
        random = np.random.default_rng(seed)
        near = NEAR * max(float(np.ptp(positions, axis=0).max()), 1e-12)
        colours = start[:, :3].double().numpy() / REACH
        placed = np.hstack([colours, (positions - positions.mean(axis=0)) / near])
        self._of_colour = kinds(colours, N_COLOURS, random)
        self._metallic = usual(start[:, METALLIC], *kinds(placed, N_KINDS, random))

    def usual_gloss(self, unknowns: Tensor) -> Tensor:
        """The usual roughness and metallic of texels similar to each one, whose unknowns [m, n] are given as they are now: [m, n],
        NaN where there is no such value."""
        result = torch.full_like(unknowns, torch.nan)
        result[:, ROUGHNESS] = usual(unknowns[:, ROUGHNESS], *self._of_colour)
        islands = (self._metallic >= METAL) & (unknowns[:, METALLIC] < self._metallic)
        result[:, METALLIC] = torch.where(islands, self._metallic, torch.nan)
        return result


def kinds(features: np.ndarray, most: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At most so many kinds of texels with similar features [m, d], which are in units of a Gaussian's deviation: the numbers [k] of
    texels by which medians are found, their weights [kinds, k] by the Gaussian around each kind's centre, and the kind [m] of each texel.
    Texels are not weighted by certainty: glossy ones would decide for all."""
    seen = random.permutation(len(features))[:N_SEEN]
    apart = random.normal(scale=0.01, size=(len(seen), features.shape[1]))  # equal texels make no clusters
    centres, _ = kmeans2(features[seen] + apart, min(most, len(seen)), minit="++", seed=random)
    squared = cdist(centres, features[seen], "sqeuclidean")
    return seen, np.exp((squared.min(1, keepdims=True) - squared) / 2), vq(features, centres)[0]


def usual(values: Tensor, seen: np.ndarray, weights: np.ndarray, label: np.ndarray) -> Tensor:
    """[m] the usual one, a weighted median, of values [m] among the texels of each one's kind, see :func:`kinds`."""
    return torch.from_numpy(weighted_medians(values.numpy()[seen], weights)[label])


def weighted_medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """[k] the medians of values [n], one for each row of weights [k, n]; each row's sum is above 0."""
    order = np.argsort(values)
    sums = np.cumsum(weights[:, order], axis=1)
    return values[order][(sums < 0.5 * sums[:, -1:]).sum(axis=1)]
