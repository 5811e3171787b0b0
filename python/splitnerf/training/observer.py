"""Who looks on while a run trains: observers see its numbers and pictures, and may ask it to wait, to save or to stop."""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import Enum, auto
from pathlib import Path
from typing import Protocol

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.progress import Interrupt
from splitnerf.render.model import SceneModel

PAUSE = 0.1  # seconds between two questions whether a pause has ended


class Wish(Enum):
    """What an observer asks of a training between two steps."""

    PAUSE = auto()
    SAVE = auto()
    STOP = auto()  # and to deliver what there is


class Observed(Protocol):
    """What an observer sees of a training between two steps. It changes none of it, and draws no random numbers of torch."""

    config: Config
    dataset: Dataset
    model: SceneModel
    run: Path
    step: int
    seconds: float
    psnr_mean: float | None

    @property
    def progress(self) -> float: ...


class Observer:
    """Looks on. Whoever observes overrides what it needs; the training's own thread calls all of it."""

    def began(self, training: Observed) -> None:
        """Training begins, or goes on, with the step after `training.step`."""

    def logged(self, line: dict[str, object]) -> None:
        """A line was added to metrics.jsonl."""

    def previewed(self, picture: Path, step: int) -> None:
        """A preview was written."""

    def between_steps(self, training: Observed) -> Wish | None:
        """Between two steps; a wish is fulfilled, and the question comes again until there is none."""

    def delivering(self, stage: str, folder: Path | None = None) -> None:
        """Training has ended and a stage begins; `folder` holds the newest asset and its light, if there is one."""


class Observers(Observer):
    """Several observers as one."""

    def __init__(self, observers: Sequence[Observer] = ()):
        self._observers = tuple(observers)

    def began(self, training: Observed) -> None:
        for observer in self._observers:
            observer.began(training)

    def logged(self, line: dict[str, object]) -> None:
        for observer in self._observers:
            observer.logged(line)

    def previewed(self, picture: Path, step: int) -> None:
        for observer in self._observers:
            observer.previewed(picture, step)

    def between_steps(self, training: Observed) -> Wish | None:
        wishes = [observer.between_steps(training) for observer in self._observers]
        return next((wish for wish in wishes if wish), None)

    def delivering(self, stage: str, folder: Path | None = None) -> None:
        for observer in self._observers:
            observer.delivering(stage, folder)


class Heeding(Observed, Protocol):
    """A training that does what is asked of it."""

    observers: Observers
    stopped: bool

    def save(self) -> None: ...

    def settle(self) -> None: ...


def heed(training: Heeding, interrupt: Interrupt) -> float:
    """Does what the observers ask between two steps; a signal to end ends a pause, too.

    Returns:
        The seconds of a pause, in which nothing was trained.
    """
    paused = 0.0
    while not interrupt.asked and not training.stopped:
        wish = training.observers.between_steps(training)
        if wish is None:
            break
        training.settle()
        if wish is Wish.SAVE:
            training.save()
        elif wish is Wish.STOP:
            training.stopped = True
        else:
            clock = time.monotonic()
            time.sleep(PAUSE)
            paused += time.monotonic() - clock
    return paused
