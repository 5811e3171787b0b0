"""Where tensors are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

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


@contextmanager
def tensor_cores(on: bool) -> Iterator[None]:
    """Has a GPU's products of float32 matrices go through its tensor cores within the block, where ``on``: factors are
    rounded to 10 bits (TF32), sums are float32. The CPU's are what they were."""
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
