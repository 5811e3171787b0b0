"""Messages to the user: errors, which the command line turns into exit codes, and notes, which do not stop the work."""

from __future__ import annotations

import sys

LONGEST_LINE = 2000  # characters of a message
_said: set[str] = set()


def plain(text: str) -> str:
    """A text as one line without control characters, which names from files may hold; of a long one both ends."""
    line = escaped(" ".join(text.splitlines()))
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 500]} ... {line[-500:]}"


def escaped(text: str, kept: str = "") -> str:
    """A text with control characters and surrogates escaped as Python does; `kept` stays as it is."""
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


def shown(value: object) -> str:
    """A value of a file, in a message: shortened, and text as such."""
    return f"{'the text ' * isinstance(value, str)}{value!r}"[:50]


class InputError(Exception):
    """Bad input or usage: one clear line that names the file and says what to do. The command line prints it without a traceback
    and exits with code 2."""

    def __str__(self) -> str:
        return plain(super().__str__())


def note(text: str) -> None:
    """Writes one line to stderr, which names a file and the values that were repaired or left out."""
    print(f"splitnerf: note: {plain(text)}", file=sys.stderr)


def note_once(text: str, example: str = "") -> None:
    """Writes a note unless the same text was written before; the example, in brackets, may differ."""
    if text not in _said:
        _said.add(text)
        note(f"{text} ({example})" if example else text)
