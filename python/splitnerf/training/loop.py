"""Training: from posed images to a surface, its materials and the light. Reads top to bottom."""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from splitnerf.training import losses
from splitnerf.training.batches import Batch, draw_batch
from splitnerf.training.checkpoint import (
    load_checkpoint,
    restore_generator,
    restore_model,
    restore_optimiser,
    restored_occupancy,
    save_checkpoint,
)
from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, dataset_fingerprint
from splitnerf.devices import tensor_cores
from splitnerf.errors import InputError
from splitnerf.training.finite import GradientWatch, check_state, explain_loss
from splitnerf.training.graphs import StepGraphs, records_graphs
from splitnerf.training.losses import Term
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.ops import MeshScene
from splitnerf.training.optimiser import make_optimiser, set_learning_rate
from splitnerf.outputs import write_preview
from splitnerf.training.progress import Interrupt, Progress
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid, make_grid, visual_hull
from splitnerf.render.rays import PixelSource
from splitnerf.render.renderer import FoundSamples, RenderedRays, find_samples
from splitnerf.training.repeatable import same_bits
from splitnerf.training.schedule import cosine_anneal, light_moves, light_period, next_ray_count
from splitnerf.training.step import batch_losses, decided

LOG_EVERY = 20  # steps between lines of metrics.jsonl; the first ones are logged one by one
ENVIRONMENT_EVERY = 16  # steps between refreshes of the light that weighs the occlusion rays


@dataclass
class TrainedScene:
    """What a finished (or interrupted) training leaves in memory."""

    model: SceneModel
    grid: OccupancyGrid
    scene: MeshScene | None
    n_rays: int
    step: int
    seconds: float
    finished: bool


