"""LPIPS, if it is installed: Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric,
2018."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from splitnerf.errors import plain

BACKBONE_WEIGHTS = "vgg16-397923af.pth"
SOURCE = f"https://download.pytorch.org/models/{BACKBONE_WEIGHTS}"

Distance = Callable[[np.ndarray, np.ndarray], float]


def find_distance() -> tuple[Distance | None, str]:
    """The VGG distance of the package `lpips`, or None and a line that says what is missing.

    Nothing is downloaded: the backbone's weights must lie in `checkpoints` of torch's hub folder.

    Returns:
        A function of two [H, W, 3] sRGB images in [0, 1], 0 for equal ones; and "" or the line.
    """
    try:
        import lpips
    except ModuleNotFoundError as error:
        return None, f"the package {error.name} is not installed (pip install 'splitnerf[lpips]')"
    except Exception as error:  # torchvision's own, where it was built for another torch
        why = plain(str(error))[:80]
        return (
            None,
            f"the package lpips cannot be imported ({why}); install the torchvision of torch {torch.__version__}",
        )
    weights = Path(torch.hub.get_dir()) / "checkpoints" / BACKBONE_WEIGHTS
    if not weights.is_file():
        return None, f"{weights} is missing; it is {SOURCE}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            network = lpips.LPIPS(net="vgg", verbose=False).eval()
    except Exception as error:  # a damaged file may raise anything
        return None, f"{weights} cannot be used ({plain(str(error))[:80]}); replace it by {SOURCE}"

    def distance(image: np.ndarray, truth: np.ndarray) -> float:
        x, y = (torch.from_numpy(np.float32(i)).permute(2, 0, 1)[None] * 2 - 1 for i in (image, truth))
        with torch.no_grad():
            return float(network(x, y))

    return distance, ""
