"""The errors that the command line turns into exit codes."""

from __future__ import annotations


class InputError(Exception):
    """Bad input or usage: one clear line that names the file and says what to do.

    The command line prints it without a traceback and exits with code 2.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().splitlines())  # a name from a file may hold line ends


class CheckFailed(RuntimeError):
    """A benchmark's subject gives wrong results, so that its time means nothing."""
