"""Training steps as CUDA graphs: hundreds of launches recorded once and repeated by one."""

from __future__ import annotations

import gc
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor
from torch.utils._pytree import tree_leaves, tree_map

from splitnerf.fields import EvaluatedLight
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import FoundSamples, RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.losses import Terms
from splitnerf.training.schedule import light_moves, light_period
from splitnerf.training.step import Step

MOST_GRAPHS = 4  # graphs kept; they share work memory, but each has its own gradients
SAMPLE_SLACK = 1.15  # capacity for samples, over the target of a step
SHADING_SLACK = 1.25  # capacity for shaded samples and segments, over the last count
CAPACITY_UNIT = 256


class Graph(Protocol):
    """A recorded sequence of GPU work."""

    def replay(self) -> None:
        """Runs the work again on the current values of its tensors."""


class Recorded(NamedTuple):
    """A recorded step.

    Attributes:
        graph: The recorded work.
        batch, found, light: The graph's inputs, in memory of their own.
        outputs: The rendered rays and the terms of the loss.
        grads: The gradients of the model's parameters, in memory that each replay overwrites.
        capacity: The largest numbers of shaded samples and of segments that the graph can hold.
    """

    graph: Graph
    batch: Batch
    found: FoundSamples
    light: EvaluatedLight
    outputs: tuple[RenderedRays, Terms]
    grads: list[Tensor | None]
    capacity: tuple[int, int]


