"""Notes to the user that do not stop the work."""

from __future__ import annotations

import sys


def note(text: str) -> None:
    """Writes one line to stderr, which names a file and the values that were repaired or left out."""
    print(f"splitnerf: note: {text}", file=sys.stderr)
