"""Volume rendering of a scene: from rays to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset
from splitnerf.fields import EvaluatedLight
from splitnerf.ops import composite, linear_to_srgb, march_rays, surface_weights
from splitnerf.ops.rays import PackedSamples, ShadingSubset, spread_samples
from splitnerf.ops.sdf import sample_rays
from splitnerf.render.model import SceneModel, ShadedPoints
from splitnerf.render.occupancy import DENSITY_CUTOFF, LIPSCHITZ, OccupancyGrid
from splitnerf.render.rays import image_rays

MAX_SAMPLES_PER_RAY = 1024
MIN_OPACITY = 1e-4
CHUNK = 8192  # rays of a view rendered at a time
PHASES = 1024.0
SURFACE_GAP = 2.5  # in steps; two samples farther apart may lie on two surfaces


class ProbePoints(NamedTuple):
    """Points at which the field is evaluated together with the samples of the rays.

    Attributes:
        anywhere: [k, 3] points of the box, scene units.
        chosen: [m] in [0, 1), random numbers that select the samples with a neighbour: sample floor(n chosen) of n.
        shifts: [m, 3] offsets from a sample to its neighbour, scene units.
    """

    anywhere: Tensor
    chosen: Tensor
    shifts: Tensor


class FoundSamples(NamedTuple):
    """The samples of a batch of rays, with all values that depend on their positions alone.

    The samples behind those of the last ray are padding: they belong to no ray, and their `positions` repeat those of
    the first samples, so that the field is finite there.

    Attributes:
        packed: The distances of the samples along their rays.
        rays_d: [n_rays, 3] unit directions.
        phase: [n_rays] in [0, 1), random offset of the marks that :func:`splitnerf.ops.rays.spread_samples` draws with.
        positions: [n + k + m, 3] the midpoints of the n samples with the padding, then the k + m probes, scene units.
        directions: [n, 3] unit directions of the samples' rays.
        beside: [m] int64, the samples whose neighbours the last m positions are.
        step: [] length of a sample, scene units.
        anneal: [] annealing of the cosine, in [0, 1], at which the samples were chosen.
        evaluated: [n_rays] int64, the number of points per ray at which the search evaluated the distance.
        n_found: [] int64, the number of samples that the search found; those above n are left out.
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
    n_found: Tensor


@dataclass
class RenderedRays:
    """The rendering of one batch of rays: n samples with the padding, of which n_shaded are shaded.

    Attributes:
        found: What was rendered.
        mean: [n_rays, 3] colour of the object alone, un-premultiplied, not clipped above 1. With `shading.method = summed` it
            contains the quadrature correction at each ray's heaviest sample, by the share of the weight that the sample's
            segment carries.
        linear: Whether `mean` is linear; otherwise it is sRGB.
        opacity: [n_rays] in [0, 1].
        s: [] sharpness of the density, 1 / scene units.
        weights: [n] rendering weights.
        gradients: [n + k + m, 3] d sdf / d position at all samples and probes.
        anywhere: [k] signed distances at the probes that belong to no sample, scene units.
        shaded: [n_shaded] int64, indices of the shaded samples.
        sizes: [3] int64, the numbers of shaded samples, of rays with samples and of ray segments.
        shares: [n_shaded] rendering weight that each shaded sample stands for, no gradient.
        positions: [n_shaded, 3] midpoints of the shaded samples, scene units.
        sdf: [n_shaded] signed distances, scene units.
        points: Materials, occlusion and radiance of the shaded samples.
    """

    found: FoundSamples
    mean: Tensor
    linear: bool
    opacity: Tensor
    s: Tensor
    weights: Tensor
    gradients: Tensor
    anywhere: Tensor
    shaded: Tensor
    sizes: Tensor
    shares: Tensor
    positions: Tensor
    sdf: Tensor
    points: ShadedPoints

    @property
    def colour(self) -> Tensor:
        """[n_rays, 3] `mean` in sRGB."""
        return linear_to_srgb(self.mean) if self.linear else self.mean


