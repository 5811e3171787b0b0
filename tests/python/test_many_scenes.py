"""splitnerf batch, without Ray: names, options, shares, the table, processes, and what follows from how they end."""

import json
import os
import re
import socket
import subprocess
import sys
import time
from dataclasses import asdict, replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from splitnerf.cli import BAD_INPUT, build_parser, main
from splitnerf.errors import InputError
from splitnerf.files import LOCK, PARTIAL, is_locked, remove_partial
from splitnerf_tools.batch import child, scenes
from splitnerf_tools.batch.child import Outcome, Work, train_scene
from splitnerf_tools.batch.cluster import Share, machines_of, share_of
from splitnerf_tools.batch.scenes import Scene, keep_scenes, known_scenes, markdown, requested_scenes, scene_name
from splitnerf_tools.batch.tasks import BatchPlan, outcome_of, run_batch
from splitnerf_tools.commands.batch import given_options
from splitnerf_tools.doctor.machine import processors
from test_files import held
from tiny_runs import refused

GB = 1e9


def test_a_name_is_that_of_the_folder_without_what_does_harm():
    names = {"chair": "chair", "..": "scene", "-rf": "rf", ".hidden": "hidden", "K\u00e4fer": "K_fer", "\udcff": "_"}
    names |= {"\x1b]0;owned\x07\n": "_0_owned_", "logs": "logs-2", "Batch.JSON": "Batch.JSON-2", 300 * "x": 80 * "x"}
    assert {folder: scene_name(f"/a/{folder}", []) for folder in names} == names


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
UNREADABLE = [*((text, "") for text in ("", "[]", "{}")), *((json.dumps(one), ": is damaged") for one in DAMAGED)]


@pytest.mark.parametrize("text, said", [*UNREADABLE, (json.dumps(OF_ONE | {"format": 2}), ": is not of this version")])
def test_a_damaged_state_and_runs_beside_the_batch_are_refused(tmp_path, text, said):
    (tmp_path / "batch.json").write_text(text)
    with pytest.raises(InputError, match=f"batch.json{said}"):
        known_scenes(tmp_path)


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


def test_wrong_options_are_refused_before_a_scene_begins(tmp_path, capsys):
    wrong = {"set no_such=1": "no_such", "gpus-per-scene -1": "not be negative", "retries -1": "not be negative"}
    wrong |= dict.fromkeys(("max-minutes -1", "cores-per-scene 0", "memory-per-scene nan"), "be positive")
    for words, said in wrong.items():
        line = refused(capsys, "batch", tmp_path / "a", "--out", tmp_path / "out", *f"--{words}".split())
        assert said in line and (f"--{words.split()[0]} must" in line) == (said != "no_such")
        assert not (tmp_path / "out").exists()


def test_without_ray_one_line_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["batch", str(tmp_path), "--out", str(tmp_path / "out")]) == BAD_INPUT
    assert capsys.readouterr().err == "splitnerf: batch needs the package ray: pip install 'splitnerf[batch]'\n"
    assert not (tmp_path / "out").exists()


STARTS = (
    *((KeyboardInterrupt, "", "interrupted.*"), (OSError("Why. Because."), "", r"Ray does not start here \(Why\);.*")),
    (None, "127.0.0.1:{port}", r"--address 127.0.0.1:\d+: no Ray cluster answers .*"),
)


@pytest.mark.parametrize("error, address, said", STARTS)
def test_ray_that_does_not_start_is_one_line(tmp_path, monkeypatch, capsys, error, address, said):
    """Here it has all cores and nine tenths of the free memory, and answers to those alone who have its token."""
    ray = Mock(__spec__=ModuleSpec("ray", None), exceptions=ERRORS, **{"init.side_effect": error})
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setattr(os, "environ", dict(os.environ))
    monkeypatch.setattr("splitnerf_tools.batch.cluster.memory_bytes", lambda: (8000, 5000))
    with socket.socket() as taken:  # a port at which nobody listens
        taken.bind(("127.0.0.1", 0))
        words = ["--address", address.format(port=taken.getsockname()[1])] if address else []
        main(["batch", str(tmp_path), "--out", str(tmp_path / "out"), *words])
    assert re.fullmatch(f"splitnerf: {said}\n", capsys.readouterr().err)
    assert ray.shutdown.called and ray.init.called != bool(address) and os.environ["RAY_USAGE_STATS_ENABLED"] == "0"
    if not address:
        asked = ray.init.call_args.kwargs
        assert not Path(asked["_temp_dir"]).exists() and (asked["_memory"], asked["num_cpus"]) == (4500, processors())
        assert os.environ["RAY_AUTH_MODE"] == "token" and len(os.environ["RAY_AUTH_TOKEN"]) == 64


