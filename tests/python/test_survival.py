"""A run survives what happens to it: signals, kills, full disks, damaged logs, readers that go away."""

import errno
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from multiprocessing.process import BaseProcess
from pathlib import Path
from random import Random

import pytest
from splitnerf.cli import BAD_INPUT, DONE, FAILED, INTERRUPTED, main
from splitnerf.cli.streams import lasting_streams
from splitnerf.data.dataset import load_dataset
from splitnerf.files import LOCK
from splitnerf.progress import Interrupt, ended_by_signals
from splitnerf.training import loop
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.metrics import METRICS, keep_metrics, read_metrics
from splitnerf_tools.report.html import _charts
from test_files import held
from test_train import flat, same
from tiny_runs import SMALL, as_options, command, contents, lines_of, refused, tiny, train, train_scene
from tqdm import tqdm

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


# ---- signals ----


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_saves_after_the_steps_that_share_a_light(data, tmp_path, at_step, capsys, number):
    """Four steps share one, and nothing else is made before the program ends."""
    at_step(9, lambda: signal.raise_signal(number))
    assert train(data, tmp_path / "run", "--steps", "40") == INTERRUPTED
    assert "stopped at step 12; the state is in" in capsys.readouterr().out
    assert load_checkpoint(tmp_path / "run/checkpoint.pt")["step"] == 12
    assert not (tmp_path / "run/mesh.glb").exists() and not (tmp_path / "run" / LOCK).exists()


def test_a_signal_ends_a_preview(data, tmp_path, monkeypatch):
    """It may take longer than the second that there is; the run that goes on makes it."""
    begun = []

    def preview(run, model, grid, dataset, step) -> None:
        begun.append(step)
        if len(begun) == 1:
            signal.raise_signal(signal.SIGTERM)
            raise AssertionError("the preview goes on")

    monkeypatch.setattr(loop, "write_preview", preview)
    config = tiny(steps=8, preview_every=0.25)
    assert not train_scene(load_dataset(data), config, tmp_path).finished
    assert begun == [2] and load_checkpoint(tmp_path / "checkpoint.pt")["step"] == 4
    assert train_scene(load_dataset(data), config, tmp_path, resume=True).finished
    assert begun == [2, 4, 6, 8]


def test_work_that_may_be_left_out_is_so_after_a_request():
    done = []
    with Interrupt() as interrupt:
        interrupt.attempt(lambda: done.append(1))
        with pytest.raises(ZeroDivisionError):
            interrupt.attempt(lambda: 1 / 0)
        signal.raise_signal(signal.SIGTERM)
        interrupt.attempt(lambda: done.append(2))
    assert done == [1]


@pytest.mark.parametrize("part", ["splitnerf.pipeline.load_splits", "splitnerf.pipeline.begun"])
@pytest.mark.parametrize(("words", "more"), [((), ("--overwrite",)), (("--resume", "auto"), ())])
def test_an_interruption_before_the_first_checkpoint_says_what_to_do(
    part, words, more, data, tmp_path, monkeypatch, capsys
):
    """And that works: before anything stands in the run's folder, and after."""
    command = (data, tmp_path / "run", "--steps", "4", *words)
    monkeypatch.setattr(part, lambda *_, **__: signal.raise_signal(signal.SIGINT))
    assert train(*command) == INTERRUPTED
    told = "repeat the command" + "".join(f" with {word}" for word in more)
    assert capsys.readouterr().err.rstrip().endswith(f"interrupted, nothing to continue from; {told}")
    monkeypatch.undo()
    assert train(*command, *more) == DONE


def test_a_signal_elsewhere_leaves_nothing_half_written(data, tmp_path, monkeypatch, capsys):
    """As Ctrl-C does: here while the meshes are exported."""
    monkeypatch.setattr("splitnerf.pipeline.write_assets", lambda *_, **__: signal.raise_signal(signal.SIGTERM))
    assert train(data, tmp_path / "run", "--steps", "8") == INTERRUPTED
    assert "interrupted" in capsys.readouterr().err and not (tmp_path / "run" / LOCK).exists()
    monkeypatch.undo()
    assert train(data, tmp_path / "run", "--resume") == DONE


def test_a_module_that_is_being_loaded_does_not_swallow_a_signal(tmp_path, monkeypatch):
    """As some do that take any exception for a missing library."""
    content = "import signal\ntry: signal.raise_signal(2)\nexcept BaseException: loaded = 0"
    (tmp_path / "swallower.py").write_text(content)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), ended_by_signals():
        import swallower

        time.sleep(5.0)
    assert not hasattr(swallower, "loaded")


