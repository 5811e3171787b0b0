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
from splitnerf.training.room import RoomyStep
from splitnerf.training.schedule import light_moves, light_period
from splitnerf.training.start import HELD_UNTIL
from splitnerf.training.step import Room

MOST_GRAPHS = 4  # graphs kept; they share work memory, but each has its own gradients
ROOM_LEFT = 1.1  # share of the last counts for which a graph must have room


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
        room: The largest numbers of samples, shaded samples and segments that the graph can hold.
    """

    graph: Graph
    batch: Batch
    found: FoundSamples
    light: EvaluatedLight
    outputs: tuple[RenderedRays, Terms]
    grads: list[Tensor | None]
    room: Room


class GraphedStep(RoomyStep):
    """A step whose rendering, losses and backward pass are one launch where shapes repeat; see :class:`Step`.

    A graph repeats the host's decisions at the time of recording: sizes, numbers, addresses of memory. So samples are
    padded to a fixed number, and all other decisions of the host form the key of the graph. The first step with a key runs
    without a graph, the next one is recorded. Each step overwrites the results of the step before. Parameters and
    caches of the model must stay at the same addresses while the key stays the same.
    """

    def __init__(self, model: SceneModel, *parts: Any):
        super().__init__(model, *parts)
        self._seen: set[Hashable] = set()
        self._graphs: dict[Hashable, Recorded] = {}
        self._stream = torch.cuda.Stream(model.device)

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

    def _rendered(
        self, batch: Batch, found: FoundSamples, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, Terms]:
        def differentiate(batch: Batch, found: FoundSamples, light: EvaluatedLight) -> tuple[RenderedRays, Terms]:
            return self.differentiate(batch, found, light, environment, step, progress, self.room.of_shading)

        key = (*self._decided(step, progress), len(batch.target))
        if self.room.samples != self.sample_room or key not in self._seen:
            if self.room.samples == self.sample_room:
                self._seen.add(key)  # and its kernels will be loaded: none may be while recording
            return differentiate(batch, found, light)
        self.model.sdf_field.grid.stored()  # makes the 16-bit copy before the graph, not in it
        if key in self._graphs and not self._graphs[key].room.holds(self._counts._replace(samples=0), ROOM_LEFT):
            del self._graphs[key]
        if key not in self._graphs:
            while len(self._graphs) >= MOST_GRAPHS:
                del self._graphs[next(iter(self._graphs))]
            if not self._graphs:  # torch records nothing more into a pool whose graphs are all gone
                self._pool = torch.cuda.graph_pool_handle()
            self._graphs[key] = self._recorded(differentiate, batch, found, light)
        return self._replayed(self._graphs[key], batch, found, light)

    def _decided(self, step: int, progress: float) -> tuple:
        """The host's decisions about a step, except sizes: steps with equal decisions run the same work."""
        c, model = self.model.config, self.model
        since = step % light_period(c) + 1 if light_moves(c, step) else 0
        return (
            model.sdf_field.grid.n_active,
            since,
            progress >= c.constants.priors_from,
            self.start is not None and progress < HELD_UNTIL,
            self.mesh.made_at,
            model.occlusion.ready,
        )

    def _recorded(
        self, function: Callable, batch: Batch, found: FoundSamples, light: EvaluatedLight
    ) -> Recorded:
        batch, found = tree_map(torch.clone, (batch, found))
        leaves = [leaf.detach().clone().requires_grad_() for leaf in light.leaves]
        light = light.with_tensors(leaves, [x.clone() for x in light.constants])

        def work() -> tuple[RenderedRays, Terms]:
            light.zero_grad()  # a replay adds the gradients of one step only
            return function(batch, found, light)

        graph, outputs = record(work, self._pool, self.generator)
        grads = [p.grad for p in self.model.parameters()]
        return Recorded(graph, batch, found, light, outputs, grads, self.room)

    def _replayed(
        self, recorded: Recorded, batch: Batch, found: FoundSamples, light: EvaluatedLight
    ) -> tuple[RenderedRays, Terms]:
        self.room = recorded.room
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
