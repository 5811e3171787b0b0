"""What a training asks of each step: its numbers against their limits, and gradients that are cleared where it is not taken."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from splitnerf import ops
from stability.cases import Draw
from stability.entry import Rows
from stability.properties import Property

NUMBERS = 64  # of a case
LARGEST_FLOAT = torch.finfo(torch.float32).max
SPECIAL = (math.nan, math.inf, -math.inf, -0.0, 1e-45, 3e38)


def numbers_of_steps(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Terms, counts and sharpness are handed on, the norm is that of float64, to a rounding; and a step is allowed if each
    number is nearer to 0 than its limit: also at the limit itself, at infinite limits, and with what is no number. The
    squares are floats: below 1e-21 the norm may be 0, and where they overflow it is infinite and nothing is allowed."""
    gradients = draw.signs(n, NUMBERS) * draw.mixed((0.0, 1e-18, 1e12), draw.logarithmic(1e-12, 1e12, n, NUMBERS))
    gradients = (gradients * draw.pick((1e-20, 1e-3, 1.0, 1e12), n, 1)).float()
    terms = torch.where(draw.chance(0.05, n, 3), draw.pick(SPECIAL, n, 3), draw.normal(n, 3)).float()
    counts, evaluated = (torch.randint(0, 1 << 22, (n, 2), generator=draw.generator) for _ in range(2))
    s = draw.logarithmic(1.0, 1e4, n).float()
    squares = gradients.double().square().sum(1)
    norm = torch.where(squares > LARGEST_FLOAT, math.inf, squares.sqrt())
    true = torch.cat([terms, norm[:, None], counts, evaluated.sum(1, keepdim=True), s[:, None]], 1).double()
    near = true.abs().float()
    near = torch.where(draw.chance(0.1, *true.shape), near, 2 * near.clamp(min=1e-20))
    limits = torch.where(draw.chance(0.2, *true.shape), math.inf, near)
    violation = torch.zeros(n, dtype=torch.float64)
    for i in range(n):
        parts = [gradients[i, :7], gradients[i, 7:7], gradients[i, 7:].view(3, -1)]
        found, allowed = ops.step_numbers(parts, [terms[i, 0], terms[i, 1:]], [counts[i]], evaluated[i], s[i], limits[i])
        close = torch.isclose(found.double(), true[i].float().double(), rtol=1e-6, atol=1e-21, equal_nan=True)
        right = bool(allowed) == bool((found.abs() < limits[i]).all())
        violation[i] = float(not (close.all() and right))
    return violation, {"gradients": gradients, "terms": terms, "counts": counts, "evaluated": evaluated, "s": s, "limits": limits}


def cleared(draw: Draw, n: int) -> tuple[Tensor, Rows]:
    """Kept arrays keep their bits, those of NaN and of -0 too; of the others each number is +0."""
    rows = torch.where(draw.chance(0.3, n, NUMBERS), draw.pick(SPECIAL, n, NUMBERS), draw.normal(n, NUMBERS)).float()
    kept, violation = draw.chance(0.5, n), torch.zeros(n, dtype=torch.float64)
    for i in range(n):
        arrays = [rows[i, :3].clone(), rows[i, 3:3].clone(), rows[i, 3:].view(1, -1).clone()]
        ops.clear_unless(arrays, kept[i])
        bits = torch.cat([x.flatten() for x in arrays]).view(torch.int32)
        expected = rows[i].view(torch.int32) if kept[i] else torch.zeros(NUMBERS, dtype=torch.int32)
        violation[i] = float(not torch.equal(bits, expected))
    return violation, {"numbers": rows, "kept": kept[:, None]}


PROPERTIES = (
    Property(
        "step_numbers", numbers_of_steps, "the numbers given, their norm, and allowed if all are below their limits", size=NUMBERS,
        chunk=256,
    ),
    Property("clear_unless", cleared, "kept bit by bit, or +0, whatever the numbers", size=NUMBERS, chunk=256),
)  # fmt: skip
