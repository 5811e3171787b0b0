"""The numbers of a step: what decides on the device whether parameters move, and what the host reads of it later."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.devices import pinned, start_fetching
from splitnerf.ops import step_numbers
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.finite import LARGEST
from splitnerf.training.losses import Terms
from splitnerf.training.step import Room


class StepNumbers(NamedTuple):
    """What the host reads of a step, in one copy.

    Attributes:
        values: The terms of the loss without their weights, by name; the colour's term comes first.
        loss: The weighted sum.
        gradient_norm: The Euclidean norm of all gradients.
        counts: The samples found, and those shaded and their segments.
        s: The sharpness of the density.
        evaluated: The points evaluated to find the samples.
    """

    values: dict[str, float]
    loss: float
    gradient_norm: float
    counts: Room
    s: float
    evaluated: float


@dataclass
class PastStep:
    """A step that the device has been given and whose numbers the host has not read.

    Attributes:
        step: Its number, counted from 1.
        batch, ray, terms: Its rays, their rendering and the terms of its loss.
        room: The room of its results.
        allowed: [] bool, whether its loss is a number, its gradient can be squared, and its results had room.
        fetched: Its numbers on the CPU, and what waits until they are there.
        counted: The optimiser's counts of steps that this one has raised.
    """

    step: int
    batch: Batch
    ray: RenderedRays
    terms: Terms
    room: Room
    allowed: Tensor
    fetched: tuple[Tensor, Callable[[], None]]
    counted: Sequence[Tensor] = ()

    @classmethod
    def of(
        cls, step: int, batch: Batch, ray: RenderedRays, terms: Terms, room: Room, gradients: list[Tensor]
    ) -> PastStep:
        """Starts to fetch the numbers of a step with these gradients from its device."""
        values, counts = [term.value for term in terms.values()], [ray.n_found, ray.sizes]
        limits = _limits(len(terms), room, ray.mean.device)
        numbers, allowed = step_numbers(gradients, values, counts, ray.evaluated, ray.s.detach(), limits)
        return cls(step, batch, ray, terms, room, allowed, start_fetching(numbers))

    def read(self) -> StepNumbers:
        """The numbers; waits until they are there."""
        numbers, wait = self.fetched
        wait()
        values, of_step = (part.tolist() for part in numbers.tensor_split([len(self.terms)]))
        norm, samples, shaded, _, segments, evaluated, s = of_step
        loss = sum(term.weight * value for term, value in zip(self.terms.values(), values))
        return StepNumbers(dict(zip(self.terms, values)), loss, norm, Room(samples, shaded, segments), s, evaluated)


@functools.lru_cache(maxsize=256)
def _limits(n_terms: int, room: Room, device: torch.device) -> Tensor:
    """What each of a step's numbers must stay below."""
    counts = room.samples + 0.5, room.shaded + 0.5, math.inf, room.segments + 0.5
    with torch.inference_mode(False):
        limits = torch.tensor([math.inf] * n_terms + [LARGEST, *counts, math.inf, math.inf])
        return pinned(limits, device).to(device, non_blocking=True)
