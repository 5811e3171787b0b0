"""`splitnerf train --tensorboard`: what TensorBoard reads is what the run logged."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import torch
from PIL import Image
from splitnerf.cli import BAD_INPUT
from splitnerf.data.dataset import load_dataset
from splitnerf.training.loop import Training
from splitnerf.training.tensorboard import TensorBoard
from tiny_runs import lines_of, tiny, train


def test_scalars_and_previews_are_written(data, tmp_path):
    pytest.importorskip("tensorboard", reason="needs tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    run, config = tmp_path / "run", tiny(steps=40, preview_every=0.5)
    run.mkdir()
    for steps in (40, 44):  # the second run goes on
        with TensorBoard(tmp_path / "board") as board:
            training = Training(load_dataset(data), config.replace({"steps": steps}), run, torch.device("cpu"), [board])
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
        training = Training(load_dataset(data), tiny(steps=4), tmp_path, torch.device("cpu"), [board])
        assert training.complete().step == 4
    said = [line for line in capsys.readouterr().err.splitlines() if "TensorBoard" in line]
    assert len(said) == 1 and str(tmp_path / "board") in said[0] and "No space left" in said[0]


def test_without_the_package_one_line_says_what_to_install(data, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", None)
    assert train(data, tmp_path / "run", "--tensorboard", str(tmp_path / "board")) == BAD_INPUT
    assert (
        capsys.readouterr().err == "splitnerf: --tensorboard: needs tensorboard; pip install 'splitnerf[tensorboard]'\n"
    )
    assert not (tmp_path / "run").exists() and not (tmp_path / "board").exists()


def test_a_file_is_no_folder_for_tensorboard(data, tmp_path, capsys):
    pytest.importorskip("tensorboard", reason="needs tensorboard")
    (tmp_path / "board").write_text("")
    assert train(data, tmp_path / "run", "--tensorboard", str(tmp_path / "board")) == BAD_INPUT
    assert "is a file; give --tensorboard a folder" in capsys.readouterr().err and not (tmp_path / "run").exists()
