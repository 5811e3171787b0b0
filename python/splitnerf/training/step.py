"""One training step: it finds and renders samples, takes the gradients of the losses and moves the parameters."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.devices import pinned, start_fetching
from splitnerf.errors import note
from splitnerf.fields import EvaluatedLight
from splitnerf.ops import AdamW
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import FoundSamples, RenderedRays, find_samples, render_rays
from splitnerf.training import losses
from splitnerf.training.batches import Batch
from splitnerf.training.exposure import BEGIN, PhotoExposures
from splitnerf.training.finite import Diverged
from splitnerf.training.losses import Terms
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.schedule import cosine_anneal, has_shape_priors, light_moves
from splitnerf.training.start import HELD_UNTIL, POINTS, SHAPE_WEIGHT, StartShape

MOST_SKIPPED = 10  # steps in a row
LARGEST = 1e18  # norm of a gradient; the optimiser squares its values, in single precision


class Capacity(NamedTuple):
    """How many samples, shaded samples and ray segments there are, or how many there may be."""

    samples: float = math.inf
    shaded: float = math.inf
    segments: float = math.inf

    @property
    def of_shading(self) -> tuple[int, int] | None:
        """The capacity that :func:`splitnerf.render.renderer.render_rays` takes."""
        return None if math.isinf(self.shaded) else (int(self.shaded), int(self.segments))

    def holds(self, counts: Capacity, slack: float = 1.0) -> bool:
        """Whether it is at least ``slack`` times as large as the counts."""
        return all(slack * n <= capacity for n, capacity in zip(counts, self))


class StepNumbers(NamedTuple):
    """What the host reads of a step, in one copy.

    Attributes:
        step: Its number, counted from 1.
        values, weights: The terms of the loss and their weights, by name; the colour's term comes first.
        gradient_norm: The Euclidean norm of all gradients.
        counts: The samples found, and those shaded and their segments.
        s: The sharpness of the density.
        evaluated: The points evaluated to find the samples.
        complete: Whether its results did not exceed their capacity.
    """

    step: int
    n_rays: int
    values: dict[str, float]
    weights: dict[str, float]
    gradient_norm: float
    counts: Capacity
    s: float
    evaluated: float
    complete: bool = True

    @property
    def loss(self) -> float:
        """The weighted sum of the terms."""
        return sum(weight * self.values[name] for name, weight in self.weights.items())


@dataclass
class PendingNumbers:
    """The numbers of a step on their way from its device.

    Attributes:
        step, n_rays, weights: See :class:`StepNumbers`.
        capacity: The capacity of its results.
        allowed: [] bool on the device, whether its loss is a number, its gradient can be squared, and its results did not
            exceed their capacity.
        fetched: The numbers on the CPU, and what waits until they are there.
        counted: The optimiser's counts of steps that this one has raised.
    """

    step: int
    n_rays: int
    weights: dict[str, float]
    capacity: Capacity
    allowed: Tensor
    fetched: tuple[Tensor, Callable[[], None]]
    counted: Sequence[Tensor] = ()

    def read(self) -> StepNumbers:
        """The numbers; waits until they are there."""
        numbers, wait = self.fetched
        wait()
        values, (norm, samples, shaded, _, segments, evaluated, s) = (
            part.tolist() for part in numbers.tensor_split([len(self.weights)])
        )
        counts, of_terms = Capacity(samples, shaded, segments), dict(zip(self.weights, values))
        complete = self.capacity.holds(counts)
        return StepNumbers(self.step, self.n_rays, of_terms, self.weights, norm, counts, s, evaluated, complete)


class Step:
    """One training step.

    Args:
        model, grid, mesh: The scene, its occupancy grid and its newest mesh.
        generator: Random numbers for the losses' subsets.
        optimiser, exposures: What a step moves; None: it takes gradients alone.
        seen: The light that photos show around the object; None where they show none.

    Attributes:
        capacity: The capacity of the last step's results.
        start: The shape that the run began with, near which the surface is held at first; None: a sphere, which holds nothing.
        skipped: The number of steps whose gradients could not be used.
        newest: The rays of the last step, and their rendering.
        s: The sharpness as far as it is known without waiting.
    """

    start: StartShape | None = None
    newest: tuple[Batch, RenderedRays] | None = None
    s: float | None = None

    def __init__(
        self,
        model: SceneModel,
        grid: OccupancyGrid,
        mesh: SurfaceMesh,
        generator: torch.Generator,
        optimiser: AdamW | None = None,
        exposures: PhotoExposures | None = None,
        seen: losses.SeenLight | None = None,
    ):
        self.model, self.grid, self.mesh, self.generator = model, grid, mesh, generator
        self.optimiser, self.exposures, self.seen = optimiser, exposures, seen
        self.parameters = list(model.parameters())
        self.capacity, self.skipped, self._skipped_in_a_row = Capacity(), 0, 0

    def __call__(self, batch: Batch, light: EvaluatedLight, step: int, progress: float) -> Iterable[StepNumbers]:
        """Takes the gradients of a batch and moves the parameters, those of the light where its turn has come. Returns the numbers
        of the steps that are read by now, in their order; where a loss is not finite nothing has moved. Raises Diverged where the
        gradients of too many steps in a row are not finite.

        Args:
            light: The evaluated light; of no use any more where its parameters moved.
            step, progress: The number of the step, and the training's progress in [0, 1].
        """
        numbers = self.begin(batch, light, step, progress).read()
        if self.judge(numbers):
            self.optimiser.step()
            if self.exposures.learned and progress > BEGIN:
                self.exposures.learn(batch.view, batch.target, self.newest[1].mean, self.newest[1].opacity)
        return [numbers]

    def unread(self) -> Iterable[StepNumbers]:
        """Reads the numbers that no call has returned yet."""
        return []

    def running(self) -> AbstractContextManager[None]:
        """The context in which steps run."""
        return nullcontext()

    def begin(self, batch: Batch, light: EvaluatedLight, step: int, progress: float) -> PendingNumbers:
        """Takes all gradients, and starts to fetch the step's numbers."""
        ray, terms = self.gradients(batch, light, step, progress)
        if light_moves(self.model.config, step):
            light.backward()
        self.newest = batch, ray
        return self.fetch(step + 1, batch, ray, terms)

    def fetch(self, step: int, batch: Batch, ray: RenderedRays, terms: Terms) -> PendingNumbers:
        """Starts to fetch the numbers of a step whose gradients are at the parameters."""
        gradients = [p.grad for p in self.parameters if p.grad is not None]
        numbers = torch.stack(
            [*(term.value for term in terms.values()), torch.nn.utils.get_total_norm(gradients, foreach=True)]
        )
        counts = torch.cat([ray.found.n_found[None], ray.sizes, ray.found.evaluated.sum()[None]])
        numbers = torch.cat([numbers, counts, ray.s[None]]).detach()
        allowed = (numbers.abs() < _limits(len(terms), self.capacity, numbers.device)).all()  # false for NaN
        weights = {name: term.weight for name, term in terms.items()}
        return PendingNumbers(step, len(batch.target), weights, self.capacity, allowed, start_fetching(numbers))

    def judge(self, numbers: StepNumbers) -> bool:
        """Whether a step's gradients may be used: its results were complete, its loss is a number, and its gradient can be squared.
        Counts the others. Raises Diverged where those of ten steps in a row may not."""
        if numbers.complete and not math.isfinite(numbers.loss):
            return False  # which ends the run
        if numbers.complete and numbers.gradient_norm < LARGEST:
            self._skipped_in_a_row = 0
            return True
        self.skipped += 1
        if numbers.complete:
            self._skipped_in_a_row += 1
            if self._skipped_in_a_row == MOST_SKIPPED:
                raise Diverged(
                    f"step {numbers.step - 1}: the gradient was not finite in {MOST_SKIPPED} steps in a row; "
                    "lower --set learning_rate and --resume"
                )
            note(f"step {numbers.step - 1}: the gradient is not finite; the step is skipped")
        return False

    def gradients(self, batch: Batch, light: EvaluatedLight, step: int, progress: float) -> tuple[RenderedRays, Terms]:
        """Finds the rays' samples, renders them and stores the gradients of the losses at the model's parameters and the light's
        leaves; the arguments are those of a call. Returns the rendered rays, and the terms of the loss by name; the colour's term
        comes first."""
        return self.differentiate(batch, self.find(batch, progress), light, step, progress)

    def find(self, batch: Batch, progress: float, capacity: int = 0) -> FoundSamples:
        """The samples of a batch, see :func:`splitnerf.render.renderer.find_samples`."""
        anneal, probes = cosine_anneal(self.model.config, progress), batch.probes
        if not has_shape_priors(self.model.config, progress):
            probes = probes._replace(chosen=probes.chosen[:0], shifts=probes.shifts[:0])
        if self.is_held(progress):
            drawn = self.start.drawn(POINTS, self.generator)
            probes = probes._replace(anywhere=torch.cat([probes.anywhere, drawn]))
        rays = batch.rays_o, batch.rays_d, batch.jitter
        return find_samples(self.model, self.grid.cells, *rays, anneal, probes, capacity, batch.phase, self.s)

    def differentiate(
        self,
        batch: Batch,
        found: FoundSamples,
        light: EvaluatedLight,
        step: int,
        progress: float,
        capacity: tuple[int, int] | None = None,
    ) -> tuple[RenderedRays, Terms]:
        """Renders found samples and takes the gradients; for ``capacity`` see
        :func:`splitnerf.render.renderer.render_rays`."""
        c = self.model.config
        turns = None if self.model.turns is None else self.model.turns[batch.view]
        ray = render_rays(
            self.model, light, found, shades_per_ray=c.constants.shades_per_ray, capacity=capacity, turns=turns
        )
        mesh = self.mesh.scene, self.mesh.environment
        terms = losses.loss_terms(self.model, light, batch, ray, *mesh, self.generator, step, progress, self.seen)
        if self.is_held(progress):
            terms.add({"start": SHAPE_WEIGHT}, self.start.shape_loss(ray))
            drawn = found.positions[len(found.directions) :][len(ray.anywhere) - POINTS : len(ray.anywhere)]
            terms.add({"near_start": SHAPE_WEIGHT}, self.start.left(ray.anywhere[-POINTS:], drawn).mean())
        for parameter in self.parameters:
            parameter.grad = None
        terms.backward()
        return ray, terms

    def is_held(self, progress: float) -> bool:
        """Whether the surface is held near the run's start."""
        return self.start is not None and progress < HELD_UNTIL


@functools.lru_cache(maxsize=256)
def _limits(n_terms: int, capacity: Capacity, device: torch.device) -> Tensor:
    """What each of a step's numbers must stay below."""
    counts = capacity.samples + 0.5, capacity.shaded + 0.5, math.inf, capacity.segments + 0.5
    with torch.inference_mode(False):
        limits = torch.tensor([math.inf] * n_terms + [LARGEST, *counts, math.inf, math.inf])
        return pinned(limits, device).to(device, non_blocking=True)
