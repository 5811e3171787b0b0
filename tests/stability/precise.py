"""Arithmetic of 50 digits."""

import numpy as np
from splitnerf.errors import InputError

try:
    from mpmath import MPContext
except ImportError as error:
    raise InputError("arithmetic of 50 digits needs mpmath: pip install 'splitnerf[test]'") from error

mp = MPContext()
mp.dps = 50


def vector(values: np.ndarray) -> list:
    """Numbers of float64 in full precision."""
    return [mp.mpf(float(x)) for x in np.ravel(values)]
