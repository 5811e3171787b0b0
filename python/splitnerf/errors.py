"""The errors that the command line turns into exit codes."""

from __future__ import annotations


def plain(text: str) -> str:
    """A text as one line that a terminal shows and does not obey: names from files may hold line ends and escapes."""
    return escaped(" ".join(text.splitlines()))


def escaped(text: str, kept: str = "") -> str:
    """A text with what a terminal obeys, and what no encoding has, as Python writes it; `kept` stays as it is."""
    return "".join(c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)


class InputError(Exception):
    """Bad input or usage: one clear line that names the file and says what to do.

    The command line prints it without a traceback and exits with code 2.
    """

    def __str__(self) -> str:
        return plain(super().__str__())


class CheckFailed(RuntimeError):
    """A benchmark's subject gives wrong results, so that its time means nothing."""
