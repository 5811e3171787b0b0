"""What the pages are told while they are open: the newest state, again and again."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

HEARTBEAT = 2.0  # seconds after which a page hears the same state again, and knows that the server is there
FAREWELL = 5.0  # seconds that the end waits at most for open pages to load what is newest
POLL = 0.1  # seconds between two looks whether a page has gone, at the end


class News:
    """The newest state, a dictionary for JSON, for any number of pages that listen.

    Attributes:
        listeners: How many listen.
        state: The newest state; `ended` is null, or one line that says how it ended.
    """

    def __init__(self):
        self.listeners = 0
        self.state: dict[str, object] = {"ended": None}
        self._number, self._changed = 0, threading.Condition()

    def tell(self, **changes: object) -> None:
        """Changes the state; all who listen hear of it."""
        with self._changed:
            self.state = self.state | changes
            self._number += 1
            self._changed.notify_all()

    def listen(self, gone: Callable[[], bool]) -> Iterator[dict]:
        """The state now and after each change, and as a heartbeat, until `gone` says so."""
        heard = -1
        with self._changed:
            self.listeners += 1
        try:
            while not gone():
                with self._changed:
                    patience = POLL if self.state["ended"] else HEARTBEAT
                    self._changed.wait_for(lambda: self._number != heard, patience)  # noqa: B023
                    heard, state = self._number, self.state
                yield state
        finally:
            with self._changed:
                self.listeners -= 1
                self._changed.notify_all()

    def end(self, words: str) -> None:
        """Tells the end, unless one was told, and waits a moment until all pages have closed their connections."""
        with self._changed:
            if self.state["ended"]:
                return
        self.tell(ended=words)
        with self._changed:
            self._changed.wait_for(lambda: self.listeners == 0, FAREWELL)
