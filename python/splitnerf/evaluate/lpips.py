"""LPIPS where installed: Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric, 2018."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

BACKBONE_WEIGHTS = "vgg16-397923af.pth"

Distance = Callable[[np.ndarray, np.ndarray], float]


def load_distance() -> Distance | None:
    """The VGG distance of the package `lpips`, or None without the package or its backbone's weights.

    Nothing is downloaded: the weights must lie in `checkpoints` of torch's hub folder.

    Returns:
        A function of two [H, W, 3] sRGB images in [0, 1]; 0 for equal ones.
    """
    try:
        import lpips
        import torch
    except ImportError:
        return None
    if not (Path(torch.hub.get_dir()) / "checkpoints" / BACKBONE_WEIGHTS).is_file():
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        network = lpips.LPIPS(net="vgg", verbose=False).eval()

    def distance(image: np.ndarray, truth: np.ndarray) -> float:
        x, y = (torch.from_numpy(np.float32(i)).permute(2, 0, 1)[None] * 2 - 1 for i in (image, truth))
        with torch.no_grad():
            return float(network(x, y))

    return distance
