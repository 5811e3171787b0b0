"""CUDA graphs that are none: work of the CPU, recorded operator by operator and repeated on the same memory.

As on a GPU nothing is done while it is recorded, numbers of the host are frozen, what waits for a result is refused, and
what is written to is always the same memory. Of a graph that is dropped all numbers become NaN. A pool of memory cannot be
recorded into again once all its graphs are gone, see :class:`Pools`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import torch
from pretend_gpu import Stream
from splitnerf.training import gpu_step, loop
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode, _disable_current_modes
from torch.utils._pytree import tree_iter

REFUSED = "_local_scalar_dense lift_fresh _to_copy nonzero masked_select _unique2 march_rays sample_rays".split()


def tensors(value: object) -> list[Tensor]:
    return [x for x in tree_iter(value) if isinstance(x, Tensor)]


def memory(x: Tensor) -> int:
    return x.untyped_storage().data_ptr()


class Pools:
    """Counts the graphs of each pool as torch's allocator does (c10/cuda/CUDACachingAllocator.cpp, `create_or_incref_pool`).

    A handle is a number. The first recording with it makes the pool; each graph counts as one use, and its end takes the use
    back. A pool without uses is not made anew while blocks of its memory are still in use: the next recording with
    its handle fails. Here some block always is.
    """

    def __init__(self) -> None:
        self.n_handles, self.uses = 0, Counter()

    def handle(self) -> int:
        """As :func:`torch.cuda.graph_pool_handle`."""
        self.n_handles += 1
        return self.n_handles

    def begin(self, pool: int | None) -> None:
        """A recording begins."""
        if pool in self.uses and self.uses[pool] == 0:
            raise RuntimeError("it->second->use_count > 0 INTERNAL ASSERT FAILED")
        self.uses[pool] += 1


class PretendGraph(TorchDispatchMode):
    """Records within its block."""

    def __init__(self, generator: torch.Generator, pools: Pools | None = None, pool: int | None = None) -> None:
        super().__init__()
        self.generator, self.calls = generator, []
        self.pools, self.pool = pools, pool
        self.before: dict[int, tuple[Tensor, Tensor]] = {}  # what is written to, and what it held
        self.made: set[int] = set()  # memory of the recording itself

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        name = func._schema.name.split("::")[1]
        free = name == "spread_samples" and args[6] < 0
        masks = name == "index" and any(x.dtype in (torch.bool, torch.uint8) for x in tensors(args[1]))
        if name in REFUSED or free or masks or any(x.device.type != "cpu" for x in tensors((args, kwargs))):
            raise RuntimeError(f"{name} waits for the GPU")
        for argument, value in zip(func._schema.arguments, args):
            if argument.alias_info is not None and argument.alias_info.is_write:
                for x in tensors(value):
                    if memory(x) not in self.made:
                        self.before.setdefault(id(x), (x, x.clone()))
        result = func(*args, **kwargs)
        given = {memory(x) for x in tensors((args, kwargs))}
        # squeeze_ may follow
        fresh = [None if memory(x) in given else torch.ops.aten.alias(x) for x in tensors(result)]
        self.made.update(memory(x) for x in fresh if x is not None)
        writes = any(a.alias_info is not None and a.alias_info.is_write for a in func._schema.arguments)
        if writes or any(x is not None for x in fresh):  # else a view
            self.calls.append((func, args, kwargs, fresh))
        return result

    def __enter__(self) -> PretendGraph:
        self.state = self.generator.get_state()
        return super().__enter__()

    def __exit__(self, *exception) -> None:
        super().__exit__(*exception)
        self.generator.set_state(self.state)
        with torch.no_grad():
            for x, held in self.before.values():
                x.copy_(held)

    @torch.no_grad()
    def __del__(self) -> None:
        """On a GPU other work may now take the memory, but for what tensors still hold."""
        if self.pools is not None:
            self.pools.uses[self.pool] -= 1
        with _disable_current_modes():
            for *_, fresh in self.calls:
                for x in fresh:
                    if x is not None and x.is_floating_point():
                        x.fill_(torch.nan)

    @torch.no_grad()
    def replay(self) -> None:
        with torch._C.DisableTorchFunction():  # a pretended GPU has looked at the recording
            for func, args, kwargs, fresh in self.calls:
                for old, new in zip(fresh, tensors(func(*args, **kwargs)), strict=True):
                    if old is not None:
                        assert old.shape == new.shape, func
                        old.copy_(new)


def record(
    function: Callable[[], Any], pool: int | None, generator: torch.Generator, pools: Pools | None = None
) -> tuple[PretendGraph, Any]:
    """As :func:`splitnerf.training.gpu_step.record`; without pools a pool is never refused."""
    if pools is not None:
        pools.begin(pool)
    graph = PretendGraph(generator, pools, pool)
    with graph:
        outputs = function()
    return graph, outputs


def graphs_on_the_cpu(monkeypatch) -> dict[str, int]:
    """Trainings on the CPU take graphed steps from now on; returns how many they recorded, replayed, and took without a graph
    (`called`), as it goes on."""
    used = {"recorded": 0, "replayed": 0, "called": 0}
    differentiate, replay, pools = gpu_step.GpuStep.differentiate, PretendGraph.replay, Pools()

    def counted_record(*arguments):
        used["recorded"] += 1
        used["called"] -= 1
        return record(*arguments, pools)

    def counted_replay(self):
        used["replayed"] += 1
        replay(self)

    def counted_differentiate(*arguments):
        used["called"] += 1
        return differentiate(*arguments)

    monkeypatch.setattr(PretendGraph, "replay", counted_replay)
    monkeypatch.setattr(gpu_step.GpuStep, "differentiate", counted_differentiate)
    monkeypatch.setattr(gpu_step, "record", counted_record)
    monkeypatch.setattr(loop, "Step", gpu_step.GpuStep)
    monkeypatch.setattr(torch.cuda, "Stream", Stream)
    monkeypatch.setattr(torch.cuda, "graph_pool_handle", pools.handle)
    monkeypatch.setattr(torch.cuda, "current_stream", lambda device: Stream())
    monkeypatch.setattr(torch.cuda, "stream", lambda stream: nullcontext())
    return used
