"""The usual gloss of texels of one colour: a prior for roughness and metallic where the photos determine them poorly."""

from __future__ import annotations

import numpy as np
import torch
from scipy.cluster.vq import kmeans2, vq
from scipy.spatial.distance import cdist
from torch import Tensor

from splitnerf.refinement.unknowns import METALLIC, ROUGHNESS

N_KINDS = 24  # of texels, by their colour
N_SEEN = 20000  # texels by which kinds and medians are found
REACH = 0.15  # deviation of the colours that count as one
METAL, FEW = 0.7, 0.1  # a metal's colour: at most this share of its texels has less metallic than that at the start


class SimilarTexels:
    """Texels of about one colour at the start of a fit, and the gloss that is usual among them. Where a colour is a metal's, texels with less
    are metal that mirrors little. `start` [m, n] are the unknowns before all steps, see :mod:`splitnerf.refinement.unknowns`; `seed` is of
    the texels by which kinds and medians are found."""

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
        metallic = start[:, METALLIC].numpy()[self._seen]
        least, middle = (weighted_quantiles(metallic, self._weights, share) for share in (FEW, 0.5))
        self._metallic = np.where(least >= METAL, middle, np.float32(np.nan))

    def usual_gloss(self, unknowns: Tensor) -> Tensor:
        """[m, 2] the weighted median of the roughness of the texels of each one's colour, whose unknowns [m, n] are given as they are now,
        and that of the metallic at the start, NaN where the colour is not a metal's."""
        roughness = weighted_quantiles(unknowns[:, ROUGHNESS].numpy()[self._seen], self._weights, 0.5)
        return torch.from_numpy(np.stack([roughness, self._metallic], axis=1)[self._kind])


def weighted_quantiles(values: np.ndarray, weights: np.ndarray, share: float) -> np.ndarray:
    """[k] the quantiles of values [n], one for each row of weights [k, n]; each row's sum is above 0."""
    order = np.argsort(values)
    sums = np.cumsum(weights[:, order], axis=1)
    return values[order][(sums < share * sums[:, -1:]).sum(axis=1)]
