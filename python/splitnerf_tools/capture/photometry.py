"""How bright each photo is exposed and how its corners darken, from points that several photos show.

A point of the scene that sends the same light to all cameras has in photo i, at the distance r from the principal point, the
linear value gain_i (1 + a r^2 + b r^4) L. Points that shine are outliers. Source: Goldman 2010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, vstack
from scipy.sparse.linalg import lsqr

DARKEST, BRIGHTEST = 0.01, 0.9  # linear values of the observations that count
OUTLIER = 0.1  # deviation of log radiance from which on an observation counts less
FILE_DEVIATION = 0.1  # of the log exposures that the photos' files tell from the true ones
CORNER_DEVIATION = 0.3  # of the vignetting's coefficients from zero
ROUNDS = 12


@dataclass
class Exposures:
    """The brightness of photos.

    Attributes:
        gains: [n] the factor of each photo's linear values; their geometric mean is 1.
        vignetting: (a, b) of the factor 1 + a r^2 + b r^4, r in half diagonals.
    """

    gains: np.ndarray
    vignetting: tuple[float, float]


def find_exposures(
    photo_of: np.ndarray, point_of: np.ndarray, values: np.ndarray, radii: np.ndarray, by_file: np.ndarray
) -> Exposures:
    """Fits gains and vignetting to observations by iteratively reweighted least squares (Student's t, 3 degrees of freedom).

    Args:
        photo_of, point_of: [k] int64 the photo and the point of each observation.
        values: [k] linear values of the photos at the observations, in [0, 1].
        radii: [k] distances from the principal point in half diagonals.
        by_file: [n] exposures as the photos' files tell them, in any unit; NaN where they do not.
    """
    n = len(by_file)
    known = np.isfinite(by_file)
    start = np.where(known, np.log(np.where(known, by_file, 1.0)), np.nan)
    start = np.nan_to_num(start - (start[known].mean() if known.any() else 0.0))
    good = (values > DARKEST) & (values < BRIGHTEST)
    photo_of, radii, logs = photo_of[good], radii[good], np.log(values[good])
    point_of = np.unique(point_of[good], return_inverse=True)[1]
    k, m = len(logs), point_of.max(initial=-1) + 1
    rows = np.arange(k)
    squares = np.stack([radii**2, radii**4], axis=1)
    corners = np.zeros(2)
    gains, points = start.copy(), np.zeros(m)
    weights = np.ones(k)
    for _ in range(ROUNDS):
        factor = np.maximum(1 + squares @ corners, 0.05)
        entries = np.concatenate([np.ones(k), np.ones(k), *(squares / factor[:, None]).T])
        columns = np.concatenate([photo_of, n + point_of, np.full(k, n + m), np.full(k, n + m + 1)])
        model = coo_matrix((entries, (np.tile(rows, 4), columns)), shape=(k, n + m + 2))
        root = np.sqrt(weights) / OUTLIER
        target = logs - np.log(factor) + squares @ corners / factor
        held = np.concatenate([known / FILE_DEVIATION, np.zeros(m), np.full(2, 1 / CORNER_DEVIATION)])
        anchor = coo_matrix((held, (np.arange(n + m + 2),) * 2), shape=(n + m + 2, n + m + 2))
        scaled = model.multiply(root[:, None])
        right = np.concatenate([target * root, held[:n] * start, np.zeros(m + 2)])
        x = lsqr(vstack([scaled, anchor]).tocsr(), right, x0=np.concatenate([gains, points, corners]), iter_lim=200)[0]
        gains, points, corners = x[:n], x[n : n + m], x[n + m :]
        errors = gains[photo_of] + points[point_of] + np.log(np.maximum(1 + squares @ corners, 0.05)) - logs
        weights = 1 / (1 + (errors / OUTLIER) ** 2 / 3)
    gains = np.exp(gains - gains.mean())
    return Exposures(gains, (float(corners[0]), float(corners[1])))
