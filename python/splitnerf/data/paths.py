"""Paths that come from other files."""

from __future__ import annotations

from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether a file exists at the path; false for impossible names, such as names that are too long."""
    try:
        return path.is_file()
    except OSError:
        return False
