"""Weights of samples along a ray in arbitrary precision."""

from __future__ import annotations

import numpy as np

from splitnerf.bench.stability.entry import Rows
from splitnerf.bench.stability.precise import mp, vector


def neus_weights(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """w = alpha T, alpha = (Phi(f_prev) - Phi(f_next))+ / Phi(f_prev), from the logarithms of Phi."""
    s, passing, found = mp.mpf(float(shared["s"])), mp.mpf(1), []
    for before, after in zip(vector(row["f_prev"]), vector(row["f_next"])):
        logarithm = min(log_sigmoid(s * after) - log_sigmoid(s * before), mp.mpf(0))
        found.append(-mp.expm1(logarithm) * passing)
        passing *= mp.exp(logarithm)
    return {"weights": found, "opacity": [mp.fsum(found)]}


def log_sigmoid(x):
    """log(1 / (1 + exp(-x)))."""
    return -mp.log1p(mp.exp(-x)) if x > 0 else x - mp.log1p(mp.exp(x))


def composite(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    weights = vector(row["weights"])
    return {"sums": [mp.fsum(w * v for w, v in zip(weights, vector(row["values"][:, c]))) for c in range(3)]}
