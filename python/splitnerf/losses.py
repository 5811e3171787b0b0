"""The terms of the training loss."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.fields import Light
from splitnerf.ops import (
    MeshScene,
    fibonacci_directions,
    occlusion_factors,
    prefilter_light,
    quadratic_entropy,
    sample_ggx_lobe,
)
from splitnerf.render.renderer import ProbePoints, RenderedRays, normalised

SATURATED = 254.0 / 255.0
DARKEST_METAL = 0.4  # normal reflectance
OTHER_SIDE = math.sqrt(2.0)  # distance of normals beyond which a neighbour is on the other side of a thin part
SHORTEST_GRADIENT = 1e-3  # that has a direction
ALBEDO_FLOOR = 0.01  # below it albedos count as one black


def penalty(error: Tensor, form: str) -> Tensor:
    """Elementwise error^2 (`square`), or half of it that turns linear at 1 (`smooth_l1`)."""
    return error.square() if form == "square" else F.smooth_l1_loss(error, torch.zeros_like(error), reduction="none")


def weighted_mean(values: Tensor, ray: RenderedRays, chosen: Tensor | None = None) -> Tensor:
    """Mean of values [m] or [m, c] over shaded samples, the rendering weights normalised; 0 without samples.

    Args:
        values: Of the samples, per sample summed over c.
        ray: The rendered rays.
        chosen: [m] which of the shaded samples; None for all.
    """
    weights = ray.normalised_shares if chosen is None else normalised(ray.shares[chosen])
    return weights @ (values if values.dim() == 1 else values.sum(1))


def colour_loss(ray: RenderedRays, target: Tensor, background: Tensor) -> Tensor:
    """Mean squared sRGB error over the pixels, both over the same background.

    A channel that the photo clipped says only that the truth is at least as bright: there, and only
    there, the prediction is clipped too.

    Args:
        ray: The rendered rays.
        target: [n_rays, 4] sRGB, straight alpha.
        background: [n_rays, 3] sRGB.

    Source: SplitNeRF Eq. (3).
    """
    return F.mse_loss(over_background(ray.colour, ray.opacity, target, background), blended(target, background))


def monte_carlo_colour_loss(
    colours: tuple[Tensor, Tensor], ray: RenderedRays, target: Tensor, background: Tensor
) -> Tensor:
    """As :func:`colour_loss` for two independent noisy estimates: the mean product of their errors.

    Its expectation is the squared error of the mean; that of one estimate would add the noise's variance, and the
    materials would turn to whatever is less noisy. It can be negative.
    """
    truth = blended(target, background)
    opacity = ray.opacity.detach()
    first, second = (over_background(colour, opacity, target, background) - truth for colour in colours)
    return (first * second).mean()


def over_background(colour: Tensor, opacity: Tensor, target: Tensor, background: Tensor) -> Tensor:
    """[n_rays, 3] predicted pixels; where the photo is saturated the colour is clipped like it."""
    colour = torch.where(target[:, :3] >= SATURATED, colour.clamp(max=1.0), colour)
    return torch.lerp(background, colour, opacity[:, None])


def blended(target: Tensor, background: Tensor) -> Tensor:
    """[n_rays, 3] pixels of the photo over the background."""
    return torch.lerp(background, target[:, :3], target[:, 3:])


def mask_loss(ray: RenderedRays, alpha: Tensor) -> Tensor:
    """Binary cross entropy of the opacity against the mask [n_rays]. Source: NeuS Eq. (17)."""
    return F.binary_cross_entropy(ray.opacity.clamp(1e-3, 1.0 - 1e-3), alpha)


def eikonal_loss(gradients: Tensor) -> Tensor:
    """Mean (|grad f| - 1)^2; 0 without points. Source: Gropp et al. 2020."""
    return (torch.linalg.vector_norm(gradients, dim=-1) - 1.0).square().sum() / max(1, len(gradients))


def metal_loss(ray: RenderedRays, form: str = "square") -> Tensor:
    """Weighted mean of m^2 over the shaded samples. Source: SplitNeRF Eq. (18), over all samples, not a tenth."""
    return weighted_mean(penalty(ray.points.metallic.squeeze(1), form), ray)


def binary_metal_loss(ray: RenderedRays) -> Tensor:
    """Weighted mean of m (1 - m) over the shaded samples: things are of metal or not."""
    metallic = ray.points.metallic.squeeze(1)
    return weighted_mean(metallic - metallic.square(), ray)


def dark_metal_loss(ray: RenderedRays) -> Tensor:
    """Weighted mean of m (1 - F0 / .4)+ over the shaded samples, F0 the brightest channel of the albedo, taken as given.

    A dark metal and a black dielectric of F0 = .04 look nearly alike, and there are no dark metals: the common ones
    reflect half of the light and more (Akenine-Moller et al., Real-Time Rendering, 4th ed., table 9.2).
    """
    darkness = (1.0 - ray.points.albedo.detach().amax(dim=1) / DARKEST_METAL).clamp(min=0.0)
    return weighted_mean(ray.points.metallic.squeeze(1) * darkness, ray)


def light_loss(light: Light, config: Config, generator: torch.Generator, seed: int) -> Tensor:
    """Distance of g(w, rho) from the Monte Carlo integral of g(w, 0), for random directions and roughness.

    Half of the queries ask at rho = 1, the rest uniformly in [0, 1]. Broad lobes share one set of light directions, a
    rotated lattice or, as published, random ones (``light_set``); those below ``light_lobe_below`` sample their own lobe
    exactly. The gradient flows into both sides.

    Source: SplitNeRF Eq. (11).
    """
    c = config
    queries = F.normalize(torch.randn(c.light_queries, 3, generator=generator), dim=1)
    directions = light_directions(c, queries, generator)
    roughness = torch.ones(c.light_queries, 1)
    roughness[: c.light_queries // 2] = torch.rand(c.light_queries // 2, 1, generator=generator)
    narrow = roughness[:, 0] < c.light_lobe_below
    queries, roughness = torch.cat([queries[narrow], queries[~narrow]]), torch.cat([roughness[narrow], roughness[~narrow]])
    n_narrow = int(narrow.sum())
    own = sample_ggx_lobe(queries[:n_narrow], roughness[:n_narrow], c.light_lobe_samples, seed).reshape(-1, 3)
    asked = torch.cat([directions, own, queries])
    g = light(asked, torch.cat([torch.zeros(len(directions) + len(own), 1), roughness]))
    shared, lobes, prefiltered = g.split([len(directions), len(own), len(queries)])
    g_bar = torch.cat([
        lobes.view(n_narrow, c.light_lobe_samples, 3).mean(1),
        prefilter_light(queries[n_narrow:], roughness[n_narrow:], directions, shared),
    ])  # fmt: skip
    return penalty(prefiltered - g_bar, c.light_loss_form).sum(-1).mean()


def light_directions(config: Config, queries: Tensor, generator: torch.Generator) -> Tensor:
    """The directions [n, 3] that the light loss integrates over."""
    c = config
    if c.light_set == "fibonacci":
        return fibonacci_directions(c.light_samples, generator)
    uniform = F.normalize(torch.randn(c.light_samples, 3, generator=generator), dim=1)
    return torch.cat([uniform, queries]) if c.light_set == "uniform_and_queries" else uniform


def neutral_light_loss(light: Light, config: Config, generator: torch.Generator) -> Tensor:
    """Mean squared log chroma of the diffuse light g(n, 1): how far its channels are from their geometric mean.

    Images of a diffuse object leave it open whether a colour is the object's or the light's. This prefers a
    light without colour where nothing speaks against it.
    """
    normals = F.normalize(torch.randn(config.neutral_queries, 3, generator=generator), dim=1)
    log_light = torch.log(light(normals, torch.ones(len(normals), 1)) + 1e-6)
    return (log_light - log_light.mean(1, keepdim=True)).square().mean()


def draw_probes(config: Config, generator: torch.Generator) -> ProbePoints:
    """Where the eikonal loss and that of the normals' smoothness look beside the samples."""
    c = config
    n_beside = c.smoothness_points if c.normal_smoothness else 0
    return ProbePoints(
        (torch.rand(c.eikonal_points, 3, generator=generator) * 2 - 1) * c.box,
        torch.rand(n_beside, generator=generator),
        c.smoothness_radius * torch.randn(n_beside, 3, generator=generator),
    )


