"""Standard output and error that survive the end of their reader, a pipe or a terminal, so that a long run
continues."""

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
    """A text stream that drops what is written after its reader has ended. Where it carries `results` in place of
    messages, a full disk is an error, and control characters in names of files are shown and not obeyed by a terminal.
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
            with suppress(OSError, ValueError):  # the rest of its buffer is dropped too
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())
                os.close(nowhere)
        except ValueError:  # the stream is closed
            pass


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Within the block both streams exist and survive the end of their readers."""
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
