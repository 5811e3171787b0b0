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
from splitnerf.training.losses import Term
from splitnerf.training.schedule import light_moves, light_period
from splitnerf.training.step import Step

MOST_GRAPHS = 4  # kept; they share work memory, but each has the gradients that it leaves
SAMPLE_SLACK = 1.15  # capacity over the samples that are aimed at
SHADING_SLACK = 1.25  # capacity over what was last counted
CAPACITY_UNIT = 256


class Graph(Protocol):
    """Recorded work."""

    def replay(self) -> None:
        """Does it again, with what its tensors hold now."""


class Recorded(NamedTuple):
    """A recorded step.

    Attributes:
        graph: The work.
        batch, found, light: The inputs that it reads, in memory of their own.
        outputs: Its rays and the terms of its loss.
        grads: The gradients of the model's parameters, in memory that each replay writes.
        capacity: The numbers of shaded samples and of segments for which it has room.
    """

    graph: Graph
    batch: Batch
    found: FoundSamples
    light: EvaluatedLight
    outputs: tuple[RenderedRays, dict[str, Term]]
    grads: list[Tensor | None]
    capacity: tuple[int, int]


class GraphedStep(Step):
    """A step whose rendering, losses and backward pass are one launch where shapes allow; see :class:`Step`.

    A graph repeats what the host decided when it was recorded: sizes, numbers, memory. So samples are padded to a fixed
    capacity, and all else that the host decides is the key of the graph. The first step with a key is made as it is, the
    next is recorded. What one step returns is overwritten by the next. Parameters and caches of the model keep their memory
    as long as keys are the same.
    """

    def __init__(self, model: SceneModel, *parts: Any):
        super().__init__(model, *parts)
        self.capacity = round_up(SAMPLE_SLACK * model.config.sampling.target_samples)
        self._counts: tuple[float, float] | None = None  # shaded samples and segments of the last step
        self._used: tuple[int, int] | None = None  # its capacity
        self._seen: set[Hashable] = set()
        self._has_loaded = False  # every kernel of a step with a capacity
        self._graphs: dict[Hashable, Recorded] = {}
        self._stream = torch.cuda.Stream(model.device)
        self._pool = torch.cuda.graph_pool_handle()

    @contextmanager
    def stream(self) -> Iterator[None]:
        """All work of the block goes to the queue in which graphs are recorded, to which their gradients are tied."""
        outside = torch.cuda.current_stream(self.model.device)
        self._stream.wait_stream(outside)
        try:
            with torch.cuda.stream(self._stream):
                yield
        finally:
            outside.wait_stream(self._stream)

    def __call__(
        self, batch: Batch, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, dict[str, Term]]:
        found = self.find(batch, progress, self.capacity)

        def differentiate(batch: Batch, found: FoundSamples, light: EvaluatedLight, capacity: tuple[int, int] | None):
            return self.differentiate(batch, found, light, environment, step, progress, capacity)

        self._used, key = None, (*self._decided(step, progress), len(batch.target), len(found.directions))
        if len(found.directions) != self.capacity or key not in self._seen or self._counts is None:
            self._seen.add(key)
            return differentiate(batch, found, light, None)
        self.model.sdf_field.grid.stored()  # a copy in 16 bits is made before, not by the graph
        if key in self._graphs and not has_room(self._graphs[key].capacity, self._counts, slack=1.1):
            del self._graphs[key]
        if key not in self._graphs:
            self._used = tuple(round_up(SHADING_SLACK * n) for n in self._counts)
            if not self._has_loaded:
                self._has_loaded = True
                return differentiate(batch, found, light, self._used)
            while len(self._graphs) >= MOST_GRAPHS:
                del self._graphs[next(iter(self._graphs))]
            self._graphs[key] = self._recorded(differentiate, batch, found, light, self._used)
        return self._replayed(self._graphs[key], batch, found, light)

    def _decided(self, step: int, progress: float) -> tuple:
        """What the host decides about a step, but for sizes: steps that agree in it do the same to their tensors."""
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

        def work() -> tuple[RenderedRays, dict[str, Term]]:
            light.zero_grad()  # gradients of one step, not of all
            return function(batch, found, light, capacity)

        graph, outputs = record(work, self._pool, self.generator)
        grads = [p.grad for p in self.model.parameters()]
        return Recorded(graph, batch, found, light, outputs, grads, capacity)

    def _replayed(
        self, recorded: Recorded, batch: Batch, found: FoundSamples, light: EvaluatedLight
    ) -> tuple[RenderedRays, dict[str, Term]]:
        self._used = recorded.capacity
        old = [*tree_leaves((recorded.batch, recorded.found)), *recorded.light.leaves, *recorded.light.constants]
        new = [*tree_leaves((batch, found)), *light.leaves, *light.constants]
        with torch.no_grad():
            for dtype in {x.dtype for x in new}:  # one launch for all of a type
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
        """Whether the last step had room for as many as it counted. Where it had not, its results have no meaning, and all
        graphs are dropped."""
        self._counts = n_shaded, n_segments
        complete = self._used is None or has_room(self._used, self._counts)
        if not complete:
            self.n_discarded += 1
            self._graphs.clear()
        return complete


def record(function: Callable[[], Any], pool: Any, generator: torch.Generator) -> tuple[Graph, Any]:
    """A graph of what a function does on the current stream, and what it returned; nothing is done yet.

    Args:
        function: Work without an answer to wait for, called once.
        pool: Memory that graphs share. None of them may need what another has left.
        generator: Random numbers that the function draws.
    """
    graph = torch.cuda.CUDAGraph()
    graph.register_generator_state(generator)
    collects = gc.isenabled()
    gc.disable()  # what it would free within the recording would be part of it
    graph.capture_begin(pool=pool, capture_error_mode="thread_local")  # meshes are made by another thread
    try:
        outputs = function()
    except BaseException:
        with suppress(RuntimeError):  # the first error is the one to tell
            graph.capture_end()
        raise
    finally:
        if collects:
            gc.enable()
    graph.capture_end()
    return graph, outputs


def has_room(capacity: tuple[int, int], counts: tuple[float, float], slack: float = 1.0) -> bool:
    """Whether the capacity is enough for so many, times `slack`."""
    return all(slack * n <= room for n, room in zip(counts, capacity))


def round_up(n: float) -> int:
    """To a multiple of the unit of capacities."""
    return -(-int(n) // CAPACITY_UNIT) * CAPACITY_UNIT
