"""The training loop: from posed images to a surface, its materials and the light."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint
from splitnerf.devices import let_segments_grow, same_bits, spare_processors, tensor_cores
from splitnerf.errors import InputError, note_once
from splitnerf.fields import EvaluatedLight
from splitnerf.ops import MeshScene
from splitnerf.progress import Interrupt, Progress
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid, visual_hull
from splitnerf.training.batches import PixelSource, draw_batch, training_photos
from splitnerf.training.checkpoint import restore, save
from splitnerf.training.exposure import PhotoExposures
from splitnerf.training.finite import check_state, explain_loss
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.losses import SeenLight
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.metrics import METRICS, StepLog, keep_metrics, write_preview
from splitnerf.training.observer import NOBODY, Event, Observer, Request
from splitnerf.training.schedule import (
    light_moves,
    light_period,
    make_optimiser,
    next_ray_count,
    progress_of,
    set_learning_rate,
)
from splitnerf.training.start import fit_to, start_shape
from splitnerf.training.step import Step, StepNumbers

ENVIRONMENT_EVERY = 16  # steps between refreshes of the light that weighs the occlusion
PAUSE = 0.1  # seconds between two questions whether a pause has ended


@dataclass
class TrainedScene:
    """The scene that a finished or interrupted training leaves in memory; `n_new` of its steps were made since it began or
    was resumed. `exposures` are the photos' [n, 3] where they were learned, else None."""

    model: SceneModel
    grid: OccupancyGrid
    scene: MeshScene | None
    step: int
    seconds: float
    finished: bool
    n_new: int
    exposures: np.ndarray | None


def train(
    dataset: Dataset, config: Config, run: Path, *, device: torch.device | str = "cpu", resume: bool = False
) -> TrainedScene:
    """Trains a scene and keeps a checkpoint, a log and previews in the run's folder.

    The schedule (learning rate, levels, annealing, meshes) follows the progress in [0, 1]: the larger of the share of
    steps done and the share of minutes used. Ctrl-C, SIGTERM and SIGHUP end the run with a checkpoint at the next step
    after which no gradients of the light are pending.

    Args:
        dataset: The train split.
        config: The run's settings; with ``resume`` pass those of the checkpoint.
        run: The run's folder; it must exist.
        device: The device of images, fields and samples; meshes are extracted and traced on the CPU.
        resume: Whether to continue from ``run/checkpoint.pt``, which any device may have written.

    Raises:
        InputError: The checkpoint belongs to another scene or cannot be read, or the settings ask for equal bits on a
            device that cannot repeat them.
        splitnerf.training.finite.Diverged: Numbers are no longer finite, by the rule in that class; the last checkpoint
            is kept.
        OSError: The disk is full; the last checkpoint is kept.
    """
    check_repeatable(config, device)
    training = Training(dataset, config, run, torch.device(device))
    training.begin(resume)
    return training.complete()


