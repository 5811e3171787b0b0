"""The list that `splitnerf doctor` and `inspect` print."""

from __future__ import annotations

from collections.abc import Sequence

WIDTH = 24  # of the names


def show(name: str, value: str, advice: Sequence[str] = ()) -> None:
    """Prints a line of the list and what to do about it, at once: a crash that follows hides nothing."""
    print(f"{name:{WIDTH}}{value}", flush=True)
    for line in advice:
        print(f"{'':{WIDTH}}-> {line}", flush=True)
