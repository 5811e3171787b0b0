"""The training loop: from posed images to a surface, its materials and the light."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint
from splitnerf.devices import let_segments_grow, same_bits, spare_processors, tensor_cores
from splitnerf.errors import InputError
from splitnerf.fields import EvaluatedLight
from splitnerf.notes import note_once
from splitnerf.ops import MeshScene
from splitnerf.progress import Interrupt, Progress
from splitnerf.refinement.job import STATE
from splitnerf.render.averages import training_photos
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid, visual_hull
from splitnerf.render.rays import PixelSource
from splitnerf.render.seen import Cameras
from splitnerf.training.batches import draw_batch
from splitnerf.training.checkpoint import (
    load_checkpoint,
    restore_generator,
    restore_model,
    restore_optimiser,
    restored_grid,
    save_checkpoint,
)
from splitnerf.training.exposure import PhotoExposures
from splitnerf.training.finite import check_state, explain_loss
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.losses import SeenLight
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.metrics import METRICS, add_metrics, keep_metrics, write_preview
from splitnerf.training.observer import Observer, Observers, heed
from splitnerf.training.schedule import (
    light_moves,
    light_period,
    make_optimiser,
    next_ray_count,
    progress_of,
    set_learning_rate,
)
from splitnerf.training.start import HELD_UNTIL, StartShape, fit_to, start_shape
from splitnerf.training.step import Step, StepNumbers

LOG_EVERY = 20  # steps between lines of metrics.jsonl; the first steps and the last one are all logged
ENVIRONMENT_EVERY = 16  # steps between refreshes of the light that weighs the occlusion


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
    return begin_training(dataset, config, run, torch.device(device), resume=resume).complete()


def begin_training(
    dataset: Dataset, config: Config, run: Path, device: torch.device, *, resume: bool = False,
    observers: Sequence[Observer] = (),
) -> Training:  # fmt: skip
    """A training that goes on from the run's checkpoint or begins; the arguments are those of :func:`train` and
    :class:`Training`."""
    training = Training(dataset, config, run, device, observers)
    if resume:
        training.restore()
    elif config.surface.start == "stereo":
        note_once("the photos are compared to find a first shape")
        training.start_from_photos()
    return training


class Training:
    """A training: its scene, optimiser and schedule, with the state that a checkpoint stores.

    Args:
        dataset, config, run, device: See :func:`train`.
        observers: Who looks on.
    """

    def __init__(
        self, dataset: Dataset, config: Config, run: Path, device: torch.device, observers: Sequence[Observer] = ()
    ):
        c = self.config = config
        if device.type == "cuda" and c.sampling.min_weight == 0 and not c.run.cuda_graphs:  # each step has tensors of new sizes
            let_segments_grow()
        self.dataset, self.run, self.observers = dataset, run, Observers(observers)
        self.fingerprint = dataset_fingerprint(dataset)
        torch.manual_seed(c.run.seed)
        self.generator = torch.Generator(device).manual_seed(c.run.seed)
        self.photos = training_photos(dataset, c)
        self.source = source = PixelSource(self.photos, c.constants.foreground_share, self.generator, c.losses.edge_pixels)
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
        seen = None if dataset.surroundings is None else SeenLight(dataset.surroundings, device)
        self.take_step = step(self.model, self.grid, self.mesh, self.generator, self.optimiser, self.exposures, seen)
        self.light: EvaluatedLight | None = None  # evaluated; None after its parameters moved
        self.environment: Tensor | None = None  # the light that weighs traced occlusion
        self.step, self.seconds, self.n_rays, self.previewed_at = 0, 0.0, c.constants.initial_rays, 0.0
        self.psnr_mean: float | None = None
        self.unlogged: dict[str, object] | None = None  # the line of the last step read, while metrics.jsonl lacks it
        self.started, self.saved_at = time.monotonic(), 0.0  # a time of the clock, and seconds of the run
        self.first = True  # step of the run
        self.stopped = False  # an observer asked to end before the schedule does
        self.resumed_at = 0

    def restore(self) -> None:
        """Restores the state from the run's checkpoint."""
        path = self.run / "checkpoint.pt"
        content = load_checkpoint(path)
        check_same_scene(content, self.fingerprint, self.run)
        restore_model(self.model, content, path)
        restore_optimiser(self.optimiser, content, path)
        restore_generator(self.generator, content, path)
        self.grid.values, self.grid.cells = restored_grid(self.grid, content, path)
        self.model.light.loss_samples.restore(content["light_noise"].tolist())
        if content["environment"] is not None:
            self.environment = content["environment"].to(self.grid.device)
        for name in ("step", "seconds", "n_rays", "previewed_at", "psnr_mean"):
            setattr(self, name, content[name])
        # A run that was stopped for its export goes on with the export's refinement; one that has it trains on.
        self.stopped = content["stopped"] and (self.run / STATE).is_file()
        if self.exposures.learned:
            self.exposures.restore(content["exposures"])
        if content.get("start") is not None:
            tensors = {name: x.to(self.grid.device) for name, x in content["start"].items()}
            self.take_step.start = StartShape(box=self.config.constants.box, **tensors)
        self.model.open_levels(self.progress)
        self.mesh.restore(content)
        if content["occlusion_light"]:
            self.model.occlusion.restore_light(content["occlusion_light"])
        self.first, self.resumed_at = self.step == 0, self.step
        self.started, self.saved_at = time.monotonic() - self.seconds, self.seconds

    def start_from_photos(self) -> None:
        """Fits the surface to the shape that stereo finds, near which it is held at first."""
        with same_bits(self.config.run.deterministic):
            self.model.open_levels(0.0)
            self.take_step.start = start = start_shape(self.photos, self.hull, self.config)
            if start is not None:
                fit_to(self.model.sdf_field, start, self.generator, self.config)

    def complete(self) -> TrainedScene:
        """Trains to the end of the schedule, or until a signal or an observer asks to stop."""
        c = self.config
        keep_metrics(self.run / METRICS, self.step)
        self.observers.began(self)
        with (
            Interrupt() as interrupt, Progress(self.progress) as bar, same_bits(c.run.deterministic),
            tensor_cores(True), spare_processors(self.model.device), self.take_step.running(),
        ):  # fmt: skip
            if self.step:
                interrupt.attempt(self.preview_if_due)  # that an interruption left out
            while not self.finished and not (interrupt.asked and self.may_stop):
                self.refresh()
                self.advance(bar)
                interrupt.attempt(self.preview_if_due)
                if self.seconds - self.saved_at > 60.0 * c.run.checkpoint_minutes and self.may_stop:
                    self.save()
                if self.may_stop:
                    paused = heed(self, interrupt)
                    self.started += paused
                    bar.skip(paused)
            self.finish()
        return self.result()

    def save(self) -> None:
        """Writes the checkpoint."""
        self.settle()
        check_state(self.step, self.model, self.optimiser)
        self.saved_at = self.seconds
        save_checkpoint(
            self.run / "checkpoint.pt", config=self.config, fingerprint=self.fingerprint,
            state=dict(
                step=self.step, seconds=self.seconds, n_rays=self.n_rays, previewed_at=self.previewed_at, stopped=self.stopped,
                psnr_mean=self.psnr_mean, exposures=self.exposures.sums, model=self.model.state_dict(),
                optimiser={"state": self.optimiser.state_dict()["state"]},  # the rates are those of settings and step
                device=self.generator.device.type, generator=self.generator.get_state(),
                torch_generator=torch.get_rng_state(), occupancy=self.grid.values, cells=self.grid.cells,
                environment=self.environment, light_noise=self.model.light.loss_samples.state(),
                occlusion_light=self.model.occlusion.cached_light(),
                box_from_world=torch.from_numpy(self.dataset.box_from_world), start=self.start_state(), **self.mesh.state(),
                cameras=Cameras.of(self.dataset)._asdict(),
            ),
        )  # fmt: skip

    def start_state(self) -> dict[str, Tensor] | None:
        """The run's start, as long as the surface is held near it."""
        start = self.take_step.start
        if start is None or self.progress >= HELD_UNTIL:
            return None
        return {"distance": start.distance, "trust": start.trust}

    @property
    def progress(self) -> float:
        """The progress of the schedule, in [0, 1]."""
        return progress_of(self.config, self.step, self.seconds)

    @property
    def finished(self) -> bool:
        """Whether the run delivers what it has: at the end of the schedule, or as an observer asked."""
        return self.stopped or self.progress >= 1.0

    @property
    def may_stop(self) -> bool:
        """Whether no gradients of the light are pending."""
        return self.step % light_period(self.config) == 0

    def refresh(self) -> None:
        """Updates what steps share: open levels, learning rates, occupied cells, the mesh, and the light on the
        mesh."""
        c, model, step, progress = self.config, self.model, self.step, self.progress
        model.open_levels(progress)
        set_learning_rate(self.optimiser, c, step, progress)
        if self.first or step % c.constants.grid_every == 0:
            use_hull = progress < c.constants.hull_until
            self.update_grid(self.take_step.s, first=self.first, step=step, use_hull=use_hull)
        if model.occlusion.needs_mesh and progress - self.mesh.asked_at >= c.mesh.every:
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
            model.occlusion.set_light(self.light)
        if c.occlusion.indirect and step % c.constants.indirect_every == 0:
            model.refresh_indirect(self.light)

    def update_grid(self, s: float | None = None, **how: int | bool) -> None:
        """Classes the grid's cells again, see :meth:`splitnerf.render.occupancy.OccupancyGrid.update`; without `s` for the
        model's own sharpness."""
        self.grid.update(self.model.sdf_field.sdf, self.model.s_value if s is None else s, **how)

    def advance(self, bar: Progress) -> None:
        """Makes one step: draws rays, takes gradients, moves parameters."""
        c = self.config
        batch = draw_batch(self.source, self.n_rays, c, self.exposures.factors)
        read = self.take_step(batch, self.light, self.environment, self.step, self.progress)
        if light_moves(c, self.step):
            self.light = None
        self.step, self.first = self.step + 1, False
        self.settle(read, bar)

    def preview_if_due(self) -> None:
        """Writes a preview where the last one is old enough."""
        if self.progress - self.previewed_at >= self.config.run.preview_every:
            picture = write_preview(self.run, self.model, self.grid, self.dataset, self.step)
            self.previewed_at = self.progress
            self.observers.previewed(picture, self.step)

    def settle(self, read: Iterable[StepNumbers] | None = None, bar: Progress | None = None) -> None:
        """Does what follows from the numbers of steps; without `read`, of all that are not read yet.

        Raises:
            Diverged: A loss is not finite.
        """
        for numbers in self.take_step.unread() if read is None else read:
            if numbers.complete:
                if not math.isfinite(numbers.loss):
                    newest = self.take_step.newest
                    raise explain_loss(numbers.step - 1, numbers.values, self.dataset, self.model, *newest)
                psnr = -10.0 * math.log10(max(numbers.values["colour"], 1e-10))
                self.psnr_mean = psnr if self.psnr_mean is None else 0.95 * self.psnr_mean + 0.05 * psnr
            if numbers.n_rays == self.n_rays:  # else the newest count was chosen while this step was on its way
                self.n_rays = next_ray_count(self.n_rays, numbers.counts.samples, self.config)
            self.seconds = time.monotonic() - self.started
            if bar is not None:
                bar.show(self.progress, self.told(numbers.step, numbers.evaluated / numbers.n_rays))
            self.unlogged = self.line(numbers)
            if numbers.step % LOG_EVERY == 0 or numbers.step <= LOG_EVERY:
                self.log()

    def log(self) -> None:
        """Adds the line of the last step read to metrics.jsonl, if it is not there yet."""
        if self.unlogged is None:
            return
        if self.model.device.type == "cpu":
            check_state(self.step, self.model, self.optimiser)
        add_metrics(self.run / METRICS, self.unlogged)
        self.observers.logged(self.unlogged)
        self.unlogged = None

    def told(self, step: int, samples_per_ray: float) -> str:
        """What the bar tells of a step: its number, the batches' mean PSNR in dB and the samples per ray."""
        psnr = "" if self.psnr_mean is None else f"PSNR {self.psnr_mean:.2f} dB, "
        return f"step {step} {psnr}{samples_per_ray:.1f} samples/ray"

    def line(self, numbers: StepNumbers) -> dict[str, object]:
        """The values of one line of metrics.jsonl, by name."""
        n_rays, evaluated = numbers.n_rays, max(1, numbers.evaluated)
        return {
            "step": numbers.step, "seconds": round(self.seconds, 3), "progress": self.progress, "loss": numbers.loss,
            **{f"loss_{name}": weight * numbers.values[name] for name, weight in numbers.weights.items()},
            "psnr": self.psnr_mean, "rays": n_rays, "samples_per_ray": numbers.evaluated / n_rays,
            "kept": numbers.counts.samples / evaluated, "shaded": numbers.counts.shaded / evaluated,
            "s": numbers.s, "is_unoccluded": self.model.occlusion.is_unoccluded, "skipped": self.take_step.skipped,
        }  # fmt: skip

    def finish(self) -> None:
        """Logs the last step, updates grid and mesh to the final surface, unless the run was interrupted, and writes the
        last checkpoint."""
        self.settle()
        self.optimiser.zero_grad(set_to_none=True)
        self.log()
        self.mesh.poll(wait=self.finished)
        if self.finished and self.config.occlusion.kind == "bits":
            self.mesh.request(self.progress)
            self.mesh.poll(wait=True)
        if self.finished:
            self.update_grid()
        self.save()

    def result(self) -> TrainedScene:
        """The scene as the training leaves it in memory."""
        return TrainedScene(
            self.model, self.grid, self.mesh.scene, self.step, self.seconds, self.finished, self.step - self.resumed_at,
            self.exposures.found,
        )  # fmt: skip


def check_repeatable(config: Config, device: torch.device | str) -> None:
    """Raises InputError where the settings ask for equal bits on a device whose sums have no fixed order."""
    if config.run.deterministic and torch.device(device).type != "cpu":
        raise InputError("a deterministic run needs the CPU, as a GPU adds in any order; leave out --device")


def check_same_scene(content: dict, fingerprint: str, run: Path) -> None:
    """Raises InputError where a checkpoint was trained on other images."""
    if content["fingerprint"] != fingerprint:
        raise InputError(
            f"{run / 'checkpoint.pt'}: was trained on other images, or with another --downscale or --eval-mode; give those, or "
            "another --out"
        )
