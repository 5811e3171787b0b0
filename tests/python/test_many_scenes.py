"""splitnerf batch, without Ray: names, options, shares, the table, processes, and what follows from how they end."""

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from splitnerf.cli import BAD_INPUT, build_parser, main
from splitnerf.errors import InputError
from splitnerf.files import LOCK, PARTIAL, is_locked, remove_partial
from splitnerf_tools.batch import child
from splitnerf_tools.batch.child import Outcome, Work, train_scene
from splitnerf_tools.batch.cluster import Share, share_of
from splitnerf_tools.batch.scenes import Scene, keep_scenes, known_scenes, markdown, requested_scenes, scene_name
from splitnerf_tools.batch.tasks import BatchPlan, run_batch
from splitnerf_tools.commands.batch import given_options
from test_files import held
from tiny_runs import refused

GB = 1e9


# ---- names ----


@pytest.mark.parametrize(
    "folder, name",
    [
        ("/a/chair", "chair"),
        ("/a/..", "scene"),
        ("/a/-rf", "rf"),
        ("/a/.hidden", "hidden"),
        ("/a/\x1b]0;owned\x07\n", "_0_owned_"),
        ("/a/K\u00e4fer", "K_fer"),
        ("/a/\udcff", "_"),
        ("/a/logs", "logs-2"),
        ("/a/Batch.JSON", "Batch.JSON-2"),
        ("/a/" + 300 * "x", 80 * "x"),
    ],
)
def test_a_name_is_that_of_the_folder_without_what_does_harm(folder, name):
    assert scene_name(folder, []) == name


def test_two_folders_of_one_name_are_two_scenes_and_stay_so(tmp_path):
    """Whatever the order of a later call, and whatever is added to it."""
    first = [Path("/a/chair"), Path("/b/chair"), Path("/b/../a/chair/"), Path("/c/Chair")]
    known: list[Scene] = []
    assert [s.name for s in requested_scenes(known, first)] == ["chair", "chair-2", "Chair-3"]
    keep_scenes(tmp_path, known)
    again = known_scenes(tmp_path)
    assert again == known
    asked = requested_scenes(again, [Path("/d/chair"), Path("/c/Chair"), Path("/b/chair")])
    expected = [("chair-4", "/d/chair"), ("Chair-3", "/c/Chair"), ("chair-2", "/b/chair")]
    assert [(s.name, s.data) for s in asked] == expected
    assert [s.name for s in again] == ["chair", "chair-2", "Chair-3", "chair-4"]


OF_ONE = {"format": 1, "scenes": [asdict(Scene("a", "/data"))]}
BESIDE = [OF_ONE | {"scenes": [OF_ONE["scenes"][0] | {"name": name}]} for name in ("../other", "/abs/run", 5, "")]
DAMAGED = [{"format": 1, "scenes": [1]}, {"format": 1, "scenes": [{"name": "a"}]}, *BESIDE]


@pytest.mark.parametrize("text", ["", "[]", "{}", *map(json.dumps, DAMAGED)])
def test_a_damaged_state_and_runs_beside_the_batch_are_refused(tmp_path, text):
    (tmp_path / "batch.json").write_text(text)
    with pytest.raises(InputError, match="batch.json: is damaged" if len(text) > 2 else "batch.json"):
        known_scenes(tmp_path)


# ---- options ----


def test_options_reach_each_training_as_they_were_given():
    given = (
        "--preset paper --steps 70 --max-minutes 1.5 --device cpu --seed 3 --deterministic --no-refine --downscale 2 \
        --eval-mode all --mask-kind ignore --max-memory 2.5 --set a=-1 --set b=[1,2]".split()
    )
    parsed = build_parser().parse_args(["batch", "S", "--out", "D", *given])
    words = given_options(parsed)
    trained = vars(build_parser().parse_args(["train", "S", *words]))
    told = vars(build_parser().parse_args(["train", "S", *given]))
    assert trained == told and "--seed=3" in words
    assert given_options(build_parser().parse_args(["batch", "S", "--out", "D"])) == []


def test_every_option_of_train_is_one_of_batch_but_where_to_write():
    options = {
        name: {o for a in build_parser()._subparsers._group_actions[0].choices[name]._actions for o in a.option_strings}
        for name in ("train", "batch")
    }
    alone = "--resume --overwrite --view --tensorboard"
    assert options["train"] - options["batch"] == set(alone.split())


