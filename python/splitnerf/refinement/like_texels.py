"""What like texels have in common: a prior for roughness and metal of those about which the photos say little."""

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
    """What each texel's roughness and metallic would be by what is like it: [m, n], NaN for all that has no such value.

    The usual roughness is that of a colour; the usual metallic that of a colour in a place, at the start: what the prior itself
    turned into metal would turn its neighbours, step by step. It counts where it is metal, for texels with less: a metal in which little is mirrored looks like a dark dielectric, so that islands of one arise in a
    metal; the opposite is rare, and details of metal in the colour of the cloth around them are not to be lost. Without the
    place, enamel would become metal where gold elsewhere has its colour.

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

    Texels of like features are of one kind. Its usual value is the median of the texels around, weighted by a Gaussian of
    their distance from the kind's centre. What the photos say of each has no weight: glossy texels would speak for all.

    Args:
        values: [m].
        features: [m, d], in units of the Gaussian's deviation.
        n_kinds: The number of kinds.
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