LAPTOP, NODE = {"CPU": 2.0, "memory": 6 * GB}, {"CPU": 16.0, "GPU": 2.0, "memory": 64 * GB}
NOTHING_ASKED = dict(cores=None, gpus=None, memory=None)


def test_scenes_share_the_machines_unless_the_user_says_otherwise():
    cases = ([LAPTOP], 6), ([LAPTOP], 1), ([LAPTOP | {"memory": 3 * GB}], 6), ([LAPTOP, NODE], 4)
    shares = [share_of(machines, n_scenes, **NOTHING_ASKED) for machines, n_scenes in cases]
    assert shares == [Share(1, 0, 4), Share(2, 0, 4), Share(1, 0, 3), Share(4, 0.25, 4)]
    shares = [share_of([NODE, NODE], n_scenes, **NOTHING_ASKED) for n_scenes in (1, 2, 100)]
    assert shares == [Share(16, 0.25, 4), Share(16, 0.25, 4), Share(1, 0.25, 4)]
    assert share_of([NODE], 9, cores=0.5, gpus=0.1, memory=1.0) == Share(0.5, 0.1, 1.0)
    assert share_of([NODE], 9, **NOTHING_ASKED, whole_gpu=True).gpus == 1
    photos = share_of([NODE], 9, **NOTHING_ASKED, photos=10.0)
    assert photos.memory == pytest.approx(12.15, abs=0.01) and photos.photos == pytest.approx(10)
    assert Share(0.5, 0, 4).threads == 1 and Share(3.9, 0, 4).threads == 3
    assert Share(1, 0, 0.5).photos == 0.125 and str(Share(1, 0.25, 12.14)) == "1 core, 0.25 GPU and 12.1 GB"
    nodes = (True, NODE), (False, LAPTOP), (True, {"GPU": 1.0})  # one that is gone, one without cores
    ray = SimpleNamespace(nodes=lambda: [{"Alive": alive, "Resources": resources} for alive, resources in nodes])
    assert machines_of(ray) == [NODE]


def test_more_than_a_machine_has_is_refused():
    for asked in (dict(cores=3), dict(gpus=1), dict(memory=7)):
        with pytest.raises(InputError, match="no machine offers .*; request less by --cores-per-scene"):
            share_of([LAPTOP], 1, **NOTHING_ASKED | asked)
    # One has the cores, the other the GPUs.
    with pytest.raises(InputError, match="no machine offers 2 cores, 1 GPU and 1 GB"):
        share_of([{**NODE, "GPU": 0.0}, {**NODE, "CPU": 1.0}], 1, cores=2, gpus=1, memory=1)


ENDED = [
    Scene("chair", "/a/chair", "done", 300, 4.04, {"views": 34.251, "normals": 6.08, "light": 14.5}),
    Scene("x" * 60, "/a/x|`<b>\n", "refused", None, 0.0, {}, "/a/x|`<b>\n: is \x1b[31mdamaged"),
]


def test_tables_have_a_row_a_scene_whatever_its_words():
    lines = markdown(ENDED).splitlines()
    head = "scene | state | steps | minutes | views | relit | albedo | normals | light | error | data"
    assert lines[0] == f"| {head} |" and lines[-1] == "PSNR in dB, normals in degrees."
    assert [line.replace("\\|", "").count("|") for line in lines[:4]] == [12] * 4 and "<b>" not in "".join(lines)
    assert lines[2].startswith("| [chair](chair/report.html) | done | 300 | 4.0 | 34.25 | - | - | 6.1 | 14.50 |")
    assert r"is \\x1b\[31mdamaged" in lines[3] and lines[3].startswith(f"| {'x' * 60} | refused | - | - | - |")
    # On the terminal the reason of a failure stands in place of scores; a name has at most 28 letters.
    written = [scenes.terminal_row(one) for one in (None, *ENDED, replace(ENDED[0], name="y" * 28))]
    names = [name.ljust(28) for name in ("scene", "chair", "x" * 27 + "~", "y" * 28)]
    assert [row[:28] for row in written] == names and written[3][28:] == written[1][28:]
    assert [row[28:38].rstrip() for row in written] == ["  state", "  done", "  refused", "  done"]
    titles = "steps minutes views relit albedo normals light", "300 4.0 34.25 - - 6.1 14.50"
    assert [row[38:] for row in written[:2]] == ["".join(f"{cell:>8}" for cell in row.split()) for row in titles]
    assert written[2][38:] == "       -       -  /a/x|`<b> : is \\x1b[31mdamaged"


def work_in(folder: Path, data: Path, *options: str) -> Work:
    return Work(str(data), str(folder / "run"), list(options), 3, str(folder / "logs" / "a.log"))


