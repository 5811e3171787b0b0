"""What an observer of a run learns, what it may request of the training, and one that writes TensorBoard's files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from pathlib import Path
from typing import Any

import numpy as np

from splitnerf.data.images import read_image
from splitnerf.errors import InputError, note
from splitnerf.files import reason


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


class TensorBoard:
    """An observer that writes the lines of metrics.jsonl as scalars and the previews as images into a folder, which is made when
    training begins; within a block, which closes the file. Raises InputError where the package is not installed, or the path is a
    file."""

    def __init__(self, folder: Path):
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError:
            raise InputError("--tensorboard: needs tensorboard; pip install 'splitnerf[tensorboard]'") from None
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is a file; give --tensorboard a folder")
        self._folder, self._make, self._writer = folder, SummaryWriter, None

    def __enter__(self) -> TensorBoard:
        return self

    def __call__(self, event: Event) -> None:
        if event.kind == "begun":
            self._begin(event.training.step)
        elif event.kind == "logged":
            for name, value in event.line.items():
                if name != "step" and value is not None:
                    self._write("add_scalar", name, float(value), event.line["step"])
        elif event.kind == "previewed":
            pixels, step = np.ascontiguousarray(read_image(event.path)[..., :3]), event.training.step
            self._write("add_image", "photo, render, albedo, normals", pixels, step, dataformats="HWC")

    def _begin(self, step: int) -> None:
        """Opens the file; its steps after the one that the run goes on from come again. Raises InputError where that is
        impossible."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{self._folder}: cannot be made ({reason(error)}); give --tensorboard another folder"
            ) from None
        self._writer = self._make(str(self._folder), purge_step=step + 1)

    def __exit__(self, *exception) -> None:
        self._write("close")

    def _write(self, method: str, *arguments: object, **options: object) -> None:
        """Calls a method of the writer, as long as that is possible: a full disk ends the curves, not the training."""
        if self._writer is None:
            return
        try:
            getattr(self._writer, method)(*arguments, **options)
        except OSError as error:
            self._writer = None
            note(f"{self._folder}: cannot be written ({reason(error)}); TensorBoard gets no more of this run")
