"""What a training consists of: its scene, optimiser and schedule, with the state that a checkpoint stores."""

from __future__ import annotations

import time
from pathlib import Path

import torch
from torch import Tensor

from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint
from splitnerf.devices import let_segments_grow, same_bits
from splitnerf.errors import note_once
from splitnerf.fields import EvaluatedLight
from splitnerf.refinement.refine import STATE
from splitnerf.render.averages import training_photos
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import make_grid, visual_hull
from splitnerf.render.rays import PixelSource
from splitnerf.render.seen import Cameras
from splitnerf.training.checkpoint import (
    check_same_scene,
    load_checkpoint,
    restore_generator,
    restore_model,
    restore_optimiser,
    restored_grid,
    save_checkpoint,
)
from splitnerf.training.exposure import PhotoExposures
from splitnerf.training.finite import check_state
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.losses import SeenLight
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.metrics import StepLog
from splitnerf.training.observer import NOBODY, Observer
from splitnerf.training.schedule import light_period, make_optimiser, progress_of
from splitnerf.training.start import HELD_UNTIL, StartShape, fit_to, start_shape
from splitnerf.training.step import Step


class TrainingState:
    """The parts of a training: its scene, optimiser and schedule, with the state that a checkpoint stores.

    Args:
        dataset, config, run, device: See :func:`splitnerf.training.loop.train`.
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
        """Writes the checkpoint."""
        self.settle()
        check_state(self.step, self.model, self.optimiser)
        self.saved_at = self.seconds
        held = self.take_step.start if self.progress < HELD_UNTIL else None
        save_checkpoint(
            self.run / "checkpoint.pt",
            config=self.config,
            fingerprint=self.fingerprint,
            state=dict(
                step=self.step,
                seconds=self.seconds,
                n_rays=self.n_rays,
                previewed_at=self.previewed_at,
                stopped=self.stopped,
                psnr_mean=self.log.psnr,
                exposures=self.exposures.sums,
                model=self.model.state_dict(),
                optimiser={"state": self.optimiser.state_dict()["state"]},  # the rates are those of settings and step
                device=self.generator.device.type,
                generator=self.generator.get_state(),
                torch_generator=torch.get_rng_state(),
                occupancy=self.grid.values,
                cells=self.grid.cells,
                environment=self.environment,
                light_noise=self.model.light.loss_samples.state(),
                box_from_world=torch.from_numpy(self.dataset.box_from_world),
                start=None if held is None else held.state(),
                cameras=Cameras.of(self.dataset)._asdict(),
                light_turns=self.source.turns,
                **self.mesh.state(),
            ),
        )

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
        for name in ("step", "seconds", "n_rays", "previewed_at"):
            setattr(self, name, content[name])
        self.log.psnr = content["psnr_mean"]
        # A run that was stopped for its export goes on with the export's refinement; one that has it trains on.
        self.stopped = content["stopped"] and (self.run / STATE).is_file()
        if self.exposures.learned:
            self.exposures.restore(content["exposures"])
        if content.get("start") is not None:
            tensors = {name: x.to(self.grid.device) for name, x in content["start"].items()}
            self.take_step.start = StartShape(box=self.config.constants.box, **tensors)
        self.model.open_levels(self.progress)
        self.mesh.restore(content)
        self.first, self.resumed_at = self.step == 0, self.step
        self.started, self.saved_at = time.monotonic() - self.seconds, self.seconds
