"""JSON files that hold one object."""

from __future__ import annotations

import json
from pathlib import Path

from splitnerf.errors import InputError
from splitnerf.files import atomic_path


def read_json(path: Path, key: str) -> dict:
    """Reads a file; messages name the `key` that its object must have. Raises InputError where the file is missing or
    cannot be read, is not valid json, or does not hold an object."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; check the path")
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin a file with a byte order mark
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give yourself the permission") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not valid json ({str(error).splitlines()[0]}); repair it") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: must hold a json object with '{key}'")
    return content


def is_number(value: object) -> bool:
    """Whether a value is a number; true and false are none."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def need(table: dict, key: str, path: Path, where: str = "") -> object:
    """The value of a key. Raises InputError where it is missing; `where` follows the key in the message."""
    if key not in table:
        raise InputError(f"{path}: missing key '{key}'{where}; add it")
    return table[key]


def write_json(path: Path, content: dict) -> None:
    """Writes a file atomically, indented. Raises ValueError where a number is not finite, and OSError where writing fails."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
