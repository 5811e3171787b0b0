"""The exposures of photos that a run learned, in a file beside its asset."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.json_files import read_json, write_json
from splitnerf.errors import InputError

EXPOSURES = "exposures.json"
MEANING = "factors of each photo's linear red, green and blue, with the geometric mean of those that the data state"


def write_exposures(run: Path, dataset: Dataset) -> None:
    """Writes the exposures of a split."""
    factors = dict(zip(_names(dataset), np.round(dataset.exposures, 6).tolist()))
    write_json(run / EXPOSURES, {"meaning": MEANING, "exposures": factors})


def _names(dataset: Dataset) -> list[str]:
    """The images' paths in the data's folder."""
    return [os.path.relpath(path, dataset.root) for path in dataset.image_paths]


def with_exposures(dataset: Dataset, run: Path) -> Dataset:
    """A split with the exposures that a run learned; as it is where it learned none.

    Raises:
        InputError: The file is damaged, or is of other photos.
    """
    path = run / EXPOSURES
    if not path.is_file():
        return dataset
    stored = read_json(path, "exposures")["exposures"]
    try:
        factors = np.array([stored[name] for name in _names(dataset)], np.float64)
    except (KeyError, TypeError, ValueError):
        factors = np.zeros(0)
    if factors.shape != (len(dataset), 3) or not (np.isfinite(factors) & (factors > 0)).all():
        raise InputError(f"{path}: is not of these photos; delete it to take the exposures that the data state")
    return dataset.exposed(factors)
