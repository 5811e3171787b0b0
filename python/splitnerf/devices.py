"""Devices of tensors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from splitnerf import _core
from splitnerf.errors import InputError


def choose_device(name: str) -> torch.device:
    """The device with this name, ``cpu`` or ``cuda``.

    Raises:
        InputError: The machine has no such device, or this build has no kernels for it.
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


@contextmanager
def tensor_cores(on: bool) -> Iterator[None]:
    """Sets whether a GPU multiplies float32 matrices on its tensor cores within the block.

    Tensor cores round the factors to 10 bits (TF32) and add in float32. Products on the CPU do not change.
    """
    products = torch.backends.cuda.matmul
    before = products.fp32_precision
    products.fp32_precision = "tf32" if on else "ieee"
    try:
        yield
    finally:
        products.fp32_precision = before


def wait_for(device: torch.device) -> None:
    """Returns when all work given to a device is done."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