def train(
    dataset: Dataset, config: Config, run: Path, *, device: torch.device | str = "cpu", resume: bool = False
) -> TrainedScene:
    """Trains a scene and keeps a checkpoint, a log and previews in the run's folder.

    The schedule (learning rate, levels, annealing, meshes) follows the progress: the share of steps
    done or of minutes used, whichever is more. Ctrl-C ends the run with a checkpoint, after the current step or when
    the light moves next.

    Args:
        dataset: The train split.
        config: Settings; with ``resume`` those of the checkpoint are meant to be passed.
        run: The run's folder, which exists.
        device: Where images, fields and samples are; meshes are made and traced on the CPU.
        resume: Continue from ``run/checkpoint.pt``, whatever device wrote it.

    Raises:
        InputError: The checkpoint belongs to another scene or cannot be read, or the device cannot repeat its bits.
        splitnerf.training.finite.Diverged: Numbers are no longer finite, by the rule that stands there; the last checkpoint stands.
        OSError: The disk is full; the last checkpoint stands.
    """
    c = config
    check_repeatable(c, device)
    torch.manual_seed(c.seed)
    generator = torch.Generator(device).manual_seed(c.seed)
    fingerprint = dataset_fingerprint(dataset)
    source = PixelSource(dataset, c.foreground_share, generator)
    model = SceneModel(c).to(device)
    optimiser = make_optimiser(model, c)
    hull = None
    if c.hull_until > 0:
        hull = visual_hull(c.grid_resolution, c.box, source.masks, source.poses, source.intrinsics)
    grid = make_grid(c, hull, device)
    mesh = SurfaceMesh(model, background=c.background_meshes)
    graphs = StepGraphs(model, generator, c.target_samples, on=c.cuda_graphs and records_graphs(model.device))
    environment: Tensor | None = None
    step, seconds, n_rays, previewed_at = 0, 0.0, c.initial_rays, 0.0

    if resume:
        path = run / "checkpoint.pt"
        content = load_checkpoint(path)
        check_same_scene(content, fingerprint, run)
        restore_model(model, content, path)
        restore_optimiser(optimiser, content, path)
        restore_generator(generator, content, path)
        grid.values = restored_occupancy(grid.values, content, path)
        step, seconds, n_rays, previewed_at = (content[key] for key in ("step", "seconds", "n_rays", "previewed_at"))

    def save() -> None:
        check_state(step, model, optimiser)
        save_checkpoint(
            run / "checkpoint.pt",
            config=c,
            fingerprint=fingerprint,
            state=dict(
                step=step, seconds=seconds, n_rays=n_rays, previewed_at=previewed_at,
                model=model.state_dict(), optimiser=optimiser.state_dict(), device=generator.device.type,
                generator=generator.get_state(), torch_generator=torch.get_rng_state(), occupancy=grid.values,
                box_from_world=torch.from_numpy(dataset.box_from_world), **mesh.state(),
            ),
        )  # fmt: skip

    def progress_now() -> float:
        by_time = seconds / (60.0 * c.max_minutes) if c.max_minutes > 0 else 0.0
        return min(1.0, max(step / c.steps, by_time))

    if resume:
        model.open_levels(progress_now())
        mesh.restore(content)
    model.light.collect()
    light_steps = light_period(c)
    started, saved_at, first = time.monotonic() - seconds, time.monotonic(), True
    psnr_mean = samples_mean = None
    watch = GradientWatch(model.parameters())
    log = open(run / "metrics.jsonl", "a")
    with (
        log, Interrupt() as interrupt, Progress(progress_now()) as bar, same_bits(c.deterministic),
        tensor_cores(c.tensor_cores), graphs.stream(),
    ):  # fmt: skip
        while (progress := progress_now()) < 1.0 and not (interrupt.asked and step % light_steps == 0):
            model.open_levels(progress)
            set_learning_rate(optimiser, c, step, progress)
            if first or step % c.grid_every == 0:
                grid.update(
                    model.sdf_field.sdf, model.s_value, first=first, step=step, use_hull=progress < c.hull_until
                )
            if model.occlusion is not None and progress - mesh.asked_at >= c.mesh_every:
                check_state(step, model, optimiser)
                mesh.renew(progress)
            mesh.arrive(wait=c.deterministic)
            scene = mesh.scene
            traces = scene is not None and c.occlusion == "mlp" and c.occlusion_weight > 0
            if traces and (environment is None or step % ENVIRONMENT_EVERY == 0):
                environment = model.light.panorama(c.environment_height)
            if scene is not None and step % ENVIRONMENT_EVERY == 0:
                model.refresh_light()
            if c.indirect and scene is not None and step % c.indirect_every == 0:
                model.refresh_indirect()

            batch = draw_batch(source, n_rays, c)
            anneal = cosine_anneal(c, progress)
            found = find_samples(model, grid.cells, *batch.rays, anneal, batch.probes, room=graphs.capacity)

            def differentiate(
                given: tuple[Batch, FoundSamples], room: tuple[int, int] | None
            ) -> tuple[RenderedRays, dict[str, Term]]:
                traced = environment if traces else None
                ray, terms = batch_losses(model, *given, scene, traced, generator, step, progress, room)
                optimiser.zero_grad(set_to_none=True)
                losses.backward(terms)
                return ray, terms

            ray, terms = graphs(decided(model, mesh, step, progress), differentiate, (batch, found))
            if light_moves(c, step):
                model.light.deliver()
            numbers = torch.stack([*(term.value.detach() for term in terms.values()), watch.largest()])
            counts = torch.cat([ray.samples.offsets[-1:], ray.evaluated.sum()[None], ray.sizes])
            read = torch.cat([numbers, counts]).tolist()  # waits for the device
            *values, largest, n_samples, n_evaluated, n_shaded, _, n_stretches = read
            loss = sum(term.weight * value for term, value in zip(terms.values(), values))
            fitted = graphs.fits(n_shaded, n_stretches)
            if fitted and not math.isfinite(loss):
                raise explain_loss(step, dict(zip(terms, values)), dataset, batch, model, ray)
            if fitted and watch.allows(step, largest):
                optimiser.step()

            n_rays = next_ray_count(n_rays, n_samples, c)
            step, first, seconds = step + 1, False, time.monotonic() - started
            psnr = -10.0 * math.log10(max(values[0], 1e-10))
            if fitted:
                psnr_mean = psnr if psnr_mean is None else 0.95 * psnr_mean + 0.05 * psnr
            samples_mean = n_evaluated / len(batch.target)
            bar.show(progress_now(), step, psnr_mean, samples_mean)
            if step % LOG_EVERY == 0 or step <= LOG_EVERY or progress_now() >= 1.0:
                check_state(step, model, optimiser)
                log.write(json.dumps({
                    "step": step, "seconds": round(seconds, 3), "progress": progress_now(), "loss": loss,
                    **{f"loss_{name}": term.weight * value for (name, term), value in zip(terms.items(), values)},
                    "psnr": psnr_mean,
                    "rays": len(batch.target), "samples_per_ray": samples_mean,
                    "kept": n_samples / max(1, n_evaluated), "shaded": n_shaded / max(1, n_evaluated),
                    "s": model.s_value, "sees_all": getattr(model.occlusion, "sees_all", False),
                    "skipped": watch.skipped + graphs.thrown_away,
                }) + "\n")  # fmt: skip
                log.flush()
            if progress_now() - previewed_at >= c.preview_every:
                previewed_at = progress_now()
                write_preview(run, model, grid, dataset, step)
            if time.monotonic() - saved_at > 60.0 * c.checkpoint_minutes and step % light_steps == 0:
                save()
                saved_at = time.monotonic()
        optimiser.zero_grad(set_to_none=True)
        check_state(step, model, optimiser)
        finished = progress_now() >= 1.0
        mesh.arrive(wait=finished)
        if finished and c.occlusion == "bits":  # what is rendered from here on sees the final surface
            mesh.renew(1.0)
            mesh.arrive(wait=True)
        model.light.collect(False)
        grid.update(model.sdf_field.sdf, model.s_value)
        save()
    return TrainedScene(model, grid, mesh.scene, n_rays, step, seconds, finished)


def check_repeatable(config: Config, device: torch.device | str) -> None:
    """Raises InputError where a run shall have the same bits on a device that adds in any order."""
    if config.deterministic and torch.device(device).type != "cpu":
        raise InputError("a deterministic run needs the CPU, as a GPU adds in any order; leave out --device")


def check_same_scene(content: dict, fingerprint: str, run: Path) -> None:
    """Raises InputError where a checkpoint was trained on other images."""
    if content["fingerprint"] != fingerprint:
        raise InputError(
            f"{run / 'checkpoint.pt'}: was trained on other images or another --downscale; give those, or another --out"
        )
