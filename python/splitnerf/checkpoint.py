"""Saves and loads the state of a run. A checkpoint holds tensors and plain values only: loading runs no code."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path

import torch

from splitnerf.config import Config
from splitnerf.data.images import atomic_path
from splitnerf.errors import InputError

FORMAT = 1


def save_checkpoint(path: Path, *, config: Config, fingerprint: str, state: dict) -> None:
    """Writes the checkpoint beside the old one and then takes its place, so that one of them is always whole.

    Raises:
        OSError: The disk is full or the folder cannot be written; the old checkpoint stands.
    """
    with atomic_path(path) as temporary:
        try:
            torch.save(
                {"format": FORMAT, "config": dataclasses.asdict(config), "fingerprint": fingerprint, **state}, temporary
            )
        except RuntimeError as error:  # torch reports a full disk so
            raise OSError(f"{path}: the checkpoint could not be written ({error})") from error


def load_checkpoint(path: Path) -> dict:
    """Reads a checkpoint with torch's restricted unpickler.

    Raises:
        InputError: The file is missing, truncated, of another format or holds anything but tensors and plain values.
    """
    if not path.is_file():
        raise InputError(f"{path}: no checkpoint there; train without --resume first")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        found = content["format"]
    except (OSError, RuntimeError, EOFError, KeyError, TypeError, pickle.UnpicklingError) as error:
        raise InputError(f"{path}: not a readable checkpoint ({str(error).splitlines()[0]})") from error
    if found != FORMAT:
        raise InputError(f"{path}: checkpoint format {found}, this version reads {FORMAT}")
    return content


def config_of(content: dict) -> Config:
    """The settings of the run that wrote the checkpoint."""
    return Config.stored(content["config"])
