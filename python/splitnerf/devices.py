"""Where tensors are."""

from __future__ import annotations

import torch

from splitnerf import _core
from splitnerf.errors import InputError


def choose_device(name: str) -> torch.device:
    """The device of that name, ``cpu`` or ``cuda``.

    Raises:
        InputError: It is not there, or this build has no kernels for it.
    """
    if name == "cpu":
        return torch.device("cpu")
    if not _core.cuda_architectures():
        raise InputError(
            f"--device {name}: this build has no GPU kernels; install it where nvcc is found (docs/cuda.md)"
        )
    if not torch.cuda.is_available():
        raise InputError(f"--device {name}: torch finds no GPU; install a torch built for CUDA and its driver")
    return torch.device("cuda", torch.cuda.current_device())


def wait_for(device: torch.device) -> None:
    """Returns when all work given to a device is done."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
