"""What `splitnerf doctor` and `splitnerf inspect` list: what was found, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

WIDTH = 24  # of the names


@dataclass
class Finding:
    """One line of the list.

    Attributes:
        name: What was looked at.
        value: What was found.
        advice: What to do about it; empty where nothing needs to be done.
        failed: Whether a part of the program cannot work.
        suspects: What is suspected of a photo, in a few words, by its number; the worst come first.
    """

    name: str
    value: str
    advice: str = ""
    failed: bool = False
    suspects: dict[int, str] = field(default_factory=dict)

    def show(self) -> None:
        """Prints the line and the advice."""
        show(self.name, self.value, [self.advice] if self.advice else [])


def show(name: str, value: str, advice: Sequence[str] = ()) -> None:
    """Prints a line of the list and what to do about it, at once: a crash that follows hides nothing."""
    print(f"{name:{WIDTH}}{value}", flush=True)
    for line in advice:
        print(f"{'':{WIDTH}}-> {line}", flush=True)
