"""What the user should know though the work goes on."""

from __future__ import annotations

import sys


def note(text: str) -> None:
    """One line on stderr: what was repaired or left out, and of which file."""
    print(f"splitnerf: note: {text}", file=sys.stderr)
