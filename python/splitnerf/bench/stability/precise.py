"""Arithmetic of 50 digits."""

from __future__ import annotations

import numpy as np

from splitnerf.errors import InputError

try:
    from mpmath import MPContext
except ImportError as error:
    raise InputError("the stability benchmark needs mpmath: pip install 'splitnerf[bench]'") from error

mp = MPContext()
mp.dps = 50


def vector(values: np.ndarray) -> list:
    """Numbers of float64 in full precision."""
    return [mp.mpf(float(x)) for x in np.ravel(values)]