class Training:
    """A training: its scene, optimiser and schedule, and the loop over its steps.

    Args:
        dataset, config, run, device: See :func:`train`.
        observer: Learns what happens, and may request something between two steps.
    """

    def __init__(self, dataset: Dataset, config: Config, run: Path, device: torch.device, observer: Observer = NOBODY):
        c = self.config = config
        if (
            device.type == "cuda" and c.sampling.min_weight == 0 and not c.run.cuda_graphs
        ):  # each step has tensors of new sizes
            let_segments_grow()
        self.dataset, self.run, self.observer = dataset, run, observer
        self.fingerprint = dataset_fingerprint(dataset)
        torch.manual_seed(c.run.seed)
        self.generator = torch.Generator(device).manual_seed(c.run.seed)
        self.photos = training_photos(dataset, c)
        self.source = source = PixelSource(
            self.photos, c.constants.foreground_share, self.generator, c.losses.edge_pixels
        )
        self.exposures = PhotoExposures(dataset, c, device)
        self.model = SceneModel(c).to(device)
        self.optimiser = make_optimiser(self.model, c)
        self.hull = None
        if c.constants.hull_until > 0 or c.surface.start == "stereo":
            lenses = source.intrinsics / source.hull_factor
            self.hull = visual_hull(c.sampling.grid_resolution, c.constants.box, source.possible, source.poses, lenses)
        self.grid = make_grid(c, self.hull, device)
        self.mesh = SurfaceMesh(self.model, background=c.mesh.background)
        step = Step if device.type == "cpu" else GpuStep
        still = self.source.turns is None
        seen = SeenLight(dataset.surroundings, device) if still and dataset.surroundings is not None else None
        self.model.use_turns(self.source.turns)
        self.take_step = step(self.model, self.grid, self.mesh, self.generator, self.optimiser, self.exposures, seen)
        self.take_step.turns = source.turns
        self.light: EvaluatedLight | None = None  # evaluated; None after its parameters moved
        self.environment: Tensor | None = None  # the light that weighs traced occlusion
        self.step, self.seconds, self.n_rays, self.previewed_at = 0, 0.0, c.constants.initial_rays, 0.0
        self.log = StepLog(run)
        self.started, self.saved_at = time.monotonic(), 0.0  # a time of the clock, and seconds of the run
        self.first = True  # step of the run
        self.stopped = False  # the observer requested the end before the schedule does
        self.resumed_at = 0

    def begin(self, resume: bool = False) -> None:
        """Goes on from the run's checkpoint, or fits the surface to the shape that stereo finds, near which it is held at
        first."""
        c = self.config
        if resume:
            self.restore()
        elif c.surface.start == "stereo":
            note_once("the photos are compared to find a first shape")
            with same_bits(c.run.deterministic):
                self.model.open_levels(0.0)
                self.take_step.start = start = start_shape(self.photos, self.hull, c)
                if start is not None:
                    fit_to(self.model.sdf_field, start, self.generator, c)

    @property
    def progress(self) -> float:
        """The progress of the schedule, in [0, 1]."""
        return progress_of(self.config, self.step, self.seconds)

    @property
    def finished(self) -> bool:
        """Whether the run delivers what it has: at the end of the schedule, or as the observer requested."""
        return self.stopped or self.progress >= 1.0

    @property
    def may_stop(self) -> bool:
        """Whether no gradients of the light are pending."""
        return self.step % light_period(self.config) == 0

    def save(self) -> None:
        """Writes the checkpoint.

        Raises:
            Diverged: A parameter is not finite; the old checkpoint is kept.
        """
        self.settle()
        check_state(self.step, self.model, self.optimiser)
        self.saved_at = self.seconds
        save(self)

    def restore(self) -> None:
        """Restores the state from the run's checkpoint."""
        restore(self)
        self.first, self.resumed_at = self.step == 0, self.step
        self.started, self.saved_at = time.monotonic() - self.seconds, self.seconds

    def complete(self) -> TrainedScene:
        """Trains to the end of the schedule, or until a signal or the observer requests the end."""
        c = self.config
        keep_metrics(self.run / METRICS, self.step)
        self.observer(Event("begun", self))
        with (
            Interrupt() as interrupt,
            Progress(self.progress) as bar,
            same_bits(c.run.deterministic),
            tensor_cores(True),
            spare_processors(self.model.device),
            self.take_step.running(),
        ):
            if self.step:
                interrupt.attempt(self.preview_if_due)  # that an interruption left out
            while not self.finished and not (interrupt.asked and self.may_stop):
                self.refresh()
                self.advance(bar)
                interrupt.attempt(self.preview_if_due)
                if self.seconds - self.saved_at > 60.0 * c.run.checkpoint_minutes and self.may_stop:
                    self.save()
                if self.may_stop:
                    paused = self.fulfil_requests(interrupt)
                    self.started += paused
                    bar.skip(paused)
            self.finish()
        return TrainedScene(
            self.model,
            self.grid,
            self.mesh.scene,
            self.step,
            self.seconds,
            self.finished,
            self.step - self.resumed_at,
            self.exposures.found,
        )

    def refresh(self) -> None:
        """Updates what steps share: open levels, learning rates, occupied cells, the mesh, and the light on the
        mesh."""
        c, model, step, progress = self.config, self.model, self.step, self.progress
        model.open_levels(progress)
        set_learning_rate(self.optimiser, c, step, progress)
        if self.first or step % c.constants.grid_every == 0:
            use_hull = progress < c.constants.hull_until
            self.update_grid(self.take_step.s, first=self.first, step=step, use_hull=use_hull)
        if c.occlusion.kind != "off" and progress - self.mesh.asked_at >= c.mesh.every:
            check_state(step, model, self.optimiser)
            self.mesh.request(progress)
        self.mesh.poll(wait=c.run.deterministic)
        if self.light is None:
            self.light = model.evaluate_light()
        if self.mesh.scene is None:
            return
        if c.occlusion.kind == "mlp" and c.losses.occlusion_weight > 0:
            if self.environment is None or step % ENVIRONMENT_EVERY == 0:
                self.environment = model.light.panorama(c.constants.occlusion_environment_height)
        if step % ENVIRONMENT_EVERY == 0:
            model.weigh_occlusion(self.light)
        if c.occlusion.indirect and step % c.constants.indirect_every == 0:
            model.refresh_indirect(self.light)

    def update_grid(self, s: float | None = None, **how: int | bool) -> None:
        """Classes the grid's cells again, see :meth:`splitnerf.render.occupancy.OccupancyGrid.update`; without `s` for the
        model's own sharpness."""
        self.grid.update(self.model.sdf_field.sdf, self.model.s_value if s is None else s, **how)

    def advance(self, bar: Progress) -> None:
        """Makes one step: draws rays, takes gradients, moves parameters."""
        batch = draw_batch(self.source, self.n_rays, self.config, self.exposures.factors)
        read = self.take_step(batch, self.light, self.environment, self.step, self.progress)
        if light_moves(self.config, self.step):
            self.light = None
        self.step, self.first = self.step + 1, False
        self.settle(read, bar)

    def settle(self, read: Iterable[StepNumbers] | None = None, bar: Progress | None = None) -> None:
        """Does what follows from the numbers of steps; without `read`, of all that are not read yet.

        Raises:
            Diverged: A loss is not finite.
        """
        for numbers in self.take_step.unread() if read is None else read:
            if numbers.complete and not math.isfinite(numbers.loss):
                newest = self.take_step.newest
                raise explain_loss(numbers.step - 1, numbers.values, self.dataset, self.model, *newest)
            if numbers.n_rays == self.n_rays:  # else the newest count was chosen while this step was on its way
                self.n_rays = next_ray_count(self.n_rays, numbers.counts.samples, self.config)
            self.seconds = time.monotonic() - self.started
            others = {"is_unoccluded": self.model.is_unoccluded, "skipped": self.take_step.skipped}
            due = self.log.take(numbers, self.seconds, self.progress, **others)
            if bar is not None:
                bar.show(self.progress, self.log.text(numbers))
            if due:
                self.write_log()

    def write_log(self) -> None:
        """Adds the line of the last step read to metrics.jsonl, if it is not there yet."""
        if self.log.pending is not None:
            if self.model.device.type == "cpu":
                check_state(self.step, self.model, self.optimiser)
            self.observer(Event("logged", self, line=self.log.write()))

    def preview_if_due(self) -> None:
        """Writes a preview where the last one is old enough."""
        if self.progress - self.previewed_at >= self.config.run.preview_every:
            picture = write_preview(self.run, self.model, self.grid, self.dataset, self.step)
            self.previewed_at = self.progress
            self.observer(Event("previewed", self, path=picture))

    def fulfil_requests(self, interrupt: Interrupt) -> float:
        """Does what the observer requests between two steps; a signal to end ends a pause, too. Returns a pause's
        seconds."""
        paused = 0.0
        while not (interrupt.asked or self.stopped) and (request := self.observer(Event("step", self))):
            self.settle()
            if request is Request.SAVE:
                self.save()
            elif request is Request.STOP:
                self.stopped = True
            else:
                clock = time.monotonic()
                time.sleep(PAUSE)
                paused += time.monotonic() - clock
        return paused

    def finish(self) -> None:
        """Logs the last step, updates grid and mesh to the final surface, unless the run was interrupted, and writes the
        last checkpoint."""
        self.settle()
        self.optimiser.zero_grad(set_to_none=True)
        self.write_log()
        self.mesh.poll(wait=self.finished)
        if self.finished and self.config.occlusion.kind == "bits":
            self.mesh.request(self.progress)
            self.mesh.poll(wait=True)
        if self.finished:
            self.update_grid()
        self.save()


def check_repeatable(config: Config, device: torch.device | str) -> None:
    """Raises InputError where the settings ask for equal bits on a device whose sums have no fixed order."""
    if config.run.deterministic and torch.device(device).type != "cpu":
        raise InputError("a deterministic run needs the CPU, as a GPU adds in any order; leave out --device")
