"""Training as a user runs it: files, exit codes, resume, interruption, observers."""

import json
import re
import shutil
import signal
from collections.abc import Callable
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import torch
from splitnerf.cli import BAD_INPUT, DONE, main
from splitnerf.cli.common import Stages
from splitnerf.config import Config
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import read_image, write_image
from splitnerf.devices import same_bits
from splitnerf.errors import InputError
from splitnerf.pipeline import reconstruct
from splitnerf.progress import Interrupt
from splitnerf.refinement.refine import STATE
from splitnerf.training import loop
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.loop import Training
from splitnerf.training.observer import Request, together
from splitnerf.training.schedule import light_period
from tiny_runs import SMALL, as_options, lines_of, refused, tiny, train, train_scene


def test_a_run_holds_every_file_and_evaluate_repeats_its_scores(data_with_mesh, tmp_path, capsys):
    data, run = data_with_mesh, tmp_path / "run"
    assert train(data, run, "--steps", "25") == DONE
    said = capsys.readouterr().out
    assert "PSNR" in said and re.search(r" s on the CPU, \d\.\d GB of memory\n", said)
    assets = ["mesh.ply", "mesh.glb", "environment.exr", "environment.hdr"]
    for name in (*assets, "config.toml", "checkpoint.pt", "report.html"):
        assert (run / name).stat().st_size > 0, name
    assert list((run / "previews").glob("step_*.png"))
    lines = lines_of(run)
    assert lines[-1]["step"] == 25 and all(np.isfinite(line["loss"]) for line in lines)

    first, before = json.loads((run / "evaluation.json").read_text()), [(run / x).stat().st_mtime_ns for x in assets]
    assert main(["evaluate", str(run), "--data", str(data)]) == DONE
    again = json.loads((run / "evaluation.json").read_text())
    assert again["novel_view"]["psnr"] == pytest.approx(first["novel_view"]["psnr"], abs=0.05)
    assert first["chamfer"] > 0 and again["f_score"] == pytest.approx(first["f_score"], abs=1e-3)
    assert first.keys() == again.keys() and again["relight"] is None
    assert before == [(run / x).stat().st_mtime_ns for x in assets]
    kept, other = (run / "evaluation.json").read_bytes(), tmp_path / "other.json"
    assert main(["evaluate", str(run), "--data", str(data), "--views", "1", "--out", str(other)]) == DONE
    assert json.loads(other.read_text())["views"] == 1 and (run / "evaluation.json").read_bytes() == kept


def test_photos_that_are_all_dark_make_an_asset(data, tmp_path):
    dark = shutil.copytree(data, tmp_path / "dark")
    for path in dark.glob("train/*.png"):
        write_image(path, read_image(path) * np.float32([0, 0, 0, 1]))
    assert train(dark, tmp_path / "run", "--steps", "8") == DONE
    assert len(read_asset(tmp_path / "run/mesh.glb").triangles) > 0  # and no coordinate is NaN
    assert np.isfinite(read_image(tmp_path / "run/environment.exr")).all()


def test_torch_adds_in_a_fixed_order_where_asked():
    for on in (False, True):
        with same_bits(on):
            assert torch.are_deterministic_algorithms_enabled() == on
            assert torch.utils.deterministic.fill_uninitialized_memory != on
        assert not torch.are_deterministic_algorithms_enabled()
        assert torch.utils.deterministic.fill_uninitialized_memory
    # What was so before is so again, after an error as well.
    with same_bits(True):
        with pytest.raises(KeyError), same_bits(True):
            raise KeyError
        with same_bits(False):
            pass
        assert torch.are_deterministic_algorithms_enabled()
    with pytest.raises(KeyError), same_bits(True):
        raise KeyError
    assert not torch.are_deterministic_algorithms_enabled()


# Runs by what decides their steps to come. One cell is always near the surface: the grid is the same.
ONE_CELL = {"grid_resolution": 1, "mesh_every": 0.25}
MLP_LIGHT = ONE_CELL | {"light.kind": "mlp", "shading.method": "split", "occlusion.kind": "off", "light_samples": 256}
RESUMED = {
    "a convex surface": ONE_CELL | {"open_below": 0.0, "grid_every": 8},
    "sparse steps": ONE_CELL | {"sparse_steps": True, "table_dtype": "float16"},
    "an MLP of the light": MLP_LIGHT,
}
# A dented surface is one that blocks some of its own sky.
DENTED = ONE_CELL | {"learning_rate": 0.05, "warmup_steps": 1, "levels_open_by": 0.0, "open_below": 0.0}
RESUMED |= {
    "the grid's cells and the number of rays": {"grid_every": 5, "target_samples": 4608},
    "the light that weighs the bits": DENTED | {"indirect": False},
    "the light that the mesh sends": DENTED | {"indirect_every": 16},
    "the light that weighs the rays": DENTED | {"occlusion.kind": "mlp", "shading.method": "split"},
}


