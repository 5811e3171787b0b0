"""A batch from its first scene to its last: what is left to do, who does it, and what is told of it."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from splitnerf.errors import plain
from splitnerf.files import LOCK, atomic_path
from splitnerf.workflow import is_finished
from splitnerf_tools.batch.child import Outcome, Work, train_scene
from splitnerf_tools.batch.cluster import GB, Share
from splitnerf_tools.batch.scenes import DONE, FAILED, LOGS, REFUSED, STOPPED, TABLE, WAITING, Scene, fingerprint, keep_scenes
from splitnerf_tools.batch.table import markdown, scores_of, shortened

LOOK = 1.0  # seconds between looks at the runs
TRAINING = 0.8  # of a scene's work; the rest is its refinement and its scores
NAMED = 4  # scenes at work
TAIL = 4096  # bytes that hold the last line of metrics.jsonl
REFUSAL, INTERRUPTION = 2, 130  # exit codes of the command line


@dataclass(frozen=True)
class Batch:
    """What a call is to do.

    Attributes:
        out: The batch's folder.
        scenes: All scenes that the folder knows.
        asked: Those of this call.
        options: Of `splitnerf train`.
        retries: How often a scene whose process was killed is begun again.
        again: Whether scenes that were refused are tried though their files are the same.
    """

    out: Path
    scenes: list[Scene]
    asked: list[Scene]
    options: list[str]
    retries: int
    again: bool

    def left(self) -> list[Scene]:
        """The scenes that something is to be done for; of others, what was found stands."""
        return [scene for scene in self.asked if not self._stands(scene)]

    def _stands(self, scene: Scene) -> bool:
        if scene.options != self.options:
            return False
        if scene.state == DONE:
            return is_finished(self.out / scene.name)
        return scene.state == REFUSED and not self.again and scene.fingerprint == fingerprint(scene.data)

    def keep(self) -> None:
        """Writes the table, and what the next call needs to know."""
        keep_scenes(self.out, self.scenes)
        with atomic_path(self.out / TABLE) as temporary:
            temporary.write_text(markdown(self.scenes), encoding="utf-8", errors="backslashreplace")


@dataclass(frozen=True)
class Told:
    """Who is told what: `row` of a scene that ended, `note` of what happened to one, `show` of the share of all work that is
    done and of who is at work."""

    row: Callable[[Scene], None]
    note: Callable[[str], None]
    show: Callable[[float, str], None]


def run_batch(ray: ModuleType, batch: Batch, left: Sequence[Scene], share: Share, told: Told) -> bool:
    """Trains the scenes that are left, each as a task of Ray's.

    Returns:
        Whether all came to an end; False where a signal to end came. All processes have ended then, each with its state
        saved.
    """
    options = list(batch.options)
    if not any(option.startswith("--max-memory") for option in options):
        options.append(f"--max-memory={share.photos:g}")
    task = ray.remote(train_scene).options(
        num_cpus=share.cores, num_gpus=share.gpus, memory=int(share.memory * GB), max_retries=0
    )
    tasks, watch = {}, Watch(batch)

    def begin(scene: Scene) -> None:
        run, log = (batch.out / scene.name).absolute(), (batch.out / LOGS / f"{scene.name}.log").absolute()
        scene.attempts += 1
        tasks[task.remote(Work(scene.data, str(run), options, share.threads, str(log)))] = scene

    def end(reference: object, stopping: bool) -> None:
        scene = tasks.pop(reference)
        outcome = outcome_of(ray, reference)
        killed = not outcome.stopped and outcome.code is not None and (outcome.code < 0 or outcome.code == INTERRUPTION)
        if killed and not stopping and scene.attempts <= batch.retries:
            told.note(f"{scene.name}: {outcome.error}; it goes on from its last checkpoint, retry {scene.attempts} of {batch.retries}")
            return begin(scene)
        conclude(scene, batch.out / scene.name, outcome, stopping)
        batch.keep()
        told.row(scene)

    try:
        for scene in left:
            scene.begin(batch.options)
            begin(scene)
        batch.keep()
        while tasks:
            told.show(*watch.look(tasks.values()))
            for reference in ray.wait(list(tasks), timeout=LOOK)[0]:
                end(reference, stopping=False)
        return True
    except KeyboardInterrupt:
        told.note("ends; each scene at work saves its state")
        for reference in tasks:
            ray.cancel(reference)
        while tasks:
            for reference in ray.wait(list(tasks), timeout=LOOK)[0]:
                end(reference, stopping=True)
        return False


def outcome_of(ray: ModuleType, reference: object) -> Outcome:
    """What a task found; where Ray lost it, as if its process had been killed."""
    errors = ray.exceptions
    try:
        return ray.get(reference)
    except errors.TaskCancelledError:
        return Outcome(None, "", True)
    except errors.OutOfMemoryError:
        return Outcome(-signal.SIGKILL, "was ended for want of memory (--memory-per-scene)", False)
    except (errors.WorkerCrashedError, errors.NodeDiedError, errors.ObjectLostError):
        return Outcome(-signal.SIGKILL, "its worker was killed", False)
    except errors.RayError as error:  # of the task itself: the machine lacks the package, or cannot write
        lines = [line for line in str(error).splitlines() if line.strip()]
        return Outcome(1, plain((lines or [type(error).__name__])[-1]), False)


def conclude(scene: Scene, run: Path, outcome: Outcome, stopping: bool) -> None:
    """Puts down what became of a scene."""
    line = last_line(run)
    scene.steps, scene.minutes = line.get("step"), line.get("seconds", 0.0) / 60
    if outcome.code == 0:
        scene.state, scene.error = DONE, ""
        scene.scores, minutes = scores_of(run)
        scene.minutes = scene.minutes if minutes is None else minutes
    elif outcome.stopped or stopping:
        scene.state = STOPPED if (run / "checkpoint.pt").is_file() else WAITING
    elif outcome.code == REFUSAL:
        scene.state, scene.error, scene.fingerprint = REFUSED, outcome.error, fingerprint(scene.data)
    else:
        scene.state, scene.error = FAILED, outcome.error


class Watch:
    """Sees from the runs' folders how far a batch is.

    Args:
        batch: The batch.
    """

    def __init__(self, batch: Batch):
        self._batch, self._begun = batch, set()

    def look(self, at_work: Iterable[Scene]) -> tuple[float, str]:
        """The share of the work of all asked scenes that is done, and who is at work."""
        names = [scene.name for scene in at_work]
        locked = {name for name in names if (self._batch.out / name / LOCK).exists()}
        self._begun |= locked  # an earlier call may have left lines in the other folders
        shares = {n: min(1.0, last_line(self._batch.out / n).get("progress", 0.0)) for n in names if n in self._begun}
        running = [name for name, share in shares.items() if share == 1 or name in locked]
        words = [f"{shortened(n, 16)} " + (f"{shares[n]:.0%}" if shares[n] < 1 else "refinement") for n in running[:NAMED]]
        if len(running) > NAMED:
            words.append(f"{len(running) - NAMED} more at work")
        if len(running) < len(names):
            words.append(f"{len(names) - len(running)} waiting")
        n_asked = len(self._batch.asked)
        return (n_asked - len(names) + TRAINING * sum(shares.values())) / n_asked, ", ".join(words)


def last_line(run: Path) -> dict:
    """The last whole line of a run's metrics; empty where there is none."""
    with suppress(OSError), open(run / "metrics.jsonl", "rb") as log:
        log.seek(max(0, log.seek(0, 2) - TAIL))
        for line in reversed(log.read().splitlines()):
            with suppress(ValueError):
                content = json.loads(line)
                if isinstance(content, dict) and isinstance(content.get("step"), int):
                    return content
    return {}
