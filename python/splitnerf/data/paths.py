"""Files that other files name."""

from __future__ import annotations

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether a file stands there; false for names that none can have, such as ones too long."""
    try:
        return path.is_file()
    except OSError:
        return False