def test_nohup_is_left_to_ignore():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals(), Interrupt() as interrupt:
            signal.raise_signal(signal.SIGHUP)
            assert not interrupt.asked and signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_thread_beside_the_main_one_runs_commands(capsys):
    codes = []
    thread = threading.Thread(target=lambda: codes.append(main(["info", "--settings"])))
    thread.start()
    thread.join()
    assert codes == [DONE] and "mask_weight" in capsys.readouterr().out


# ---- streams ----


class Gone:
    """A stream whose reader has gone."""

    def __init__(self, number: int = errno.EPIPE):
        self.number, self.tries = number, 0

    def write(self, text: str) -> int:
        self.tries += 1
        raise OSError(self.number, os.strerror(self.number))

    def flush(self) -> None:
        raise OSError(self.number, os.strerror(self.number))

    def isatty(self) -> bool:
        return False

    def fileno(self) -> int:
        raise OSError("none")


@pytest.mark.parametrize("number", [errno.EPIPE, errno.EIO, errno.ENOSPC])
def test_a_run_goes_on_without_a_reader_of_its_words(data, tmp_path, monkeypatch, number):
    stream = Gone(number)
    monkeypatch.setattr(sys, "stderr", stream)
    assert train(data, tmp_path / "run", "--steps", "8") == DONE
    assert stream.tries and (tmp_path / "run/report.html").is_file()


def test_results_that_find_no_room_are_an_error(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", Gone(errno.ENOSPC))
    assert main(["info"]) == FAILED and "splitnerf: No space left on device\n" == capsys.readouterr().err
    monkeypatch.setattr(sys, "stdout", Gone(errno.EPIPE))
    assert main(["info"]) == DONE


STREAMS = """
import os, sys
os.close(0)
from splitnerf.cli.streams import lasting_streams
with lasting_streams():
    with open(sys.argv[1], "w") as file:
        assert file.fileno() > 2
        print("words", file=sys.stderr)
        print("results")
        file.write("mine")
"""


@pytest.mark.parametrize("closed", [1, 2])
def test_a_closed_stream_does_not_write_into_the_next_file(tmp_path, closed):
    begin = f"import os, sys; os.close({closed}); os.execv(sys.executable, [sys.executable, '-c', *sys.argv[1:]])"
    words = [sys.executable, "-c", begin, STREAMS, str(tmp_path / "file")]
    program = subprocess.run(words, capture_output=True, text=True)
    assert program.returncode == 0, program.stderr
    assert (tmp_path / "file").read_text() == "mine"
    assert (program.stdout, program.stderr) == (("results\n", "") if closed == 2 else ("", "words\n"))


LEFT = """
import sys
from splitnerf.cli.streams import lasting_streams
with lasting_streams():
    print("results", flush=True)
    sys.stdin.read()
    print("more")
"""


def test_what_is_left_in_a_pipe_that_closed_is_dropped():
    """Without a word at the program's end, and with exit code 0."""
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    program = subprocess.Popen([sys.executable, "-c", LEFT], env=buffered, text=True, **pipes)
    assert program.stdout.readline() == "results\n"
    program.stdout.close()
    program.stdin.close()
    assert program.stderr.read() == "" and program.wait() == 0


def test_names_do_not_command_the_terminal(tmp_path, capsys):
    name = tmp_path / "\x1b]0;owned\x07"
    assert main(["evaluate", str(name)]) == BAD_INPUT
    with lasting_streams():
        print(f"results: {name}")
    printed = capsys.readouterr()
    assert "\x1b" not in printed.err + printed.out and r"\x1b]0;owned\x07" in printed.err and r"\x1b" in printed.out


# ---- the folder ----


def test_a_run_in_use_is_refused(data, done, capsys):
    """Whatever would write there."""
    run, before = done, contents(done)
    with held(run) as owner:
        for words in (
            ["train", data, "--out", run, "--resume"],
            ["train", data, "--out", run, "--overwrite"],
            ["train", data, "--out", run, "--resume", "auto"],
            ["demo", "--out", run, "--overwrite"],
            ["export", run],
            ["batch", data, "--out", run],
            ["evaluate", run, "--data", data],
        ):
            assert f"in use by pid {owner.pid} on " in refused(capsys, *words)
    (run / LOCK).unlink()
    shutil.rmtree(run / "sub")  # what the owner was writing
    assert contents(run) == before


def test_a_refused_run_leaves_the_folder_as_it_was(data, other_data, done, capsys):
    """Refused when it goes on, or refused for its settings when it is to be replaced; the demo replaces none."""
    before = contents(done)
    for words in (
        ["train", other_data, "--resume", "--steps", "9"],
        ["train", data, "--resume", "--set", "n_levels=5"],
        ["train", data, "--resume", "--set", "grid_resolution=20"],
        ["train", data, "--overwrite", "--set", "no_such=1"],
        ["train", data, "--overwrite", "--set", "box=0"],
        ["train", data / "none", "--overwrite"],
        ["train", data, "--overwrite", "--downscale", "99"],
        ["demo", "--max-minutes", "-1", "--overwrite"],
        ["demo", "--seed", "99999999999999999999", "--overwrite"],
        ["demo"],
        ["train", data],
    ):
        assert command(*words, "--out", done) == BAD_INPUT, words
        assert contents(done) == before, words
    said = capsys.readouterr().err
    assert said.count("holds a run already") == 2 and "--overwrite" in said


def test_a_run_whose_model_cannot_be_made_is_not_replaced(data, done, monkeypatch):
    before = contents(done)

    def fails(*_) -> None:
        raise MemoryError("32 TiB")

    monkeypatch.setattr(loop, "SceneModel", fails)
    assert train(data, done, "--overwrite") == FAILED
    assert contents(done) == before


def test_data_are_not_replaced_by_results(data, trained_once, capsys):
    run, before = trained_once, contents(data)
    for words in (
        ["train", data, "--overwrite"],
        ["demo", "--overwrite"],
        ["export", run],
        ["refine", run, "--data", data],
        ["relight", run / "mesh.glb", "--env", data / "light.hdr", "--overwrite"],
        ["batch", "a"],
    ):
        assert command(*words, "--out", data) == BAD_INPUT, words
        assert "holds a data set, which results would replace" in capsys.readouterr().err, words
        assert contents(data) == before, words


def test_a_folder_that_was_removed_ends_a_run_with_one_line(data, tmp_path, at_step, capsys):
    run = tmp_path / "run"
    at_step(5, lambda: run.rename(tmp_path / "elsewhere"))
    assert train(data, run, "--steps", "40") == FAILED
    error = capsys.readouterr().err
    assert "run/metrics.jsonl: cannot be written (No such file or directory)" in error and "Traceback" not in error
    assert not run.exists()


@pytest.mark.parametrize("victim", ["checkpoint.pt", "mesh.glb", "environment.exr", "evaluation.json", "report.html"])
def test_a_full_disk_is_one_line_and_the_checkpoint_stays_whole(data, tmp_path, monkeypatch, capsys, victim):
    run, write = tmp_path / "run", os.replace

    def replace(source, target) -> None:
        if Path(target).name == victim:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source))
        write(source, target)

    monkeypatch.setattr(os, "replace", replace)
    assert train(data, run, "--steps", "4") == FAILED
    line = capsys.readouterr().err.splitlines()[-1]
    assert line == f"splitnerf: {run / victim}: cannot be written (No space left on device)"
    assert not list(run.rglob(".*")) and not (run / victim).exists()
    if victim != "checkpoint.pt":
        assert load_checkpoint(run / "checkpoint.pt")["step"] == 4
        monkeypatch.undo()
        assert train(data, run, "--resume") == DONE


