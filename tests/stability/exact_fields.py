"""The distance field in arbitrary precision: trilinear interpolation in a hash grid, and its network."""

from __future__ import annotations

import itertools

import numpy as np

from stability.entry import Rows
from stability.precise import mp, vector

PRIMES = (1, 2654435761, 805459861)  # Teschner et al. 2003
LEVELS, BASE, TABLE_SIZE = 6, 4, 2**9  # resolutions double


def hash_encode(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    return {"features": with_jacobian(row, shared)["features"]}


def with_jacobian(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    """Features and their derivatives by position, which are 0 by a coordinate outside the cube."""
    given = vector(row["positions"])
    position = [min(max(x, mp.mpf(0)), mp.mpf(1)) for x in given]
    moving = [p == x for p, x in zip(position, given)]
    features, jacobian = [], [[], [], []]
    for resolution, place, cell, entries in cells(position, shared["table"].numpy()):
        width = len(entries[0, 0, 0])
        value, slope = [mp.mpf(0)] * width, [[mp.mpf(0)] * width for _ in range(3)]
        for corner, entry in entries.items():
            along = [x - c if k else 1 - x + c for x, c, k in zip(place, cell, corner)]
            entry = vector(entry)
            weight = along[0] * along[1] * along[2]
            value = [v + weight * t for v, t in zip(value, entry)]
            for axis in (axis for axis in range(3) if moving[axis]):
                others = along[(axis + 1) % 3] * along[(axis + 2) % 3] * (resolution if corner[axis] else -resolution)
                slope[axis] = [v + others * t for v, t in zip(slope[axis], entry)]
        features += value
        for axis in range(3):
            jacobian[axis] += slope[axis]
    return {"features": features, "jacobian": [x for axis in jacobian for x in axis]}


def cells(position: list, table: np.ndarray):
    """For each level its resolution, the position in cells, the cell, and the table's rows at its corners."""
    offset = 0
    for level in range(LEVELS):
        resolution = BASE * 2**level
        nodes = resolution + 1
        dense = nodes**3 <= TABLE_SIZE
        place = [x * resolution for x in position]
        cell = [min(int(x), resolution - 1) for x in place]
        entries = {}
        for corner in itertools.product((0, 1), repeat=3):
            node = [c + k for c, k in zip(cell, corner)]
            index = (node[0] * nodes + node[1]) * nodes + node[2]
            if not dense:
                index = 0
                for n, prime in zip(node, PRIMES):
                    index ^= n * prime % 2**32
                index %= TABLE_SIZE
            entries[corner] = table[offset + index]
        yield resolution, place, cell, entries
        offset += nodes**3 if dense else TABLE_SIZE


def sdf_values(row: dict[str, np.ndarray], shared: Rows, box: int = 1) -> dict[str, list]:
    """The layer over the grid's features, of the table scaled by 1e-3 in float64."""
    weights = [[vector(weights) for weights in shared[name].numpy()] for name in ("hidden", "out")]
    return {"values": layer(row["positions"], in_box(row, shared, box), *weights, shared, box=box)["outputs"][:1]}


def sdf_field(row: dict[str, np.ndarray], shared: Rows, box: int = 1) -> dict[str, list]:
    """The same with all outputs and the gradient; rows of weights are length times unit direction."""
    weights = [normalised(shared[name].numpy(), shared[f"{name}_length"].numpy()) for name in ("hidden", "out")]
    features = in_box(row, shared, box)
    return {"features": features["features"]} | layer(row["positions"], features, *weights, shared, box=box)


def in_box(row: dict[str, np.ndarray], shared: Rows, box: int) -> dict[str, list]:
    unit = {"positions": np.asarray(row["positions"], np.float64) / (2 * box) + 0.5}
    return with_jacobian(unit, shared | {"table": 1e-3 * shared["table"]})


def normalised(directions: np.ndarray, lengths: np.ndarray) -> list[list]:
    scales = [mp.mpf(float(n)) / mp.sqrt(mp.fsum(x**2 for x in vector(d))) for d, n in zip(directions, lengths[:, 0])]
    return [[scale * x for x in vector(d)] for d, scale in zip(directions, scales)]


def layer(
    positions: np.ndarray,
    grid: dict[str, list],
    hidden: list[list],
    out: list[list],
    biases: Rows,
    beta: int = 100,
    box: int = 1,
) -> dict[str, list]:
    """outputs = out softplus(a) + out_bias and d outputs[0] / d position by the chain rule."""
    inputs = vector(positions) + grid["features"]
    n = len(grid["features"])
    outputs = vector(biases["out_bias"].numpy())
    by_input = [mp.mpf(0)] * len(inputs)
    for h, weights in enumerate(hidden):
        y = beta * (mp.fsum(w * x for w, x in zip(weights, inputs)) + mp.mpf(float(biases["hidden_bias"][h])))
        e = mp.exp(-abs(y))
        unit, slope = (max(y, 0) + mp.log1p(e)) / beta, (1 if y > 0 else e) / (1 + e)
        outputs = [o + row[h] * unit for o, row in zip(outputs, out)]
        by_input = [b + out[0][h] * slope * w for b, w in zip(by_input, weights)]
    gradient = []
    for axis in range(3):
        through = mp.fsum(j * b for j, b in zip(grid["jacobian"][n * axis : n * (axis + 1)], by_input[3:]))
        gradient.append(by_input[axis] + through / (2 * box))
    return {"outputs": outputs, "gradient": gradient}
