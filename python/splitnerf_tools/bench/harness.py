"""Shared by all benchmarks: checks the methods, times them in turns, and makes charts of time against error."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from splitnerf.errors import InputError
from splitnerf.files import locked, refuse_others
from torch import Tensor

from splitnerf_tools.bench.charts import Chart, Point, write_result
from splitnerf_tools.bench.subjects import LEFT_OUT

ROUNDS, QUICK_ROUNDS = 15, 7
SHORTEST = 0.005  # seconds of one measurement; faster calls are repeated within it
SETTLING = 0.004  # seconds of pause before each measurement, since threads of the call before still spin


class CheckFailed(RuntimeError):
    """A benchmark's subject gives wrong results, so that its time is meaningless."""


class Quartiles(NamedTuple):
    """The median of the rounds, and the quartiles: seconds of one call, or the ratio of two calls' times."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.median:.2f}x ({self.low:.2f} to {self.high:.2f})"


class Times:
    """Seconds by call and round, from :func:`interleaved`."""

    def __init__(self, seconds: Mapping[Hashable, list[float]]):
        self.seconds = seconds

    def __getitem__(self, name: Hashable) -> Quartiles:
        return _median_and_quartiles(self.seconds[name])

    def ratio(self, slow: Hashable, fast: Hashable) -> Quartiles:
        """The ratio of the times of `slow` to those of `fast`, round by round."""
        return _median_and_quartiles([a / b for a, b in zip(self.seconds[slow], self.seconds[fast])])


def interleaved(calls: Mapping[Hashable, Callable[[], object]], rounds: int) -> Times:
    """Runs every call once to warm up, then times `rounds` rounds of all calls in turns, so that all run under the same load."""
    repeats = {}
    for name, call in calls.items():
        call()
        started = time.perf_counter()
        call()
        repeats[name] = max(1, round(SHORTEST / max(time.perf_counter() - started, 1e-7)))
    seconds: dict[Hashable, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            time.sleep(SETTLING)
            started = time.perf_counter()
            for _ in range(repeats[name]):
                call()
            seconds[name].append((time.perf_counter() - started) / repeats[name])
    return Times(seconds)


def _median_and_quartiles(values: list[float]) -> Quartiles:
    return Quartiles(*map(float, np.quantile(values, (0.5, 0.25, 0.75))))


def rms(values: ArrayLike) -> float:
    """Root of the mean square of all numbers."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values, np.float64)))))


def with_gradients(way: Callable[..., Tensor], inputs: tuple[Tensor, ...], cotangent: Tensor) -> Callable[[], tuple]:
    """A call that returns a function's result and the gradients of all inputs."""
    leaves = tuple(x.clone().requires_grad_() for x in inputs)

    def call() -> tuple[Tensor, ...]:
        out = way(*leaves)
        return out.detach(), *torch.autograd.grad(out, leaves, cotangent)

    return call


def check(subject: str, errors: Mapping[Hashable, float], limit: float) -> None:
    """Checks a method's errors before it is timed. Raises CheckFailed where an error is not below the limit."""
    for name, error in errors.items():
        if not error < limit:
            way = name if isinstance(name, str) else " ".join(name)
            raise CheckFailed(f"{subject}: {way} is wrong by {error:.1e}, more than {limit:.1e}")


def chart_of(
    title: str,
    cost: str,
    error: str,
    times: Times | Mapping[tuple[str, str], Quartiles],
    errors: Mapping[tuple[str, str], float],
    default: Collection[tuple[str, str]],
) -> Chart:
    """Times in milliseconds against errors.

    Args:
        title, cost, error: The texts of :class:`splitnerf_tools.bench.charts.Chart` with these names.
        times: Seconds by series and variant.
        errors: Errors by series and variant, in the order of the table.
        default: The keys of the library's defaults.
    """
    points = []
    for key, value in errors.items():
        median, low, high = (1e3 * x for x in times[key])
        points.append(Point(*key, median, value, low, high, key in default))
    return Chart(title, cost, error, points)


def run_benchmarks(modules: Sequence[str], quick: bool, out: Path, show: Callable[[str], None]) -> list[Path]:
    """Checks and times the operators, writes the charts, and shows the findings as they come. Raises CheckFailed where an
    operator's results are wrong, and InputError where matplotlib is missing or the folder cannot take the results.

    Args:
        modules: The names of modules, each with ``run(quick, rounds)``.
        quick: Whether to use small inputs and few rounds, which takes minutes in all.
        out: The folder of the results; created if missing. Only earlier results are replaced there.
    """
    if find_spec("matplotlib") is None:
        raise InputError("the charts need matplotlib: pip install 'splitnerf[bench]'")
    files = []
    with locked(out):
        for name in (module.rpartition(".")[2] for module in modules):
            refuse_others(out / f"{name}.md", b"; measures `", out / f"{name}.csv", out / f"{name}.png")
        for module in modules:
            result = importlib.import_module(module).run(quick, QUICK_ROUNDS if quick else ROUNDS)
            result.findings.extend(dict.fromkeys(LEFT_OUT))
            LEFT_OUT.clear()
            files += write_result(result, out)
            show(result.title)
            for finding in result.findings:
                show(f"  {finding}")
    return files