def normal_smoothness_loss(ray: RenderedRays) -> Tensor:
    """Mean distance of the unit normals of samples from those at points beside them, by the rendering weights.

    Of the surfaces that explain the images this prefers the one that wavers least: the distance adds up to the same
    along a smooth bend and along a sharp edge, so that edges stay. Neighbours on the other side of a thin part, whose normals
    are more than 90 degrees off, do not count.
    """
    m = len(ray.beside)
    if m == 0:
        return torch.zeros(())
    gradients = torch.cat([ray.gradients[ray.beside], ray.gradients[-m:]])
    here, there = F.normalize(gradients, dim=1, eps=SHORTEST_GRADIENT).split(m)
    apart = torch.linalg.vector_norm(there - here, dim=1)
    weights = ray.weights.detach()[ray.beside] * (apart.detach() < OTHER_SIDE)
    return normalised(weights) @ apart


def material_entropy_loss(ray: RenderedRays, config: Config, generator: torch.Generator) -> Tensor:
    """Quadratic entropy of the materials of surface points, -ln mean exp(-|x_i - x_j|^2 / 4) over all pairs.

    Images leave open how bright a side of the object is and how bright its light. This prefers the split in which few
    materials make up the object: points alike in colour and gloss draw together, and those far apart do not. x holds log
    albedo, roughness and metallic, each over the width within which points count as alike.

    Source: Barron and Malik 2015 (SIRFS), section 4.2, for reflectance; the gloss is our addition.
    """
    c, points = config, ray.points
    weights = ray.shares
    if len(weights) == 0:
        return torch.zeros(())
    chosen = torch.multinomial(weights + 1e-12, c.entropy_points, replacement=True, generator=generator)
    gloss = torch.cat([points.roughness[chosen], points.metallic[chosen]], dim=1)
    x = torch.cat([torch.log(points.albedo[chosen] + ALBEDO_FLOOR) / c.albedo_width, gloss / c.gloss_width], dim=1)
    return quadratic_entropy(x)


