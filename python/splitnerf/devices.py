"""Devices of tensors, processors, and threads beside the training."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import AbstractContextManager, contextmanager, nullcontext

import torch
from torch import Tensor

from splitnerf import _core
from splitnerf.errors import InputError


def choose_device(name: str) -> torch.device:
    """The device with this name, ``cpu`` or ``cuda``. Raises InputError where the machine has no such device, or this
    build no kernels for it."""
    if name == "cpu":
        return torch.device("cpu")
    if not _core.cuda_architectures():
        raise InputError(
            f"--device {name}: this build has no GPU kernels; install it where nvcc and a GPU are found (docs/cuda.md)"
        )
    if not torch.cuda.is_available():
        raise InputError(f"--device {name}: torch finds no GPU; install a torch built for CUDA and its driver")
    return torch.device("cuda", torch.cuda.current_device())


def devices() -> list[str]:
    """The devices that the operators can run on."""
    built = _core.cuda_architectures()
    usable = built and torch.cuda.is_available() and covers(built, *torch.cuda.get_device_capability())
    return ["cpu", "cuda"] if usable else ["cpu"]


def covers(architectures: str, major: int, minor: int) -> bool:
    """Whether kernels for these architectures (as CMake names them) run on a GPU of this capability: machine code runs on GPUs of
    its major number from its minor one on, PTX on all later GPUs."""
    for number, kind in re.findall(r"(\d+)[a-z]?(-real|-virtual)?", architectures):
        older = int(number) <= 10 * major + minor
        if older and (kind != "-real" or int(number) // 10 == major):
            return True
    return False


def fit_device(failing_operators: Callable[[str], tuple[list[str], int]] | None) -> tuple[str, str]:
    """The GPU where all operators pass their test on it (see :class:`splitnerf.plugins.Plugin`; None: no test), else
    the CPU: ``cuda`` or ``cpu``, and why, in a clause."""
    if not _core.cuda_architectures():
        return "cpu", "this build has no GPU kernels"
    if not torch.cuda.is_available():
        return "cpu", "torch finds no GPU"
    name = torch.cuda.get_device_name()
    if "cuda" not in devices():
        return "cpu", f"this build has no kernels for the {name}"
    if failing_operators is None:
        return "cuda", f"the build has kernels for the {name}"
    failed, n_tested = failing_operators("cuda")
    if failed:
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        return "cpu", f"the {name} fails the test of {failed[0]}{others} (splitnerf doctor)"
    return "cuda", f"the {name} passes the test of {n_tested} operators"


def refuse_one_processor() -> None:
    """Raises InputError on a machine with one processor, where xatlas 0.0.11 (texture coordinates) crashes: it
    allocates for one thread and runs two."""
    if os.cpu_count() == 1:
        raise InputError(
            "this machine has one processor, where xatlas 0.0.11 (texture coordinates) crashes; use one with two or more"
        )


@contextmanager
def tensor_cores(on: bool) -> Iterator[None]:
    """Sets whether a GPU multiplies float32 matrices on its tensor cores within the block. They round the factors to 10 bits (TF32)
    and add in float32. Products on the CPU do not change."""
    products = torch.backends.cuda.matmul
    before = products.fp32_precision
    products.fp32_precision = "tf32" if on else "ieee"
    try:
        yield
    finally:
        products.fp32_precision = before


@contextmanager
def same_bits(on: bool) -> Iterator[None]:
    """With ``on``, makes torch add in a fixed order within the block; the program's own operators always do so. Without it, threads
    that scatter into one tensor add in the order in which they arrive. Sums still depend on the number of threads and on the
    processor's instruction set."""
    before = torch.are_deterministic_algorithms_enabled(), torch.utils.deterministic.fill_uninitialized_memory
    try:
        if on:
            torch.use_deterministic_algorithms(True)
            torch.utils.deterministic.fill_uninitialized_memory = False  # no code reads memory before it writes it
        yield
    finally:
        torch.use_deterministic_algorithms(before[0])
        torch.utils.deterministic.fill_uninitialized_memory = before[1]


def let_segments_grow() -> None:
    """Lets torch's allocator extend the segments of a GPU's memory, so that tensors of ever new sizes leave fewer gaps.
    A value of the user's own in PYTORCH_ALLOC_CONF or PYTORCH_CUDA_ALLOC_CONF stays."""
    if not {"PYTORCH_ALLOC_CONF", "PYTORCH_CUDA_ALLOC_CONF"} & os.environ.keys():
        torch._C._accelerator_setAllocatorSettings("expandable_segments:True")  # the variables are read only once


@contextmanager
def spare_processors(device: torch.device) -> Iterator[None]:
    """Leaves two processors without torch's threads within the block, where the device is a GPU: one for the thread
    that feeds it, one for what else runs. The rays that another thread traces use torch's threads."""
    if device.type == "cpu":
        yield
        return
    before, allowed = torch.get_num_threads(), len(os.sched_getaffinity(0))
    torch.set_num_threads(min(before, max(1, allowed - 2)))
    try:
        yield
    finally:
        torch.set_num_threads(before)


def start_fetching(x: Tensor) -> tuple[Tensor, Callable[[], None]]:
    """Starts to copy a tensor to the CPU, in the order of its device's work; returns the copy, and a function that
    waits until it is complete, which another thread may call."""
    copy = x.to("cpu", non_blocking=True)  # into pinned memory, where it comes from a GPU
    if x.device.type != "cuda":
        return copy, lambda: None
    copied = torch.cuda.Event(blocking=True)  # the waiting thread sleeps
    copied.record(torch.cuda.current_stream(x.device))
    return copy, copied.synchronize


def pinned(x: Tensor, device: torch.device) -> Tensor:
    """A tensor of the CPU in memory from which this device copies without keeping the host waiting."""
    return x.pin_memory() if device.type == "cuda" else x


class SideStream:
    """The order of another thread's work on a device: on a GPU a CUDA stream, on the CPU nothing. Neither thread waits for work of
    the other, except in the methods below; then the GPU waits, not the host."""

    def __init__(self, device: torch.device):
        self._device, self._stream = device, torch.cuda.Stream(device) if device.type == "cuda" else None

    def within(self) -> AbstractContextManager[object]:
        """The context of the other thread's work."""
        return nullcontext() if self._stream is None else torch.cuda.stream(self._stream)

    def follow(self) -> None:
        """Lets later work here begin when all that the caller has given to the device is done; memory that was made here, and that
        the caller has freed, is not taken again before that."""
        if self._stream is not None:
            self._stream.wait_stream(torch.cuda.current_stream(self._device))

    def join(self) -> None:
        """Lets later work of the caller begin when all work that was given here is done."""
        if self._stream is not None:
            torch.cuda.current_stream(self._device).wait_stream(self._stream)


def in_background(function: Callable, *args: object) -> Future:
    """Calls a function in a thread of its own, which ends with the program; the future holds its result or
    exception."""
    future = Future()

    def work() -> None:
        try:
            future.set_result(function(*args))
        except BaseException as error:  # the thread that reads the result raises it
            future.set_exception(error)

    threading.Thread(target=work, daemon=True).start()
    return future
