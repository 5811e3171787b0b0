"""The distance field in arbitrary precision: trilinear interpolation in a hash grid, and its network."""

from __future__ import annotations

import itertools

import numpy as np

from splitnerf.bench.stability.entry import Rows
from splitnerf.bench.stability.precise import mp, vector

PRIMES = (1, 2654435761, 805459861)  # Teschner et al. 2003
LEVELS, BASE, TABLE_SIZE = 6, 4, 2**9  # resolutions double


def hash_encode(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    table, found, offset = shared["table"].numpy(), [], 0
    position = [min(max(x, mp.mpf(0)), mp.mpf(1)) for x in vector(row["positions"])]
    for level in range(LEVELS):
        resolution = BASE * 2**level
        nodes = resolution + 1
        dense = nodes**3 <= TABLE_SIZE
        place = [x * resolution for x in position]
        cell = [min(int(x), resolution - 1) for x in place]
        sums = [mp.mpf(0)] * table.shape[1]
        for corner in itertools.product((0, 1), repeat=3):
            node = [c + k for c, k in zip(cell, corner)]
            index = (node[0] * nodes + node[1]) * nodes + node[2]
            if not dense:
                index = 0
                for n, prime in zip(node, PRIMES):
                    index ^= n * prime % 2**32
                index %= TABLE_SIZE
            weight = mp.mpf(1)
            for x, c, k in zip(place, cell, corner):
                weight *= x - c if k else 1 - x + c
            sums = [s + weight * mp.mpf(float(t)) for s, t in zip(sums, table[offset + index])]
        found += sums
        offset += nodes**3 if dense else TABLE_SIZE
    return {"features": found}


def sdf_layer(row: dict[str, np.ndarray], shared: Rows, beta: int = 100, box: int = 1) -> dict[str, list]:
    """outputs = out softplus(a) + out_bias and d outputs[0] / d position by the chain rule."""
    inputs = vector(row["positions"]) + vector(row["features"])
    hidden, bias, out = (shared[name].numpy() for name in ("hidden", "hidden_bias", "out"))
    outputs = vector(shared["out_bias"].numpy())
    by_input = [mp.mpf(0)] * len(inputs)
    for h, weights in enumerate(hidden):
        weights = vector(weights)
        y = beta * (mp.fsum(w * x for w, x in zip(weights, inputs)) + mp.mpf(float(bias[h])))
        e = mp.exp(-abs(y))
        unit, slope = (max(y, 0) + mp.log1p(e)) / beta, (1 if y > 0 else e) / (1 + e)
        outputs = [o + mp.mpf(float(w)) * unit for o, w in zip(outputs, out[:, h])]
        by_input = [b + mp.mpf(float(out[0, h])) * slope * w for b, w in zip(by_input, weights)]
    gradient = []
    for axis in range(3):
        through = mp.fsum(j * b for j, b in zip(vector(row["jacobian"][axis]), by_input[3:]))
        gradient.append(by_input[axis] + through / (2 * box))
    return {"outputs": outputs, "gradient": gradient}
