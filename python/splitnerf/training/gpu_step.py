"""Training steps of a GPU: the host waits for no count, and hundreds of launches are recorded once and repeated by one."""

from __future__ import annotations

import gc
import math
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.utils._pytree import tree_leaves, tree_map

from splitnerf.fields import EvaluatedLight
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import FoundSamples, RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.exposure import BEGIN
from splitnerf.training.losses import Terms
from splitnerf.training.schedule import has_shape_priors, light_moves, light_period
from splitnerf.training.step import Capacity, PendingNumbers, Step, StepNumbers

SAMPLE_SLACK = 1.15  # capacity for samples, over the target of a step
SHADING_SLACK = 1.25  # capacity for shaded samples and segments, over the last known count
UNIT = 256
READ_EVERY = 16  # steps whose numbers are read together
MOST_GRAPHS = 4  # graphs kept; they share work memory, but each has its own gradients
SPARE = 1.1  # a graph holds so many times the last known counts, else it is recorded anew


class Recorded(NamedTuple):
    """A recorded step."""

    graph: torch.cuda.CUDAGraph  # the recorded work
    batch: Batch  # like found and light an input of the graph, in memory of its own
    found: FoundSamples
    light: EvaluatedLight
    outputs: tuple[RenderedRays, Terms]  # the rendered rays and the terms of the loss
    grads: list[Tensor | None]  # of the model's parameters, in memory that each replay overwrites
    capacity: Capacity  # the largest numbers of samples, shaded samples and segments that the graph can hold


