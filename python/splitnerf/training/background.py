"""Work beside the training."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future


def in_background(function: Callable, *args: object) -> Future:
    """Calls a function in a thread of its own, which ends with the program; the future holds its result or exception."""
    future = Future()
    threading.Thread(target=_fulfil, args=(future, function, *args), daemon=True).start()
    return future


def _fulfil(future: Future, function: Callable, *args: object) -> None:
    try:
        future.set_result(function(*args))
    except BaseException as error:  # the thread that asks for the result raises it
        future.set_exception(error)
