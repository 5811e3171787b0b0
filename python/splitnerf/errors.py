"""The error that stands for bad input or usage."""

from __future__ import annotations


class InputError(Exception):
    """Bad input or usage: one clear line that names the file and says what to do.

    The command line prints it without a traceback and exits with code 2.
    """

    def __str__(self) -> str:
        return " ".join(super().__str__().splitlines())  # a name from a file may hold line ends
