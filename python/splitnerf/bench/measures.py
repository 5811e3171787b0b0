"""Measures that several benchmarks share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def rms(values: ArrayLike) -> float:
    """Root of the mean square of all numbers."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values, np.float64)))))
