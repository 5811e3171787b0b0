"""Notes to the user that do not stop the work."""

from __future__ import annotations

import sys

from splitnerf.errors import plain

_said: set[str] = set()


def note(text: str) -> None:
    """Writes one line to stderr, which names a file and the values that were repaired or left out."""
    print(f"splitnerf: note: {plain(text)}", file=sys.stderr)


def note_once(text: str, example: str = "") -> None:
    """Writes a note unless the same text was written before; the example, in brackets, may differ."""
    if text not in _said:
        _said.add(text)
        note(f"{text} ({example})" if example else text)
