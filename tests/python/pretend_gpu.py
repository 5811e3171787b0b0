"""A GPU that is none: tensors that say they are on ``cuda:0`` and live on the CPU.

It finds what a machine without a GPU otherwise cannot: tensors of two devices in one call, factories that forget the
device, generators of another device, ``numpy()`` of what is not on the CPU; and it counts what would wait for the GPU.
What happens inside a backward pass is not looked at; a thread that works in a stream of its own has such a GPU too, and its waits
are its own.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode, resolve_name
from torch.utils._pytree import tree_iter, tree_map

GPU = torch.device("cuda", 0)
CPU = torch.device("cpu")
ON_CPU_BY_CONTRACT = {"splitnerf.light_lookup": (4, 5), "splitnerf::light_lookup": (4, 5)}  # resolutions and nodes
WAITS = set(
    (
        "item tolist nonzero argwhere unique unique_consecutive masked_select bincount repeat_interleave "
        "equal allclose is_nonzero __bool__ __int__ __float__ __index__ __contains__ cpu"
    ).split()
)
FROM_LISTS = {"tensor", "as_tensor", "new_tensor"}
ACROSS = {"_has_compatible_shallow_copy_type", "__set__", "copy_"}  # one tensor takes the place of another


class GpuTensor(Tensor):
    """Lives on the CPU. Only :class:`PretendGpu` makes it."""

    __torch_function__ = torch._C._disabled_torch_function_impl


class Generator(torch.Generator):
    """Draws on the CPU, for tensors of the device that it names."""

    def __new__(cls, device: torch.device | str = "cpu") -> Generator:
        made = super().__new__(cls)
        made.named = GPU if torch.device(device).type == "cuda" else CPU
        return made

    @property
    def device(self) -> torch.device:
        return self.named


class Event:
    """Is over when it begins, as is all work of the CPU."""

    def __init__(self, blocking: bool = False):
        pass

    def record(self, stream: object) -> None:
        pass

    def synchronize(self) -> None:
        pass


class Stream:
    """Work of the CPU has one order."""

    def __init__(self, device: torch.device | None = None):
        pass

    def wait_stream(self, other: Stream) -> None:
        pass


def marked(value: object) -> object:
    """The same with all its tensors on the GPU."""
    return tree_map(lambda x: x.as_subclass(GpuTensor) if type(x) is Tensor else x, value)


def unmarked(value: object) -> object:
    """The same with all its tensors on the CPU."""
    return tree_map(lambda x: x.as_subclass(Tensor) if isinstance(x, GpuTensor) else x, value)


def named_device(values: list) -> torch.device | None:
    """The device that one of a call's arguments names."""
    for value in values:
        if isinstance(value, torch.device) or (isinstance(value, str) and value.split(":")[0] in ("cpu", "cuda")):
            return torch.device(value)
    return None


def on_cpu(value: object) -> object:
    """The same argument, the CPU in place of a device."""
    return CPU if named_device([value]) is not None else value