# ---- resume ----


def test_resume_auto_begins_goes_on_and_ends(data, tmp_path, at_step, capsys):
    """The same command each time."""
    run, words = tmp_path / "run", ("--steps", "16", "--preset", "cpu", "--resume", "auto")
    at_step(5, lambda: signal.raise_signal(signal.SIGTERM))
    assert train(data, run, *words) == INTERRUPTED
    assert load_checkpoint(run / "checkpoint.pt")["step"] == 8
    assert train(data, run, *words) == DONE
    assert load_checkpoint(run / "checkpoint.pt")["step"] == 16
    before = {path: path.stat().st_mtime_ns for path in run.rglob("*")}
    capsys.readouterr()
    assert train(data, run, *words) == DONE
    printed = capsys.readouterr().out
    assert "is finished" in printed and "novel views" in printed
    assert before == {path: path.stat().st_mtime_ns for path in run.rglob("*")}
    os.utime(run / "checkpoint.pt", (2e9, 2e9))  # as a copy may leave it, or a clock that was set
    assert train(data, run, *words) == DONE and "is finished" in capsys.readouterr().out
    assert train(data, run, "--steps", "20", "--resume", "auto") == DONE
    assert load_checkpoint(run / "checkpoint.pt")["step"] == 20
    assert train(data, run, "--preset", "fast", "--resume", "auto") == BAD_INPUT
    assert train(data, run, "--overwrite", "--resume", "auto") == BAD_INPUT


