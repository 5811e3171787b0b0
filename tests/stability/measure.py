"""The error of an operator in float32, row by row."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from stability.entry import Entry, Rows

LARGEST = 3.0e38  # true values beyond it have no float32
CHANGE = 2.0**-22  # relative, of the inputs, by which the condition is found
MANY_PROBES = 64
ROUNDS = ((4, 1.0), (16, 0.25), (MANY_PROBES, 0.0625))  # probes, and of which share of a chunk at most, the worst rows


@dataclass(frozen=True)
class Errors:
    """Of a batch of rows, [n] each.

    Attributes:
        forward, gradient: Largest error over the outputs and over the gradients, see :class:`Entry`.
        plain_forward, plain_gradient: The same without the condition number.
        broken: Whether something is not finite that should be.
        shared: Largest error of a gradient to what the rows share.
    """

    forward: Tensor
    gradient: Tensor
    plain_forward: Tensor
    plain_gradient: Tensor
    broken: Tensor
    shared: float


def cast(rows: Rows, dtype: torch.dtype) -> Rows:
    return {name: x.to(dtype) if x.is_floating_point() else x for name, x in rows.items()}


def cotangent(output: Tensor) -> Tensor:
    """The same numbers for every row, of both signs, in [0.5, 1.5]."""
    n = math.prod(output.shape[1:])
    steps = torch.arange(n, dtype=torch.float64, device=output.device)
    values = (0.5 + torch.frac(0.1 + 0.6180339887498949 * steps)) * torch.where(steps % 3 == 1, -1.0, 1.0)
    return values.float().to(output.dtype).reshape(1, *output.shape[1:]).expand_as(output)


def evaluate(
    entry: Entry, rows: Rows, dtype: torch.dtype, shared: Rows | None = None, generator: torch.Generator | None = None
) -> tuple[Rows, Rows, Rows]:
    """Outputs, gradients to rows and to what they share, by name; with a generator the cotangents are changed."""
    rows, shared = cast(rows, dtype), cast(entry.shared if shared is None else shared, dtype)
    leaves = {name: rows[name].detach().clone().requires_grad_() for name in entry.smooth}
    common = {name: shared[name].detach().clone().requires_grad_() for name in entry.smooth_shared}
    outputs = entry.call(rows | leaves, shared | common)
    answered = [x for x in outputs.values() if x.requires_grad]
    wanted = [*leaves.values(), *common.values()]
    if not wanted:
        return outputs, {}, {}
    given = [cotangent(x) if generator is None else changed(cotangent(x), generator) for x in answered]
    gradients = torch.autograd.grad(answered, wanted, given, allow_unused=True)
    found = [torch.zeros_like(x) if g is None else g for x, g in zip(wanted, gradients)]
    outputs = {name: x.detach() for name, x in outputs.items()}
    return outputs, dict(zip(leaves, found)), dict(zip(common, found[len(leaves) :]))


def measure(entry: Entry, rows: Rows) -> Errors:
    """Compares float32 with float64 on the same numbers."""
    got, got_gradients, got_shared = evaluate(entry, rows, torch.float32)
    true, true_gradients, true_shared = evaluate(entry, rows, torch.float64)
    n = len(next(iter(rows.values())))
    parts = []
    broken = torch.zeros(n, dtype=torch.bool)
    for ours, truth, floor in ((got, true, entry.floor), (got_gradients, true_gradients, entry.gradient_floor)):
        plain = torch.zeros(n, dtype=torch.float64)
        for name in truth:
            error, bad = row_error(ours[name], truth[name], floor)
            plain, broken = torch.maximum(plain, error), broken | bad
        parts.append(plain)
    forward, gradient = parts[0].clone(), parts[1].clone()
    spoilt = any(bool(row_error(got_shared[k][None], x[None], 0.0)[1]) for k, x in true_shared.items())
    if entry.conditioned:
        for probes, share in ROUNDS:
            high = torch.maximum(forward / entry.bound, gradient / entry.gradient_bound)
            which = torch.nonzero((high > 1) & ~broken)[:, 0]
            which = which[torch.argsort(high[which], descending=True)[: int(share * entry.chunk)]]
            if len(which):
                few = {name: x[which] for name, x in rows.items()}
                ours = ({k: x[which] for k, x in got.items()}, {k: x[which] for k, x in got_gradients.items()})
                forward[which], gradient[which] = conditioned_errors(entry, few, ours, probes)
        calm = (parts[0] <= entry.bound) & (parts[1] <= entry.gradient_bound) & ~broken
        if true_shared and not bool(calm.all()):
            few = {name: x[calm] for name, x in rows.items()}
            got_shared, true_shared = (evaluate(entry, few, dtype)[2] for dtype in (torch.float32, torch.float64))
            rows = few
    worst_shared = math.inf if spoilt else shared_error(entry, rows, got_shared, true_shared)
    return Errors(forward, gradient, *parts, broken, worst_shared)


def shared_error(entry: Entry, rows: Rows, got: Rows, true: Rows) -> float:
    """Largest error of the gradients to what the rows share, over their size and, above the bound, their condition."""
    errors = [row_error(got[name][None], x[None], entry.gradient_floor)[0].item() for name, x in true.items()]
    if entry.conditioned and errors and max(errors) > entry.shared_bound:
        generator, wide = torch.Generator().manual_seed(0), dict.fromkeys(true, 0.0)
        for _ in range(ROUNDS[0][0]):
            near = {name: changed(x, generator, name in entry.vectors) for name, x in rows.items()}
            shared = {name: changed(x, generator) for name, x in entry.shared.items()}
            for name, x in evaluate(entry, near, torch.float64, shared, generator)[2].items():
                wide[name] = max(wide[name], (x - true[name]).abs().max().item() / CHANGE)
        errors = [row_error(got[k][None], x[None], entry.gradient_floor, wide[k])[0].item() for k, x in true.items()]
    return max(errors, default=0.0)


def row_error(got: Tensor, true: Tensor, floor: float, scale: Tensor | float = 0.0) -> tuple[Tensor, Tensor]:
    """[n] errors over each row's size, and whether a number of the row is not finite though the truth is, or the truth is
    NaN: the inputs are numbers, and every entry is drawn from where its operator is defined."""
    got, true = got.double().reshape(len(true), -1), true.double().reshape(len(true), -1)
    if true.shape[1] == 0:
        return true.new_zeros(len(true)), torch.zeros(len(true), dtype=torch.bool)
    tame = torch.isfinite(true) & (true.abs() <= LARGEST)
    bad = ((tame & ~torch.isfinite(got)) | torch.isnan(true)).any(1)
    size = torch.where(tame, true.abs(), 0.0).amax(1)
    difference = torch.where(tame & torch.isfinite(got), (got - true).abs(), 0.0).amax(1)
    return difference / (size + scale).clamp(min=floor), bad


def conditioned_errors(entry: Entry, rows: Rows, got: tuple[Rows, Rows], probes: int) -> tuple[Tensor, Tensor]:
    """[n] errors of outputs and of gradients over their size and their condition."""
    true, condition = conditions(entry, rows, probes)
    worst = []
    for part, ours, wide, floor in zip(true, got, condition, (entry.floor, entry.gradient_floor)):
        errors = [row_error(ours[name], part[name], floor, wide[name])[0] for name in part]
        zero = torch.zeros(len(next(iter(rows.values()))), dtype=torch.float64)
        worst.append(torch.stack([zero, *errors]).amax(0))
    return worst[0], worst[1]


def conditions(entry: Entry, rows: Rows, probes: int) -> tuple[tuple[Rows, Rows], tuple[Rows, Rows]]:
    """True outputs and gradients, and for each row how much they change by a relative change of what they follow from.

    All numbers, the gradients to the outputs too, are changed at random by CHANGE at most; what the rows share in a few
    ways, the rows each in their own.
    """
    true = evaluate(entry, rows, torch.float64)[:2]
    wide = tuple({name: x.new_zeros(len(x)) for name, x in part.items()} for part in true)
    generator, n = torch.Generator().manual_seed(0), len(next(iter(rows.values())))
    at_once = max(1, probes // 4)
    for _ in range(min(4, probes)):
        many = {name: x.repeat(at_once, *[1] * (x.dim() - 1)) for name, x in rows.items()}
        near = {name: changed(x, generator, name in entry.vectors) for name, x in many.items()}
        shared = {name: changed(x, generator) for name, x in entry.shared.items()}
        for part, moved, widest in zip(true, evaluate(entry, near, torch.float64, shared, generator)[:2], wide):
            for name, x in part.items():
                step = (moved[name].reshape(at_once, n, -1) - x.reshape(1, n, -1)).abs().nan_to_num(0.0, 0.0, 0.0)
                if step.numel():
                    widest[name] = torch.maximum(widest[name], step.amax((0, 2)) / CHANGE)
    return true, wide


def changed(x: Tensor, generator: torch.Generator, whole: bool = False) -> Tensor:
    """Numbers changed at random by CHANGE of themselves, or of the largest of their vector."""
    if not x.is_floating_point():
        return x
    x = x.double()
    size = x.abs().amax(-1, keepdim=True) if whole else x
    return x + CHANGE * size * (2 * torch.rand(x.shape, generator=generator, dtype=torch.float64) - 1)
