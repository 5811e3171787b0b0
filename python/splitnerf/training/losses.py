"""The terms of the training loss."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.data.environment import seen_at
from splitnerf.devices import pinned
from splitnerf.fields import EvaluatedLight, Light
from splitnerf.ops import MeshScene, fibonacci_directions, occlusion_factors, prefilter_light
from splitnerf.ops.light import light_prior, sample_ggx_lobe
from splitnerf.ops.training import gradient_losses, pixel_losses, quadratic_entropy
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import RenderedRays
from splitnerf.training.batches import Batch
from splitnerf.training.schedule import has_shape_priors, light_moves, light_period

CHANNELS = 3
KEPT_SHARE = 0.1  # of the weights of distances and masks where shape has no full priors
TAILS = 3.0  # degrees of freedom
SEEN_TEXELS = 1024  # directions in which the light is compared with what photos show, at least
SEEN_DEVIATION = 0.2  # of the log radiance
RADIANCE_FLOOR = 1e-3  # radiance below it counts as dark
ALBEDO_FLOOR = 0.01  # albedos below it count as the same black
USUAL_ERROR = 1 / 1500  # of the colours, at which smoothness counts as its weight says
MOST_SMOOTHER = 10.0  # factor of it where their error is larger


class Term(NamedTuple):
    """One term of the loss."""

    weight: float  # its factor in the loss
    value: Tensor  # [] without the weight; no gradient


class Terms(dict[str, Term]):
    """The terms of a loss by name."""

    def __init__(self) -> None:
        super().__init__()
        self._roots: list[tuple[Tensor, tuple[float, ...]]] = []

    def add(self, weights: dict[str, float | None], values: Tensor) -> None:
        """Adds the terms `values` [k], or [] for one, with their names and weights in that order. A term whose weight is None
        is left out."""
        if any(weights.values()):
            self._roots.append((values, tuple(weight or 0.0 for weight in weights.values())))
        flat = values.detach().reshape(-1)
        self.update(
            (name, Term(weight, flat[i])) for i, (name, weight) in enumerate(weights.items()) if weight is not None
        )

    def backward(self) -> None:
        """Takes the gradients of the weighted sum. The weights seed the backward pass, so that the sum itself is never
        computed."""
        roots = [(values, weights) for values, weights in self._roots if values.requires_grad]
        seeds = [_stored_seed(weights, values.shape, values.device) for values, weights in roots]
        torch.autograd.backward([values for values, _ in roots], seeds)


@functools.lru_cache(maxsize=1024)
def _stored_seed(weights: tuple[float, ...], shape: torch.Size, device: torch.device) -> Tensor:
    with torch.inference_mode(False):
        return pinned(torch.tensor(weights).reshape(shape), device).to(device, non_blocking=True)


def loss_terms(
    model: SceneModel,
    light: EvaluatedLight,
    batch: Batch,
    ray: RenderedRays,
    scene: MeshScene | None,
    environment: Tensor | None,
    generator: torch.Generator,
    step: int,
    progress: float,
    seen: SeenLight | None = None,
) -> Terms:
    """The terms of the loss by name; the colour's term comes first.

    Args:
        ray: The rendering of the batch.
        scene: The surface as a mesh; None before the first mesh.
        environment: [h, 2h, 3] linear radiance that weighs the traced occlusion; None: no occlusion is traced.
        generator: Random numbers for the losses' subsets.
        step, progress: The number of the step, and the training's progress in [0, 1].
        seen: The light that photos show around the object; None where they show none.

    Source: SplitNeRF Eq. (3), (11), (18) and the losses below.
    """
    c, w, terms = model.config, model.config.losses, Terms()
    shapes = has_shape_priors(c, progress)
    kept = 1.0 if shapes else KEPT_SHARE
    has_priors = progress >= c.constants.priors_from
    # SplitNeRF Eq. (3) sums over the channels; `colour` is their mean.
    terms.add(
        {"colour": CHANNELS * w.colour_weight, "mask": kept * w.mask_weight or None},
        pixel_losses(
            ray.mean,
            ray.opacity,
            target=batch.target,
            background=batch.background,
            whole=batch.whole,
            exposure=batch.exposure,
            linear=ray.linear,
        ),
    )
    smoothness = (shapes and w.smoothness_weight) or None
    of_normals = gradient_losses(ray.gradients, ray.weights.detach(), ray.found.beside)
    if smoothness:
        of_normals = of_normals * prior_factors(terms["colour"].value)
    terms.add({"eikonal": kept * w.eikonal_weight, "smoothness": smoothness}, of_normals)
    terms.add(
        {"metal": w.metal_weight or None, "dark_metal": w.dark_metal_weight or None},
        material_losses(ray.points.albedo.detach(), ray.points.metallic, ray.shares),
    )
    if has_priors and w.entropy_weight:
        terms.add({"entropy": w.entropy_weight}, material_entropy_loss(ray, c, generator))
    if model.light.needs_consistency_loss and w.light_weight:
        terms.add({"light": w.light_weight}, light_loss(model.light, c, generator, step))
    if light_moves(c, step):  # once for all steps since the light last moved
        since = step % light_period(c) + 1
        if w.neutral_weight:
            terms.add({"neutral": w.neutral_weight * since}, neutral_light_loss(light, c, generator))
        if w.light_prior_weight and c.light.kind == "pyramid":
            terms.add(
                {"light_prior": w.light_prior_weight * since}, light_prior(model.light.texels, model.light.level_sizes)
            )
        if seen is not None and w.seen_weight:
            terms.add({"seen_light": w.seen_weight * since}, seen.loss(light))
    if environment is not None:
        terms.add({"occlusion": w.occlusion_weight}, occlusion_loss(ray, scene, environment, c, generator, step))
    return terms


def prior_factors(error: Tensor) -> Tensor:
    """[2] factors of the eikonal and the smoothness loss at a mean squared error [] of the colours. What the model does not explain
    counts as noise of the photos: the larger its variance, the more a prior counts beside them (Bishop 2006, Eq. (3.55)). Where
    little is explained yet, or ever, as of a metal that mirrors itself, normals would fit the noise."""
    smooth = (error / USUAL_ERROR).clamp(max=MOST_SMOOTHER)
    return torch.stack([torch.ones_like(smooth), smooth])


def light_loss(light: Light, config: Config, generator: torch.Generator, seed: int) -> Tensor:
    """Distance of g(w, rho) from the Monte Carlo integral of g(w, 0), for random directions and roughness.

    Half of the queries have rho = 1, the others a uniform rho in [0, 1]. Broad lobes share one set of light directions:
    a rotated lattice or, as published, random directions (``light_set``). A lobe below the roughness
    ``light_lobe_below`` samples its own directions from its density. The gradient flows into both sides.

    Source: SplitNeRF Eq. (11); the lobes' own directions are our addition.
    """
    c, draw = config.constants, {"generator": generator, "device": generator.device}
    queries = F.normalize(torch.randn(c.light_queries, 3, **draw), dim=1)
    if c.light_set == "fibonacci":
        directions = fibonacci_directions(c.light_samples, generator)
    else:
        directions = F.normalize(torch.randn(c.light_samples, 3, **draw), dim=1)
    roughness = torch.ones_like(queries[:, :1])
    roughness[: c.light_queries // 2] = torch.rand(c.light_queries // 2, 1, **draw).sort(0).values  # narrow lobes first
    n_narrow = int((roughness < c.light_lobe_below).sum()) if c.light_lobe_below > 0 else 0
    own = sample_ggx_lobe(queries[:n_narrow], roughness[:n_narrow], c.light_lobe_samples, seed).reshape(-1, 3)
    queried = torch.cat([directions, own, queries])
    g = light(queried, torch.cat([roughness.new_zeros(len(directions) + len(own), 1), roughness]))
    shared, lobes, prefiltered = g.split([len(directions), len(own), len(queries)])
    sums = prefilter_light(queries[n_narrow:], roughness[n_narrow:], light_dirs=directions, light=shared)
    error = prefiltered - torch.cat([lobes.view(n_narrow, c.light_lobe_samples, 3).mean(1), sums])
    if c.light_form == "square":
        return error.square().sum(-1).mean()
    return F.smooth_l1_loss(error, torch.zeros_like(error), reduction="none").sum(-1).mean()


def material_losses(albedo: Tensor, metallic: Tensor, shares: Tensor) -> Tensor:
    """Two penalties [2] on metallic m [n, 1], 0 without points: weighted means (`shares` [n]) of m^2, and of m (1 - F0 / 0.4)+,
    where F0 is the brightest channel of the linear albedo [n, 3], in [0, 1].

    Source: SplitNeRF Eq. (18), over all samples instead of a tenth. A dark metal and a black dielectric with F0 = 0.04
    look nearly alike, but no dark metals exist (Akenine-Moller et al., Real-Time Rendering, 4th ed., table 9.2).
    """
    m = metallic[:, 0]
    darkness = (1 - albedo.amax(1) / 0.4).clamp(min=0)
    penalties = torch.stack([m * m, m * darkness])
    return penalties @ (shares / shares.sum().clamp(min=1e-8))


def neutral_light_loss(light: EvaluatedLight, config: Config, generator: torch.Generator) -> Tensor:
    """Mean squared log chroma of the diffuse light g(n, 1): images of a diffuse object do not say whether a colour is
    the object's or the light's; without other evidence the light has none."""
    n = config.constants.neutral_queries
    normals = F.normalize(torch.randn(n, 3, generator=generator, device=generator.device), dim=1)
    log_light = torch.log(light(normals, torch.ones_like(normals[:, :1])) + 1e-6)
    return (log_light - log_light.mean(1, keepdim=True)).square().mean()


class SeenLight:
    """A term of the loss that holds the light near that which photos show around the object: `surroundings` [h, 2 h, 4], radiance
    and how well it is known, see :class:`splitnerf.data.dataset.Dataset`."""

    def __init__(self, surroundings: np.ndarray, device: torch.device):
        self._surroundings, self._device = surroundings, device
        self._target: Tensor | None = None

    def loss(self, light: EvaluatedLight) -> Tensor:
        """The mean over the sphere of the cost of the light's log radiance beside that of the photos, the cost of Student's t
        distribution: what stands near is not what the object sees in that direction."""
        texels = light.partition(SEEN_TEXELS, self._device)
        if self._target is None:
            radiance, known = (
                torch.from_numpy(x) for x in seen_at(self._surroundings, texels.directions.cpu().numpy())
            )
            weights = known.to(self._device) * texels.solid_angles / (4 * math.pi)
            self._target, self._weights = radiance.to(self._device).clamp(min=RADIANCE_FLOOR).log(), weights
        difference = (texels.radiance.clamp(min=RADIANCE_FLOOR).log() - self._target) / SEEN_DEVIATION
        return (torch.log1p(difference.square() / TAILS).mean(1) * self._weights).sum()


def material_entropy_loss(ray: RenderedRays, config: Config, generator: torch.Generator) -> Tensor:
    """Quadratic entropy of the materials of surface points, -ln mean exp(-|x_i - x_j|^2 / 4) over all pairs.

    Images do not determine how bright a side of the object is and how bright its light is. This loss prefers the split
    in which the object has few materials: points of similar colour and gloss attract each other, and dissimilar points do
    not. x holds log albedo, roughness and metallic, each divided by the width within which points count as similar.

    Source: Barron and Malik 2015 (SIRFS), section 4.2, for reflectance; the gloss is our addition.
    """
    c, points = config, ray.points
    weights = ray.shares
    if len(weights) == 0:
        return weights.new_zeros(())
    weights = weights.nan_to_num(0.0, 0.0, 0.0) + 1e-12  # a loss that is not finite is reported by the loss itself
    chosen = torch.multinomial(weights, c.constants.entropy_points, replacement=True, generator=generator)
    taken = points.albedo, points.roughness, points.metallic
    albedo, roughness, metallic = (x.index_select(0, chosen) for x in taken)
    gloss = torch.cat([roughness, metallic], dim=1) / c.constants.gloss_width
    x = torch.cat([torch.log(albedo + ALBEDO_FLOOR) / c.constants.albedo_width, gloss], dim=1)
    return quadratic_entropy(x)


def occlusion_loss(
    ray: RenderedRays, scene: MeshScene, environment: Tensor, config: Config, generator: torch.Generator, seed: int
) -> Tensor:
    """Weighted squared distance of the predicted occlusion factors from traced ones (SplitNeRF Eq. (12)-(16)), on a random share of
    the samples. Rays start at the samples, moved on to the surface, and are traced on the CPU; a GPU waits for them. The specular
    lobe's axis is the normal."""
    c, share = config, config.constants.occlusion_share
    chosen = (torch.rand(len(ray.shaded), generator=generator, device=generator.device) < share).nonzero().squeeze(1)
    if len(chosen) == 0:
        return ray.shares.new_zeros(())
    predicted = ray.points.occlusion_d[chosen], ray.points.occlusion_s[chosen]
    with torch.no_grad():
        normals, n_rays = ray.points.normals[chosen], c.constants.occlusion_rays
        traced = occlusion_factors(
            scene,
            ray.positions[chosen] - normals * ray.sdf[chosen, None],
            normals,
            lobe_dirs=normals,
            roughness=ray.points.roughness[chosen],
            environment=environment,
            n_diffuse_rays=n_rays,
            n_specular_rays=n_rays,
            offset=c.constants.occlusion_offset,
            seed=seed,
            n_channels=c.occlusion.channels,
        )
    error_d, error_s = ((ours - truth).square() for ours, truth in zip(predicted, traced))
    shares = ray.shares[chosen]
    return shares @ (error_d + error_s).sum(1) / (shares.sum().clamp(min=1e-8) * c.occlusion.channels)
