"""A batch from its first scene to its last."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from splitnerf.errors import plain
from splitnerf.training.metrics import METRICS, read_metrics

from splitnerf_tools.batch.child import Outcome, Work, train_scene
from splitnerf_tools.batch.cluster import GB, Share
from splitnerf_tools.batch.scenes import DONE, FAILED, LOGS, REFUSED, STOPPED, WAITING, Scene, keep_scenes

LOOK = 1.0  # seconds between polls of the tasks
REFUSAL, INTERRUPTION = 2, 130  # exit codes of the command line


@dataclass(frozen=True)
class BatchPlan:
    """The plan of a call.

    Attributes:
        out: The batch's folder.
        scenes: All scenes of the folder.
        requested: The scenes of this call.
        options: The options of `splitnerf train`.
        retries: How often a scene whose process was killed is restarted.
        row: Called with each scene that ended.
        note: Called with a line on an event.
    """

    out: Path
    scenes: list[Scene]
    requested: list[Scene]
    options: list[str]
    retries: int
    row: Callable[[Scene], None]
    note: Callable[[str], None]


def run_batch(ray: ModuleType, batch: BatchPlan, share: Share) -> bool:
    """Trains the scenes, each as a task of Ray's; a finished run is left alone by `train --resume auto` itself. Returns whether all
    came to an end; False where a signal to end came. All processes have ended then, each with its state saved."""
    options = list(batch.options)
    if not any(option.startswith("--max-memory") for option in options):
        options.append(f"--max-memory={share.photos:g}")
    task = ray.remote(train_scene).options(
        num_cpus=share.cores, num_gpus=share.gpus, memory=int(share.memory * GB), max_retries=0
    )
    tasks = {}

    def begin(scene: Scene, attempt: int = 1) -> None:
        run, log = (batch.out / scene.name).absolute(), (batch.out / LOGS / f"{scene.name}.log").absolute()
        tasks[task.remote(Work(scene.data, str(run), options, share.threads, str(log)))] = scene, attempt

    def end(reference: object, stopping: bool) -> None:
        scene, attempt = tasks.pop(reference)
        outcome = outcome_of(ray, reference)
        killed = not outcome.stopped and outcome.code is not None and (outcome.code < 0 or outcome.code == INTERRUPTION)
        if killed and not stopping and attempt <= batch.retries:
            retry = f"retry {attempt} of {batch.retries}"
            batch.note(f"{scene.name}: {outcome.error}; it continues from its last checkpoint, {retry}")
            return begin(scene, attempt + 1)
        conclude(scene, batch.out / scene.name, outcome, stopping)
        keep_scenes(batch.out, batch.scenes)
        batch.row(scene)

    try:
        for scene in batch.requested:
            scene.state, scene.error, scene.scores = WAITING, "", {}
            begin(scene)
        keep_scenes(batch.out, batch.scenes)
        while tasks:
            for reference in ray.wait(list(tasks), timeout=LOOK)[0]:
                end(reference, stopping=False)
        return True
    except KeyboardInterrupt:
        batch.note("ends; each scene at work saves its state")
        for reference in tasks:
            ray.cancel(reference)
        while tasks:
            for reference in ray.wait(list(tasks), timeout=LOOK)[0]:
                end(reference, stopping=True)
        return False


def outcome_of(ray: ModuleType, reference: object) -> Outcome:
    """The outcome of a task; a task that Ray lost counts as killed."""
    errors = ray.exceptions
    try:
        return ray.get(reference)
    except errors.TaskCancelledError:
        return Outcome(None, "", True)
    except errors.OutOfMemoryError:
        return Outcome(-signal.SIGKILL, "ran out of memory (--memory-per-scene)", False)
    except (errors.WorkerCrashedError, errors.NodeDiedError, errors.ObjectLostError):
        return Outcome(-signal.SIGKILL, "its worker was killed", False)
    except errors.RayError as error:  # of the task itself: the machine lacks the package, or cannot write
        lines = [line for line in str(error).splitlines() if line.strip()]
        return Outcome(1, plain((lines or [type(error).__name__])[-1]), False)


def conclude(scene: Scene, run: Path, outcome: Outcome, stopping: bool) -> None:
    """Records the outcome of a scene."""
    last = (read_metrics(run / METRICS) or [{}])[-1]
    scene.steps, scene.minutes = last.get("step"), last.get("seconds", 0.0) / 60
    if outcome.code == 0:
        scene.state = DONE
        scene.read_scores(run)
    elif outcome.stopped or stopping:
        scene.state = STOPPED if (run / "checkpoint.pt").is_file() else WAITING
    else:
        scene.state, scene.error = REFUSED if outcome.code == REFUSAL else FAILED, outcome.error
