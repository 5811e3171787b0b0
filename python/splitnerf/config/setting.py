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
    """The allowed values of a setting, within its type.

    Attributes:
        low, high: The bounds of a number; None for other types.
        without_low, without_high: Whether the bound itself is excluded.
        choices: The only allowed values; empty if there is no such list.
        multiple_of: A number that must divide the value, or 0.
        power_of_2: Whether the value must be a power of 2.
    """

    low: float | None = None
    high: float | None = None
    without_low: bool = False
    without_high: bool = False
    choices: tuple = ()
    multiple_of: int = 0
    power_of_2: bool = False

    def allow(self, value: object) -> bool:
        """Whether a value of the right type is allowed. NaN never is."""
        if self.choices:
            return value in self.choices
        if self.low is None:
            return True
        above = self.low < value if self.without_low else self.low <= value
        below = value < self.high if self.without_high else value <= self.high
        uneven = (self.multiple_of and value % self.multiple_of) or (self.power_of_2 and value & (value - 1))
        return above and below and not uneven

    def __str__(self) -> str:
        """The words that follow "must be" in a message; empty where all values of the type are allowed."""
        if self.choices:
            return f"one of {', '.join(map(str, self.choices))}"
        if self.low is None:
            return ""
        kind = f"a multiple of {self.multiple_of} " if self.multiple_of else "a power of 2 " if self.power_of_2 else ""
        low, high = (f"{bound:g}" if isinstance(bound, float) else bound for bound in (self.low, self.high))
        return f"{kind}in {'(' if self.without_low else '['}{low}, {high}{')' if self.without_high else ']'}"


def setting(
    default: Any,
    meaning: str,
    *,
    unit: str = "",
    choices: Iterable = (),
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    multiple_of: int = 0,
    power_of_2: bool = False,
) -> Any:
    """The field of a group of settings, with its description as metadata: ``meaning`` (a noun phrase), ``unit``,
    ``limits``.

    Args:
        default: The value in the preset ``cpu``.
        choices: The only allowed values; without them all values within the bounds are allowed.
        at_least, above: The lower bound of a number, with or without the bound itself (default: at least 0).
        at_most, below: The upper bound, with or without the bound itself (default: `LARGEST_INT`, `LARGEST_FLOAT`).
        multiple_of, power_of_2: Further conditions on an integer, see :class:`Limits`.
    """
    limits = Limits(choices=tuple(choices))
    if type(default) in (int, float) and not limits.choices:
        low = above if above is not None else at_least if at_least is not None else 0
        high = below if below is not None else at_most if at_most is not None else None
        if high is None:
            high = LARGEST_INT if type(default) is int else LARGEST_FLOAT
        limits = Limits(low, high, above is not None, below is not None, (), multiple_of, power_of_2)
    return dataclasses.field(default=default, metadata={"meaning": meaning, "unit": unit, "limits": limits})