def sample_step(config: Config, s: float) -> float:
    """Length of a sample in scene units: proportional to the width 1/s of the density, within the configured bounds."""
    c = config.constants
    return min(max(c.step_scale / s, c.min_step), max(c.max_step, c.min_step))


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
    phase: Tensor | None = None,
    s: float | None = None,
) -> FoundSamples:
    """Finds the samples of rays that contribute to their pixels, with the current field.

    Args:
        cells: [r, r, r] uint8 cells of the occupancy grid.
        rays_o, rays_d: [n_rays, 3] origins (scene units) and unit directions.
        jitter: [n_rays] in [0, 1), offsets of the samples as shares of a sample's length.
        anneal: The annealing of the cosine: 0 at the start of a training, 1 when done.
        probes: Additional points at which the field will be evaluated, or None.
        capacity: The number of samples in the result, if positive: padding fills it up, and what exceeds it is left
            out. Where ``sampling.min_weight`` is 0, nothing is left out.
        phase: [n_rays] in [0, 1), see :class:`FoundSamples`; None: the last digits of `jitter`.
        s: The sharpness of the density; None: the model's own, for which the host waits.
    """
    c, s = model.config, model.s_value if s is None else s
    step = sample_step(c, s)
    if c.sampling.min_weight == 0:
        packed = march_rays(
            rays_o, rays_d, jitter, cells, box=c.constants.box, step=step, max_samples=MAX_SAMPLES_PER_RAY
        )
        evaluated, n_found = packed.offsets.diff(), packed.offsets[-1]
    else:
        packed, evaluated, n_found = sample_rays(
            rays_o,
            rays_d,
            jitter,
            cells,
            model.sdf_field.network(),
            step=step,
            s=s,
            anneal=anneal,
            min_weight=c.sampling.min_weight,
            min_transmittance=c.constants.min_transmittance,
            reach=DENSITY_CUTOFF / s,
            lipschitz=LIPSCHITZ,
            max_samples=MAX_SAMPLES_PER_RAY,
            capacity=capacity,
        )
    packed = packed.extended(max(0, capacity - len(packed.ray_indices)))
    probes = ProbePoints(rays_o[:0], jitter[:0], rays_o[:0]) if probes is None else probes
    positions, directions, beside = place_samples(rays_o, rays_d, packed, probes, padded=capacity > 0)
    if phase is None:  # the choice of shaded samples must not depend on their positions
        phase = (PHASES * jitter) % 1.0
    numbers = (positions.new_full((), x) for x in (step, anneal))
    return FoundSamples(packed, rays_d, phase, positions, directions, beside, *numbers, evaluated, n_found)


def place_samples(
    rays_o: Tensor, rays_d: Tensor, packed: PackedSamples, probes: ProbePoints, padded: bool
) -> tuple[Tensor, Tensor, Tensor]:
    """`positions`, `directions` and `beside` of :class:`FoundSamples`, without waiting for the number of samples. Padding repeats
    the first samples, with directions of 0; without a sample all is 0."""
    rays, t, rows = packed.ray_indices, packed.middles, len(packed.ray_indices)
    n: int | Tensor = rows
    if padded:
        n, numbers = packed.offsets[-1].clamp(max=rows), torch.arange(rows, device=rays.device)
        first = numbers % n.clamp(min=1)
        rays, t = rays[first], t[first]
    directions = rays_d.index_select(0, rays)
    middles = rays_o.index_select(0, rays) + directions * t[:, None]
    if padded:
        middles = torch.where(n > 0, middles, 0)
        directions = torch.where((numbers < n)[:, None], directions, 0)
    m = len(probes.chosen) if rows else 0
    beside = (probes.chosen[:m] * n).long().clamp(max=n - 1).clamp(min=0)
    points = middles.index_select(0, beside) + probes.shifts[:m]
    return torch.cat([middles, probes.anywhere, points]), directions, beside


def add_corrections(
    mean: Tensor, added: Tensor, at: Tensor, spread: ShadingSubset, ray_indices: Tensor, shares: Tensor, opacity: Tensor
) -> Tensor:
    """The rays' colours [n_rays, 3] with corrections `added` [m, 3] of their shaded samples `at` [m], each by the share of the ray's
    opacity that the sample's segment carries; `shares` [n_shaded] is the weight that each shaded sample stands for."""
    rays = ray_indices.index_select(0, spread.shaded.index_select(0, at))
    carried = shares.new_zeros(len(spread.representatives)).index_add(0, spread.segment, shares)
    opacity = opacity.index_select(0, rays).clamp(min=MIN_OPACITY)
    part = carried.index_select(0, spread.segment.index_select(0, at)) / opacity
    return mean.index_add(0, rays, added * part[:, None])


