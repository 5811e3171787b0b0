"""What a run leaves out: measured on its last state, one skip at a time switched off."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass

import torch
from torch import Tensor

from splitnerf import losses
from splitnerf.batches import Batch, draw_batch
from splitnerf.devices import wait_for
from splitnerf.fields import VisibilityBits
from splitnerf.ops import CELL_OCCUPIED, MeshScene
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import find_samples
from splitnerf.schedule import light_moves, light_period
from splitnerf.step import batch_losses

WARM_UP, REPEATS = 1, 3
EVERYWHERE_RAYS = 32  # of the batch where no space is empty


@dataclass(frozen=True)
class Skip:
    """One line of the table.

    Attributes:
        name: Of the skip.
        unit: What is counted.
        done, possible: How many a step has with the skip and without.
        saved: Seconds a step; None where it was not timed.
    """

    name: str
    unit: str
    done: float
    possible: float
    saved: float | None

    def text(self) -> str:
        share = 100.0 * (1.0 - self.done / self.possible) if self.possible else 0.0
        time_saved = "" if self.saved is None else f", saves {1e3 * self.saved:.1f} ms a step"
        return f"{share:.1f} % of {self.possible:.4g} {self.unit} a step{time_saved}"


@dataclass(frozen=True)
class Work:
    """Of a step: seconds, and what it evaluated."""

    seconds: float
    samples: int
    asked: int
    shaded: int


def measure_skips(
    model: SceneModel, grid: OccupancyGrid, scene: MeshScene | None, source: PixelSource, n_rays: int, n_steps: int
) -> list[Skip]:
    """Times forward and backward passes of the same rays with one skip at a time switched off. Leaves no gradient.

    Args:
        model: A trained scene, whose settings say what it skips.
        grid: Its occupancy.
        scene: Its mesh.
        source: The training images.
        n_rays: Of a batch.
        n_steps: Of the whole run.
    """
    c = model.config
    generator = torch.Generator(model.device).manual_seed(0)
    batch = draw_batch(source, n_rays, c)

    def work(batch: Batch, cells: Tensor = grid.cells, **settings: object) -> Work:
        model.config = c.replace(settings)
        try:
            return timed_work(model, cells, batch, scene, generator)
        finally:
            model.config = c

    now = work(batch)
    skips = []
    everywhere = work(
        Batch(*(part[:EVERYWHERE_RAYS] for part in batch[:-1]), batch.probes),
        torch.full_like(grid.cells, CELL_OCCUPIED),
        sample_above=0.0,
    )
    all_samples = work(batch, sample_above=0.0)
    scale = n_rays / EVERYWHERE_RAYS
    saved = scale * everywhere.seconds - all_samples.seconds
    skips.append(Skip("empty space", "samples", all_samples.samples, scale * everywhere.samples, saved))
    if c.sample_above:
        skips.append(
            Skip("faint samples", "samples", now.samples, all_samples.samples, all_samples.seconds - now.seconds)
        )
    if c.shades_per_ray:
        every = work(batch, shades_per_ray=0)
        skips.append(Skip("shading", "shaded samples", now.shaded, every.shaded, every.seconds - now.seconds))
    if light_period(c) > 1:
        each = work(batch, light_step_every=1)
        skips.append(Skip("light's maps", "passes", 1.0 / light_period(c), 1.0, each.seconds - now.seconds))
    if c.light_noise and model.light.needs_consistency_loss:
        every = work(batch, light_noise=0.0)
        wanted = model.light.loss_samples.count(c.light_noise, c.light_samples)
        skips.append(Skip("light samples", "directions", wanted, c.light_samples, every.seconds - now.seconds))
    if getattr(model.occlusion, "sees_all", False):
        skips.append(Skip("occlusion, as the surface is convex", "lookups", 0.0, now.shaded, None))
    elif isinstance(model.occlusion, VisibilityBits) and model.occlusion.cache is not None:
        traced = len(model.occlusion.cache.vertices) * len(model.occlusion.directions) / 2 * (1 / c.mesh_every + 1)
        skips.append(Skip("occlusion rays", "rays", traced / n_steps, 2.0 * c.occlusion_rays * now.shaded, None))
    return skips


def timed_work(
    model: SceneModel, cells: Tensor, batch: Batch, scene: MeshScene | None, generator: torch.Generator
) -> Work:
    """The median step, averaged over the period of the light."""
    c, seconds = model.config, []
    period = light_period(c)
    model.light.collect()
    try:
        for repeat in range(WARM_UP + REPEATS):
            started = time.perf_counter()
            for step in range(period):
                found = find_samples(model, cells, *batch.rays, probes=batch.probes)
                ray, terms = batch_losses(model, batch, found, scene, None, generator, step, 1.0)
                losses.backward(terms)
                if light_moves(c, step):
                    model.light.deliver()
            wait_for(model.device)
            seconds.append((time.perf_counter() - started) / period)
    finally:
        model.light.collect(False)
        model.zero_grad(set_to_none=True)
    return Work(statistics.median(seconds[WARM_UP:]), len(ray.weights), int(ray.evaluated.sum()), len(ray.shaded))
