"""The numbers of a step: what decides on the device whether parameters move, and what the host reads of it later."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.devices import start_fetching
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.finite import LARGEST
from splitnerf.training.losses import Terms
from splitnerf.training.ranks import Agreed
from splitnerf.training.step import Room


class StepNumbers(NamedTuple):
    """What the host reads of a step, in one copy.

    Attributes:
        values: The terms of the loss without their weights, by name; the colour's term comes first.
        loss: The weighted sum.
        gradient_norm: The Euclidean norm of all gradients.
        counts: The samples found, and those shaded and their segments.
        s: The sharpness of the density.
        agreed: The counts of all processes of the training, and what else they agreed on.
    """

    values: dict[str, float]
    loss: float
    gradient_norm: float
    counts: Room
    s: float
    agreed: Agreed


@dataclass
class PastStep:
    """A step that the device has been given and whose numbers the host has not read.

    Attributes:
        step: Its number, counted from 1.
        batch, ray, terms: Its rays, their rendering and the terms of its loss.
        room: The room of its results.
        allowed: [] bool, whether its loss is a number, its gradient can be squared and its results had room.
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
        cls, step: int, batch: Batch, ray: RenderedRays, terms: Terms, room: Room, norm: Tensor, s: Tensor,
        agreed: Tensor | None = None,
    ) -> PastStep:  # fmt: skip
        """Starts to fetch the numbers of a step from its device; ``norm`` [] is that of all gradients, ``s`` [] the sharpness,
        ``agreed`` what the processes of the training agreed on, if there are several."""
        own = norm[None], s.detach()[None], ray.n_found[None], ray.sizes, ray.evaluated.sum()[None]
        numbers = terms.values_with(*own) if agreed is None else terms.values_with(*own, agreed)
        allowed = (numbers.abs() < _limits(len(terms), room, agreed is not None, numbers.device)).all()
        return cls(step, batch, ray, terms, room, allowed, start_fetching(numbers))

    def read(self) -> StepNumbers:
        """The numbers; waits until they are there."""
        numbers, wait = self.fetched
        wait()
        values, (norm, s, *counts) = (part.tolist() for part in numbers.tensor_split([len(self.terms)]))
        loss = sum(term.weight * value for term, value in zip(self.terms.values(), values))
        own, agreed = Agreed(*counts[:5]), Agreed(*counts[-len(Agreed._fields) :])
        return StepNumbers(dict(zip(self.terms, values)), loss, norm, Room(own.samples, own.shaded, own.segments), s, agreed)


@functools.lru_cache(maxsize=256)
def _limits(n_terms: int, room: Room, several: bool, device: torch.device) -> Tensor:
    """What each of a step's numbers must stay below."""
    counts = Agreed(room.samples + 0.5, room.shaded + 0.5, math.inf, room.segments + 0.5, math.inf)
    of_all = Agreed(*[math.inf] * len(counts))._replace(without_room=0.5) if several else ()
    with torch.inference_mode(False):
        return torch.tensor([*[math.inf] * n_terms, LARGEST, math.inf, *counts[:5], *of_all], device=device)
