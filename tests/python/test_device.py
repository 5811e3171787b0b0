"""The trainer on another device than the CPU, by tensors that only say so."""

from __future__ import annotations

import itertools
import json
import statistics

import pytest
import torch
from pretend_gpu import GPU, GpuTensor, pretend_gpu
from tiny_runs import tiny

from splitnerf.training import loop as trainer
from splitnerf.training import step
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.cli import BAD_INPUT, main
from splitnerf.data.dataset import load_dataset
from splitnerf.errors import InputError
from splitnerf.render import model, renderer
from splitnerf.render.renderer import find_samples
from splitnerf.workflow import reconstruct


def test_two_devices_in_one_call_are_told(monkeypatch):
    with pretend_gpu(monkeypatch) as gpu:
        here, there = torch.ones(3), torch.ones(3, device="cuda")
        assert there.device == GPU and here.device.type == "cpu" and (there * 2).device == GPU
        assert torch.zeros_like(there).is_cuda and not there.cpu().is_cuda and there.to("cpu") is not there
        for wrong in (
            lambda: here + there, lambda: torch.cat([here, there]), lambda: there[torch.tensor([0, 1])],
            lambda: torch.rand(3, generator=torch.Generator("cuda")),
            lambda: torch.rand(3, generator=torch.Generator(), device="cuda"),
        ):  # fmt: skip
            with pytest.raises(RuntimeError, match="two devices"):
                wrong()
        with pytest.raises(TypeError, match="on the GPU"):
            there.numpy()
        assert (there + torch.tensor(1.0)).sum().item() == 6 and there[there > 0].shape == (3,)
        assert gpu.waits == {"cpu": 1, "to": 1, "item": 1, "__getitem__": 1}


def test_modules_and_gradients_stay_there(monkeypatch):
    with pretend_gpu(monkeypatch):
        layer = torch.nn.Linear(3, 2).to("cuda")
        assert all(isinstance(p, GpuTensor) and p.requires_grad for p in layer.parameters())
        layer(torch.ones(4, 3, device="cuda")).sum().backward()
        optimiser = torch.optim.AdamW(layer.parameters(), fused=True)
        optimiser.step()
        assert layer.weight.grad.device == GPU and optimiser.state[layer.weight]["exp_avg"].device == GPU


@pytest.mark.parametrize("name", ["cpu", "fast", "paper"])
def test_a_step_stays_on_the_gpu_and_seldom_waits_for_it(data, tmp_path, monkeypatch, name):
    """Operators that must know how many samples there are wait within, unless they are told what to have room for."""
    waits = []

    def waiting(module, name, is_told):
        operator = getattr(module, name)

        def called(*args, **kwargs):
            gpu.waits[name] += not is_told(*args, **kwargs)
            return operator(*args, **kwargs)

        monkeypatch.setattr(module, name, called)

    waiting(renderer, "march_rays", lambda *_: False)
    waiting(renderer, "sample_rays", lambda *_, room, **__: room > 0)
    waiting(renderer, "spread_samples", lambda *args: args[5] is not None)
    waiting(model, "wide_lobes", lambda *args: args[4] is not None)

    def counted(*args, **kwargs):
        waits.append(gpu.waits.total())
        return find_samples(*args, **kwargs)

    monkeypatch.setattr(step, "find_samples", counted)
    with pretend_gpu(monkeypatch) as gpu:
        settings = {"min_step": 0.03} if name == "paper" else {"target_samples": 4608}  # so that samples have room
        trained = trainer.train(load_dataset(data), tiny(name, steps=32, **settings), tmp_path, device="cuda")
        assert trained.finished and trained.model.device == GPU and trained.grid.cells.device == GPU
    assert all(isinstance(p, GpuTensor) for p in trained.model.parameters())
    each = statistics.median(b - a for a, b in itertools.pairwise(waits[-12:]))
    assert each <= {"cpu": 0, "fast": 0, "paper": 2}[name]


@pytest.mark.parametrize("settings", [{}, {"sparse_steps": True, "table_dtype": "float16"}])
def test_runs_go_on_on_the_other_device_and_back(data, tmp_path, monkeypatch, settings):
    dataset = load_dataset(data)
    config = tiny("cpu", occlusion_directions=256, open_below=0.0, **settings)
    trainer.train(dataset, config.replace({"steps": 12}), tmp_path)
    with pretend_gpu(monkeypatch):
        there = trainer.train(dataset, config.replace({"steps": 24}), tmp_path, device="cuda", resume=True)
        assert there.model.occlusion.cache.bits.device == GPU and there.step == 24
    content = load_checkpoint(tmp_path / "checkpoint.pt")
    assert content["device"] == "cuda" and not any(isinstance(x, GpuTensor) for x in content["model"].values())
    back = trainer.train(dataset, config.replace({"steps": 36}), tmp_path, resume=True)
    steps = [json.loads(line)["step"] for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert back.finished and back.step == 36 and steps == sorted(set(steps))
    psnr = [json.loads(line)["psnr"] for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert all(abs(a - b) < 1.0 for a, b in itertools.pairwise(psnr))


def test_all_files_are_written_from_there(data, tmp_path, monkeypatch):
    with pretend_gpu(monkeypatch):
        _, evaluation = reconstruct(data, tmp_path / "run", tiny("cpu", steps=24), device="cuda")
    assert evaluation["novel_view"]["psnr"] > 5
    for name in ("mesh.ply", "mesh.glb", "environment.exr", "report.html"):
        assert (tmp_path / "run" / name).stat().st_size > 0, name


def test_a_gpu_is_refused_where_bits_shall_repeat(data, tmp_path, monkeypatch):
    config = tiny("cpu", deterministic=True)
    with pretend_gpu(monkeypatch), pytest.raises(InputError, match="deterministic"):
        reconstruct(data, tmp_path / "run", config, device="cuda")
    assert not (tmp_path / "run").exists()
    with pretend_gpu(monkeypatch), pytest.raises(InputError, match="deterministic"):
        trainer.train(load_dataset(data), config, tmp_path, device="cuda")


def test_without_a_gpu_the_device_is_refused(data, tmp_path, capsys):
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    assert main(["train", str(data), "--out", str(tmp_path / "run"), "--device", "cuda"]) == BAD_INPUT
    error = capsys.readouterr().err
    assert "--device cuda" in error and len(error.splitlines()) == 1 and not (tmp_path / "run").exists()
