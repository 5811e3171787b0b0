"""One setting: its default, meaning, unit and allowed values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

LARGEST_INT = 1 << 24  # bound of a setting without its own
LARGEST_FLOAT = 1e30


@dataclass(frozen=True)
class Limits:
    """The allowed values of a setting, within its type."""

    low: float | None = None  # the bounds of a number; None for other types
    high: float | None = None
    without_low: bool = False  # whether the bound itself is excluded
    without_high: bool = False
    choices: tuple = ()  # the only allowed values; empty if there is no such list

    def allow(self, value: object) -> bool:
        """Whether a value of the right type is allowed. NaN never is."""
        if self.choices:
            return value in self.choices
        if self.low is None:
            return True
        above = self.low < value if self.without_low else self.low <= value
        below = value < self.high if self.without_high else value <= self.high
        return above and below

    def __str__(self) -> str:
        """The words that follow "must be" in a message; empty where all values of the type are allowed."""
        if self.choices:
            return f"one of {', '.join(map(str, self.choices))}"
        if self.low is None:
            return ""
        low, high = (f"{bound:g}" if isinstance(bound, float) else bound for bound in (self.low, self.high))
        return f"in {'(' if self.without_low else '['}{low}, {high}{')' if self.without_high else ']'}"


def setting(
    default: Any,
    meaning: str,
    *,
    unit: str = "",
    choices: Iterable = (),
    at_least: float = 0,
    above: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
) -> Any:
    """The field of a group of settings, with its description as metadata: ``meaning`` (a noun phrase), ``unit``,
    ``limits``.

    Args:
        default: The value in the preset ``cpu``.
        choices: The only allowed values; without them all values within the bounds are allowed.
        at_least, above: The lower bound of a number, with or without the bound itself (default: at least 0).
        at_most, below: The upper bound, with or without the bound itself (default: `LARGEST_INT`, `LARGEST_FLOAT`).
    """
    limits = Limits(choices=tuple(choices))
    if type(default) in (int, float) and not limits.choices:
        largest = LARGEST_INT if type(default) is int else LARGEST_FLOAT
        low, high = above if above is not None else at_least, below if below is not None else at_most
        limits = Limits(low, largest if high is None else high, above is not None, below is not None)
    return dataclasses.field(default=default, metadata={"meaning": meaning, "unit": unit, "limits": limits})
