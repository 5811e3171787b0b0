"""One training step: it renders rays, computes the terms of the loss and takes their gradients."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, closing, nullcontext
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.fields import EvaluatedLight
from splitnerf.ops import MeshScene, gradient_losses, material_losses, pixel_losses
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import FoundSamples, RenderedRays, find_samples, render_rays
from splitnerf.training import losses
from splitnerf.training.batches import Batch
from splitnerf.training.late_occlusion import LateOcclusion
from splitnerf.training.losses import Terms
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.schedule import cosine_anneal, light_moves, light_period
from splitnerf.training.start import HELD_UNTIL, POINTS, SHAPE_WEIGHT, StartShape

CHANNELS = 3


class Room(NamedTuple):
    """How many samples, shaded samples and ray segments there are, or how many there may be."""

    samples: float = math.inf
    shaded: float = math.inf
    segments: float = math.inf

    @property
    def of_shading(self) -> tuple[int, int] | None:
        """The capacity that :func:`splitnerf.render.renderer.render_rays` takes."""
        return None if math.isinf(self.shaded) else (int(self.shaded), int(self.segments))

    def holds(self, counts: Room, slack: float = 1.0) -> bool:
        """Whether it is at least ``slack`` times as large as the counts."""
        return all(slack * n <= room for n, room in zip(counts, self))


class Step:
    """One training step up to the gradients, which it stores at the model's parameters and the light's leaves.

    Args:
        model, grid, mesh: The scene, its occupancy grid and its newest mesh.
        generator: Random numbers for the losses' subsets.
        seen: The light that photos show around the object; None where they show none.

    Attributes:
        room: The room of the last step.
        start: The shape that the run began with, near which the surface is held at first; None: a sphere, which holds nothing.
        n_discarded: The number of steps whose results had too little room.
    """

    room, n_discarded = Room(), 0
    start: StartShape | None = None
    s: float | None = None  # the sharpness as far as it is known without waiting

    def __init__(
        self, model: SceneModel, grid: OccupancyGrid, mesh: SurfaceMesh, generator: torch.Generator,
        seen: losses.SeenLight | None = None,
    ):  # fmt: skip
        self.model, self.grid, self.mesh, self.generator, self.seen = model, grid, mesh, generator, seen
        on_cpu, self.late = model.device.type == "cpu", None  # whose threads would only share the time
        if not on_cpu and model.config.occlusion.kind == "mlp":
            # How often it draws depends on the CPU's speed: the training's own numbers must not.
            own = torch.Generator(generator.device).manual_seed(model.config.run.seed)
            self.late = LateOcclusion(model, own)

    def __call__(
        self, batch: Batch, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, Terms]:
        """Finds the rays' samples, renders them and takes the gradients of the losses.

        Args:
            batch: The rays.
            light: The evaluated light.
            environment: [h, 2h, 3] linear radiance that weighs the traced occlusion; None: no occlusion is traced.
            step, progress: The number of the step, and the training's progress in [0, 1].

        Returns:
            The rendered rays, and the terms of the loss by name; the colour's term comes first.
        """
        return self.differentiate(batch, self.find(batch, progress), light, environment, step, progress)

    def find(self, batch: Batch, progress: float, capacity: int = 0) -> FoundSamples:
        """The samples of a batch, see :func:`splitnerf.render.renderer.find_samples`."""
        anneal = cosine_anneal(self.model.config, progress)
        probes = batch.probes
        if self.start is not None and progress < HELD_UNTIL:
            drawn = self.start.drawn(POINTS, self.generator)
            probes = probes._replace(anywhere=torch.cat([probes.anywhere, drawn]))
        return find_samples(
            self.model, self.grid.cells, *batch.rays, anneal, probes, capacity, batch.phase, self.s
        )

    def differentiate(
        self, batch: Batch, found: FoundSamples, light: EvaluatedLight, environment: Tensor | None, step: int,
        progress: float, capacity: tuple[int, int] | None = None,
    ) -> tuple[RenderedRays, Terms]:  # fmt: skip
        """Renders found samples and takes the gradients; for ``capacity`` see
        :func:`splitnerf.render.renderer.render_rays`."""
        c = self.model.config
        ray = render_rays(self.model, light, found, shades_per_ray=c.constants.shades_per_ray, capacity=capacity)
        terms = loss_terms(
            self.model, light, batch, ray, self.mesh.scene, environment, self.generator, step, progress, self.seen, self.late
        )
        self.hold(terms, ray, found, progress)
        self.model.zero_grad(set_to_none=True)
        terms.backward()
        return ray, terms

    def hold(self, terms: Terms, ray: RenderedRays, found: FoundSamples, progress: float) -> None:
        """Adds the terms that hold the surface near the run's start."""
        if self.start is None or progress >= HELD_UNTIL:
            return
        terms.add({"start": SHAPE_WEIGHT}, self.start.shape_loss(ray))
        drawn = found.positions[len(found.directions) :][len(ray.anywhere) - POINTS : len(ray.anywhere)]
        terms.add({"near_start": SHAPE_WEIGHT}, self.start.left(ray.anywhere[-POINTS:], drawn).mean())

    def settle(self, counts: Room, room: Room, s: float) -> bool:
        """Takes in the counts of a step with this room and its sharpness. Returns whether the results may be used."""
        return room.holds(counts)

    def stream(self) -> AbstractContextManager[None]:
        """The context in which steps run."""
        return nullcontext() if self.late is None else closing(self.late)


