"""Observers of a training: what they hear, and what the training does at their wish."""

from __future__ import annotations

import signal
from types import SimpleNamespace

import pytest
import torch
from splitnerf.cli import DONE, main
from splitnerf.config import Config
from splitnerf.data.dataset import load_dataset
from splitnerf.errors import InputError
from splitnerf.pipeline import reconstruct
from splitnerf.progress import Interrupt
from splitnerf.refinement.refine import STATE
from splitnerf.training import loop
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.loop import Training
from splitnerf.training.observer import NOBODY, Observer, Request, together
from splitnerf.training.schedule import light_period
from tiny_runs import lines_of, tiny

CPU = torch.device("cpu")


class Asking:
    """Requests one thing after the other, from a step on; and writes down what it learns."""

    def __init__(self, at: int = 0, *requests: Request | None):
        self.at, self.requests, self.heard, self.logged = at, list(requests), [], lambda line: None

    def __call__(self, event):
        kind, training, path = event.kind, event.training, event.path
        if kind == "logged":
            self.heard.append((kind, event.line["step"]))
            self.logged(event.line)
        elif kind == "previewed":
            self.heard.append((kind, training.step, path.is_file()))
        elif training is not None:
            self.heard.append((kind, training.step))
            if kind == "step":
                return self.requests.pop(0) if training.step >= self.at and self.requests else None
        else:
            self.heard.append((kind, None if path is None else (path / "mesh.glb").is_file()))


def trained(data, run, config: Config, observer: Observer = NOBODY):
    run.mkdir(exist_ok=True)
    return Training(load_dataset(data), config, run, CPU, observer).complete()


def test_observers_learn_of_all_that_happens(data, tmp_path):
    asking, second = Asking(), Asking()
    config = tiny(steps=40, preview_every=0.5)
    period = light_period(config)  # steps that share gradients of the light, and are not parted
    reconstruct(data, tmp_path / "run", config, observer=together([asking, second]))
    heard = asking.heard
    assert heard[0] == ("begun", 0) and [event for event in heard if event[0] == "step"] == [
        ("step", n) for n in range(period, 41, period)
    ]
    assert [event[1] for event in heard if event[0] == "logged"] == [
        line["step"] for line in lines_of(tmp_path / "run")
    ]
    assert [event for event in heard if event[0] == "previewed"] == [("previewed", 20, True), ("previewed", 40, True)]
    assert heard[-2:] == [("export", None), ("evaluation", True)]
    assert second.heard == heard
    resumed = Asking()
    reconstruct(data, tmp_path / "run", config.replace({"steps": 41}), resume=True, observer=resumed)
    assert resumed.heard[0] == ("begun", 40)


def test_refinement_is_said_with_what_it_begins_from(data, tmp_path, monkeypatch):
    def refused(source, *_, **__):
        assert (source / "mesh.glb").is_file()
        raise InputError("nothing to fit")

    monkeypatch.setattr("splitnerf.pipeline.refine_folder", refused)
    asking = Asking()
    reconstruct(data, tmp_path / "run", tiny(steps=30, **{"refinement.enabled": True}), observer=asking)
    assert asking.heard[-3:] == [("export", None), ("refinement", True), ("evaluation", True)]


def test_a_run_that_is_stopped_delivers_and_can_go_on(data, tmp_path):
    config = tiny(steps=400)
    scene, scores = reconstruct(data, tmp_path / "run", config, observer=Asking(20, Request.STOP))
    assert scene.finished and 20 <= scene.step < 30 and scores["scored"] == "fields"
    assert {"mesh.glb", "environment.exr", "report.html"} <= {path.name for path in (tmp_path / "run").iterdir()}
    assert main(["train", str(data), "--out", str(tmp_path / "run"), "--resume", "auto"]) == DONE  # is finished
    asking = Asking(60, Request.STOP)
    again, _ = reconstruct(data, tmp_path / "run", config, resume=True, observer=asking)
    assert asking.heard[0] == ("begun", scene.step) and 60 <= again.step < 70


@pytest.mark.parametrize("ends", [Request.STOP, signal.SIGINT, signal.SIGTERM])
def test_the_last_step_of_a_stopped_run_is_logged(data, tmp_path, ends):
    """Also between two of the steps that are logged by their number; and once, where the run goes on from there."""

    def ending(event):
        if event.kind != "step" or event.training.step < 24:
            return None
        if ends is Request.STOP:
            return ends
        signal.raise_signal(ends)
        return None

    config = tiny(steps=40)
    scene = trained(data, tmp_path, config, ending)
    assert scene.step == 24 and [line["step"] for line in lines_of(tmp_path)] == [*range(1, 21), 24]
    training = Training(load_dataset(data), config, tmp_path, CPU)
    training.restore()
    training.stopped = False
    training.complete()
    assert [line["step"] for line in lines_of(tmp_path)] == [*range(1, 21), 24, 40]


@pytest.mark.parametrize("stage_begun", [True, False])
def test_a_stopped_run_goes_on_where_it_was(data, tmp_path, stage_begun):
    """With its refinement, if that was interrupted; else with the training."""
    config = tiny(steps=40)
    stopped = trained(data, tmp_path, config, Asking(20, Request.STOP))
    assert stopped.finished and stopped.step == 20
    if stage_begun:
        (tmp_path / STATE).write_bytes(b"")
    training = Training(load_dataset(data), config, tmp_path, CPU)
    training.restore()
    scene = training.complete()
    assert scene.finished and (scene.step, scene.n_new) == ((20, 0) if stage_begun else (40, 20))


def test_a_checkpoint_is_saved_when_asked(data, tmp_path):
    asking = Asking(8, Request.SAVE, None, Request.STOP)
    steps = []
    asking.logged = lambda line: (
        steps.append(load_checkpoint(tmp_path / "checkpoint.pt")["step"]) if len(asking.requests) == 1 else None
    )
    trained(data, tmp_path, tiny(steps=400), asking)
    assert set(steps) == {8}


def test_the_time_of_a_pause_is_told(monkeypatch):
    clock = [0.0]
    fake = SimpleNamespace(monotonic=lambda: clock[0], sleep=lambda seconds: clock.__setitem__(0, clock[0] + seconds))
    monkeypatch.setattr(loop, "time", fake)
    done = []
    training = SimpleNamespace(
        observer=Asking(0, Request.PAUSE, Request.PAUSE, Request.SAVE, Request.PAUSE),
        stopped=False,
        step=1,
        settle=lambda: done.append("settle"),
        save=lambda: done.append("save"),
    )
    with Interrupt() as interrupt:
        assert Training.fulfil_requests(training, interrupt) == pytest.approx(3 * loop.PAUSE)
    assert done == ["settle", "settle", "settle", "save", "settle"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_paused_run(data, tmp_path, number):
    def pausing(event):
        if event.kind != "step" or event.training.step < 8:
            return None
        signal.raise_signal(number)
        return Request.PAUSE

    scene = trained(data, tmp_path, tiny(steps=400), pausing)
    assert not scene.finished and scene.step < 20
    assert load_checkpoint(tmp_path / "checkpoint.pt")["step"] == scene.step
