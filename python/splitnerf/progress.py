"""The display of a long run's progress, and its handling of Ctrl-C and of other signals to end."""

from __future__ import annotations

import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TypeVar

from tqdm import tqdm

LOADER, AGAIN = "<frozen importlib._bootstrap>", 0.05  # what loads modules; seconds until a signal comes again
LINE_EVERY = 10.0  # seconds between lines where the output is not a terminal
Item = TypeVar("Item")


def ending_signals() -> list[signal.Signals]:
    """The signals that ask a program to end: Ctrl-C, SIGTERM, and that of a terminal which closes, unless nohup ignores it."""
    asking = [signal.SIGINT, signal.SIGTERM]
    return asking if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else [*asking, signal.SIGHUP]


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Within the block every signal to end raises KeyboardInterrupt, so that nothing is left half-written; where a
    module is being loaded, soon after: it might take the exception for a missing library, or stay broken. Threads
    beside the main one have no signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    outside = _loads_of_modules(sys._getframe())

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _loads_of_modules(frame) == outside:
            raise KeyboardInterrupt
        threading.Timer(AGAIN, signal.pthread_kill, (threading.main_thread().ident, number)).start()

    previous = {s: signal.signal(s, interrupt) for s in ending_signals()}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _loads_of_modules(frame: FrameType | None) -> int:
    """How many calls on the stack load a module."""
    return sum(inner.f_code.co_filename == LOADER for inner, _ in traceback.walk_stack(frame))


class Interrupt:
    """Turns the first signal to end into a request; a second signal has its default effect."""

    def __enter__(self) -> Interrupt:
        self.asked = self._may_raise = False
        self._previous = {s: signal.signal(s, self._ask) for s in ending_signals()}
        return self

    def attempt(self, work: Callable[[], None]) -> None:
        """Does optional work: a request to end skips it, or interrupts it."""
        if self.asked:
            return
        try:
            try:
                self._may_raise = True
                work()
            finally:
                self._may_raise = False
        except _Abandoned:
            pass

    def _ask(self, number, frame) -> None:
        self.asked = True
        signal.signal(number, self._previous[number])
        if self._may_raise:
            self._may_raise = False
            raise _Abandoned

    def __exit__(self, *exception) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)


class _Abandoned(BaseException):
    """A request to end interrupts optional work."""


class Progress:
    """Shows the share done, the time left and a text: as a bar on a terminal, elsewhere as a line every ten seconds.

    Args:
        start: The share that is done already.
        leave: Whether a terminal keeps the bar at its end.
        at_once: Whether the first text is a line at once, also where the output is not a terminal.
    """

    def __init__(self, start: float, leave: bool = True, at_once: bool = False):
        self._stream = sys.stderr
        self._is_terminal = self._stream.isatty()
        self._bar = tqdm(
            total=100.0,
            initial=100.0 * start,
            file=self._stream,
            disable=not self._is_terminal,
            leave=leave,
            bar_format="{percentage:3.0f}%|{bar:30}| {elapsed}<{remaining}{postfix}",
        )
        self._start, self._started, self._last_line = start, time.monotonic(), -LINE_EVERY if at_once else 0.0

    def __enter__(self) -> Progress:
        return self

    def show(self, progress: float, text: str) -> None:
        if self._is_terminal:
            self._bar.set_postfix_str(text, refresh=False)
            made = 100.0 * progress - self._bar.n
            self._bar.update(made)
            if made <= 0:
                self._bar.refresh()  # its clock goes on
            return
        elapsed = time.monotonic() - self._started
        if elapsed - self._last_line >= LINE_EVERY or progress >= 1.0:
            self._last_line = elapsed
            made = progress - self._start
            left = tqdm.format_interval(elapsed * (1.0 - progress) / made) if made > 0 else "?"
            print(
                f"{100 * progress:3.0f}% {tqdm.format_interval(elapsed)}<{left} {text}", file=self._stream, flush=True
            )

    def skip(self, seconds: float) -> None:
        """Excludes the last seconds, in which nothing was done."""
        self._started += seconds
        if self._is_terminal:  # else tqdm keeps no time
            self._bar.start_t += seconds

    def __exit__(self, *exception) -> None:
        self._bar.close()


def tracked(items: Sequence[Item], what: str) -> Iterator[Item]:
    """The items, with a display of how many are done; less than ten seconds of work show on a terminal only."""
    with Progress(0.0, leave=False) as bar:
        for i, item in enumerate(items):
            bar.show(i / len(items), f"{what} {i + 1} of {len(items)}")
            yield item
