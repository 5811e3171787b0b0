"""Steps whose results have a room that is known beforehand, so that the host waits for no count of the GPU."""

from __future__ import annotations

import math

from torch import Tensor

from splitnerf.fields import EvaluatedLight
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import FoundSamples, RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.losses import Terms
from splitnerf.training.step import Room, Step

SAMPLE_SLACK = 1.15  # room for samples, over the target of a step
SHADING_SLACK = 1.25  # room for shaded samples and segments, over the last count
UNIT = 256


class RoomyStep(Step):
    """A step whose room follows from the counts of steps before; see :class:`splitnerf.training.step.Step`.

    The first step has no limits, and neither has one after a step whose samples were too many. What exceeds its room has no
    meaning and moves nothing. Where ``sampling.min_weight`` is 0 no step has limits, unless it is to be recorded: the search for
    samples waits for their number anyway.
    """

    def __init__(self, model: SceneModel, *parts: object):
        super().__init__(model, *parts)
        self.sample_room = round_up(SAMPLE_SLACK * model.config.sampling.target_samples)
        self._counts: Room | None = None  # of the last step whose counts are known

    def __call__(
        self, batch: Batch, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, Terms]:
        c = self.model.config
        pads = c.sampling.min_weight > 0 or c.run.cuda_graphs
        known = pads and self._counts is not None and self._counts.samples <= self.sample_room
        found = self.find(batch, progress, self.sample_room if known else 0)
        self.room = self._wanted(len(found.directions)) if known else Room()
        return self._rendered(batch, found, light, environment, step, progress)

    def _rendered(
        self, batch: Batch, found: FoundSamples, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, Terms]:
        return self.differentiate(batch, found, light, environment, step, progress, self.room.of_shading)

    def _wanted(self, n_samples: int) -> Room:
        """The room of a step with so many samples."""
        shaded, segments = (round_up(SHADING_SLACK * n) for n in self._counts[1:])
        return Room(n_samples, shaded, segments)

    def settle(self, counts: Room, room: Room, s: float) -> bool:
        """As :meth:`Step.settle`; counts the steps whose results may not be used."""
        self._counts, self.s = counts, s
        complete = super().settle(counts, room, s)
        self.n_discarded += not complete
        return complete


def round_up(n: float) -> int:
    """The smallest multiple of the rooms' unit that is at least n."""
    return -(-math.floor(n) // UNIT) * UNIT