def test_a_damaged_scene_is_refused_with_its_last_word(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data/transforms_train.json").write_text("{")
    outcome = train_scene(work_in(tmp_path, tmp_path / "data"))
    assert outcome.code == 2 and not outcome.stopped and not (tmp_path / "run").exists()
    assert outcome.error.startswith(f"{tmp_path}/data/transforms_train.json: is not valid json")
    log = (tmp_path / "logs/a.log").read_text()
    assert log.startswith("$ ") and f"train {tmp_path}/data --out {tmp_path}/run --resume auto" in log


def test_the_last_word_says_why(tmp_path):
    for said, code, error in (
        ("splitnerf: data: bad\nsplitnerf: note: a\n 10% 00:10\n", 2, "data: bad"),
        *(("Segmentation fault\n\n", 1, "Segmentation fault"), ("", 1, "ended with exit code 1")),
        *(("splitnerf: x\n", -9, "was killed by SIGKILL"), ("splitnerf: x\n", 0, ""), ("y" * 9000, 1, "y" * 500)),
        ("splitnerf: \x1b[31mred\n", 1, r"\x1b[31mred"),
    ):
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
    """Ray cancels by KeyboardInterrupt. The process has as many threads as it should and not Ray's token."""
    told, given = tmp_path / "told", {}
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs/a.log").write_text("splitnerf: of an earlier one\n")
    monkeypatch.setenv("RAY_AUTH_TOKEN", "secret")
    start = subprocess.Popen

    def started(words, **rest):
        given.update(rest["env"])
        return start([sys.executable, "-c", CHILD, str(told)], **rest)

    monkeypatch.setattr(child.subprocess, "Popen", started)

    def interrupted(seconds):
        time.sleep(0.01)
        if told.exists() and told.read_text() == "works":
            raise KeyboardInterrupt

    monkeypatch.setattr(child, "time", SimpleNamespace(sleep=interrupted, monotonic=time.monotonic))
    outcome = train_scene(work_in(tmp_path, tmp_path))
    assert outcome == Outcome(130, "ended with exit code 130", True) and told.read_text() == "saved"
    assert given["OMP_NUM_THREADS"] == "3" and "RAY_AUTH_TOKEN" not in given and given["PATH"] == os.environ["PATH"]
    assert (tmp_path / "logs/a.log").read_text().startswith("splitnerf: of an earlier one\n$ ")


RayError = type("RayError", (Exception,), {})
LOSSES = ("TaskCancelledError", "OutOfMemoryError", "WorkerCrashedError", "NodeDiedError", "ObjectLostError")
ERRORS = SimpleNamespace(RayError=RayError, **{name: type(name, (RayError,), {}) for name in LOSSES})


class PretendRay:
    """Ray with one worker: each scene's processes end as its list says, the first of those that wait next. It keeps
    what tasks were said to need, their work and its folders in the order in which processes began, and what was cancelled."""

    exceptions = ERRORS

    def __init__(self, ends: dict[str, list]):
        self.ends, self.needs, self.works, self.begun, self.cancelled = ends, {}, [], [], []

    def remote(self, function):
        return SimpleNamespace(options=lambda **needs: SimpleNamespace(remote=self.needs.update(needs) or self.place))

    def place(self, work: Work):
        self.works.append(work)
        self.begun.append(work.data)
        return Mock(end=self.ends[work.data].pop(0))

    def wait(self, references, timeout):
        if references[0].end is KeyboardInterrupt and references[0] not in self.cancelled:
            raise KeyboardInterrupt
        return references[:1], references[1:]

    def get(self, reference):
        if isinstance(reference.end, Exception):
            raise reference.end
        return Outcome(130, "stopped", True) if reference.end is KeyboardInterrupt else reference.end

    def cancel(self, reference):
        self.cancelled.append(reference)


def batch_of(tmp_path: Path, ends: dict[str, list], retries: int = 3, *options: str) -> tuple:
    """A batch that ran with a pretended Ray; its rows and notes, and whether all came to an end."""
    known, rows, notes = known_scenes(tmp_path), [], []
    asked = requested_scenes(known, [Path(data) for data in ends])
    row = lambda scene: rows.append((scene.name, scene.state))
    batch = BatchPlan(tmp_path, known, asked, ["--steps=4", *options], retries, row, notes.append)
    ray = PretendRay({data: list(end) for data, end in ends.items()})
    return batch, ray, rows, notes, run_batch(ray, batch, Share(2.5, 0.25, 12))


KILLED, REFUSED = Outcome(-9, "was killed by SIGKILL", False), Outcome(2, "bad", False)
WELL, BROKE = Outcome(0, "", False), Outcome(1, "loss is nan", False)
LOST = ERRORS.WorkerCrashedError()


def finish_run(run: Path, **scores: object) -> None:
    run.mkdir(parents=True)
    (run / "checkpoint.pt").touch()
    steps = [f'{{"step": {step}, "progress": 1.0, "seconds": {seconds}}}\n' for step, seconds in ((2, 30.0), (4, 90.0))]
    (run / "metrics.jsonl").write_text("".join(steps) + '{"step": 9, "lo')
    (run / "evaluation.json").write_text(json.dumps({"novel_view": {"psnr": 30.0}, "albedo": None} | scores))


def test_only_killed_scenes_are_tried_again(tmp_path):
    """Of the worker or of the process in it, or asked to end by another than us; each goes on in its turn."""
    asked = Outcome(130, "stopped at step 8", False)
    scores = {"relight": {"psnr": 28.0}, "albedo": {"psnr": 21.0}, "normal_mae_deg": 5.0, "light_psnr": 15.0}
    for name, seconds in zip("abc", ({"seconds": 120.0} | scores, {}, {})):
        finish_run(tmp_path / name, **seconds)
    ends = {"/a": [LOST, KILLED, WELL], "/b": [WELL], "/c": [asked, WELL], "/d": [REFUSED], "/e": [BROKE]}
    batch, ray, rows, notes, ended = batch_of(tmp_path, ends)
    assert ended and ray.begun == ["/a", "/b", "/c", "/d", "/e", "/a", "/c", "/a"]
    assert rows == [("b", "done"), ("d", "refused"), ("e", "failed"), ("c", "done"), ("a", "done")]
    reasons = [note.partition(";")[0] for note in notes]
    assert reasons == ["a: its worker was killed", "c: stopped at step 8", "a: was killed by SIGKILL"]
    assert [note.rpartition(" of ")[0][-1] + note[-1] for note in notes] == ["13", "13", "23"]  # of three retries
    found = {scene.name: scene for scene in known_scenes(tmp_path)}
    assert (found["a"].minutes, found["a"].steps) == (2, 4)
    assert found["a"].scores == {"views": 30.0, "relit": 28.0, "albedo": 21.0, "normals": 5.0, "light": 15.0}
    assert found["b"].minutes == 1.5 and found["b"].scores == {"views": 30.0}  # those of the log
    memory = ["--steps=4", f"--max-memory={12 - 2 * 2**30 / 1e9:g}"]  # without the 2 GiB of a training
    assert ray.works[0] == Work("/a", str(tmp_path / "a"), memory, 2, str(tmp_path / "logs/a.log"))
    assert ray.needs == {"num_cpus": 2.5, "num_gpus": 0.25, "memory": 12 * 10**9, "max_retries": 0}
    assert found["e"].error == "loss is nan" and "| e | failed |" in (tmp_path / "batch.md").read_text()


def test_retries_come_to_an_end_and_what_ray_says_of_a_task_is_its_outcome(tmp_path):
    memory = ERRORS.OutOfMemoryError()
    batch, ray, rows, notes, ended = batch_of(tmp_path, {"/a": [LOST, LOST, memory]}, 2, "--max-memory=3")
    assert ended and rows == [("a", "failed")] and len(notes) == 2
    assert batch.scenes[0].error == "ran out of memory (--memory-per-scene)"
    assert ray.works[2].options == ["--steps=4", "--max-memory=3"]
    for error, outcome in (
        *((ERRORS.TaskCancelledError(), Outcome(None, "", True)), (RayError(), Outcome(1, "RayError", False))),
        (ERRORS.NodeDiedError("where"), Outcome(-9, "its worker was killed", False)),
        (RayError("in a task:\nModuleNotFoundError: Why\n\n"), Outcome(1, "ModuleNotFoundError: Why", False)),
    ):
        assert outcome_of(PretendRay({}), Mock(end=error)) == outcome


def test_an_interrupt_cancels_all_and_waits_for_them(tmp_path):
    """Also for one that fails meanwhile, and one that has not begun. A second call forgets what was known of a scene."""
    finish_run(tmp_path / "a")
    finish_run(tmp_path / "b")
    ends = {"/a": [WELL], "/b": [KeyboardInterrupt], "/c": [LOST], "/d": [BROKE], "/e": [ERRORS.TaskCancelledError()]}
    batch, ray, rows, notes, ended = batch_of(tmp_path, ends)
    waiting = [(name, "waiting") for name in "cde"]
    assert not ended and rows == [("a", "done"), ("b", "stopped"), *waiting] and len(ray.cancelled) == 4
    assert [(scene.steps, scene.minutes) for scene in batch.scenes[1:3]] == [(4, 1.5), (None, 0)]
    batch, ray, rows, notes, ended = batch_of(tmp_path, {"/a": [REFUSED], "/b": [WELL], "/c": [WELL]})
    assert ended and rows == [("a", "refused"), ("b", "done"), ("c", "done")]
    assert batch.scenes[0].scores == {} and batch.scenes[1].scores == {"views": 30.0}
