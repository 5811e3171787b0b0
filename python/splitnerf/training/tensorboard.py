"""The numbers and previews of a training as TensorBoard's event files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.images import read_image
from splitnerf.errors import InputError
from splitnerf.files import reason
from splitnerf.training.observer import Observed, Observer


class TensorBoard(Observer):
    """Writes the lines of metrics.jsonl as scalars and the previews as images; within a block, which closes the file.

    Args:
        folder: The folder of the event files; it is made when training begins.

    Raises:
        InputError: The package is not installed, or the path is a file.
    """

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

    def began(self, training: Observed) -> None:
        """Steps of an earlier file after the one from which the run goes on come again.

        Raises:
            InputError: The folder cannot be made.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self._folder}: cannot be made ({reason(error)}); give --tensorboard another folder") from None
        self._writer = self._make(str(self._folder), purge_step=training.step + 1)

    def logged(self, line: dict[str, object]) -> None:
        for name, value in line.items():
            if name != "step" and value is not None:
                self._writer.add_scalar(name, float(value), line["step"])

    def previewed(self, picture: Path, step: int) -> None:
        pixels = np.ascontiguousarray(read_image(picture)[..., :3])
        self._writer.add_image("photo, render, albedo, normals", pixels, step, dataformats="HWC")

    def __exit__(self, *exception) -> None:
        if self._writer is not None:
            self._writer.close()
