"""Occlusion factors that are traced beside the training, so that a GPU's step does not wait for rays on the CPU."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.devices import in_background, pinned, start_fetching
from splitnerf.fields import OcclusionQuery
from splitnerf.ops import MeshScene
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.losses import OcclusionPoints, occlusion_error, occlusion_points, traced_factors


class PendingTargets(NamedTuple):
    """What an earlier step left, on the model's device.

    Attributes:
        positions: [m, 3] samples of its rays, scene units.
        points: The same on the surface.
        shares: [m] rendering weights.
        truth: [m, 2 channels] the traced factors, diffuse and then specular, on the CPU; ready when the thread is done.
    """

    positions: Tensor
    points: OcclusionPoints
    shares: Tensor
    truth: Future[Tensor]


class LateOcclusion:
    """The term of :func:`splitnerf.training.losses.occlusion_loss` for points of earlier steps.

    One thread traces the points of one step at a time. A step that finds it idle takes over what it traced and hands over points
    of its own; a step that finds it busy hands over none. Every step compares the newest traced factors with those that the
    network now predicts at the same points: positions, lobes and weights are those of the earlier step, the field's
    outputs, the prediction and its gradient those of now.

    So tracing never waits in a queue, the term keeps its weight where tracing is slow, and its points are then
    used in several steps. Before the first points are traced there is no term.

    Args:
        model: The scene, whose occlusion is a network.
        generator: Random numbers that choose the points, on the model's device.
    """

    def __init__(self, model: SceneModel, generator: torch.Generator):
        self.model, self.generator = model, generator
        self._asked: PendingTargets | None = None
        self._known: tuple[PendingTargets, tuple[Tensor, Tensor]] | None = None

    def loss(self, ray: RenderedRays, scene: MeshScene, environment: Tensor, seed: int) -> Tensor | None:
        """The loss [] at the newest traced points; None before there are any.

        Args:
            ray: The rendered rays, of which points may be handed over.
            scene, environment: The mesh, and the light that weighs its rays, as in
                :func:`splitnerf.ops.occlusion_factors`.
            seed: The seed of the rays.

        Raises:
            Exception: What went wrong while an earlier step's points were traced.
        """
        if self._asked is not None and self._asked.truth.done():
            truth = self._asked.truth.result().to(self.model.device, non_blocking=True)
            self._known, self._asked = (self._asked, truth.chunk(2, dim=1)), None
        if self._asked is None:
            self._asked = self._ask(ray, scene, environment, seed)
        return None if self._known is None else self._compare(*self._known)

    def close(self) -> None:
        """Waits for the thread; what it still traces is not used."""
        if self._asked is not None:
            with suppress(Exception):  # of factors that nobody asks for
                self._asked.truth.result()
            self._asked = None

    @torch.no_grad()
    def _ask(self, ray: RenderedRays, scene: MeshScene, environment: Tensor, seed: int) -> PendingTargets | None:
        c = self.model.config
        chosen = one_of_each_run(len(ray.shaded), c.constants.occlusion_share, self.generator)
        if len(chosen) == 0:
            return None
        points = occlusion_points(ray, chosen, c)
        packed = [*points, environment]
        numbers, wait = start_fetching(torch.cat([x.flatten() for x in packed]))  # one copy
        shapes = [x.shape for x in packed]
        truth = in_background(trace, numbers, wait, shapes, self.model.device, scene, c, seed)
        return PendingTargets(ray.positions[chosen], points, ray.shares[chosen], truth)

    def _compare(self, pending: PendingTargets, truth: tuple[Tensor, Tensor]) -> Tensor:
        inputs = self.model.head_inputs(pending.positions, *self.model.sdf_field(pending.positions))
        predicted = self.model.occlusion(OcclusionQuery(inputs, *pending.points))
        return occlusion_error((predicted.diffuse, predicted.specular), truth, pending.shares, self.model.config)


def trace(
    numbers: Tensor,
    wait: Callable[[], None],
    shapes: list[torch.Size],
    device: torch.device,
    scene: MeshScene,
    config: Config,
    seed: int,
) -> Tensor:
    """Traces points that are on their way from a device, and gets the factors ready for the way back.

    Args:
        numbers, wait: The numbers of :class:`splitnerf.training.losses.OcclusionPoints` and of the light, one after
            the other, on the CPU, and what waits until they are there.
        shapes: The shapes of these five.
        device: Where the factors will go.
        scene, config, seed: See :func:`splitnerf.training.losses.traced_factors`.

    Returns:
        [m, 2 channels] factors, diffuse and then specular.
    """
    wait()
    parts = numbers.split([math.prod(shape) for shape in shapes])
    *points, environment = (part.view(shape) for part, shape in zip(parts, shapes))
    factors = traced_factors(scene, OcclusionPoints(*points), environment, config, seed)
    return pinned(torch.cat(factors, dim=1), device)


def one_of_each_run(n: int, share: float, generator: torch.Generator) -> Tensor:
    """Random numbers [m] int64 below n, ascending, where m is about ``share`` of n: one of each run of n / m.

    Each number has the same chance; one on the border of two runs may come twice. The host knows how many
    there are, so that it does not wait for a GPU.
    """
    m = min(n, round(share * n))
    first = torch.arange(m, device=generator.device)
    jitter = torch.rand(m, generator=generator, device=generator.device, dtype=torch.float64)
    return ((first + jitter) * (n / max(1, m))).long().clamp(max=n - 1)
