"""What a long run shows of its progress, to a terminal, a log and TensorBoard, and how Ctrl-C reaches it."""

import io
import signal
import sys

import numpy as np
import pytest
import torch
from PIL import Image
from splitnerf import progress
from splitnerf.cli import BAD_INPUT
from splitnerf.data.dataset import load_dataset
from splitnerf.progress import Interrupt, Progress
from splitnerf.training.loop import Training
from splitnerf.training.observer import TensorBoard
from tiny_runs import lines_of, tiny, train


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch) -> list[float]:
    """The seconds of the clock, as its only number."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_elsewhere_than_on_a_terminal_a_line_is_written_every_ten_seconds(clock, capsys):
    """A part that began at 20 % and took 10 seconds to 40 % has 30 seconds left."""
    with Progress(0.2) as bar:
        for seconds, share in ((5, 0.3), (10, 0.4), (19, 0.5), (20, 0.6), (29.9, 0.7)):
            clock[0] = 100.0 + seconds
            bar.show(share, f"step {round(10 * share)}")
        bar.show(1.0, "done")
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == [" 40% 00:10<00:30 step 4", " 60% 00:20<00:20 step 6", "100% 00:29<00:00 done"]


def test_a_terminal_shows_a_bar(monkeypatch):
    """It begins where the run goes on, and ends its line."""
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    with Progress(0.25) as bar:
        assert " 25%|" in terminal.getvalue()
        bar.show(0.5, "step 7")
        bar.show(0.75, "step 8")
        assert not terminal.getvalue().endswith("\n")
    shown = terminal.getvalue()
    assert " 75%|" in shown.split("\r")[-1] and "step 8" in shown and shown.endswith("\n")


def test_a_part_that_may_take_long_is_said_at_once(clock, capsys):
    with Progress(0.0, at_once=True) as bar:
        bar.show(0.0, "first")
        bar.show(0.5, "second")
    assert capsys.readouterr().err == "  0% 00:00<? first\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_and_the_second_is_as_before(number):
    seen = []
    others = {s: signal.signal(s, lambda s, frame: seen.append(s)) for s in (signal.SIGINT, signal.SIGTERM)}
    try:
        with Interrupt() as interrupt:
            assert not interrupt.asked
            signal.raise_signal(number)
            assert interrupt.asked and seen == []
            signal.raise_signal(number)
            assert seen == [number]
        with Interrupt():
            pass
        for s in others:
            signal.raise_signal(s)
        assert seen == [number, *others]
    finally:
        for s, handler in others.items():
            signal.signal(s, handler)


def test_scalars_and_previews_are_written(data, tmp_path):
    pytest.importorskip("tensorboard", reason="needs tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    run, config = tmp_path / "run", tiny(steps=40, preview_every=0.5)
    run.mkdir()
    for steps in (40, 44):  # the second run goes on
        with TensorBoard(tmp_path / "board") as board:
            training = Training(load_dataset(data), config.replace({"steps": steps}), run, torch.device("cpu"), board)
            if steps == 44:
                training.restore()
            training.complete()
    read = EventAccumulator(str(tmp_path / "board"), size_guidance={"images": 0, "scalars": 0}).Reload()
    lines = lines_of(run)
    for name in ("loss", "loss_colour", "psnr", "samples_per_ray", "is_unoccluded"):
        written = [(event.step, event.value) for event in read.Scalars(name)]
        assert [step for step, _ in written] == [line["step"] for line in lines]
        assert [value for _, value in written] == pytest.approx([float(line[name]) for line in lines], rel=1e-6)
    (tag,) = read.Tags()["images"]
    assert [event.step for event in read.Images(tag)][:2] == [20, 40]
    (tmp_path / "shown.png").write_bytes(read.Images(tag)[0].encoded_image_string)
    shown, saved = (
        np.asarray(Image.open(path).convert("RGB"))
        for path in (tmp_path / "shown.png", run / "previews/step_000020.png")
    )
    assert np.abs(shown.astype(int) - saved).max() <= 1


def test_a_full_disk_ends_the_curves_and_not_the_run(data, tmp_path, monkeypatch, capsys):
    pytest.importorskip("tensorboard", reason="needs tensorboard")
    from torch.utils.tensorboard import SummaryWriter

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(SummaryWriter, "add_scalar", full)
    with TensorBoard(tmp_path / "board") as board:
        training = Training(load_dataset(data), tiny(steps=4), tmp_path, torch.device("cpu"), board)
        training.complete()
        assert training.step == 4
    said = [line for line in capsys.readouterr().err.splitlines() if "TensorBoard" in line]
    assert len(said) == 1 and str(tmp_path / "board") in said[0] and "No space left" in said[0]


def test_without_the_package_one_line_says_what_to_install(data, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    assert train(data, tmp_path / "run", "--tensorboard", str(tmp_path / "board")) == BAD_INPUT
    said = "splitnerf: --tensorboard: needs tensorboard; pip install 'splitnerf[tensorboard]'\n"
    assert capsys.readouterr().err == said
    assert not (tmp_path / "run").exists() and not (tmp_path / "board").exists()


def test_a_file_is_no_folder_for_tensorboard(data, tmp_path, capsys):
    pytest.importorskip("tensorboard", reason="needs tensorboard")
    (tmp_path / "board").write_text("")
    assert train(data, tmp_path / "run", "--tensorboard", str(tmp_path / "board")) == BAD_INPUT
    assert "is a file; give --tensorboard a folder" in capsys.readouterr().err and not (tmp_path / "run").exists()