def render_rays(
    model: SceneModel,
    light: EvaluatedLight,
    found: FoundSamples,
    *,
    shades_per_ray: int = 0,
    capacity: tuple[int, int] | None = None,
    turns: Tensor | None = None,
) -> RenderedRays:
    """Renders rays from their samples.

    Args:
        found: The samples; the field may have changed slightly since the search.
        shades_per_ray: The approximate number of shaded samples per ray; the values of the other samples are
            interpolated. 0 shades all.
        capacity: The capacity for shaded samples and segments, see :func:`splitnerf.ops.rays.spread_samples`; with None the
            host waits for the GPU's counts. If ``sizes`` of the result exceeds the capacity, the colours have no
            meaning.
        turns: [n_rays, 3, 3] rotations of directions into the light's frame; None where the light stands still.

    Source: SplitNeRF Eq. (1)-(2), (17).
    """
    c = model.config
    samples, step, n = found.packed, found.step, len(found.directions)
    field, s = model.surface(found.positions), model.s
    normals, weights, opacity = surface_weights(
        field.outputs,
        field.gradient,
        found.rays_d,
        s,
        samples.offsets,
        step=step,
        anneal=found.anneal,
        min_transmittance=c.constants.min_transmittance,
        n_samples=n,
    )
    spread = spread_samples(weights.detach(), samples, shades_per_ray, found.phase, SURFACE_GAP, capacity, step)
    shaded = spread.shaded
    of_samples = found.positions, found.directions, normals, field.outputs, field.features
    positions, directions, normals, outputs, features = (x.index_select(0, shaded) for x in of_samples)
    view_dirs = -directions
    sdf = outputs[:, 0]
    turned = light if turns is None else light.turned(turns[samples.ray_indices.index_select(0, shaded)])
    points = model.shade(turned, positions, outputs, features, normals, view_dirs, spread)
    radiance = points.radiance if c.shading.compositing == "linear" else linear_to_srgb(points.radiance).clamp(max=1.0)
    shares = spread.gather(weights.detach())
    mean = composite(weights, spread.interpolate(radiance), samples.offsets, opacity, MIN_OPACITY)
    if model.sums_light:
        at, correction = model.quadrature_correction(
            light, view_dirs, points, spread.heaviest, None if capacity is None else spread.sizes[1]
        )
        mean = add_corrections(mean, correction, at, spread, samples.ray_indices, shares, opacity.detach())
    return RenderedRays(
        found,
        mean,
        c.shading.compositing == "linear",
        opacity,
        s,
        weights,
        field.gradient,
        field.outputs[n : len(found.positions) - len(found.beside), 0],
        shaded,
        spread.sizes,
        shares,
        positions,
        sdf,
        points,
    )


@torch.no_grad()
def render_view(
    model: SceneModel, cells: Tensor, pose: Tensor, lens: Tensor, height: int, width: int, turn: Tensor | None = None
) -> dict[str, Tensor]:
    """Renders a whole view with its maps.

    Args:
        cells: [r, r, r] uint8 cells of the occupancy grid.
        pose: [4, 4] camera-to-world, OpenGL axes, internal frame.
        lens: [4] fx, fy, cx, cy in pixels.
        height, width: The image's size in pixels.
        turn: [3, 3] the rotation of directions into the light's frame; None where the light stands still.

    Returns:
        rgb [H, W, 3] sRGB un-premultiplied in [0, 1], alpha [H, W], albedo [H, W, 3] linear, roughness, metallic,
        occlusion_d, occlusion_s [H, W], normal [H, W, 3] unit, world.
    """
    rays_o, rays_d = image_rays(pose, lens, height, width)
    light, rows = model.evaluate_light(), []
    for o, d in zip(rays_o.split(CHUNK), rays_d.split(CHUNK)):
        found = find_samples(model, cells, o, d, torch.full_like(o[:, 0], 0.5))
        ray = render_rays(model, light, found, turns=None if turn is None else turn.expand(len(o), 3, 3))
        p = ray.points
        maps = torch.cat(
            [p.albedo, p.roughness, p.metallic, p.occlusion_d.mean(1, True), p.occlusion_s.mean(1, True), p.normals], 1
        )
        weighed = ray.shares[:, None] * torch.cat([maps, torch.ones_like(maps[:, :1])], 1)
        sums = weighed.new_zeros(len(o), weighed.shape[1]).index_add(0, found.packed.ray_indices[ray.shaded], weighed)
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


def render_maps(
    model: SceneModel, grid: OccupancyGrid, dataset: Dataset, index: int, factor: int = 1
) -> dict[str, np.ndarray]:
    """All maps of one view as float32 arrays, see :func:`render_view`; smaller than its photo by a whole factor."""
    pose, intrinsics = (torch.from_numpy(x[index]).to(model.device) for x in (dataset.poses, dataset.intrinsics))
    turn = None if dataset.light_turns is None else torch.from_numpy(dataset.light_turns[index]).to(model.device)
    height, width = dataset.height // factor, dataset.width // factor
    maps = render_view(model, grid.cells, pose, intrinsics / factor, height, width, turn=turn)
    return {name: value.cpu().numpy() for name, value in maps.items()}