@pytest.mark.parametrize(
    "words, said",
    [
        (["--set", "no_such=1"], "no_such"),
        (["--max-minutes", "-1"], "--max-minutes must be positive"),
        (["--cores-per-scene", "0"], "--cores-per-scene must be positive"),
        (["--gpus-per-scene", "-1"], "--gpus-per-scene must not be negative"),
        (["--memory-per-scene", "nan"], "--memory-per-scene must be positive"),
        (["--retries", "-1"], "--retries"),
    ],
)
def test_wrong_options_are_refused_before_a_scene_begins(tmp_path, capsys, words, said):
    assert said in refused(capsys, "batch", tmp_path / "a", "--out", tmp_path / "out", *words)
    assert not (tmp_path / "out").exists()


def test_without_ray_one_line_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["batch", str(tmp_path), "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert capsys.readouterr().err == "splitnerf: batch needs the package ray: pip install 'splitnerf[batch]'\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("error, said", [(KeyboardInterrupt, "interrupted"), (OSError("Why"), "Ray does not start")])
def test_ray_that_does_not_start_is_one_line(tmp_path, monkeypatch, capsys, error, said):
    ray = Mock(__spec__=ModuleSpec("ray", None), **{"init.side_effect": error})
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setattr(os, "environ", dict(os.environ))
    main(["batch", str(tmp_path), "--out", str(tmp_path / "out")])
    assert re.fullmatch(f"splitnerf: {said}.*\n", capsys.readouterr().err)
    assert not Path(ray.init.call_args.kwargs["_temp_dir"]).exists() and ray.shutdown.called


# ---- shares ----

LAPTOP, NODE = {"CPU": 2.0, "memory": 6 * GB}, {"CPU": 16.0, "GPU": 2.0, "memory": 64 * GB}
NOTHING_ASKED = dict(cores=None, gpus=None, memory=None)


@pytest.mark.parametrize(
    "machines, n_scenes, share",
    [
        ([LAPTOP], 6, Share(1, 0, 4)),
        ([LAPTOP], 1, Share(2, 0, 4)),
        ([{"CPU": 2.0, "memory": 3 * GB}], 6, Share(1, 0, 3)),
        ([NODE, NODE], 100, Share(1, 0.25, 4)),
        ([NODE, NODE], 2, Share(16, 0.25, 4)),
        ([LAPTOP, NODE], 3, Share(6, 0.25, 4)),
    ],
)
def test_scenes_share_the_machines(machines, n_scenes, share):
    assert share_of(machines, n_scenes, **NOTHING_ASKED) == share


def test_a_share_is_what_the_user_says():
    assert share_of([NODE], 9, cores=0.5, gpus=0.1, memory=1.0) == Share(0.5, 0.1, 1.0)
    assert share_of([NODE], 9, **NOTHING_ASKED, whole_gpu=True).gpus == 1
    photos = share_of([NODE], 9, **NOTHING_ASKED, photos=10.0)
    assert photos.memory == pytest.approx(12.15, abs=0.01) and photos.photos == pytest.approx(10)
    assert Share(0.5, 0, 4).threads == 1 and Share(3.9, 0, 4).threads == 3
    assert 0 < Share(1, 0, 0.5).photos < 0.5


@pytest.mark.parametrize("asked", [dict(cores=3), dict(gpus=1), dict(memory=7)])
def test_more_than_a_machine_has_is_refused(asked):
    with pytest.raises(InputError, match="no machine offers .*; request less by --cores-per-scene"):
        share_of([LAPTOP], 1, **NOTHING_ASKED | asked)
    # One has the cores, the other the GPUs.
    with pytest.raises(InputError, match="no machine offers 2 cores, 1 GPU and 1 GB"):
        share_of([{**NODE, "GPU": 0.0}, {**NODE, "CPU": 1.0}], 1, cores=2, gpus=1, memory=1)


# ---- the table ----

ENDED = [
    Scene("chair", "/a/chair", "done", 300, 4.04, {"views": 34.251, "normals": 6.08, "light": 14.5}),
    Scene("x" * 60, "/a/x|`<b>\n", "refused", None, 0.0, {}, "/a/x|`<b>\n: is \x1b[31mdamaged"),
]


def test_markdown_has_a_row_a_scene_whatever_its_words():
    lines = markdown(ENDED).splitlines()
    assert [line.replace("\\|", "").count("|") for line in lines[:4]] == [12] * 4 and "<b>" not in "".join(lines)
    assert lines[2].startswith("| [chair](chair/report.html) | done | 300 | 4.0 | 34.25 | - | - | 6.1 | 14.50 |")
    assert r"is \\x1b\[31mdamaged" in lines[3] and lines[3].startswith("| xxx")


# ---- processes ----


def work_in(folder: Path, data: Path, *options: str) -> Work:
    return Work(str(data), str(folder / "run"), list(options), 1, str(folder / "logs" / "a.log"))


def test_a_damaged_scene_is_refused_with_its_last_word(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data/transforms_train.json").write_text("{")
    outcome = train_scene(work_in(tmp_path, tmp_path / "data"))
    assert outcome.code == 2 and not outcome.stopped and not (tmp_path / "run").exists()
    assert outcome.error.startswith(f"{tmp_path}/data/transforms_train.json: is not valid json")
    log = (tmp_path / "logs/a.log").read_text()
    assert log.startswith("$ ") and f"train {tmp_path}/data --out {tmp_path}/run --resume auto" in log


@pytest.mark.parametrize(
    "said, code, error",
    [
        ("splitnerf: data: bad\nsplitnerf: note: a\n 10% 00:10\n", 2, "data: bad"),
        ("Segmentation fault\n\n", 1, "Segmentation fault"),
        ("", 1, "ended with exit code 1"),
        ("splitnerf: x\n", -9, "was killed by SIGKILL"),
        ("splitnerf: x\n", 0, ""),
        ("splitnerf: \x1b[31mred\n", 1, r"\x1b[31mred"),
        ("y" * 9000, 1, "y" * 500),
    ],
)
def test_the_last_word_says_why(tmp_path, said, code, error):
    (tmp_path / "log").write_text("splitnerf: of an earlier one\n" + said)
    assert child.failure_line(tmp_path / "log", 29, code) == error


def test_a_run_in_use_is_waited_for_and_then_left_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(child, "TIMEOUT", 0.3)
    with held(tmp_path / "run"):
        assert is_locked(tmp_path / "run")
        outcome = train_scene(work_in(tmp_path, tmp_path))
        assert outcome == Outcome(None, f"{tmp_path / 'run'}: is in use by another program", False)
        halves = list((tmp_path / "run/sub").iterdir())
        (tmp_path / f"run/{PARTIAL}half.glb").touch()
        (tmp_path / "left").mkdir()
        (tmp_path / f"left/{PARTIAL}half.glb").touch()
        remove_partial(tmp_path)
        assert (tmp_path / f"run/{PARTIAL}half.glb").exists() and not list((tmp_path / "left").iterdir()) and halves
    assert (tmp_path / "run" / LOCK).exists() and not is_locked(tmp_path / "run") and not is_locked(tmp_path)


PARENT = """
import os, subprocess, sys
words = [sys.executable, "-c", sys.argv[1], sys.argv[2]]
child = subprocess.Popen([sys.executable, "-m", "splitnerf_tools.batch.child", str(os.getpid()), *words])
child.wait()
"""
CHILD = """
import pathlib, signal, sys, time
told = pathlib.Path(sys.argv[1])
def save(*_):
    told.write_text("saved")
    sys.exit(130)
signal.signal(signal.SIGTERM, save)
told.write_text("works")
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process of its parent's end")
def test_a_training_saves_its_state_when_its_worker_is_killed(tmp_path):
    told = tmp_path / "told"
    parent = subprocess.Popen([sys.executable, "-c", PARENT, CHILD, str(told)])

    def wait_for(text: str) -> None:
        until = time.monotonic() + 60
        while not (told.exists() and told.read_text() == text):
            assert time.monotonic() < until
            time.sleep(0.05)

    wait_for("works")
    parent.kill()
    parent.wait()
    wait_for("saved")


def test_a_cancelled_task_asks_its_process_to_save_and_waits(tmp_path, monkeypatch):
    """Ray cancels by KeyboardInterrupt."""
    told = tmp_path / "told"
    start, poll = subprocess.Popen, subprocess.Popen.poll
    monkeypatch.setattr(
        child.subprocess, "Popen", lambda words, **rest: start([sys.executable, "-c", CHILD, str(told)], **rest)
    )

    def interrupted(process):
        if told.exists() and told.read_text() == "works":
            monkeypatch.setattr(start, "poll", poll)
            raise KeyboardInterrupt
        return poll(process)

    monkeypatch.setattr(start, "poll", interrupted)
    outcome = train_scene(work_in(tmp_path, tmp_path))
    assert outcome.stopped and outcome.code == 130 and told.read_text() == "saved"


# ---- what follows from how they end ----


RayError = type("RayError", (Exception,), {})
LOSSES = ("TaskCancelledError", "OutOfMemoryError", "WorkerCrashedError", "NodeDiedError", "ObjectLostError")
ERRORS = SimpleNamespace(RayError=RayError, **{name: type(name, (RayError,), {}) for name in LOSSES})


@dataclass(eq=False)
class Reference:
    """To a task whose process ends so."""

    end: object


class PretendRay:
    """Ray with one worker: each scene's processes end as its list says, the first of those that wait next.

    Attributes:
        exceptions: As Ray has them.
        begun: The scenes' folders, in the order in which processes began.
        cancelled: Those whose tasks were cancelled.
    """

    exceptions = ERRORS

    def __init__(self, ends: dict[str, list]):
        self.ends, self.begun, self.cancelled = ends, [], []

    def remote(self, function):
        return SimpleNamespace(options=lambda **needs: SimpleNamespace(remote=self.place))

    def place(self, work: Work):
        self.begun.append(work.data)
        return Reference(self.ends[work.data].pop(0))

    def wait(self, references, timeout):
        if references[0].end is KeyboardInterrupt and references[0] not in self.cancelled:
            raise KeyboardInterrupt
        return references[:1], references[1:]

    def get(self, reference):
        if reference in self.cancelled:
            return Outcome(130, "stopped", True)
        if isinstance(reference.end, Exception):
            raise reference.end
        return reference.end

    def cancel(self, reference):
        self.cancelled.append(reference)


def batch_of(tmp_path: Path, ends: dict[str, list], retries: int = 3) -> tuple:
    """A batch that ran with a pretended Ray; its rows and notes, and whether all came to an end."""
    known, rows, notes = known_scenes(tmp_path), [], []
    asked = requested_scenes(known, [Path(data) for data in ends])
    row = lambda scene: rows.append((scene.name, scene.state))
    batch = BatchPlan(tmp_path, known, asked, ["--steps=4"], retries, row, notes.append)
    ray = PretendRay({data: list(end) for data, end in ends.items()})
    return batch, ray, rows, notes, run_batch(ray, batch, Share(1, 0, 4))


KILLED, REFUSED = Outcome(-9, "was killed by SIGKILL", False), Outcome(2, "bad", False)
WELL, BROKE = Outcome(0, "", False), Outcome(1, "loss is nan", False)
LOST = ERRORS.WorkerCrashedError()


def finish_run(run: Path, steps: int = 4) -> None:
    run.mkdir(parents=True)
    for name in ("checkpoint.pt", "report.html"):
        (run / name).touch()
    (run / "metrics.jsonl").write_text(f'{{"step": {steps}, "progress": 1.0, "seconds": 90.0}}\n{{"step": 9, "lo')
    (run / "evaluation.json").write_text(json.dumps({"novel_view": {"psnr": 30.0}, "albedo": None, "seconds": 120.0}))


def test_only_killed_scenes_are_tried_again(tmp_path):
    """Of the worker or of the process in it, or asked to end by another than us; each goes on in its turn."""
    asked = Outcome(130, "stopped at step 8", False)
    for name in "abc":
        finish_run(tmp_path / name)
    ends = {"/a": [LOST, KILLED, WELL], "/b": [WELL], "/c": [asked, WELL], "/d": [REFUSED], "/e": [BROKE]}
    batch, ray, rows, notes, ended = batch_of(tmp_path, ends)
    assert ended and ray.begun == ["/a", "/b", "/c", "/d", "/e", "/a", "/c", "/a"]
    assert rows == [("b", "done"), ("d", "refused"), ("e", "failed"), ("c", "done"), ("a", "done")]
    reasons = [note.partition(";")[0] for note in notes]
    assert reasons == ["a: its worker was killed", "c: stopped at step 8", "a: was killed by SIGKILL"]
    assert [note[-11:] for note in notes] == ["retry 1 of 3"[1:], "retry 1 of 3"[1:], "retry 2 of 3"[1:]]
    found = {scene.name: scene for scene in known_scenes(tmp_path)}
    assert found["a"].minutes == 2 and found["a"].steps == 4 and found["a"].scores == {"views": 30.0}
    assert found["e"].error == "loss is nan" and "| e | failed |" in (tmp_path / "batch.md").read_text()


def test_retries_come_to_an_end(tmp_path):
    memory = ERRORS.OutOfMemoryError()
    batch, ray, rows, notes, ended = batch_of(tmp_path, {"/a": [LOST, LOST, memory]}, retries=2)
    assert ended and rows == [("a", "failed")] and len(notes) == 2
    assert batch.scenes[0].error == "ran out of memory (--memory-per-scene)"


def test_an_interrupt_cancels_all_and_waits_for_them(tmp_path):
    finish_run(tmp_path / "a")
    finish_run(tmp_path / "b")
    batch, ray, rows, notes, ended = batch_of(tmp_path, {"/a": [WELL], "/b": [KeyboardInterrupt], "/c": [LOST]})
    assert not ended and rows == [("a", "done"), ("b", "stopped"), ("c", "waiting")] and len(ray.cancelled) == 2
    ends = {"/a": [WELL], "/b": [REFUSED], "/c": [WELL]}
    assert batch_of(tmp_path, ends)[2] == [("a", "done"), ("b", "refused"), ("c", "done")]  # a second call
