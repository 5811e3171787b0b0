"""What texels of one colour have in common: a prior for roughness and metal of those about which the photos say little."""

from __future__ import annotations

import numpy as np
import torch
from scipy.cluster.vq import kmeans2, vq
from torch import Tensor

from splitnerf.refinement.unknowns import METALLIC, ROUGHNESS

N_COLOURS = 24
N_SEEN = 20000  # texels by which colours and medians are found
REACH = 0.15  # deviation of the colours that count as one
METAL = 0.5  # the usual metallic from which on a colour is a metal's


def usual_gloss(unknowns: Tensor, seed: int) -> Tensor:
    """What each texel's roughness and metallic would be by its colour alone: [m, n], NaN for all that has no such value.

    The usual roughness of a colour is a median over the texels, weighted by a Gaussian of the distance of their colours
    from the centre of the colour's cluster. What the photos say of each has no weight: glossy texels would speak for all
    of their colour.

    The usual metallic counts where it is metal, for texels with less. A metal in which little is mirrored looks like a
    dark dielectric, so that islands of one arise in a metal; the opposite is rare, and details of metal in the colour of
    the cloth around them are not to be lost.

    Args:
        unknowns: See :mod:`splitnerf.refinement.unknowns`.
        seed: The seed of the texels by which colours and medians are found.
    """
    random = np.random.default_rng(seed)
    colours = unknowns[:, :3].double().numpy()
    seen = random.permutation(len(colours))[:N_SEEN]
    apart = random.normal(scale=1e-3, size=(len(seen), 3))  # equal colours make no clusters
    centres, _ = kmeans2(colours[seen] + apart, min(N_COLOURS, len(seen)), minit="++", seed=random)
    label, _ = vq(colours, centres)
    squared = np.square(colours[seen] - centres[:, None]).sum(2)
    weights = np.exp((squared.min(1, keepdims=True) - squared) / (2 * REACH**2))
    usual = [weighted_medians(unknowns[:, unknown].numpy()[seen], weights)[label] for unknown in (ROUGHNESS, METALLIC)]
    result = torch.full_like(unknowns, torch.nan)
    roughness, metallic = map(torch.from_numpy, usual)
    result[:, ROUGHNESS] = roughness
    islands = (metallic >= METAL) & (unknowns[:, METALLIC] < metallic)
    result[:, METALLIC] = torch.where(islands, metallic, torch.nan)
    return result


def weighted_medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """[k] the medians of values [n], one for each row of weights [k, n]; each row's sum is above 0."""
    order = np.argsort(values)
    sums = np.cumsum(weights[:, order], axis=1)
    return values[order][(sums < 0.5 * sums[:, -1:]).sum(axis=1)]
