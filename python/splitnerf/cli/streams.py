"""Standard output and error that outlive their reader: a long run does not end because a pipe or a terminal did."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import TextIO

from splitnerf.errors import escaped

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Lasting:
    """A text stream: what is written after its reader has gone is dropped.

    Args:
        stream: The stream.
        results: Whether it takes results, and not words about the work: a full disk is then an error, and a terminal
            shows the names of files and does not obey them.
    """

    def __init__(self, stream: TextIO, *, results: bool):
        self._stream, self._results = stream, results

    def write(self, text: str) -> int:
        with self._lasting():
            self._stream.write(escaped(text, kept="\n\t") if self._results else text)
        return len(text)

    def flush(self) -> None:
        with self._lasting():
            self._stream.flush()

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)

    @contextmanager
    def _lasting(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if self._results and error.errno in NO_ROOM:
                raise
            with suppress(OSError, ValueError):  # what is left in its buffer goes nowhere either
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())
                os.close(nowhere)
        except ValueError:  # the stream is closed
            pass


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Within the block both streams are there and last."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:  # else the next file of the program would take the number
        pass
    os.close(number)
    streams = [
        stream or open(number, "w", errors="backslashreplace", closefd=False)
        for number, stream in ((1, sys.stdout), (2, sys.stderr))
    ]
    output, errors = Lasting(streams[0], results=True), Lasting(streams[1], results=False)
    with redirect_stdout(output), redirect_stderr(errors):
        try:
            yield
        finally:
            for stream in (output, errors):
                with suppress(OSError):
                    stream.flush()
