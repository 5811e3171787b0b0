"""A stream of the newest state for the pages that are open."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

HEARTBEAT = 2.0  # seconds after which a page gets the same state again, as a sign of life
FAREWELL = 5.0  # seconds that the end waits at most for open pages to load the newest asset
POLL = 0.1  # seconds between two checks for closed pages, at the end


class EventStream:
    """The newest state, a dictionary for JSON, for any number of listening pages.

    Attributes:
        listeners: The number of listening pages.
        state: The newest state; `ended` is null, or one line that says how it ended.
    """

    def __init__(self):
        self.listeners = 0
        self.state: dict[str, object] = {"ended": None}
        self._number, self._changed = 0, threading.Condition()

    def update(self, **changes: object) -> None:
        """Changes the state and sends it to all listeners."""
        with self._changed:
            self.state = self.state | changes
            self._number += 1
            self._changed.notify_all()

    def listen(self, gone: Callable[[], bool]) -> Iterator[dict]:
        """The state now, after each change and as a heartbeat, until `gone` returns true."""
        sent = -1
        with self._changed:
            self.listeners += 1
        try:
            while not gone():
                with self._changed:
                    timeout = POLL if self.state["ended"] else HEARTBEAT
                    self._changed.wait_for(lambda: self._number != sent, timeout)  # noqa: B023
                    sent, state = self._number, self.state
                yield state
        finally:
            with self._changed:
                self.listeners -= 1
                self._changed.notify_all()

    def end(self, words: str) -> None:
        """Sends the end, once, and waits a moment until all pages have closed their connections."""
        with self._changed:
            if self.state["ended"]:
                return
        self.update(ended=words)
        with self._changed:
            self._changed.wait_for(lambda: self.listeners == 0, FAREWELL)
