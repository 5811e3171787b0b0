"""One training step: it renders rays, computes the terms of the loss and takes their gradients."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager, closing, nullcontext
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf.fields import EvaluatedLight
from splitnerf.ops import MeshScene, pixel_losses, totalled_gradient_losses, totalled_material_losses
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.renderer import FoundSamples, RenderedRays, find_samples, render_rays
from splitnerf.training import losses
from splitnerf.training.batches import Batch
from splitnerf.training.late_occlusion import LateOcclusion
from splitnerf.training.losses import Terms
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.ranks import ALONE, Alone
from splitnerf.training.schedule import cosine_anneal, light_moves, light_period
from splitnerf.training.start import HELD_UNTIL, POINTS_WEIGHT, SHAPE_WEIGHT, SIDES_UNTIL, StartShape, side_loss

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
        ranks: The processes of the training.

    Attributes:
        room: The room of the last step.
        start: The shape that the run began with, near which the surface is held at first; None: a sphere, which holds nothing.
        agreed: What the processes agreed on in the last step, see :meth:`splitnerf.training.ranks.Alone.agree`.
        n_discarded: The number of steps whose results had too little room.
    """

    room, n_discarded = Room(), 0
    start: StartShape | None = None
    s: float | None = None  # the sharpness as far as it is known without waiting

    def __init__(
        self, model: SceneModel, grid: OccupancyGrid, mesh: SurfaceMesh, generator: torch.Generator,
        seen: losses.SeenLight | None = None, ranks: Alone = ALONE,
    ):  # fmt: skip
        self.model, self.grid, self.mesh, self.generator, self.seen = model, grid, mesh, generator, seen
        self.ranks, self.agreed = ranks, None
        on_cpu, self.late = model.device.type == "cpu", None  # whose threads would only share the time
        if not on_cpu and model.config.occlusion.kind == "mlp":
            # How often it draws depends on the CPU's speed: the training's own numbers must not.
            own = torch.Generator(generator.device).manual_seed(model.config.run.seed + ranks.rank)
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
        if self.start is not None and progress < SIDES_UNTIL:
            probes = probes._replace(anywhere=torch.cat([probes.anywhere, self.start.drawn(self.generator)]))
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
        ray = render_rays(self.model, light, found, shades_per_ray=c.sampling.shades_per_ray, capacity=capacity)
        own = self.ranks.own(self.generator, c.run.seed, step)
        terms = loss_terms(
            self.model, light, batch, ray, self.mesh.scene, environment, self.generator, step, progress, self.seen, self.late, own
        )
        self.hold(terms, ray, progress)
        self.agreed = self.ranks.agree(terms, ray, self.room)
        self.model.zero_grad(set_to_none=True)
        terms.backward()
        return ray, terms

    def hold(self, terms: Terms, ray: RenderedRays, progress: float) -> None:
        """Adds the terms that hold the surface near the run's start."""
        if self.start is not None and progress < HELD_UNTIL:
            error, weight = self.start.shape_loss(ray)
            terms.add({"start": SHAPE_WEIGHT}, error, [weight])
        n_drawn = len(ray.anywhere) - self.model.config.losses.eikonal_points
        if n_drawn > 0:
            terms.add({"sides": POINTS_WEIGHT}, side_loss(ray.anywhere[-n_drawn:]), [float(n_drawn)])

    def settle(self, counts: Room, room: Room, s: float, elsewhere: bool = False) -> bool:
        """Takes in the counts of a step with this room and its sharpness. ``elsewhere``: another process had too little room.
        Returns whether the results may be used: only if no process had too little."""
        return room.holds(counts) and not elsewhere

    def stream(self) -> AbstractContextManager[None]:
        """The context in which steps run."""
        return nullcontext() if self.late is None else closing(self.late)


def loss_terms(
    model: SceneModel, light: EvaluatedLight, batch: Batch, ray: RenderedRays, scene: MeshScene | None,
    environment: Tensor | None, generator: torch.Generator, step: int, progress: float,
    seen: losses.SeenLight | None = None, late: LateOcclusion | None = None, own: torch.Generator | None = None,
) -> Terms:  # fmt: skip
    """The terms of the loss by name; the colour's term comes first.

    Args:
        model, light: The scene, and its evaluated light.
        batch, ray: The rays, and their rendering.
        scene: The surface as a mesh; None before the first mesh.
        environment: [h, 2h, 3] linear radiance that weighs the traced occlusion; None: no occlusion is traced.
        generator: Random numbers, the same in all processes of a training.
        step, progress: The number of the step, and the training's progress in [0, 1].
        seen: The light that photos show around the object; None where they show none.
        late: Traces occlusion beside the training; None: the step traces its own points.
        own: Random numbers for the losses' subsets of this process's points; None: `generator`.

    Source: SplitNeRF Eq. (3), (11), (18) and the losses named in :mod:`splitnerf.training.losses`.
    """
    c, w, terms = model.config, model.config.losses, Terms()
    n_rays, own = len(batch.target), generator if own is None else own
    has_priors = progress >= w.priors_from
    # SplitNeRF Eq. (3) sums over the channels; `colour` is their mean.
    terms.add(
        {"colour": CHANNELS * w.colour_weight, "mask": w.mask_weight or None},
        pixel_losses(
            ray.mean, ray.opacity, batch.target, batch.background, batch.whole, batch.exposure, linear=ray.linear
        ),
        [n_rays, n_rays],
    )
    bends, weight = totalled_gradient_losses(ray.gradients, ray.weights.detach(), ray.beside)
    terms.add(
        {"eikonal": w.eikonal_weight, "smoothness": w.smoothness_weight or None}, bends, [len(ray.gradients), weight]
    )
    metals, weight = totalled_material_losses(
        ray.points.albedo.detach(), ray.points.metallic, ray.shares, smooth_l1=w.metal_form == "smooth_l1"
    )
    terms.add(
        {
            "metal": w.metal_weight if w.metal_regulariser else None,
            "binary_metal": (has_priors and w.binary_metal_weight) or None,
            "dark_metal": w.dark_metal_weight or None,
        },
        metals,
        [weight] * 3,
    )
    if has_priors and w.entropy_weight:
        terms.add({"entropy": w.entropy_weight}, losses.material_entropy_loss(ray, c, own))
    if model.light.needs_consistency_loss and w.light_weight and step % w.light_every == 0:
        terms.add({"light": w.light_weight}, losses.light_loss(model.light, c, own, step))
    if light_moves(c, step):  # once for all steps since the light last moved
        since = step % light_period(c) + 1
        if w.neutral_weight:
            terms.add({"neutral": w.neutral_weight * since}, losses.neutral_light_loss(light, c, generator))
        if w.light_prior_weight and c.light.kind == "pyramid":
            terms.add({"light_prior": w.light_prior_weight * since}, losses.light_prior_loss(model.light))
        if seen is not None and w.seen_weight:
            terms.add({"seen_light": w.seen_weight * since}, seen.loss(light))
    if environment is not None and late is None:
        error, weight = losses.occlusion_loss(ray, scene, environment, c, own, step)
        terms.add({"occlusion": w.occlusion_weight}, error, [weight])
    elif environment is not None and (found := late.loss(ray, scene, environment, step)) is not None:
        terms.add({"occlusion": w.occlusion_weight}, found)
    elif environment is not None and own is not generator:  # other processes may have traced points
        terms.add({"occlusion": w.occlusion_weight}, environment.new_zeros(()), [0.0])
    return terms