class GpuStep(Step):
    """A step that keeps a GPU busy; see :class:`splitnerf.training.step.Step`.

    *Capacity.* The results of a step have sizes that follow from the counts of the last step that was read. The first step
    has no limits, and neither has one after a step whose samples were too many. What exceeds its capacity has no meaning and
    moves nothing. Where ``sampling.min_weight`` is 0 no step has limits, unless it is to be recorded: the search for samples
    waits for their number anyway.

    *Numbers* are read :data:`READ_EVERY` steps at a time, all but those of the newest step, which the GPU still works on; and
    one step late where that may change the next step: after a step that was not complete, and while the number of rays
    changes. The device itself decides whether parameters move.

    *Graphs* (``run.cuda_graphs``). A graph repeats the host's decisions at the time of recording: sizes, numbers, addresses
    of memory. So samples are padded to a fixed number, and all other decisions of the host form the key of the graph. The
    first step with a key runs without a graph, the next one is recorded. Each step overwrites the results of the step
    before. Parameters and caches of the model must stay at the same addresses while the key stays the same.

    Attributes:
        last: The numbers of the last step that was read.
    """

    def __init__(self, model: SceneModel, *parts: Any):
        super().__init__(model, *parts)
        c = model.config
        self.sample_capacity = in_units(SAMPLE_SLACK * c.sampling.target_samples)
        self.last: StepNumbers | None = None
        self._pending: deque[PendingNumbers] = deque()
        self._with_kernels: set[Hashable] = set()  # keys of steps that were taken once
        self._graphs: dict[Hashable, Recorded] = {}
        self._stream = torch.cuda.Stream(model.device) if c.run.cuda_graphs else None

    def __call__(self, batch: Batch, light: EvaluatedLight, step: int, progress: float) -> Iterable[StepNumbers]:
        pending = self.begin(batch, light, step, progress)
        for leaf in light.leaves:
            if leaf.grad is not None:
                leaf.grad.masked_fill_(~pending.allowed, 0.0)  # it would stay until the light moves
        self.optimiser.step(allowed=pending.allowed)
        pending.counted = self.optimiser.counted
        if self.exposures.learned and progress > BEGIN:
            ray = self.newest[1]
            self.exposures.learn(batch.view, batch.target, ray.mean, ray.opacity, pending.allowed)
        self._pending.append(pending)
        is_steady = self.last is not None and self.last.complete and self.last.n_rays == pending.n_rays
        return self._read(1) if len(self._pending) > (READ_EVERY if is_steady else 1) else []

    def unread(self) -> Iterable[StepNumbers]:
        return self._read(0)

    def _read(self, left: int) -> Iterator[StepNumbers]:
        """Reads the numbers of all steps but the last ones, and does what follows from them."""
        while len(self._pending) > left:
            pending = self._pending.popleft()
            self.last = pending.read()
            self.s = self.last.s
            if not self.judge(self.last):
                self.optimiser.take_back(pending.counted)
            yield self.last

    @contextmanager
    def running(self) -> Iterator[None]:
        """Runs the block's work in the CUDA stream that graphs are recorded in; autograd ties gradients to that stream."""
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

    def gradients(self, batch: Batch, light: EvaluatedLight, step: int, progress: float) -> tuple[RenderedRays, Terms]:
        c = self.model.config
        known = self.last.counts if self.last is not None else Capacity()
        is_bounded = known.samples <= self.sample_capacity and (c.sampling.min_weight > 0 or c.run.cuda_graphs)
        found = self.find(batch, progress, self.sample_capacity if is_bounded else 0)
        self.capacity = Capacity()
        if is_bounded:
            self.capacity = Capacity(len(found.directions), *(in_units(SHADING_SLACK * n) for n in known[1:]))

        def differentiate(batch: Batch, found: FoundSamples, light: EvaluatedLight) -> tuple[RenderedRays, Terms]:
            return self.differentiate(batch, found, light, step, progress, self.capacity.of_shading)

        key = (*self._decided(step, progress), len(batch.target))
        if not c.run.cuda_graphs or self.capacity.samples != self.sample_capacity:
            return differentiate(batch, found, light)
        if key not in self._with_kernels:  # which are loaded now: none may be while recording
            self._with_kernels.add(key)
            return differentiate(batch, found, light)
        self.model.sdf_field.grid.stored()  # makes the 16-bit copy before the graph, not in it
        if key in self._graphs and not self._graphs[key].capacity.holds(known._replace(samples=0), SPARE):
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
        priors = progress >= c.constants.priors_from, self.is_held(progress), has_shape_priors(c, progress)
        return model.sdf_field.grid.n_active, since, *priors, self.mesh.made_at, model.has_mesh

    def _recorded(self, function: Callable, batch: Batch, found: FoundSamples, light: EvaluatedLight) -> Recorded:
        batch, found = tree_map(torch.clone, (batch, found))
        leaves = [leaf.detach().clone().requires_grad_() for leaf in light.leaves]
        light = light.with_leaves(leaves)

        def work() -> tuple[RenderedRays, Terms]:
            light.zero_grad()  # a replay adds the gradients of one step only
            return function(batch, found, light)

        graph, outputs = record(work, self._pool, self.generator)
        grads = [p.grad for p in self.model.parameters()]
        return Recorded(graph, batch, found, light, outputs, grads, self.capacity)

    def _replayed(
        self, recorded: Recorded, batch: Batch, found: FoundSamples, light: EvaluatedLight
    ) -> tuple[RenderedRays, Terms]:
        self.capacity = recorded.capacity
        old = [*tree_leaves((recorded.batch, recorded.found)), *recorded.light.leaves]
        new = [*tree_leaves((batch, found)), *light.leaves]
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


def record(function: Callable[[], Any], pool: Any, generator: torch.Generator) -> tuple[torch.cuda.CUDAGraph, Any]:
    """Records the work of a function without running it; returns the graph and the function's result. The function never waits for
    a result of the GPU, is called once, and draws from `generator`. Graphs share the memory `pool`; none may rely on values that
    another left there."""
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


def in_units(n: float) -> int:
    """The smallest multiple of the capacities' unit that is at least n."""
    return -(-math.floor(n) // UNIT) * UNIT