class PretendGpu(TorchFunctionMode):
    """Within its block tensors can be on ``cuda``.

    Attributes:
        waits: How often the caller would have waited for the GPU, by function.
    """

    def __init__(self) -> None:
        super().__init__()
        self.waits: Counter[str] = Counter()

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = dict(kwargs or {})
        name = (resolve_name(func) or getattr(func, "__qualname__", str(func))).removeprefix("torch.")
        last = name.removesuffix(".__get__").split(".")[-1]
        given = [x for x in tree_iter((args, kwargs)) if isinstance(x, Tensor)]
        on_gpu = any(isinstance(x, GpuTensor) for x in given)
        if name.endswith("device.__get__"):
            return GPU if on_gpu else CPU
        if name.endswith(("is_cuda.__get__", "is_cpu.__get__")):
            return on_gpu == ("is_cuda" in name)
        if last == "numpy" and on_gpu:
            raise TypeError(f"{name}: the tensor is on the GPU")
        if last in WAITS and on_gpu or masks(func, args) or comes_from_cpu(func, args):
            self.waits[last] += 1
        if last in ("to", "cuda", "cpu"):
            return self.moved(func, last, args, kwargs)
        asked = named_device([kwargs.get("device")])
        generator = kwargs.get("generator")
        if generator is not None:
            self.check(name, generator.device.type == (asked.type if asked else "cuda" if on_gpu else "cpu"), given)
        if asked is not None:
            kwargs["device"], on_gpu = CPU, asked.type == "cuda"
        if on_gpu and last in FROM_LISTS:  # copied from memory that the GPU does not reach by itself
            self.waits[last] += 1
        if asked is None and on_gpu and last not in ACROSS:
            allowed = [args[i] for i in ON_CPU_BY_CONTRACT.get(name.removesuffix(".default"), ())]
            same = all(isinstance(x, GpuTensor) or x.dim() == 0 or any(x is y for y in allowed) for x in given)
            self.check(name, same, given)
        result = func(*args, **kwargs)
        return marked(result) if on_gpu else result

    def moved(self, func, how: str, args: tuple, kwargs: dict):
        target = CPU if how == "cpu" else GPU if how == "cuda" else named_device([*args[1:], *kwargs.values()])
        if target is None and len(args) > 1 and isinstance(args[1], Tensor):
            target = GPU if isinstance(args[1], GpuTensor) else CPU
        if target is None:
            target = GPU if isinstance(args[0], GpuTensor) else CPU
        crossed = isinstance(args[0], GpuTensor) != (target.type == "cuda")
        if how == "to" and crossed and not kwargs.get("non_blocking"):
            self.waits[how] += 1
        result = args[0]
        if how == "to":  # a dtype may change as well
            result = func(*map(on_cpu, args), **{name: on_cpu(value) for name, value in kwargs.items()})
        if crossed:
            result = result.clone() if result is args[0] else result
        return marked(result) if target.type == "cuda" else unmarked(result)

    @staticmethod
    def check(name: str, holds: bool, given: list[Tensor]) -> None:
        if not holds:
            places = ", ".join(f"{list(x.shape)} on {'cuda' if isinstance(x, GpuTensor) else 'cpu'}" for x in given)
            raise RuntimeError(f"{name}: arguments on two devices: {places}")


def masks(func, args: tuple) -> bool:
    """Whether this is indexing by a mask, which has as many rows as it has ones; or by a list, which is copied. To fill by a mask
    with a number waits for nothing."""
    name = getattr(func, "__name__", "")
    if name not in ("__getitem__", "__setitem__") or not isinstance(args[0], GpuTensor):
        return False
    index = args[1] if isinstance(args[1], tuple) else (args[1],)
    by_list = any(isinstance(part, list) for part in index)
    by_mask = any(isinstance(part, Tensor) and part.dtype in (torch.bool, torch.uint8) for part in index)
    return by_list or by_mask and (name == "__getitem__" or isinstance(args[2], Tensor))


def comes_from_cpu(func, args: tuple) -> bool:
    """Whether this overwrites a tensor with one of another device, for which the host waits."""
    return getattr(func, "__name__", "") == "copy_" and isinstance(args[0], GpuTensor) != isinstance(args[1], GpuTensor)


def within(stream: Stream) -> AbstractContextManager[object]:
    """A stream's context."""
    return nullcontext() if threading.current_thread() is threading.main_thread() else PretendGpu()


@contextmanager
def pretend_gpu(monkeypatch) -> Iterator[PretendGpu]:
    """A GPU for the block, with ``torch.Generator("cuda")`` and modules that can be moved to it."""
    monkeypatch.setattr(torch, "Generator", Generator)
    monkeypatch.setattr(torch.cuda, "synchronize", lambda device=None: None)
    monkeypatch.setattr(torch.cuda, "Event", Event)
    monkeypatch.setattr(torch.cuda, "Stream", Stream)
    monkeypatch.setattr(torch.cuda, "current_stream", lambda device=None: Stream())
    monkeypatch.setattr(torch.cuda, "stream", within)
    monkeypatch.setattr(Tensor, "pin_memory", lambda x: x)
    before = torch.__future__.get_overwrite_module_params_on_conversion()
    torch.__future__.set_overwrite_module_params_on_conversion(True)
    try:
        with PretendGpu() as mode:
            yield mode
    finally:
        torch.__future__.set_overwrite_module_params_on_conversion(before)
