"""The training loop: from posed images to a surface, its materials and the light."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint
from splitnerf.devices import let_segments_grow, same_bits, spare_processors, tensor_cores
from splitnerf.errors import note_once
from splitnerf.fields import EvaluatedLight
from splitnerf.progress import Interrupt, Progress
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import make_grid
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
    progress_by,
    set_learning_rate,
)
from splitnerf.training.start import COMPARED_FROM, StartShape, fit_to, start_shape
from splitnerf.training.step import Step, StepNumbers

# Steps of a first shape that is not sure, and of a sphere beside it: the first of which a lead counts, the fewest that tell, and the most.
# The decibels by which a shape may be behind, and those that it must lead by, to be told before the most are made; the steps over
# which a lead is the mean; the share of the run's time or steps that both may take.
FIRST_LEAD, FEWEST_TRIED, MOST_TRIED, BEHIND, AHEAD, LED, TRIED_SHARE = 200, 500, 1000, 0.5, 1.0, 100, 0.3
PAUSE = 0.1  # seconds between two questions whether a pause has ended


class Training:
    """The training of a scene.

    The schedule (learning rate, levels, annealing, meshes) follows the progress in [0, 1]: the larger of the share of
    steps done and the share of minutes used. Ctrl-C, SIGTERM and SIGHUP end the run with a checkpoint at the next step
    after which no gradients of the light are pending.

    Args:
        dataset: The train split.
        config: The run's settings; those of the checkpoint in a run that goes on.
        run: The run's folder, for a checkpoint, a log and previews; it must exist.
        device: The device of images, fields and samples; meshes are extracted and traced on the CPU.
        observer: Learns what happens, and may request something between two steps.

    Attributes:
        step, seconds: The steps made and the time that they took, with those before the run was resumed.
        resumed_at: The step at which the run was resumed, or 0.
        model, grid, mesh: The scene, its occupancy grid and its newest mesh.
        light: The evaluated light; None after its parameters moved.
        stopped: Whether the observer requested the end.
    """

    def __init__(self, dataset: Dataset, config: Config, run: Path, device: torch.device, observer: Observer = NOBODY):
        c = self.config = config
        if device.type == "cuda" and not (c.sampling.min_weight > 0 or c.run.cuda_graphs):  # tensors of ever new sizes
            let_segments_grow()
        self.dataset, self.fingerprint, self.run, self.observer = dataset, dataset_fingerprint(dataset), run, observer
        torch.manual_seed(c.run.seed)
        self.generator = torch.Generator(device).manual_seed(c.run.seed)
        self.photos = training_photos(dataset, c)
        self.source = PixelSource(self.photos, c.constants.foreground_share, self.generator, c.losses.edge_pixels)
        self.exposures = PhotoExposures(dataset, c, device)
        self.model = SceneModel(c).to(device)
        self.optimiser = make_optimiser(self.model, c)
        self.grid = make_grid(c, device)
        self.mesh = SurfaceMesh(self.model, background=c.mesh.background)
        self.model.use_turns(self.source.turns)
        is_seen = dataset.surroundings is not None and self.source.turns is None
        seen = SeenLight(dataset.surroundings, device) if is_seen else None
        step = Step if device.type == "cpu" else GpuStep
        self.take_step = step(self.model, self.grid, self.mesh, self.generator, self.optimiser, self.exposures, seen)
        self.light: EvaluatedLight | None = None
        self.progress_at, self.stopped = progress_by(c), False
        self.step = self.resumed_at = 0
        self.seconds, self.n_rays, self.previewed_at, self.log = 0.0, c.constants.initial_rays, 0.0, StepLog(run)
        self.started, self.saved_at = time.monotonic(), 0.0  # a time of the clock, and seconds of the run

    def start_from(self, shape: StartShape) -> None:
        """Begins with a shape, to which the levels of the field that are open at first are fitted."""
        self.model.open_levels(0.0)
        fit_to(self.model.sdf_field, shape, self.generator, self.config)
        self.take_step.start = shape

    @property
    def progress(self) -> float:
        """The progress of the schedule, in [0, 1]."""
        return self.progress_at(self.step, self.seconds)

    @property
    def finished(self) -> bool:
        """Whether the run delivers what it has: at the end of its schedule, or as the observer requested."""
        return self.stopped or self.progress >= 1.0

    @property
    def may_stop(self) -> bool:
        """Whether no gradients of the light are pending."""
        return self.step % light_period(self.config) == 0

    def save(self) -> None:
        """Writes the checkpoint. Raises Diverged where a parameter is not finite; the old checkpoint is kept."""
        self.settle()
        check_state(self.step, self.model, self.optimiser)
        self.saved_at = self.seconds
        save(self)

    def restore(self) -> None:
        """Restores the state from the run's checkpoint."""
        restore(self)
        self.resumed_at, self.saved_at = self.step, self.seconds
        self.started = time.monotonic() - self.seconds

    def complete(self) -> None:
        """Trains to the end of the schedule, or until a signal or the observer requests the end. Raises
        :class:`splitnerf.training.finite.Diverged` where numbers are no longer finite, by the rule there, and OSError where the
        disk is full; the last checkpoint is kept."""
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
                    self.fulfil_requests(interrupt, bar)
            self.finish()

    def refresh(self) -> None:
        """Updates what steps share: open levels, learning rates, occupied cells, the mesh, and the light on the mesh."""
        c, model, progress, step = self.config, self.model, self.progress, self.step
        model.open_levels(progress)
        set_learning_rate(self.optimiser, c, step, progress)
        if step % c.constants.grid_every == 0:
            s = model.s_value if self.take_step.s is None else self.take_step.s
            self.grid.update(model.sdf_field.sdf, s, first=step == 0, step=step)
        if c.occlusion.kind != "off" and progress - self.mesh.asked_at >= c.mesh.every:
            check_state(step, model, self.optimiser)
            self.mesh.request(progress)
        self.mesh.poll(wait=c.run.deterministic)
        if self.light is None:
            self.light = model.evaluate_light()
        self.mesh.light_up(self.light, step)

    def advance(self, bar: Progress) -> None:
        """Makes one step: draws rays, takes gradients, moves parameters."""
        batch = draw_batch(self.source, self.n_rays, self.config, self.exposures.factors)
        read = self.take_step(batch, self.light, self.step, self.progress)
        if light_moves(self.config, self.step):
            self.light = None
        self.step += 1
        self.settle(read, bar)

    def settle(self, read: Iterable[StepNumbers] | None = None, bar: Progress | None = None) -> None:
        """Does what follows from the numbers of steps; without `read`, of all that are not read yet. Raises Diverged where a loss
        is not finite."""
        for numbers in self.take_step.unread() if read is None else read:
            if numbers.complete and not math.isfinite(numbers.loss):
                raise explain_loss(numbers.step - 1, numbers.values, self.model, *self.take_step.newest)
            if numbers.n_rays == self.n_rays:  # else the newest count was chosen while this step was on its way
                self.n_rays = next_ray_count(self.n_rays, numbers.counts.samples, self.config)
            self.seconds = time.monotonic() - self.started
            others = {"is_unoccluded": self.model.is_unoccluded, "skipped": self.take_step.skipped}
            if self.log.take(numbers, self.seconds, self.progress, **others):
                self.write_log()
            if bar is not None:
                bar.show(self.progress, self.log.text(numbers))

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

    def fulfil_requests(self, interrupt: Interrupt, bar: Progress) -> None:
        """Does what the observer requests between two steps; a signal to end ends a pause, too."""
        while not (interrupt.asked or self.stopped) and (request := self.observer(Event("step", self))):
            self.settle()
            if request is Request.SAVE:
                self.save()
            elif request is Request.STOP:
                self.stopped = True
            else:
                clock = time.monotonic()
                time.sleep(PAUSE)
                paused = time.monotonic() - clock
                self.started += paused
                bar.skip(paused)

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
            self.grid.update(self.model.sdf_field.sdf, self.model.s_value)
        self.save()


