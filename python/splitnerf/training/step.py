"""One training step: it renders rays, computes the terms of the loss and takes their gradients."""

from __future__ import annotations

from contextlib import AbstractContextManager, closing, nullcontext

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
from splitnerf.training.losses import Term
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.schedule import cosine_anneal, light_moves, light_period

CHANNELS = 3


class Step:
    """One training step up to the gradients, which it stores at the model's parameters and the light's leaves.

    Args:
        model, grid, mesh: The scene, its occupancy grid and its newest mesh.
        generator: Random numbers for the losses' subsets.
        seen: The light that photos show around the object; None where they show none.
    """

    n_discarded = 0  # steps whose results were not complete

    def __init__(
        self, model: SceneModel, grid: OccupancyGrid, mesh: SurfaceMesh, generator: torch.Generator,
        seen: losses.SeenLight | None = None,
    ):  # fmt: skip
        self.model, self.grid, self.mesh, self.generator, self.seen = model, grid, mesh, generator, seen
        on_cpu = model.device.type == "cpu"  # whose threads would only share the time
        self.late = None if on_cpu or model.config.occlusion.kind != "mlp" else LateOcclusion(model, generator)

    def __call__(
        self, batch: Batch, light: EvaluatedLight, environment: Tensor | None, step: int, progress: float
    ) -> tuple[RenderedRays, dict[str, Term]]:
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
        return find_samples(self.model, self.grid.cells, *batch.rays, anneal, batch.probes, capacity)

    def differentiate(
        self, batch: Batch, found: FoundSamples, light: EvaluatedLight, environment: Tensor | None, step: int,
        progress: float, capacity: tuple[int, int] | None = None,
    ) -> tuple[RenderedRays, dict[str, Term]]:  # fmt: skip
        """Renders found samples and takes the gradients; for ``capacity`` see
        :func:`splitnerf.render.renderer.render_rays`."""
        c = self.model.config
        ray = render_rays(self.model, light, found, shades_per_ray=c.sampling.shades_per_ray, capacity=capacity)
        terms = loss_terms(
            self.model, light, batch, ray, self.mesh.scene, environment, self.generator, step, progress, self.seen, self.late
        )
        self.model.zero_grad(set_to_none=True)
        losses.backward(terms)
        return ray, terms

    def is_complete(self, n_shaded: float, n_segments: float) -> bool:
        """Whether the last step's results hold all samples and segments that were counted; here they always do."""
        return True

    def stream(self) -> AbstractContextManager[None]:
        """The context in which steps run."""
        return nullcontext() if self.late is None else closing(self.late)


def loss_terms(
    model: SceneModel, light: EvaluatedLight, batch: Batch, ray: RenderedRays, scene: MeshScene | None,
    environment: Tensor | None, generator: torch.Generator, step: int, progress: float,
    seen: losses.SeenLight | None = None, late: LateOcclusion | None = None,
) -> dict[str, Term]:  # fmt: skip
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
    c = model.config
    colour, mask = pixel_losses(
        ray.mean * batch.exposure, ray.opacity, batch.target, batch.background, batch.whole, linear=ray.linear
    )
    eikonal, smoothness = gradient_losses(ray.gradients, ray.weights.detach(), ray.beside)
    metal, binary_metal, dark_metal = material_losses(
        ray.points.albedo.detach(), ray.points.metallic, ray.shares, smooth_l1=c.losses.metal_form == "smooth_l1"
    )
    # SplitNeRF Eq. (3) sums over the channels; `colour` is their mean.
    terms = {"colour": Term(CHANNELS * c.losses.colour_weight, colour), "eikonal": Term(c.losses.eikonal_weight, eikonal)}
    if c.losses.mask_weight:
        terms["mask"] = Term(c.losses.mask_weight, mask)
    if model.light.needs_consistency_loss and c.losses.light_weight and step % c.losses.light_every == 0:
        terms["light"] = Term(c.losses.light_weight, losses.light_loss(model.light, c, generator, step))
    if light_moves(c, step):  # once for all steps since the light last moved
        since = step % light_period(c) + 1
        if c.losses.neutral_weight:
            terms["neutral"] = Term(c.losses.neutral_weight * since, losses.neutral_light_loss(light, c, generator))
        if c.losses.light_prior_weight and c.light.kind == "pyramid":
            terms["light_prior"] = Term(c.losses.light_prior_weight * since, losses.light_prior_loss(model.light))
        if seen is not None and c.losses.seen_weight:
            terms["seen_light"] = Term(c.losses.seen_weight * since, seen.loss(light))
    if c.losses.smoothness_weight:
        terms["smoothness"] = Term(c.losses.smoothness_weight, smoothness)
    if c.losses.entropy_weight and progress >= c.losses.priors_from:
        terms["entropy"] = Term(c.losses.entropy_weight, losses.material_entropy_loss(ray, c, generator))
    if c.losses.metal_regulariser:
        terms["metal"] = Term(c.losses.metal_weight, metal)
    if c.losses.binary_metal_weight and progress >= c.losses.priors_from:
        terms["binary_metal"] = Term(c.losses.binary_metal_weight, binary_metal)
    if c.losses.dark_metal_weight:
        terms["dark_metal"] = Term(c.losses.dark_metal_weight, dark_metal)
    if environment is not None and late is None:
        terms["occlusion"] = Term(
            c.losses.occlusion_weight, losses.occlusion_loss(ray, scene, environment, c, generator, step)
        )
    elif environment is not None and (value := late.loss(ray, scene, environment, step)) is not None:
        terms["occlusion"] = Term(c.losses.occlusion_weight, value)
    return terms
