"""Entries of the operators of the distance field: hash grid and network."""

import math
from functools import lru_cache

import torch
from splitnerf import ops
from splitnerf.ops.sdf import rounded

from stability.cases import Draw
from stability.entry import Entry, Rows

SPEC = ops.HashGridSpec(n_levels=6, n_features=2, base_resolution=4, growth=2.0, log2_table_size=9)
WIDTH, OUTPUTS, BETA, BOX = 16, 5, 100.0, 1.0
EDGES = (0.0, 1e-45, 1e-38, 1e-7, 0.5, 1 - 6e-8, 1.0, -1e-7, -3.0, 1 + 1.2e-7, 2.0, 1e30, -1e30)
BY_CELL = "a coordinate times the resolution is rounded, which the condition holds; else a few roundings"


def draw_positions(draw: Draw, n: int) -> Rows:
    """Points of the unit cube, on borders of cells of every level, beside these, and outside."""
    resolution = draw.pick(tuple(float(level[0]) for level in SPEC.levels()), n, 3)
    border = torch.round(draw.uniform(n, 3) * resolution) / resolution
    ordinary = torch.where(draw.chance(0.3, n, 3), border, draw.uniform(n, 3))
    return {"positions": draw.mixed(EDGES, ordinary, 0.3)}


@lru_cache(maxsize=1)
def grid() -> Rows:
    """A table with entries from 1e-6 to 1e3 of both signs."""
    draw = Draw(4)
    table = draw.signs(SPEC.n_entries, SPEC.n_features) * draw.logarithmic(1e-6, 1e3, SPEC.n_entries, SPEC.n_features)
    return {"table": table.float()}


def encoded(rows: Rows, shared: Rows) -> Rows:
    return {"features": ops.hash_encode(rows["positions"], shared["table"], SPEC)}


def from_16_bits(rows: Rows, shared: Rows) -> Rows:
    """:func:`encoded` with a table that is read in float16; in float64, of the same numbers."""
    table = shared["table"]
    if table.dtype == torch.float32:
        return {"features": ops.hash_encode(rows["positions"], table, SPEC, stored=rounded(table))}
    return encoded(rows, {"table": table + (rounded(table).double() - table).detach()})


def on_a_lattice(rows: Rows) -> Rows:
    """Positions in and around the box, of few enough digits that the way to the unit cube rounds none away: no point changes its
    cell, where derivatives jump."""
    return {"positions": torch.round(rows["positions"].clamp(-1.5, 1.5) * 2**20) / 2**20}


@lru_cache(maxsize=1)
def network() -> Rows:
    draw = Draw(5)
    return {
        "hidden": draw.normal(WIDTH, 3 + SPEC.n_outputs).float(),
        "hidden_bias": 0.1 * draw.normal(WIDTH).float(),
        "out": draw.normal(OUTPUTS, WIDTH).float() / math.sqrt(WIDTH),
        "out_bias": draw.normal(OUTPUTS).float(),
    }


@lru_cache(maxsize=1)
def learned() -> Rows:
    """The network as it is learned: directions of all lengths, and the lengths of rows."""
    draw, weights = Draw(6), network()
    lengths = {f"{name}_length": weights[name].norm(dim=1, keepdim=True) for name in ("hidden", "out")}
    scaled = {
        name: (weights[name] * draw.logarithmic(1e-3, 1e3, len(weights[name]), 1)).float() for name in ("hidden", "out")
    }
    return weights | lengths | scaled


def field(rows: Rows, shared: Rows) -> Rows:
    weights = {name: shared[name] for name in LEARNED}
    outputs, features, gradient = ops.sdf_field(
        rows["positions"], 1e-3 * shared["table"], **weights, beta=BETA, box=BOX, spec=SPEC
    )
    return {"outputs": outputs, "features": features, "gradient": gradient}


def values(rows: Rows, shared: Rows) -> Rows:
    weights = [shared[name] for name in ("hidden", "hidden_bias", "out", "out_bias")]
    field = ops.sdf.SdfNetwork(SPEC, SPEC.n_levels, 1e-3 * shared["table"], *weights, BETA, BOX)
    return {"values": ops.sdf.sdf_values(rows["positions"], field)[:, None]}


def grid_entry(name: str, call, dtype: torch.dtype = torch.float32) -> Entry:
    return Entry(
        name,
        draw=draw_positions,
        call=call,
        smooth=("positions",),
        smooth_shared=("table",),
        shared={"table": grid()["table"].to(dtype).float()},
        bound=2e-6,
        reason=BY_CELL,
    )


LEARNED = ("hidden", "hidden_length", "hidden_bias", "out", "out_length", "out_bias")
ENTRIES = (
    grid_entry("hash_encode", encoded),
    grid_entry("hash_encode, float16", from_16_bits, torch.float16),
    Entry(
        "sdf_field",
        draw=lambda draw, n: on_a_lattice({"positions": 2 * draw_positions(draw, n)["positions"] - 1}),
        repair=on_a_lattice,
        call=field,
        smooth_shared=("table", *LEARNED),
        shared=learned() | grid(),
        bound=4e-6,
        reason="sums of 15 products, softplus of slope up to 1 and curvature beta / 4, which the condition holds",
    ),
    Entry(
        "sdf_values",
        call=values,
        shared=network() | grid(),
        bound=4e-6,
        reason="the two above",
        draw=lambda draw, n: {"positions": 2 * draw_positions(draw, n)["positions"].clamp(0, 1) - 1},
        repair=lambda rows: {"positions": rows["positions"].clamp(-1, 1)},
    ),
)
