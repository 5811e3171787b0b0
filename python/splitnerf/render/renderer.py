"""Volume rendering of a scene: from rays to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.config import Config
from splitnerf.fields import EvaluatedLight, RaySegments
from splitnerf.ops import (
    PackedSamples,
    composite,
    linear_to_srgb,
    march_rays,
    sample_rays,
    spread_samples,
    surface_weights,
)
from splitnerf.render.model import SceneModel, ShadedPoints
from splitnerf.render.occupancy import DENSITY_CUTOFF, LIPSCHITZ
from splitnerf.render.rays import image_rays

MIN_OPACITY = 1e-4
PHASES = 1024.0
SURFACE_GAP = 2.5  # samples farther apart, in steps, may be of two surfaces


class ProbePoints(NamedTuple):
    """Points at which the field is asked for along with the samples of the rays, in one go.

    Attributes:
        anywhere: [k, 3].
        chosen: [m] in [0, 1), which of the samples get a neighbour.
        shifts: [m, 3] from there to the neighbour.
    """

    anywhere: Tensor
    chosen: Tensor
    shifts: Tensor


class FoundSamples(NamedTuple):
    """The samples of a batch of rays, and all that follows from where they are.

    n is at least the capacity that was asked for. Samples past those of the last ray belong to no ray; in their place
    `positions` repeats the first ones, so that the field is finite there.

    Attributes:
        packed: Where on the rays they are.
        rays_d: [n_rays, 3] unit.
        phase: [n_rays] in [0, 1), random: where the marks begin by which samples are drawn to be shaded.
        positions: [n + k + m, 3] of the n samples in their middles, and of the probes.
        directions: [n, 3] of their rays.
        beside: [m] the samples whose neighbours the last m are.
        step: [] length of a sample, scene units.
        anneal: [] of the cosine by which they were chosen.
        evaluated: [n_rays] int64, points at which the distance was asked for to find them.
    """

    packed: PackedSamples
    rays_d: Tensor
    phase: Tensor
    positions: Tensor
    directions: Tensor
    beside: Tensor
    step: Tensor
    anneal: Tensor
    evaluated: Tensor


@dataclass
class RenderedRays:
    """What one batch of rays leaves behind.

    Attributes:
        mean: [n_rays, 3] colour of the object alone, un-premultiplied, not clipped above 1.
        linear: Whether that is linear, or sRGB.
        opacity: [n_rays].
        samples: The packed samples.
        evaluated: [n_rays] int64, points at which the distance was asked for.
        weights: [n].
        values: [n, 3] what is composited: radiance of the split sum, linear or sRGB as `compositing` says. With `shading =
            summed` the colour has, beside their composite, what the sum adds at each ray's heaviest sample.
        gradients: [n + k + m, 3] d sdf / d position of all samples and probes.
        beside: [m] the samples whose neighbours the last m are.
        shaded: [m] indices of the samples that were shaded.
        sizes: [3] int64, how many samples were shaded, rays have samples, stretches of rays share what is seen from them.
        shares: [m] how much of their ray's colour they are, no gradient.
        positions: [m, 3] of the shaded samples, on the level set through the sample.
        normals: [m, 3].
        sdf: [m].
        points: Their materials and light.
    """

    mean: Tensor
    linear: bool
    opacity: Tensor
    samples: PackedSamples
    evaluated: Tensor
    weights: Tensor
    values: Tensor
    gradients: Tensor
    beside: Tensor
    shaded: Tensor
    sizes: Tensor
    shares: Tensor
    positions: Tensor
    normals: Tensor
    sdf: Tensor
    points: ShadedPoints

    @property
    def colour(self) -> Tensor:
        """[n_rays, 3] the same in sRGB."""
        return linear_to_srgb(self.mean) if self.linear else self.mean


def sample_step(config: Config, s: float) -> float:
    """Length of a sample: it follows the width 1/s of the density, within the configured bounds."""
    return min(
        max(config.sampling.step_scale / s, config.sampling.min_step),
        max(config.sampling.max_step, config.sampling.min_step),
    )


@torch.no_grad()
def find_samples(
    model: SceneModel,
    cells: Tensor,
    rays_o: Tensor,
    rays_d: Tensor,
    jitter: Tensor,
    anneal: float = 1.0,
    probes: ProbePoints | None = None,
    capacity: int = 0,
) -> FoundSamples:
    """The samples that pixels are made of, by the field as it stands.

    Args:
        model: The scene.
        cells: [r, r, r] uint8 occupancy.
        rays_o, rays_d: [n_rays, 3]; directions unit.
        jitter: [n_rays] in [0, 1).
        anneal: Of the cosine, 0 at the start, 1 when done.
        probes: More points at which the field will be wanted.
        capacity: The fewest samples of the result; what is missing is filled with samples of no ray.
    """
    c, s = model.config, model.s_value
    step = sample_step(c, s)
    if c.sampling.min_weight == 0:
        packed = march_rays(rays_o, rays_d, jitter, cells, c.surface.box, step, c.sampling.max_samples_per_ray)
        evaluated = packed.offsets.diff()
    else:
        packed, evaluated = sample_rays(
            rays_o, rays_d, jitter, cells, model.sdf_field.network(), step=step, s=s, anneal=anneal,
            min_weight=c.sampling.min_weight, min_transmittance=c.sampling.min_transmittance,
            reach=DENSITY_CUTOFF / s, lipschitz=LIPSCHITZ,
            max_samples=c.sampling.max_samples_per_ray,
        )  # fmt: skip
    directions = rays_d[packed.ray_indices]
    positions = rays_o[packed.ray_indices] + directions * packed.middles[:, None]
    beside = torch.empty(0, dtype=torch.int64, device=positions.device)
    if probes is not None:
        beside = (probes.chosen * len(positions)).long() if len(positions) else beside
        neighbours = positions[beside] + probes.shifts[: len(beside)]
        again, n, n_more = [], len(positions), capacity - len(positions)
        if n_more > 0:
            packed, directions = packed.extended(n_more), F.pad(directions, (0, 0, 0, n_more))
            which = torch.arange(n_more, device=positions.device) % max(n, 1)
            again = [positions[which] if n else positions.new_zeros(n_more, 3)]
        positions = torch.cat([positions, *again, probes.anywhere, neighbours])
    phase = (PHASES * jitter) % 1.0  # where samples stand shall not decide which are shaded
    numbers = (positions.new_full((), x) for x in (step, anneal))
    return FoundSamples(packed, rays_d, phase, positions, directions, beside, *numbers, evaluated)


def render_rays(
    model: SceneModel, light: EvaluatedLight, found: FoundSamples, *, shades_per_ray: int = 0,
    capacity: tuple[int, int] | None = None,
) -> RenderedRays:  # fmt: skip
    """Renders rays from their samples.

    Args:
        model: The scene.
        light: Its light as it stands.
        found: The samples; the field may have moved a little since.
        shades_per_ray: Samples of a ray that are shaded, about; others are interpolated. 0 shades all.
        capacity: See :func:`splitnerf.ops.spread_samples`; None waits for a GPU to count. Where it is exceeded ``sizes`` tells
            so, and the colours have no meaning.

    Source: SplitNeRF Eq. (1)-(2), (17).
    """
    c = model.config
    samples, step, n = found.packed, found.step, len(found.directions)
    field = model.surface(found.positions)
    sdf = field.sdf[:n]
    normals, weights, opacity = surface_weights(
        sdf,
        field.gradient[:n],
        found.rays_d,
        model.s,
        samples.offsets,
        step=step,
        anneal=found.anneal,
        min_transmittance=c.sampling.min_transmittance,
    )

    spread = spread_samples(weights.detach(), samples, shades_per_ray, found.phase, SURFACE_GAP * step, capacity)
    shaded = spread.shaded
    positions, view_dirs = found.positions[shaded], -found.directions[shaded]
    # The gradient of index_select is a sum; that of indexing sorts on a GPU.
    normals, outputs, features = (x.index_select(0, shaded) for x in (normals, field.outputs, field.features))
    sdf = outputs[:, 0]
    segments = RaySegments(spread.leaders, spread.stretch)
    points = model.shade(light, positions, outputs, features, normals, view_dirs, segments)
    radiance = points.radiance if c.shading.compositing == "linear" else linear_to_srgb(points.radiance).clamp(max=1.0)
    values, shares = spread.interpolate(radiance), spread.gather(weights.detach())
    mean = composite(weights, values, samples.offsets) / opacity.clamp(min=MIN_OPACITY)[:, None]
    if model.sums_light:
        on_surface = positions - normals.detach() * sdf.detach()[:, None]
        at, correction = model.quadrature_correction(
            light,
            on_surface,
            normals,
            view_dirs,
            points,
            spread.heaviest,
            None if capacity is None else spread.sizes[1],
        )
        mean = mean.index_add(0, samples.ray_indices[shaded[at]], correction)
    return RenderedRays(
        mean, c.shading.compositing == "linear", opacity, samples, found.evaluated, weights, values, field.gradient,
        found.beside,
        shaded, spread.sizes, shares, positions, normals, sdf, points,
    )  # fmt: skip


@torch.no_grad()
def render_view(
    model: SceneModel, cells: Tensor, pose: Tensor, intrinsics: Tensor, height: int, width: int, chunk: int = 8192
) -> dict[str, Tensor]:
    """Renders a whole view with its maps.

    Returns:
        rgb [H, W, 3] sRGB un-premultiplied in [0, 1], alpha [H, W], albedo [H, W, 3] linear, roughness, metallic,
        occlusion_d, occlusion_s [H, W], normal [H, W, 3] unit, world.
    """
    rays_o, rays_d = image_rays(pose, intrinsics, height, width)
    light, rows = model.evaluate_light(), []
    for o, d in zip(rays_o.split(chunk), rays_d.split(chunk)):
        ray = render_rays(model, light, find_samples(model, cells, o, d, torch.full_like(o[:, 0], 0.5)))
        p = ray.points
        maps = torch.cat(
            [p.albedo, p.roughness, p.metallic, p.occlusion_d.mean(1, True), p.occlusion_s.mean(1, True), ray.normals],
            1,
        )
        weighed = ray.shares[:, None] * torch.cat([maps, torch.ones_like(maps[:, :1])], 1)
        sums = weighed.new_zeros(len(o), weighed.shape[1]).index_add(0, ray.samples.ray_indices[ray.shaded], weighed)
        mean = sums[:, :-1] / sums[:, -1:].clamp(min=MIN_OPACITY)
        rows.append(torch.cat([ray.colour.clamp(0, 1), ray.opacity[:, None], mean], 1))
    image = torch.cat(rows).view(height, width, -1)
    return {
        "rgb": image[..., :3],
        "alpha": image[..., 3],
        "albedo": image[..., 4:7],
        "roughness": image[..., 7],
        "metallic": image[..., 8],
        "occlusion_d": image[..., 9],
        "occlusion_s": image[..., 10],
        "normal": torch.nn.functional.normalize(image[..., 11:14], dim=-1),
    }
