"""What one training step computes: rays as they are rendered now, and the terms of the loss."""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.training import losses
from splitnerf.training.batches import Batch
from splitnerf.training.losses import Term
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.ops import MeshScene, gradient_losses, material_losses, pixel_losses
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import FoundSamples, RenderedRays, render_rays
from splitnerf.training.schedule import light_moves, light_period


def batch_losses(
    model: SceneModel, batch: Batch, found: FoundSamples, scene: MeshScene | None, environment: Tensor | None,
    generator: torch.Generator, step: int, progress: float, room: tuple[int, int] | None = None,
) -> tuple[RenderedRays, dict[str, Term]]:  # fmt: skip
    """The rays as they are rendered now, and the terms of the loss by name, the colour's first.

    Args:
        model: The scene.
        batch: The rays.
        found: Their samples.
        scene: The surface as a mesh, once there is one.
        environment: [h, 2h, 3], the light that weighs the occlusion rays; None: none are traced.
        generator: Draws subsets.
        step, progress: Where the training stands.
        room: As of :func:`splitnerf.render.renderer.render_rays`.
    """
    c = model.config
    ray = render_rays(model, found, shades_per_ray=c.shades_per_ray, room=room)
    colour, mask = pixel_losses(ray.mean, ray.opacity, batch.target, batch.background, linear=ray.linear)
    eikonal, smoothness = gradient_losses(ray.gradients, ray.weights.detach(), ray.beside)
    metal, binary_metal, dark_metal = material_losses(
        ray.points.albedo.detach(), ray.points.metallic, ray.shares, smooth_l1=c.metal_loss_form == "smooth_l1"
    )
    terms = {"colour": Term(c.colour_weight, colour), "eikonal": Term(c.eikonal_weight, eikonal)}
    if c.mask_weight:
        terms["mask"] = Term(c.mask_weight, mask)
    if model.light.needs_consistency_loss and c.light_weight and step % c.light_every == 0:
        terms["light"] = Term(c.light_weight, losses.light_loss(model.light, c, generator, step))
    if c.neutral_weight and light_moves(c, step):  # for all steps since it moved
        since = step % light_period(c) + 1
        terms["neutral"] = Term(c.neutral_weight * since, losses.neutral_light_loss(model.light, c, generator))
    if c.normal_smoothness:
        terms["smoothness"] = Term(c.normal_smoothness, smoothness)
    if c.entropy_weight and progress >= c.priors_from:
        terms["entropy"] = Term(c.entropy_weight, losses.material_entropy_loss(ray, c, generator))
    if c.metal_regulariser:
        terms["metal"] = Term(c.metal_weight, metal)
    if c.binary_metal_weight and progress >= c.priors_from:
        terms["binary_metal"] = Term(c.binary_metal_weight, binary_metal)
    if c.dark_metal_weight:
        terms["dark_metal"] = Term(c.dark_metal_weight, dark_metal)
    if environment is not None:
        terms["occlusion"] = Term(
            c.occlusion_weight, losses.occlusion_loss(ray, scene, environment, c, generator, step)
        )
    return ray, terms


def decided(model: SceneModel, mesh: SurfaceMesh, step: int, progress: float) -> tuple:
    """What the host decides about a step, but for sizes: steps that agree in it do the same to their tensors."""
    c = model.config
    since = step % light_period(c) + 1 if light_moves(c, step) else 0
    return model.sdf_field.grid.n_active, since, progress >= c.priors_from, mesh.made_at, model.occlusion_ready