@pytest.mark.parametrize("settings", RESUMED.values(), ids=RESUMED)
def test_an_interrupted_run_ends_with_the_bits_of_an_uninterrupted_one(data, tmp_path, at_step, settings):
    """All that a checkpoint holds, but for the seconds: 28 steps, of which 12 or 20 (a dented surface) before Ctrl-C."""
    dataset, config = load_dataset(data), tiny(steps=28, deterministic=True, **settings)
    for name in ("whole", "halves"):
        (tmp_path / name).mkdir()
    train_scene(dataset, config, tmp_path / "whole")
    stop = 20 if "learning_rate" in settings else 12
    at_step(stop - 2, lambda: signal.raise_signal(signal.SIGINT))  # to this thread, so that it comes at once
    assert not train_scene(dataset, config, tmp_path / "halves").finished
    # The light moves every 4 steps: the run goes on until it has.
    stopped = load_checkpoint(tmp_path / "halves" / "checkpoint.pt")["step"]
    assert stopped == (stop if settings.get("light.kind") != "mlp" else stop - 1)
    train_scene(dataset, config, tmp_path / "halves", resume=True)
    whole, halves = (flat(load_checkpoint(tmp_path / name / "checkpoint.pt")) for name in ("whole", "halves"))
    assert whole.keys() == halves.keys() and whole["step"] == 28
    different = [key for key in whole if key != "seconds" and not same(whole[key], halves[key])]
    assert different == []


def flat(content: object, prefix: str = "") -> dict[str, object]:
    """The leaves of nested dictionaries and lists by their path."""
    if isinstance(content, (dict, list)):
        items = content.items() if isinstance(content, dict) else enumerate(content)
        return {path: leaf for key, value in items for path, leaf in flat(value, f"{prefix}.{key}").items()}
    return {prefix[1:]: content}


def same(a: object, b: object) -> bool:
    return torch.equal(a, b) if isinstance(a, torch.Tensor) else a == b


def test_a_deterministic_run_goes_on_where_it_began(data, tmp_path, monkeypatch):
    """On the CPU, though there is a GPU by now and the command does not repeat what it asked for."""
    run = tmp_path / "run"
    assert train(data, run, "--steps", "4", "--deterministic") == DONE
    monkeypatch.setattr("splitnerf.devices.fit_device", lambda test: ("cuda", "it is fit"))
    assert main(["train", str(data), "--out", str(run), "--resume", "--steps", "6"]) == DONE


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--set", "n_levels"], "key=value"),
        (["--steps", "0"], "steps"),
        (["--resume", "--overwrite"], "exclude"),
        (["--resume"], "no checkpoint"),
        (["--max-minutes", "-1"], "max-minutes"),
    ],
)
def test_bad_options_exit_with_2(data, tmp_path, capsys, options, word):
    assert word in refused(capsys, "train", data, "--out", tmp_path / "run", *options)
    assert not (tmp_path / "run").exists()


def test_the_paper_preset_takes_steps(data, tmp_path):
    """The published widths and levels, with few samples: every one of its switches runs."""
    run = tmp_path / "run"
    smaller = {name: size for name, size in SMALL.items() if name != "n_levels"}
    settings = smaller | {"log2_table_size": 14, "mesh_every": 0.3, "preview_every": 1.0}
    command = ["train", str(data), "--out", str(run), "--preset", "paper", "--steps", "6", "--downscale", "2"]
    assert main([*command, *as_options(settings)]) == DONE
    assert (run / "evaluation.json").stat().st_size > 0 and list((run / "previews").iterdir())
    assert Config.read(run / "config.toml").shading.fresnel == "paper"
    assert main(["evaluate", str(run), "--data", str(data), "--views", "1"]) == DONE, "at the downscale of the run"
    assert main(["evaluate", str(run), "--data", str(data), "--views", "1", "--downscale", "1"]) == BAD_INPUT


# ---- observers ----


CPU = torch.device("cpu")


class Asking:
    """Requests one thing after the other, or calls it, from a step on; and writes down what it learns."""

    def __init__(self, at: int = 0, *requests: Request | Callable | None):
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
            if kind == "step" and training.step >= self.at and self.requests:
                request = self.requests.pop(0)
                return request() if callable(request) else request
        else:
            self.heard.append((kind, None if path is None else (path / "mesh.glb").is_file()))


def test_observers_learn_of_all_that_happens(data, tmp_path):
    asking, second = Asking(), Asking()
    config = tiny(steps=40, preview_every=0.5)
    period = light_period(config)  # steps that share gradients of the light, and are not parted
    reconstruct(data, tmp_path / "run", config, observer=together([asking, second]))
    heard = asking.heard
    assert heard[0] == ("begun", 0)
    assert [event for event in heard if event[0] == "step"] == [("step", n) for n in range(period, 41, period)]
    assert [e[1] for e in heard if e[0] == "logged"] == [line["step"] for line in lines_of(tmp_path / "run")]
    assert [event for event in heard if event[0] == "previewed"] == [("previewed", 20, True), ("previewed", 40, True)]
    assert heard[-2:] == [("export", None), ("evaluation", True)]
    assert second.heard == heard
    resumed = Asking()
    reconstruct(data, tmp_path / "run", config.replace({"steps": 41}), resume=True, observer=resumed)
    assert resumed.heard[0] == ("begun", 40)