def begun(
    dataset: Dataset, config: Config, run: Path, device: torch.device, observer: Observer = NOBODY, resume: bool = False
) -> Training:
    """A training that goes on from the run's checkpoint, or begins with the shape that stereo finds, near which it is held at
    first. A shape that the photos are not clear about is tried. Arguments as of :class:`Training`."""
    training, c = Training(dataset, config, run, device, observer), config
    if resume:
        training.restore()
    elif c.surface.start == "stereo" and not 0 < c.training_minutes < COMPARED_FROM:
        note_once("the photos are compared to find a first shape")
        with same_bits(c.run.deterministic):
            shape = start_shape(training.photos, training.source.hull(c), c)
            if shape is not None and shape.is_sure:
                training.start_from(shape)
            elif shape is not None:
                note_once("the first shape is not clear; some hundred steps from it and from a sphere are compared")
                other = Training(dataset, config, run, device, observer)
                other.start_from(shape)
                training = better_of(training, other)
    return training


def better_of(sphere: Training, other: Training) -> Training:
    """Of two trainings before their first step the one that goes on: the first one unless the other explains the photos better
    after a thousand steps, or as much better as steps are missing where there is no time for these. What it has gained since
    :data:`FIRST_LEAD` counts once more: a wrong shape leads at first, and loses its lead."""
    c, run, observer, found = sphere.config, sphere.run, sphere.observer, []
    n_steps = max(1, min(MOST_TRIED, int(0.5 * TRIED_SHARE * c.run.steps)))
    ends = time.monotonic() + (TRIED_SHARE * 60.0 * c.training_minutes or math.inf)
    other.started, lead, n = sphere.started, 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        for each in (sphere, other):  # the run's folder may still hold an earlier run
            each.observer, each.log.path = NOBODY, Path(folder) / METRICS
        while n < n_steps and time.monotonic() < ends and (n < FEWEST_TRIED or -BEHIND < lead < AHEAD):
            for each in (sphere, other):
                with each.take_step.running():
                    each.refresh()
                    each.advance(None)
            found.append((other.log.psnr or 0.0) - (sphere.log.psnr or 0.0))
            n = len(found)
            now, first = (float(np.mean(found[max(0, end - LED) : end])) for end in (n, min(n, FIRST_LEAD)))
            lead = 2 * now - first
        is_better = n >= min(FEWEST_TRIED, n_steps) and lead > AHEAD * (1.0 - n / n_steps)
        better = other if is_better else sphere
        better.settle()
    better.observer, better.log.path = observer, run / METRICS
    return better
