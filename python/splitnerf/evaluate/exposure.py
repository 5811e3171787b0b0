"""The exposures of held-out photos, fitted to the run's own images of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from splitnerf.data.dataset import Dataset
from splitnerf.data.images import srgb_to_linear
from splitnerf.data.pixels import per_channel
from splitnerf.data.truth import OPAQUE

DARKEST, BRIGHTEST = 0.01, 0.95  # linear values of a photo between which pixels count


def exposed_like(views: Dataset, predictions: Sequence[dict[str, np.ndarray]]) -> Dataset:
    """Views with exposures fitted to predictions: one factor a photo, the median ratio of the channels' means where the
    object covers both. Photos without such pixels keep their exposure.

    Args:
        views: The photos.
        predictions: Maps per view, `rgb` [H, W, 3] sRGB and `alpha` [H, W].
    """
    factors = np.ones(len(views))
    for i, maps in enumerate(predictions):
        photo = views.images[i]
        ours, theirs = (srgb_to_linear(x.astype(np.float32)) for x in (maps["rgb"], photo[..., :3]))
        counts = (photo[..., 3] > OPAQUE) & (maps["alpha"] > OPAQUE)
        exposed = theirs * per_channel(views.exposures)[i].astype(np.float32)
        counts &= ((exposed > DARKEST) & (exposed < BRIGHTEST)).all(-1)
        ours, theirs = (x.mean(-1).clip(1e-4) for x in (ours, theirs))
        if counts.any():
            factors[i] = np.exp(np.median(np.log(theirs[counts] / ours[counts])))
    return views.exposed(per_channel(views.exposures) * factors[:, None])
