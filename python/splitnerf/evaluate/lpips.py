"""LPIPS: Zhang et al., The Unreasonable Effectiveness of Deep Features as a Perceptual Metric, 2018.

The features are those of VGG16, whose weights are a file that the user names. What each counts in the distance comes with the package
`lpips`, of which no code is imported: it needs a torchvision that was built for this very torch.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.errors import InputError, plain

SOURCE = "https://download.pytorch.org/models/vgg16-397923af.pth"
# Numbers of VGG16's convolutions (Simonyan and Zisserman 2015) in that file: a block for each size, after which features are compared.
BLOCKS = (0, 2), (5, 7), (10, 12, 14), (17, 19, 21), (24, 26, 28)
MEAN, DEVIATION = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)  # of photographs in [-1, 1], as LPIPS 0.1 takes them
LEAST = 1e-10  # added to the length of a feature

Distance = Callable[[np.ndarray, np.ndarray], float]


class Lpips:
    """The distance of two [H, W, 3] sRGB images in [0, 1] of at least 16 x 16 pixels; 0 for equal ones. `backbone` is a file with
    the state of torchvision's VGG16. Raises InputError where it holds something else, or the package lpips is not there; the
    message says what to do."""

    def __init__(self, backbone: Path):
        package = find_spec("lpips")
        if package is None:
            raise InputError("--lpips needs the package lpips; pip install --no-deps lpips")
        heads = Path(package.origin).parent / "weights/v0.1/vgg.pth"
        self._heads = _read(
            heads, [f"lin{k}.model.1.weight" for k in range(len(BLOCKS))], "pip install --no-deps lpips"
        )
        names = [f"features.{i}.{part}" for block in BLOCKS for i in block for part in ("weight", "bias")]
        state = _read(backbone, names, f"give {SOURCE}")
        self._convolutions = list(zip(state[::2], state[1::2]))
        if [len(head[0]) for head in self._heads] != [len(self._convolutions[k][1]) for k in (1, 3, 6, 9, 12)]:
            raise InputError(f"{backbone}: is of another network than VGG16; give {SOURCE}")

    @torch.no_grad()
    def __call__(self, image: np.ndarray, truth: np.ndarray) -> float:
        pairs = zip(self._heads, *map(self._features, (image, truth)))
        return float(sum(F.conv2d((x - y).square(), head).mean() for head, x, y in pairs))

    def _features(self, image: np.ndarray) -> list[Tensor]:
        """The features after each block, [1, c, h, w] of unit length."""
        mean, deviation = (torch.tensor(x)[:, None, None] for x in (MEAN, DEVIATION))
        x = (torch.from_numpy(np.float32(image)).permute(2, 0, 1)[None] * 2 - 1 - mean) / deviation
        convolutions, found = iter(self._convolutions), []
        for block in BLOCKS:
            x = F.max_pool2d(x, 2) if found else x
            for _ in block:
                x = F.relu(F.conv2d(x, *next(convolutions), padding=1))
            found.append(x / (x.norm(dim=1, keepdim=True) + LEAST))
        return found


def _read(file: Path, names: list[str], remedy: str) -> list[Tensor]:
    """Tensors of a file by name. Raises InputError where it has not all of them."""
    try:
        state = torch.load(file, map_location="cpu", weights_only=True)
        return [state[name].float() for name in names]
    except Exception as error:  # a damaged file may raise anything
        raise InputError(f"{file}: cannot be used for LPIPS ({plain(str(error))[:80]}); {remedy}") from None
