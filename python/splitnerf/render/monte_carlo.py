"""Shading without the split: light from directions drawn by the BSDF, past the mesh, for the last part of a training."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from splitnerf.fields.light import lobe_roughness
from splitnerf.ops import (
    MeshScene,
    composite,
    linear_to_srgb,
    monte_carlo_light,
    sample_bsdf,
    shade_sums,
    trace_visibility,
)
from splitnerf.render.model import SceneModel
from splitnerf.render.renderer import MIN_OPACITY, RenderedRays


def monte_carlo_radiance(
    model: SceneModel,
    scene: MeshScene,
    positions: Tensor,
    normals: Tensor,
    view_dirs: Tensor,
    albedo: Tensor,
    roughness: Tensor,
    metallic: Tensor,
    seed: int,
) -> Tensor:
    """Outgoing radiance of surface points towards the camera, an unbiased estimate up to the light's filter.

    The materials are those of the split sum: Schlick's Fresnel term, energy compensation, and the diffuse share that the
    specular lobe leaves. The light is asked at the roughness whose lobe covers a sample's solid angle, which trades
    noise for blur. Directions, visibility and that roughness count as given; the rest is differentiable.

    Args:
        model: The scene; its light and settings are used.
        scene: The mesh that blocks.
        positions, normals, view_dirs: [n, 3].
        albedo: [n, 3]. roughness, metallic: [n, 1].
        seed: Of the directions.

    Returns:
        [n, 3] linear.

    Source: SplitNeRF Eq. (4)-(6); filtered importance sampling: Krivanek and Colbert 2008.
    """
    c, k = model.config, model.config.finetune_samples
    with torch.no_grad():
        directions, pdf = sample_bsdf(normals, view_dirs, roughness, k, seed)
        facing = torch.where((normals * view_dirs).sum(-1, keepdim=True) < 0, -normals, normals)
        origins = (positions + c.occlusion_offset * facing)[:, None].expand_as(directions)
        above = pdf.flatten() > 0
        lit = torch.zeros_like(above)
        lit[above] = trace_visibility(scene, origins.reshape(-1, 3)[above], directions.reshape(-1, 3)[above])
        lit = lit.nonzero().squeeze(1)
        filter_roughness = lobe_roughness(1.0 / (k * pdf.flatten()[lit]))[:, None]
    light = model.light(directions.reshape(-1, 3)[lit], filter_roughness)
    radiance = torch.zeros_like(directions).view(-1, 3).index_copy(0, lit, light).view_as(directions)
    sums = monte_carlo_light(normals, view_dirs, roughness, directions, pdf, radiance)
    return shade_sums(normals, view_dirs, albedo, roughness, metallic, sums, c.compensate)


def monte_carlo_colours(
    model: SceneModel, scene: MeshScene, ray: RenderedRays, view_dirs: Tensor, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Two independent estimates of the rays' colours, [n_rays, 3] sRGB as :attr:`RenderedRays.colour`.

    Each ray shades one of its samples, drawn by weight; the split sum, held fixed, stands in for the others (a control
    variate). The gradient flows to materials and light alone: the surface would be roughened by its noise, and follows
    the split sum's colours instead.
    """
    weights = ray.shares
    rays = ray.samples.ray_indices[ray.shaded]
    key = torch.log(weights) - torch.log(
        -torch.log(torch.rand(len(weights), generator=generator, device=weights.device).clamp(1e-7, 1 - 1e-7))
    )
    best = torch.full_like(ray.opacity, -math.inf).scatter_reduce(0, rays, key, "amax")
    drawn = (key == best[rays]).nonzero().squeeze(1)
    rays, points = rays[drawn], ray.points
    on_surface = (ray.positions[drawn] - ray.normals[drawn] * ray.sdf[drawn, None]).detach()
    fixed = points.radiance[drawn].detach()
    opacity = ray.opacity.detach().clamp(min=MIN_OPACITY)[:, None]
    mean = composite(ray.weights.detach(), ray.values.detach(), ray.samples.offsets) / opacity
    colours = []
    for _ in range(2):
        seed = int(torch.randint(1 << 31, (), generator=generator, device=generator.device))
        radiance = monte_carlo_radiance(
            model, scene, on_surface, ray.normals[drawn].detach(), view_dirs[rays], points.albedo[drawn], points.roughness[drawn],
            points.metallic[drawn], seed,
        )  # fmt: skip
        colours.append(linear_to_srgb(mean.index_add(0, rays, radiance - fixed)))
    return colours[0], colours[1]
