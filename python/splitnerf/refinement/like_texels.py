"""What texels of one colour have in common: a prior for the roughness of those about which the photos say little."""

from __future__ import annotations

import numpy as np
import torch
from scipy.cluster.vq import kmeans2, vq
from torch import Tensor

from splitnerf.refinement.unknowns import ROUGHNESS

N_COLOURS = 24
N_SEEN = 20000  # texels by which colours and medians are found


def with_like_roughness(unknowns: Tensor, seed: int) -> Tensor:
    """The unknowns [m, n] with the usual roughness of each texel's colour: the median.

    Each texel counts the same. Weighted by what the photos say of each, glossy texels would speak for all of their colour.

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
    usual = unknowns[:, ROUGHNESS].numpy()[seen]
    of_colour = np.full(len(centres), np.nan, np.float32)
    for number in np.unique(label[seen]):
        of_colour[number] = np.median(usual[label[seen] == number])
    result = unknowns.clone()
    roughness = torch.from_numpy(of_colour[label])
    result[:, ROUGHNESS] = torch.where(roughness.isnan(), result[:, ROUGHNESS], roughness)
    return result
