"""Runs an operator over adversarial rows, searches around the worst of them, and asks the worst again exactly."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from stability.cases import Draw
from stability.entry import Entry, Rows
from stability.measure import MANY_PROBES, Errors, cast, conditions, measure, row_error

KEPT = 1000  # worst rows
SEARCH_SHARE = 0.2  # of all cases go to the search
STEPS = (2.0**-23, 2.0**-20, 2.0**-16, 2.0**-12, 2.0**-8, 2.0**-4, 0.5)  # relative, by which the search moves numbers


@dataclass(frozen=True)
class Result:
    """What became of one operator.

    Attributes:
        entry: What was asked.
        cases: Inputs that were tried.
        forward, gradient: Largest errors, see :class:`Entry`.
        plain_forward, plain_gradient: The same without the condition number.
        shared: Largest error of a gradient to what the rows share.
        broken: Rows that gave NaN or infinity where the truth is finite.
        exact: Largest error of float64 against arbitrary precision over the worst rows; None where there is no formula.
        single_exact: The same of float32.
        worst_forward, worst_gradient: The rows that made the largest errors.
    """

    entry: Entry
    cases: int
    forward: float
    gradient: float
    plain_forward: float
    plain_gradient: float
    shared: float
    broken: int
    exact: float | None
    single_exact: float | None
    worst_forward: Rows
    worst_gradient: Rows

    @property
    def holds(self) -> bool:
        """Whether every promise of the entry was kept."""
        return (
            self.broken == 0
            and self.forward <= self.entry.bound
            and self.gradient <= self.entry.gradient_bound
            and self.shared <= self.entry.shared_bound
            and (self.exact is None or self.exact <= self.entry.exact_bound)
        )


class Worst:
    """Keeps the rows of the largest scores."""

    def __init__(self, n: int = KEPT):
        self.n = n
        self.rows: Rows = {}
        self.scores = torch.empty(0, dtype=torch.float64)

    def add(self, rows: Rows, scores: Tensor) -> None:
        if len(scores) == 0:
            return
        top = torch.topk(scores, min(self.n, len(scores))).indices
        rows, scores = {name: x[top] for name, x in rows.items()}, scores[top]
        if self.rows:
            rows = {name: torch.cat([self.rows[name], x]) for name, x in rows.items()}
            scores = torch.cat([self.scores, scores])
        top = torch.topk(scores, min(self.n, len(scores))).indices
        self.rows, self.scores = {name: x[top] for name, x in rows.items()}, scores[top]


class Tally:
    """The largest errors so far, of one operator."""

    def __init__(self, entry: Entry):
        self.entry, self.rows = entry, 0
        self.largest = {"forward": 0.0, "gradient": 0.0, "plain_forward": 0.0, "plain_gradient": 0.0}
        self.shared, self.broken = 0.0, 0
        self.worst = {"forward": Worst(), "gradient": Worst()}

    def add(self, rows: Rows) -> Tensor:
        """Measures the rows; their scores, 1 at the promised bound."""
        errors = measure(self.entry, rows)
        self.rows += len(errors.forward)
        self.broken += int(errors.broken.sum())
        self.shared = max(self.shared, errors.shared)
        for name in self.largest:
            found = getattr(errors, name)
            self.largest[name] = max(self.largest[name], float(found.max()) if len(found) else 0.0)
        self.worst["forward"].add(rows, torch.where(errors.broken, torch.inf, errors.forward))
        self.worst["gradient"].add(rows, torch.where(errors.broken, torch.inf, errors.gradient))
        return score(self.entry, errors)


def score(entry: Entry, errors: Errors) -> Tensor:
    scores = errors.forward / entry.bound
    if entry.smooth:
        scores = torch.maximum(scores, errors.gradient / entry.gradient_bound)
    return torch.where(errors.broken, torch.inf, scores)


def run(entry: Entry, cases: int, seed: int = 0, exact: int = KEPT) -> Result:
    """Tries ``cases`` inputs: drawn ones, and a fifth by search around the worst.

    Args:
        entry: The operator.
        cases: Inputs, ``entry.size`` of them a row.
        seed: Of the inputs.
        exact: How many of the worst inputs are asked again in arbitrary precision.
    """
    draw, tally, best = Draw(seed), Tally(entry), Worst()
    total = max(1, cases // entry.size)
    while tally.rows < total * (1 - SEARCH_SHARE):
        n = min(entry.chunk, max(1, int(total * (1 - SEARCH_SHARE)) - tally.rows))
        rows = cast(entry.draw(draw, n), torch.float32)
        best.add(rows, tally.add(rows))
    climb(tally.add, best, entry.repair, draw, total - tally.rows, entry.chunk)
    again = -(-exact // entry.size)
    double, single = exact_errors(entry, tally.worst["forward"], again) if entry.exact else (None, None)
    worst = {name: {k: x[:1] for k, x in kept.rows.items()} for name, kept in tally.worst.items()}
    return Result(
        entry,
        tally.rows * entry.size,
        **tally.largest,
        shared=tally.shared,
        broken=tally.broken,
        exact=double,
        single_exact=single,
        worst_forward=worst["forward"],
        worst_gradient=worst["gradient"],
    )


def climb(
    scored: Callable[[Rows], Tensor], best: Worst, repair: Callable[[Rows], Rows], draw: Draw, n: int, chunk: int
) -> None:
    """Moves the worst rows, keeps what is worse, and goes on until ``n`` rows are spent."""
    while n > 0:
        take = min(n, chunk, max(32, n // 8))
        parents = torch.randint(len(best.scores), (take,), generator=draw.generator)
        parents = torch.minimum(parents, torch.randint(len(best.scores), (take,), generator=draw.generator))
        moved = repair({name: moved_numbers(x[parents], draw) for name, x in best.rows.items()})
        moved = cast(moved, torch.float32)
        best.add(moved, scored(moved))
        n -= take


def moved_numbers(x: Tensor, draw: Draw) -> Tensor:
    """Some numbers of each row moved by a relative step, a few units in the last place, or to another row's."""
    if not x.is_floating_point():
        return x
    others = x[torch.randperm(len(x), generator=draw.generator)]
    step = draw.pick(STEPS, len(x), *[1] * (x.dim() - 1)) * draw.normal(*x.shape)
    moved = (x.double() * (1 + step)).clamp(-3e38, 3e38).float()
    moved = torch.where(draw.chance(0.05, *x.shape), others, moved)
    return torch.where(draw.chance(0.4, *x.shape), moved, x)


def exact_errors(entry: Entry, worst: Worst, n: int) -> tuple[float, float]:
    """Largest error of float64 and of float32 against arbitrary precision over the worst rows."""
    rows = {name: x[:n] for name, x in worst.rows.items()}
    double = entry.call(cast(rows, torch.float64), cast(entry.shared, torch.float64))
    single = entry.call(rows, cast(entry.shared, torch.float32))
    wide = conditions(entry, rows, MANY_PROBES)[1][0] if entry.conditioned else {}
    largest = [0.0, 0.0]
    for i in range(len(next(iter(rows.values())))):
        row = {name: x[i].double().numpy() for name, x in rows.items()}
        for name, values in entry.exact(row, cast(entry.shared, torch.float64)).items():
            true = torch.tensor([[float(v) for v in values]], dtype=torch.float64)
            scale = wide[name][i : i + 1] if name in wide else 0.0
            for k, got in enumerate((double, single)):
                error, bad = row_error(got[name][i : i + 1], true, entry.floor, scale)
                largest[k] = max(largest[k], float("inf") if bool(bad) else float(error))
    return largest[0], largest[1]
