"""The usual roughness of texels of one colour: a prior for it where the photos determine it poorly."""

from __future__ import annotations

import numpy as np
import torch
from scipy.cluster.vq import kmeans2, vq
from scipy.spatial.distance import cdist
from torch import Tensor

from splitnerf.refinement.unknowns import ROUGHNESS

N_KINDS = 24  # of texels, by their colour
N_SEEN = 20000  # texels by which kinds and medians are found
REACH = 0.15  # deviation of the colours that count as one


class SimilarTexels:
    """Texels of about one colour at the start of a fit, and the roughness that is usual among them. `start` [m, n] are the unknowns
    before all steps, see :mod:`splitnerf.refinement.unknowns`; `seed` is of the texels by which kinds and medians are found."""

    def __init__(self, start: Tensor, seed: int):
        random, colours = np.random.default_rng(seed), start[:, :3].double().numpy() / REACH
        self._seen = random.permutation(len(colours))[:N_SEEN]
        seen = colours[self._seen]
        apart = random.normal(scale=0.01, size=seen.shape)  # equal texels make no clusters
        centres, _ = kmeans2(seen + apart, min(N_KINDS, len(seen)), minit="++", seed=random)
        squared = cdist(centres, seen, "sqeuclidean")
        # not by certainty: glossy texels would decide for all
        self._weights = np.exp((squared.min(1, keepdims=True) - squared) / 2)
        self._kind = vq(colours, centres)[0]

    def usual_roughness(self, unknowns: Tensor) -> Tensor:
        """[m] the weighted median of the roughness of the texels of each one's colour, whose unknowns [m, n] are given as they are now."""
        medians = weighted_medians(unknowns[:, ROUGHNESS].numpy()[self._seen], self._weights)
        return torch.from_numpy(medians[self._kind])


def weighted_medians(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """[k] the medians of values [n], one for each row of weights [k, n]; each row's sum is above 0."""
    order = np.argsort(values)
    sums = np.cumsum(weights[:, order], axis=1)
    return values[order][(sums < 0.5 * sums[:, -1:]).sum(axis=1)]
