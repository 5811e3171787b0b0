"""What an observer of a run learns, and what it may request of the training."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import Any


class Request(Enum):
    """What an observer requests of a training between two steps."""

    PAUSE = auto()
    SAVE = auto()
    STOP = auto()  # and to deliver what there is


@dataclass(frozen=True)
class Event:
    """Something that happens in a run.

    Attributes:
        kind: ``begun``: the training begins, or goes on, with the step after `training.step`. ``step``: it is between two
            steps; a request is fulfilled, and the event comes again until there is none. ``logged``: `line` was added to
            metrics.jsonl. ``previewed``: the picture `path` was written. ``export``, ``refinement``, ``evaluation``: the
            training has ended and this stage begins; `path` is the folder of the newest asset and its light, if there is one.
        training: The :class:`splitnerf.training.loop.Training`, of which an observer changes nothing; None in the stages
            after it. Observers draw no random numbers of torch.
        line: The values of the line by name.
        path: See `kind`.
    """

    kind: str
    training: Any = None
    line: dict[str, object] | None = None
    path: Path | None = None


Observer = Callable[[Event], Request | None]  # the training's own thread calls it


def together(observers: Sequence[Observer]) -> Observer:
    """Several observers as one: each learns of each event, and the first request counts."""

    def observe(event: Event) -> Request | None:
        requests = [observer(event) for observer in observers]
        return next((request for request in requests if request), None)

    return observe


NOBODY: Observer = together(())
