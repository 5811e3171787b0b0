"""The errors that the command line turns into exit codes."""

from __future__ import annotations


def plain(text: str) -> str:
    """A text as one line without control characters, which names from files may hold."""
    return escaped(" ".join(text.splitlines()))


def escaped(text: str, kept: str = "") -> str:
    """A text with control characters and surrogates escaped as Python does; `kept` stays as it is."""
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


class InputError(Exception):
    """Bad input or usage: one clear line that names the file and says what to do.

    The command line prints it without a traceback and exits with code 2.
    """

    def __str__(self) -> str:
        return plain(super().__str__())


class CheckFailed(RuntimeError):
    """A benchmark's subject gives wrong results, so that its time is meaningless."""
