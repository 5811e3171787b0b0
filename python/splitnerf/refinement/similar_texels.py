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


def usual_gloss(unknowns: Tensor, start: Tensor, positions: np.ndarray, seed: int) -> Tensor:
    """The usual roughness and metallic of texels similar to each one: [m, n], NaN where there is no such value.

    The usual roughness is that of a colour. The usual metallic is that of a colour in a place, before all steps,
    because metal that the prior made would spread to its neighbours. It counts only where it is metal, for texels with
    less: a metal that mirrors little looks like a dark dielectric, which leaves islands of dielectric in metal. The
    opposite is rare. Without the place, enamel would become metal where gold elsewhere has its colour.

    Args:
        unknowns: [m, n], see :mod:`splitnerf.refinement.unknowns`.
        start: [m, n] the unknowns before all steps.
        positions: [m, 3] the texels' points.
        seed: The seed of the texels by which kinds and medians are found.
    """
    random = np.random.default_rng(seed)
    near = NEAR * max(float(np.ptp(positions, axis=0).max()), 1e-12)
    colours = unknowns[:, :3].double().numpy() / REACH
    placed = np.hstack([colours, (positions - positions.mean(axis=0)) / near])
    result = torch.full_like(unknowns, torch.nan)
    result[:, ROUGHNESS] = usual(unknowns[:, ROUGHNESS], colours, N_COLOURS, random)
    metallic = usual(start[:, METALLIC], placed, N_KINDS, random)
    islands = (metallic >= METAL) & (unknowns[:, METALLIC] < metallic)
    result[:, METALLIC] = torch.where(islands, metallic, torch.nan)
    return result


def usual(values: Tensor, features: np.ndarray, n_kinds: int, random: np.random.Generator) -> Tensor:
    """[m] the usual value of each texel's kind.

    Texels of similar features are of one kind. Its usual value is the median of the texels around, weighted by a
    Gaussian of their distance from the kind's centre. They are not weighted by certainty: glossy texels would decide
    for all.

    Args:
        values: [m].
        features: [m, d], in units of the Gaussian's deviation.
        random: What draws the texels by which kinds and medians are found.
    """
    seen = random.permutation(len(features))[:N_SEEN]
    apart = random.normal(scale=0.01, size=(len(seen), features.shape[1]))  # equal texels make no clusters
    centres, _ = kmeans2(features[seen] + apart, min(n_kinds, len(seen)), minit="++", seed=random)
    label, _ = vq(features, centres)
    squared = cdist(centres, features[seen], "sqeuclidean")
    weights = np.exp((squared.min(1, keepdims=True) - squared) / 2)
    return torch.from_numpy(weighted_medians(values.numpy()[seen], weights)[label])


def weighted_medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """[k] the medians of values [n], one for each row of weights [k, n]; each row's sum is above 0."""
    order = np.argsort(values)
    sums = np.cumsum(weights[:, order], axis=1)
    return values[order][(sums < 0.5 * sums[:, -1:]).sum(axis=1)]