def loss_terms(
    model: SceneModel, light: EvaluatedLight, batch: Batch, ray: RenderedRays, scene: MeshScene | None,
    environment: Tensor | None, generator: torch.Generator, step: int, progress: float,
    seen: losses.SeenLight | None = None, late: LateOcclusion | None = None,
) -> Terms:  # fmt: skip
    """The terms of the loss by name; the colour's term comes first.

    Args:
        model, light: The scene, and its evaluated light.
        batch, ray: The rays, and their rendering.
        scene: The surface as a mesh; None before the first mesh.
        environment: [h, 2h, 3] linear radiance that weighs the traced occlusion; None: no occlusion is traced.
        generator: Random numbers for the losses' subsets.
        step, progress: The number of the step, and the training's progress in [0, 1].
        seen: The light that photos show around the object; None where they show none.
        late: Traces occlusion beside the training; None: the step traces its own points.

    Source: SplitNeRF Eq. (3), (11), (18) and the losses named in :mod:`splitnerf.training.losses`.
    """
    c, w, terms = model.config, model.config.losses, Terms()
    has_priors = progress >= c.constants.priors_from
    # SplitNeRF Eq. (3) sums over the channels; `colour` is their mean.
    terms.add(
        {"colour": CHANNELS * w.colour_weight, "mask": w.mask_weight or None},
        pixel_losses(
            ray.mean, ray.opacity, batch.target, batch.background, batch.whole, batch.exposure, linear=ray.linear
        ),
    )
    terms.add(
        {"eikonal": w.eikonal_weight, "smoothness": w.smoothness_weight or None},
        gradient_losses(ray.gradients, ray.weights.detach(), ray.beside),
    )
    terms.add(
        {
            "metal": w.metal_weight or None,
            "binary_metal": (has_priors and w.binary_metal_weight) or None,
            "dark_metal": w.dark_metal_weight or None,
        },
        material_losses(
            ray.points.albedo.detach(), ray.points.metallic, ray.shares
        ),
    )
    if has_priors and w.entropy_weight:
        terms.add({"entropy": w.entropy_weight}, losses.material_entropy_loss(ray, c, generator))
    if model.light.needs_consistency_loss and w.light_weight:
        terms.add({"light": w.light_weight}, losses.light_loss(model.light, c, generator, step))
    if light_moves(c, step):  # once for all steps since the light last moved
        since = step % light_period(c) + 1
        if w.neutral_weight:
            terms.add({"neutral": w.neutral_weight * since}, losses.neutral_light_loss(light, c, generator))
        if w.light_prior_weight and c.light.kind == "pyramid":
            terms.add({"light_prior": w.light_prior_weight * since}, losses.light_prior_loss(model.light))
        if seen is not None and w.seen_weight:
            terms.add({"seen_light": w.seen_weight * since}, seen.loss(light))
    if environment is not None and late is None:
        terms.add({"occlusion": w.occlusion_weight}, losses.occlusion_loss(ray, scene, environment, c, generator, step))
    elif environment is not None and (found := late.loss(ray, scene, environment, step)) is not None:
        terms.add({"occlusion": w.occlusion_weight}, found)
    return terms