def test_refinement_is_said_with_what_it_begins_from(data, tmp_path, monkeypatch, capsys):
    def refused(source, *_, **__):
        assert (source / "mesh.glb").is_file()
        raise InputError("nothing to fit")

    monkeypatch.setattr("splitnerf.pipeline.refine_folder", refused)
    asking, run = Asking(), tmp_path / "run"
    reconstruct(data, run, tiny(steps=30, **{"refinement.enabled": True}), observer=together([asking, Stages()]))
    assert asking.heard[-3:] == [("export", None), ("refinement", True), ("evaluation", True)]
    assert "without refinement, as nothing to fit" in (err := capsys.readouterr().err)
    assert (run / "mesh.glb").is_file() and json.loads((run / "evaluation.json").read_text())["scored"] == "fields"
    where = rf"{torch.get_num_threads()} threads? of the CPU, [\d.]+ of [\d.]+ GB of memory free"
    assert re.search(f"training on {where}; in all 30 steps; results go to {run}$", err, re.MULTILINE)
    said = [re.split(", | on ", line)[0] for line in err.splitlines() if line.startswith("stage")]
    names = ["training", "export", "refinement", "evaluation"]
    assert said == [f"stage {number} of 4: {name}" for number, name in enumerate(names, 1)]


@pytest.mark.parametrize("end, last", [(600.0, "10:00 minutes"), (470.0, "7:50 of 8:40 minutes")])
def test_stages_say_how_long_the_rest_takes_by_the_trainings_own_clock(end, last, monkeypatch, capsys):
    monkeypatch.setattr("splitnerf.cli.common.time", Mock(monotonic=iter([0.0, 424.4, end]).__next__))
    stages, training = Stages(), Mock(started=40.0, finished=False, **{"config.run.max_minutes": 8.0})
    for kind in ("begun", "refinement", "evaluation"):
        stages(Mock(kind=kind, training=training))
    said = ["refinement, after 7:04 minutes and 1:36 to come", f"evaluation, after {last}"]
    assert capsys.readouterr().err.splitlines()[1:] == [f"stage {i} of 4: {words}" for i, words in enumerate(said, 3)]


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
    ending = ends if ends is Request.STOP else lambda: signal.raise_signal(ends)
    config = tiny(steps=40)
    scene = train_scene(load_dataset(data), config, tmp_path, Asking(24, ending))
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
    stopped = train_scene(load_dataset(data), config, tmp_path, Asking(20, Request.STOP))
    assert stopped.finished and stopped.step == 20
    if stage_begun:
        (tmp_path / STATE).write_bytes(b"")
    training = Training(load_dataset(data), config, tmp_path, CPU)
    training.restore()
    training.complete()
    assert training.finished and (training.step, training.resumed_at) == (20 if stage_begun else 40, 20)


def test_a_checkpoint_is_saved_when_asked(data, tmp_path):
    asking = Asking(8, Request.SAVE, None, Request.STOP)
    steps = []
    asking.logged = lambda line: (
        steps.append(load_checkpoint(tmp_path / "checkpoint.pt")["step"]) if len(asking.requests) == 1 else None
    )
    train_scene(load_dataset(data), tiny(steps=400), tmp_path, asking)
    assert set(steps) == {8}


def test_the_time_of_a_pause_is_told(monkeypatch):
    clock = [0.0]
    fake = SimpleNamespace(monotonic=lambda: clock[0], sleep=lambda seconds: clock.__setitem__(0, clock[0] + seconds))
    monkeypatch.setattr(loop, "time", fake)
    done = []
    does = {name: lambda name=name: done.append(name) for name in ("settle", "save")}
    observer = Asking(0, Request.PAUSE, Request.PAUSE, Request.SAVE, Request.PAUSE)
    training = SimpleNamespace(observer=observer, stopped=False, step=1, started=5.0, **does)
    skipped = []
    with Interrupt() as interrupt:
        Training.fulfil_requests(training, interrupt, SimpleNamespace(skip=skipped.append))
    assert sum(skipped) == pytest.approx(3 * loop.PAUSE) and training.started == pytest.approx(5.0 + sum(skipped))
    assert done == ["settle", "settle", "settle", "save", "settle"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_paused_run(data, tmp_path, number):
    def pausing(event):
        if event.kind != "step" or event.training.step < 8:
            return None
        signal.raise_signal(number)
        return Request.PAUSE

    scene = train_scene(load_dataset(data), tiny(steps=400), tmp_path, pausing)
    assert not scene.finished and scene.step < 20
    assert load_checkpoint(tmp_path / "checkpoint.pt")["step"] == scene.step
