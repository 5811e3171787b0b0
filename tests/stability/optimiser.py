"""The entry of the optimiser's step. A row is one parameter with its gradient and its moments."""

from __future__ import annotations

import numpy as np
import torch
from splitnerf.ops._library import lib

from stability.cases import Draw
from stability.entry import Entry, Rows
from stability.precise import mp, vector

NAMES = ("param", "grad", "exp_avg", "exp_avg_sq")
RATE, BETAS, EPS, DECAY = 0.01, (0.9, 0.99), 1e-15, 0.01
STEPS = (1, 3000)
LARGEST = {"param": 1e6, "grad": 1e18, "exp_avg": 1e18, "exp_avg_sq": 1e36}
EDGES = (0.0, 1e-45, 1e-38, 1e-30, 1e-15, 1e-7, 1.0, 1e18)


def draw_parameters(draw: Draw, n: int) -> Rows:
    """Gradients and moments from nothing to the largest that a training lets pass, alike and unlike each other."""
    rows = {name: draw.signs(n, 2) * draw.mixed(EDGES, draw.logarithmic(1e-12, 1e3, n, 2)) for name in NAMES}
    alike = draw.chance(0.5, n, 1)
    rows["exp_avg"] = torch.where(alike, rows["grad"] * draw.uniform(n, 2), rows["exp_avg"])
    rows["exp_avg_sq"] = torch.where(alike, rows["grad"].square() * draw.uniform(n, 2), rows["exp_avg_sq"].abs())
    rows["grad"] = torch.where(draw.chance(0.1, n, 1), 0.0, rows["grad"])
    return repaired(rows)


def repaired(rows: Rows) -> Rows:
    return {name: x.clamp(0 if name == "exp_avg_sq" else -LARGEST[name], LARGEST[name]) for name, x in rows.items()}


def stepped(rows: Rows, shared: Rows) -> Rows:
    out: Rows = {}
    for step in STEPS:
        for sparse in (False, True):
            param, grad, exp_avg, exp_avg_sq = (rows[name].clone() for name in NAMES)
            lib.adamw_steps_(
                [param], [grad], [exp_avg], [exp_avg_sq], [RATE], *BETAS, EPS, [DECAY], [step], [sparse], [], []
            )
            kind = f"step {step}{', sparse' * sparse}"
            out |= {f"param, {kind}": param, f"exp_avg, {kind}": exp_avg, f"exp_avg_sq, {kind}": exp_avg_sq}
    return out


def exactly(row: dict[str, np.ndarray], shared: Rows) -> dict[str, list]:
    lr, beta1, beta2, eps, decay = (mp.mpf(value) for value in (RATE, *BETAS, EPS, DECAY))
    numbers = list(zip(*(vector(row[name]) for name in NAMES)))
    still = all(g == 0 for _, g, _, _ in numbers)
    out: dict[str, list] = {}
    for step in STEPS:
        for sparse in (False, True):
            found = []
            for p, g, m, v in numbers:
                if not (sparse and still):
                    m, v = beta1 * m + (1 - beta1) * g, beta2 * v + (1 - beta2) * g * g
                    scale = mp.sqrt(v / (1 - beta2**step)) + eps
                    p = p * (1 - lr * decay) - lr * (m / (1 - beta1**step)) / scale
                found.append((p, m, v))
            kind = f"step {step}{', sparse' * sparse}"
            for name, values in zip(("param", "exp_avg", "exp_avg_sq"), zip(*found)):
                out[f"{name}, {kind}"] = list(values)
    return out


ENTRIES = (
    Entry(
        "adamw_steps_",
        draw=draw_parameters,
        call=stepped,
        repair=repaired,
        conditioned=True,
        bound=1e-6,
        exact=exactly,
        exact_bound=1e-13,
        floor=1e-24,
        reason="a few roundings of each term; below 1e-24 absolute: moments below 1e-38 lose digits, and eps divides them by 1e-15",
    ),
)
