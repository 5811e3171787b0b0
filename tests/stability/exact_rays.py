"""Weights of samples along a ray in arbitrary precision."""

import numpy as np

from stability.entry import Rows
from stability.precise import mp, vector


def weights_along_z(row: dict[str, np.ndarray], shared: Rows, step: float) -> dict[str, list]:
    """Of gradients (1, 0, slope) and a ray along z."""
    before, after = [], []
    for f, slope in zip(vector(row["sdf"]), vector(row["slope"])):
        half = mp.mpf(step) / 2 * max(-slope / mp.sqrt(1 + slope**2 + mp.mpf("1e-12")), 0)
        before.append(f + half), after.append(f - half)
    return weights_of(before, after, mp.mpf(float(shared["s"])))


def weights_of(f_prev: list, f_next: list, s) -> dict[str, list]:
    """w = alpha T, alpha = (Phi(f_prev) - Phi(f_next))+ / Phi(f_prev), from the logarithms of Phi."""
    passing, found = mp.mpf(1), []
    for before, after in zip(f_prev, f_next):
        logarithm = min(log_sigmoid(s * after) - log_sigmoid(s * before), mp.mpf(0))
        found.append(-mp.expm1(logarithm) * passing)
        passing *= mp.exp(logarithm)
    return {"weights": found, "opacity": [mp.fsum(found)]}


def surface_weights(row: dict[str, np.ndarray], shared: Rows, step: float, anneal: float) -> dict[str, list]:
    """Intervals sdf -+ step / 2 times the annealed cosine of ray and normal."""
    t, direction, before, after, normals = mp.mpf(anneal), vector(row["rays_d"]), [], [], []
    for f, g in zip(vector(row["sdf"]), row["gradient"]):
        g = vector(g)
        length = mp.sqrt(mp.fsum(x * x for x in g) + mp.mpf("1e-12"))
        normal = [x / length for x in g]
        cosine = mp.fsum(a * b for a, b in zip(direction, normal))
        slope = -(max((1 - cosine) / 2, 0) * (1 - t) + max(-cosine, 0) * t)
        half = mp.mpf(step) / 2 * slope
        before.append(f - half), after.append(f + half)
        normals += normal
    return {"normals": normals, **weights_of(before, after, mp.mpf(float(shared["s"])))}


def log_sigmoid(x):
    """log(1 / (1 + exp(-x)))."""
    return -mp.log1p(mp.exp(-x)) if x > 0 else x - mp.log1p(mp.exp(x))
