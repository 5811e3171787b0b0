"""The display of a long run's progress, and its handling of Ctrl-C."""

from __future__ import annotations

import signal
import sys
import time

from tqdm import tqdm

LINE_EVERY = 10.0  # seconds between lines where the output is not a terminal


class Interrupt:
    """Turns the first Ctrl-C (or SIGTERM) into a request; a second one ends the program at once."""

    def __enter__(self) -> Interrupt:
        self.asked = False
        self._previous = {s: signal.signal(s, self._ask) for s in (signal.SIGINT, signal.SIGTERM)}
        return self

    def _ask(self, number, frame) -> None:
        self.asked = True
        signal.signal(number, self._previous[number])

    def __exit__(self, *exception) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)


class Progress:
    """Shows the share done, the time left and a text: as a bar on a terminal, elsewhere as a line every ten seconds."""

    def __init__(self, start: float):
        self._is_terminal = sys.stderr.isatty()
        self._bar = tqdm(
            total=100.0, initial=100.0 * start, file=sys.stderr, disable=not self._is_terminal,
            bar_format="{percentage:3.0f}%|{bar:30}| {elapsed}<{remaining} {postfix}",
        )  # fmt: skip
        self._start, self._started, self._told = start, time.monotonic(), 0.0

    def __enter__(self) -> Progress:
        return self

    def show(self, progress: float, told: str) -> None:
        if self._is_terminal:
            self._bar.set_postfix_str(told, refresh=False)
            self._bar.update(100.0 * progress - self._bar.n)
            return
        elapsed = time.monotonic() - self._started
        if elapsed - self._told >= LINE_EVERY or progress >= 1.0:
            self._told = elapsed
            left = elapsed * (1.0 - progress) / max(progress - self._start, 1e-9)
            times = "<".join(tqdm.format_interval(seconds) for seconds in (elapsed, left))
            print(f"{100 * progress:3.0f}% {times} {told}", file=sys.stderr, flush=True)

    def __exit__(self, *exception) -> None:
        self._bar.close()
