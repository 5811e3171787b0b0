"""Pixels or cells that belong to an object: what is thought of each, and what their colours say of neighbours."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

LEAST_TIE = 1e-4  # between neighbours, however unlike; 1 between those of one colour
LEAST_HINT = 1e-9  # so that each share is determined


def random_walk(hints: np.ndarray, colours: np.ndarray, known: np.ndarray, contrast: float) -> np.ndarray:
    """[h, w] float32 in [0, 1], the share of the object in each cell: that of its neighbours, more so of those of its own colour,
    and that of its hint.

    Args:
        hints: [h, w] positive where a cell is thought to be the object's, negative where not. A hint of size 1 counts as much as
            a neighbour of one colour.
        colours: [h, w, 3] the cells' colours.
        known: [h, w] bool, the cells that take part; the others get 0.
        contrast: How little unlike neighbours count: exp(-contrast d²), d² being the squared distance of their colours divided
            by the variance of all.

    Source: Grady 2005 (Multilabel random walker image segmentation using prior models).
    """
    shares = np.zeros(hints.shape, np.float32)
    if not known.any():
        return shares
    number, n = np.cumsum(known).reshape(known.shape) - 1, int(known.sum())
    variance = max(float(colours[known].var(axis=0).sum()), 1e-6)
    joined = coo_matrix((n, n))
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        both = known[one] & known[other]
        unlike = np.square(colours[one] - colours[other]).sum(-1)[both] / variance
        ties = np.exp(-contrast * unlike) + LEAST_TIE
        half = coo_matrix((ties, (number[one][both], number[other][both])), (n, n))
        joined = joined + half + half.T
    counted = np.abs(hints[known]) + LEAST_HINT
    system = diags(np.asarray(joined.sum(axis=1)).ravel() + counted) - joined
    shares[known] = spsolve(system.tocsc(), hints[known].clip(0)).clip(0, 1)
    return shares
