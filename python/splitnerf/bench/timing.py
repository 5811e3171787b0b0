"""Times of several calls that do the same work, taken in turns so that all meet the same load."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

SHORTEST = 0.005  # seconds of one measurement; faster calls are repeated within it
SETTLING = 0.004  # seconds before each: what ran before has threads that go on looking for work


@dataclass(frozen=True)
class Timing:
    """Seconds of one call: the median of the rounds, and the quartiles beside it."""

    seconds: float
    low: float
    high: float


@dataclass(frozen=True)
class Ratio:
    """How many times as long one call takes as another: the median over rounds in which both ran, and the quartiles."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f}x ({self.low:.2f} to {self.high:.2f})"


class Times:
    """Seconds by call and round, from :func:`interleaved`."""

    def __init__(self, seconds: Mapping[str, list[float]]):
        self.seconds = seconds

    def __getitem__(self, name: str) -> Timing:
        return Timing(*_median_and_quartiles(self.seconds[name]))

    def ratio(self, slow: str, fast: str) -> Ratio:
        """Of the times of `slow` and `fast`, round by round."""
        return Ratio(*_median_and_quartiles([a / b for a, b in zip(self.seconds[slow], self.seconds[fast])]))


def interleaved(calls: Mapping[str, Callable[[], object]], rounds: int) -> Times:
    """Runs every call once to warm up, then all of them in turns.

    Args:
        calls: What is timed, by name.
        rounds: How often each is measured.
    """
    repeats = {}
    for name, call in calls.items():
        call()
        started = time.perf_counter()
        call()
        repeats[name] = max(1, round(SHORTEST / max(time.perf_counter() - started, 1e-7)))
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            time.sleep(SETTLING)
            started = time.perf_counter()
            for _ in range(repeats[name]):
                call()
            seconds[name].append((time.perf_counter() - started) / repeats[name])
    return Times(seconds)


def _median_and_quartiles(values: list[float]) -> tuple[float, float, float]:
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return middle, low, high
