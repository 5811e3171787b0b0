"""Training steps as CUDA graphs: hundreds of launches recorded once and repeated by one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor
from torch.utils._pytree import tree_leaves, tree_map

from splitnerf.render.model import SceneModel

MOST_GRAPHS = 4  # kept; they share work memory, but each has the gradients that it leaves
SAMPLE_ROOM = 1.15  # of the samples that are aimed at
SHADING_ROOM = 1.25  # of what was last counted
ROOM_UNIT = 256


def records_graphs(device: torch.device) -> bool:
    """Whether work of a device can be recorded."""
    return device.type == "cuda"


class Graph(Protocol):
    """What has been recorded."""

    def replay(self) -> None:
        """Does it again, with what its tensors hold now."""


class Recorded(NamedTuple):
    """A recorded call.

    Attributes:
        graph: Of what it did.
        inputs: Where it reads.
        outputs: What it returned.
        grads: Gradients of the parameters, where it leaves them.
        room: Of the shaded samples and of the stretches.
    """

    graph: Graph
    inputs: Any
    outputs: Any
    grads: list[Tensor | None]
    room: tuple[int, int]


class StepGraphs:
    """Calls a function that leaves gradients at a model's parameters, on a GPU by CUDA graphs where shapes allow.

    A graph repeats what the host decided when it was recorded: sizes, numbers, memory. So samples have room for
    ``capacity`` of them, and all else that the host decides is the key of the graph. The first call with a key is made as it
    is, the next is recorded. What one call leaves is gone with the next.

    Args:
        model: The scene. Its parameters, light and caches stay where they are in memory for as long as keys are the same.
        generator: Random numbers that the function draws.
        n_samples: Of a step, about.
        on: Otherwise all calls are made as they are.

    Attributes:
        capacity: Samples for which there shall be room; 0 where nothing is recorded.
        thrown_away: Calls that had too little room.
    """

    def __init__(self, model: SceneModel, generator: torch.Generator, n_samples: int, *, on: bool):
        self.model, self.generator, self.thrown_away = model, generator, 0
        self.capacity = round_up(SAMPLE_ROOM * n_samples) if on else 0
        self._counts: tuple[float, float] | None = None  # of the last call
        self._used: tuple[int, int] | None = None  # its room
        self._seen: set[Hashable] = set()
        self._graphs: dict[Hashable, Recorded] = {}
        self._stream = torch.cuda.Stream(model.device) if on else None
        self._pool = torch.cuda.graph_pool_handle() if on else None

    @contextmanager
    def stream(self) -> Iterator[None]:
        """All work of the block goes to the queue in which graphs are recorded: gradients are tied to theirs."""
        if self._stream is None:
            yield
            return
        outside = torch.cuda.current_stream(self.model.device)
        self._stream.wait_stream(outside)
        try:
            with torch.cuda.stream(self._stream):
                yield
        finally:
            outside.wait_stream(self._stream)

    def __call__(self, key: Hashable, function: Callable[[Any, tuple[int, int] | None], Any], inputs: Any) -> Any:
        """function(inputs, room), whose room is None where the function may wait for the GPU to tell.

        Args:
            key: All that the host decides, but for shapes.
            function: Returns the same, and leaves the same gradients, whenever key, inputs and the model are the same.
            inputs: Tuples, lists and dictionaries of tensors, those of samples ``capacity`` long where that is enough.
        """
        self._used = None
        given = tree_leaves(inputs)
        key = key, *(x.shape for x in given)
        known = key in self._seen and self._counts is not None
        if not self.capacity or not known or all(len(x) != self.capacity for x in given if x.dim()):
            self._seen.add(key)
            return function(inputs, None)
        self.model.prepare()
        if key in self._graphs and not has_room(self._graphs[key].room, self._counts, slack=1.1):
            del self._graphs[key]
        if key not in self._graphs:
            while len(self._graphs) >= MOST_GRAPHS:
                del self._graphs[next(iter(self._graphs))]
            self._graphs[key] = self._recorded(function, inputs)
        recorded = self._graphs[key]
        by_type = defaultdict(lambda: ([], []))  # one launch for all of a type
        for old, new in zip(tree_leaves(recorded.inputs), given, strict=True):
            for tensors, x in zip(by_type[new.dtype], (old, new)):
                tensors.append(x)
        for old, new in by_type.values():
            torch._foreach_copy_(old, new)
        for parameter, grad in zip(self.model.parameters(), recorded.grads):
            parameter.grad = grad
        recorded.graph.replay()
        self._used = recorded.room
        return recorded.outputs

    def fits(self, n_shaded: float, n_stretches: float) -> bool:
        """Whether the last call had room for as many as it counted. Where it had not, what it left must not be used, all graphs
        are dropped, and so is what has come together of the light's gradients."""
        self._counts = n_shaded, n_stretches
        fitted = self._used is None or has_room(self._used, self._counts)
        if not fitted:
            self.thrown_away += 1
            self._graphs.clear()
            self.model.light.forget()
        return fitted

    def _recorded(self, function: Callable, inputs: Any) -> Recorded:
        inputs = tree_map(torch.clone, inputs)
        room = tuple(round_up(SHADING_ROOM * n) for n in self._counts)
        graph, outputs = record(lambda: function(inputs, room), self._pool, self.generator)
        return Recorded(graph, inputs, outputs, [p.grad for p in self.model.parameters()], room)


def record(function: Callable[[], Any], pool: Any, generator: torch.Generator) -> tuple[Graph, Any]:
    """A graph of what a function does on the current stream, and what it returned; nothing is done yet.

    Args:
        function: Called once.
        pool: Of work memory. Graphs that share one must not need what another has left.
        generator: Random numbers that it draws.
    """
    graph = torch.cuda.CUDAGraph()
    graph.register_generator_state(generator)
    graph.capture_begin(pool=pool, capture_error_mode="thread_local")  # meshes are made by another thread
    try:
        outputs = function()
    finally:
        graph.capture_end()
    return graph, outputs


def has_room(room: tuple[int, int], counts: tuple[float, float], slack: float = 1.0) -> bool:
    """Whether that is enough for so many, times `slack`."""
    return all(slack * n <= r for n, r in zip(counts, room))


def round_up(n: float) -> int:
    """To a multiple of the unit in which room is made."""
    return -(-int(n) // ROOM_UNIT) * ROOM_UNIT