class GraphedStep(Step):
    """A step whose rendering, losses and backward pass are one launch where shapes repeat; see :class:`Step`.

    A graph repeats the host's decisions at the time of recording: sizes, numbers, addresses of memory. So samples are
    padded to a fixed capacity, and all other decisions of the host form the key of the graph. The first step with a key
    runs without a graph, the next one is recorded. Each step overwrites the results of the step before. Parameters and
    caches of the model must stay at the same addresses while the key stays the same.
    """

    def __init__(self, model: SceneModel, *parts: Any):
        super().__init__(model, *parts)
        self.capacity = round_up(SAMPLE_SLACK * model.config.sampling.target_samples)
        self._counts: tuple[float, float] | None = None  # shaded samples and segments of the last step
        self._used: tuple[int, int] | None = None  # capacity of the last step
        self._seen: set[Hashable] = set()
        self._loaded: set[bool] = set()  # of steps with a capacity, by whether light is summed: their kernels are loaded
        self._graphs: dict[Hashable, Recorded] = {}
        self._stream = torch.cuda.Stream(model.device)
        self._pool = torch.cuda.graph_pool_handle()

    @contextmanager
    def stream(self) -> Iterator[None]:
        """Runs the block's work in the CUDA stream that graphs are recorded in; autograd ties gradients to that
        stream."""
        outside = torch.cuda.current_stream(self.model.device)
        self._stream.wait_stream(outside)
        try:
            with torch.cuda.stream(self._stream):
                yield
        finally:
            outside.wait_stream(self._stream)

    def __call__(
        self, batch: Batch, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, Terms]:
        found = self.find(batch, progress, self.capacity)

        def differentiate(batch: Batch, found: FoundSamples, light: EvaluatedLight, capacity: tuple[int, int] | None):
            return self.differentiate(batch, found, light, environment, step, progress, capacity)

        self._used, key = None, (*self._decided(step, progress), len(batch.target), len(found.directions))
        if len(found.directions) != self.capacity or key not in self._seen or self._counts is None:
            self._seen.add(key)
            return differentiate(batch, found, light, None)
        self.model.sdf_field.grid.stored()  # makes the 16-bit copy before the graph, not in it
        if key in self._graphs and not has_room(self._graphs[key].capacity, self._counts, slack=1.1):
            del self._graphs[key]
        if key not in self._graphs:
            self._used = tuple(round_up(SHADING_SLACK * n) for n in self._counts)
            if self.model.sums_light not in self._loaded:
                self._loaded.add(self.model.sums_light)
                return differentiate(batch, found, light, self._used)
            while len(self._graphs) >= MOST_GRAPHS:
                del self._graphs[next(iter(self._graphs))]
            self._graphs[key] = self._recorded(differentiate, batch, found, light, self._used)
        return self._replayed(self._graphs[key], batch, found, light)

    def _decided(self, step: int, progress: float) -> tuple:
        """The host's decisions about a step, except sizes: steps with equal decisions run the same work."""
        c, model = self.model.config, self.model
        since = step % light_period(c) + 1 if light_moves(c, step) else 0
        return (
            model.sdf_field.grid.n_active,
            since,
            progress >= c.losses.priors_from,
            self.mesh.made_at,
            model.occlusion.ready,
        )

    def _recorded(
        self, function: Callable, batch: Batch, found: FoundSamples, light: EvaluatedLight, capacity: tuple[int, int]
    ) -> Recorded:
        batch, found = tree_map(torch.clone, (batch, found))
        leaves = [leaf.detach().clone().requires_grad_() for leaf in light.leaves]
        light = light.with_tensors(leaves, [x.clone() for x in light.constants])

        def work() -> tuple[RenderedRays, Terms]:
            light.zero_grad()  # a replay adds the gradients of one step only
            return function(batch, found, light, capacity)

        graph, outputs = record(work, self._pool, self.generator)
        grads = [p.grad for p in self.model.parameters()]
        return Recorded(graph, batch, found, light, outputs, grads, capacity)

    def _replayed(
        self, recorded: Recorded, batch: Batch, found: FoundSamples, light: EvaluatedLight
    ) -> tuple[RenderedRays, Terms]:
        self._used = recorded.capacity
        old = [*tree_leaves((recorded.batch, recorded.found)), *recorded.light.leaves, *recorded.light.constants]
        new = [*tree_leaves((batch, found)), *light.leaves, *light.constants]
        with torch.no_grad():
            for dtype in {x.dtype for x in new}:  # one launch for all tensors of a type
                torch._foreach_copy_(
                    [x for x in old if x.dtype == dtype], [x.detach() for x in new if x.dtype == dtype]
                )
        for parameter, grad in zip(self.model.parameters(), recorded.grads):
            parameter.grad = grad
        recorded.graph.replay()
        for ours, theirs in zip(light.leaves, recorded.light.leaves):
            if theirs.grad is not None:
                ours.grad = theirs.grad.clone() if ours.grad is None else ours.grad.add_(theirs.grad)
        return recorded.outputs

    def is_complete(self, n_shaded: float, n_segments: float) -> bool:
        """Whether the last step's capacity was enough for its counts. If not, its results have no meaning, and all
        graphs are dropped."""
        self._counts = n_shaded, n_segments
        complete = self._used is None or has_room(self._used, self._counts)
        if not complete:
            self.n_discarded += 1
            self._graphs.clear()
        return complete


def record(function: Callable[[], Any], pool: Any, generator: torch.Generator) -> tuple[Graph, Any]:
    """Records the work of a function without running it; returns the graph and the function's result.

    Args:
        function: Work that never waits for a result of the GPU; called once.
        pool: The memory that graphs share. No graph may rely on values that another graph left there.
        generator: The random generator that the function draws from.
    """
    graph = torch.cuda.CUDAGraph()
    graph.register_generator_state(generator)
    collects = gc.isenabled()
    try:
        gc.disable()  # memory freed during the recording would become part of the graph
        graph.capture_begin(pool=pool, capture_error_mode="thread_local")  # another thread makes meshes meanwhile
        outputs = function()
    except BaseException:
        with suppress(RuntimeError):  # the first error is the one to report
            graph.capture_end()
        raise
    else:
        graph.capture_end()
    finally:
        if collects:
            gc.enable()
    return graph, outputs


def has_room(capacity: tuple[int, int], counts: tuple[float, float], slack: float = 1.0) -> bool:
    """Whether the capacity is at least ``slack`` times the counts."""
    return all(slack * n <= room for n, room in zip(counts, capacity))


def round_up(n: float) -> int:
    """The smallest multiple of the capacities' unit that is at least n."""
    return -(-int(n) // CAPACITY_UNIT) * CAPACITY_UNIT