def test_resume_auto_begins_again_before_the_first_checkpoint(data, tmp_path, at_step, monkeypatch, capsys):
    """What an end before it left is no run yet; anything else is not touched."""
    run = tmp_path / "run"

    def fails() -> None:
        raise MemoryError

    at_step(2, fails)
    assert train(data, run, "--steps", "4") == FAILED
    left = {path.name for path in run.iterdir()}
    assert METRICS in left and left <= {"config.toml", "data.json", METRICS, "previews"}
    monkeypatch.undo()
    assert train(data, run, "--steps", "4", "--resume", "auto") == DONE
    assert [line["step"] for line in lines_of(run)] == [1, 2, 3, 4]
    (run / "checkpoint.pt").unlink()
    assert train(data, run, "--steps", "4", "--resume", "auto") == BAD_INPUT
    assert "holds a run already" in capsys.readouterr().err and (run / "mesh.glb").is_file()


def test_a_damaged_log_is_mended(data, tmp_path):
    """The last line of a killed run may be cut, and its lines may reach beyond the checkpoint; damage ends no finished run."""
    run = tmp_path / "run"
    assert train(data, run, "--steps", "8") == DONE
    whole = (run / METRICS).read_bytes()
    with open(run / METRICS, "ab") as log:
        log.write(b'{"step": 9, "loss": 1.0}\n[1]\n\xff\n{"step": "x"}\n{"step": 10, "lo')
    assert len(read_metrics(run / METRICS)) == 9
    keep_metrics(run / METRICS, 8)
    assert (run / METRICS).read_bytes() == whole
    (run / METRICS).write_bytes(b"damaged\n" + whole + b'{"step": 9, "loss": 1.0}\n{"step": 10, "lo')
    assert main(["evaluate", str(run), "--data", str(data)]) == DONE
    for steps in (8, 12):
        assert train(data, run, "--steps", str(steps), "--resume") == DONE
        assert [line["step"] for line in lines_of(run)] == list(range(1, steps + 1))


def test_numbers_too_large_for_a_float_are_no_news_in_a_log(tmp_path):
    """Of 400 digits, in a line that can be read, and as the step of another."""
    huge = "1" + "0" * 400
    (tmp_path / METRICS).write_text(f'{{"step": 1, "loss": {huge}, "psnr": 20.0}}\n{{"step": {huge}, "loss": 1.0}}\n')
    lines = read_metrics(tmp_path / METRICS)
    assert [line["step"] for line in lines] == [1]
    assert [title for title, *_ in _charts(lines)] == ["Photos while training, PSNR (dB)"]


FITTED = ("mesh.glb", "mesh.ply", "environment.exr", "environment.hdr", "trained/mesh.glb")


def run_command(*words: str) -> None:
    tqdm.set_lock(threading.RLock())  # its own would outlive a killed program
    sys.exit(main(list(words)))


def started(*words: str) -> BaseProcess:
    """A program that runs a command, forked from one that has loaded the packages already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["splitnerf.pipeline", "torch._dynamo"])
    process = context.Process(target=run_command, args=words)
    process.start()
    return process


@pytest.mark.parametrize("n_kills", [5, pytest.param(30, marks=pytest.mark.slow)])
def test_kills_end_with_the_bits_of_an_unbroken_run(data, tmp_path, n_kills):
    """With -9 and at random moments: while it starts, trains, exports, in the refinement and in the scores."""
    refined = {"refinement.enabled": True, "refinement_sweeps": 2}
    settings = SMALL | refined | {"checkpoint_minutes": 0.0, "mesh_every": 0.2}
    words = ["train", str(data), "--steps", "40", "--deterministic", "--resume", "auto", *as_options(settings), "--out"]

    def state(run: Path) -> dict[str, object]:
        content = flat(load_checkpoint(run / "checkpoint.pt"))
        return content | {"seconds": 0} | {name: (run / name).read_bytes() for name in FITTED}

    started("info", "--settings").join()
    whole, began = started(*words, str(tmp_path / "whole" / "run")), time.monotonic()
    whole.join()
    seconds, random, runs, kills = time.monotonic() - began, Random(0), 0, 0
    assert whole.exitcode == DONE
    expected = state(tmp_path / "whole" / "run")
    while kills < n_kills:
        runs, run = runs + 1, tmp_path / f"killed_{runs}" / "run"  # the files hold its name
        while (process := started(*words, str(run))).join(random.uniform(0.1, 1.0) * seconds) or process.is_alive():
            process.kill()
            process.join()
            kills += process.exitcode == -signal.SIGKILL
            saved = (run / "checkpoint.pt").exists()
            step = load_checkpoint(run / "checkpoint.pt")["step"] if saved else "none"
            print(f"kill {kills}: run {runs}, checkpoint of step {step}, files {len(list(run.rglob('*')))}")
        assert process.exitcode == DONE
        found = state(run)
        assert [key for key in expected if not same(expected[key], found[key])] == []
        assert not list(run.rglob(".*")) and not (run / LOCK).exists()
    print(f"{kills} kills of {runs} runs, each of which takes {seconds:.1f} s")