def occlusion_loss(
    ray: RenderedRays, scene: MeshScene, environment: Tensor, config: Config, generator: torch.Generator, seed: int
) -> Tensor:
    """Weighted squared distance of the predicted occlusion factors from traced ones, on a random share of the samples.

    The specular lobe is that about the light's direction, or, without ``occlusion_directional``, that about the normal,
    as published.

    Source: SplitNeRF Eq. (12)-(16).
    """
    c = config
    chosen = (torch.rand(len(ray.shaded), generator=generator) < c.occlusion_share).nonzero().squeeze(1)
    if len(chosen) == 0:
        return torch.zeros(())
    with torch.no_grad():
        normals = ray.normals[chosen]
        on_surface = ray.positions[chosen] - normals * ray.sdf[chosen, None]
        o_d, o_s = occlusion_factors(
            scene, on_surface, normals, ray.points.lobe_dirs[chosen] if c.occlusion_directional else normals,
            ray.points.roughness[chosen], environment, n_diffuse_rays=c.occlusion_rays, n_specular_rays=c.occlusion_rays,
            offset=c.occlusion_offset, along_ray=c.occlusion_ray_start == "ray", seed=seed, n_channels=c.occlusion_channels,
        )  # fmt: skip
    error_d, error_s = ray.points.occlusion_d[chosen] - o_d, ray.points.occlusion_s[chosen] - o_s
    error = penalty(error_d, c.occlusion_loss_form) + penalty(error_s, c.occlusion_loss_form)
    return weighted_mean(error, ray, chosen) / c.occlusion_channels
