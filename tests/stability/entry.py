"""What is said about an operator before it is asked: its inputs, its exact value and the error that it promises."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from torch import Tensor

from stability.cases import Draw

Rows = dict[str, Tensor]


def unchanged(rows: Rows) -> Rows:
    return rows


@dataclass(frozen=True)
class Entry:
    """One operator.

    The error of a row is the largest difference between float32 and float64 in one output (or one gradient), over the
    size of that output: its largest component in the row, plus, where ``conditioned``, how much the true value changes
    for a relative change of the inputs, of numbers each or of a vector as a whole (the absolute condition number;
    Higham 2002, section 1.6), since no arithmetic on rounded numbers can do better than that. The condition is only
    asked for where the error without it is above the bound.

    Attributes:
        name: Of the operator.
        draw: (source, n) to the rows, [n, ...] each.
        call: (rows, shared) of either dtype to the outputs, [n, ...] each.
        bound: Largest error of an output that the operator promises in float32.
        gradient_bound: The same of a gradient; twice `bound` where none is given.
        reason: What the bound and the floor follow from.
        smooth: Names of rows to which there is a gradient.
        smooth_shared: The same of what the rows share.
        shared_bound: Of these gradients: sums in float32 over all rows of a chunk, up to 16384 terms, each of
            which rounds by 2^-24 of the sum.
        shared: What all rows share: numbers of a table, a light, a network.
        floor: An output smaller than this counts as this large.
        gradient_floor: The same of a gradient.
        conditioned: See above.
        vectors: Names of rows that count as a whole there.
        repair: Brings rows that were changed at random back to where the operator is defined.
        exact: A row, as float64 arrays by name, and the shared numbers, to its outputs in arbitrary precision, lists of
            mpmath numbers by name; None where there is no such formula.
        exact_bound: Largest error of float64 against that.
        size: Inputs that one row holds: pixels, samples, pairs.
        chunk: Rows at a time.
    """

    name: str
    draw: Callable[[Draw, int], Rows]
    call: Callable[[Rows, Rows], Rows]
    bound: float
    reason: str
    gradient_bound: float = 0.0
    smooth: tuple[str, ...] = ()
    smooth_shared: tuple[str, ...] = ()
    shared_bound: float = 1e-4
    shared: Rows = field(default_factory=dict)
    floor: float = 1e-35
    gradient_floor: float = 1e-35
    conditioned: bool = True
    vectors: tuple[str, ...] = ()
    repair: Callable[[Rows], Rows] = unchanged
    exact: Callable[[dict[str, np.ndarray], Rows], dict[str, list]] | None = None
    exact_bound: float = 1e-11
    size: int = 1
    chunk: int = 1 << 14

    def __post_init__(self):
        object.__setattr__(self, "gradient_bound", self.gradient_bound or 2 * self.bound)
