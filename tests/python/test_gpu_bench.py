"""The scripts that measure on a GPU, rehearsed on the CPU with small sizes."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
import torch
from bench import gpu_ops, gpu_train
from tiny_runs import as_options

BENCH = Path(__file__).parents[1] / "bench"
SMALL = as_options(
    dict(
        target_samples=256,
        max_rays=64,
        grid_resolution=16,
        mesh_resolution=24,
        light_resolution=16,
        log2_table_size=10,
        light_samples=64,
        light_queries=64,
    )
)


def run(monkeypatch, main, *words: object) -> int:
    monkeypatch.setattr("sys.argv", ["script.py", *map(str, words), "--device", "cpu", *SMALL])
    return main()


def test_every_operator_of_a_step_has_its_line(data, tmp_path, monkeypatch, capsys):
    assert run(monkeypatch, gpu_ops.main, data, "--out", tmp_path, "--steps", 6, "--seconds", 0.001) == 0
    page = (tmp_path / "ops.md").read_text()
    lines = [
        dict(zip(gpu_ops.HEAD, line.strip("| ").split(" | "))) for line in page.splitlines() if line.startswith("| ")
    ][2:]
    names = {line["operator"] for line in lines}
    assert names > {
        "sample_rays",
        "sdf_field",
        "sdf_field_backward",
        "light_lookup_backward",
        "summed_light",
        "cached_occlusion",
    }
    assert all(
        float(line["error"]) < 1e-4 and float(line["share"]) > 0
        for line in lines
        if line["operator"] != "light_lookup_backward"
    )
    assert f"{len(lines)} operators, 0 failed" in capsys.readouterr().out
    assert sum(bool(re.match(r"[\d.]+$", line["torch's"])) for line in lines) >= 8


@pytest.mark.parametrize("wrong", [lambda x: 1.001 * x, lambda x: x * torch.nan, lambda x: x[1:]])
def test_a_wrong_result_fails(wrong):
    """On the device alone: what the CPU is asked for is right."""
    op, asked = torch.ops.splitnerf.linear_to_srgb, []

    def first_wrong(x):
        asked.append(x)
        return wrong(op(x)) if len(asked) == 1 else op(x)

    line = gpu_ops.measure("linear_to_srgb", (first_wrong, (torch.rand(50, 3),)), gpu_ops.Clock("cpu", 0.001), 1e9)
    assert line[-1].startswith("failed: the error is above")


def test_a_look_says_what_took_the_time(data, tmp_path, monkeypatch, capsys):
    words = "--steps", 1000, "--until", 30, "--profiled", 4, "--page", tmp_path / "steady.md"
    assert run(monkeypatch, gpu_train.main, data, "--out", tmp_path / "run", *words) == 0
    page = (tmp_path / "steady.md").read_text()
    assert "steps 10 to 30: " in page and capsys.readouterr().out.strip() in page and "| `sdf_field_backward` |" in page
    shares = [float(x) for x in re.findall(r"^\| [\d.]+ \| ([\d.]+)% \|", page, re.MULTILINE)]
    assert 90 < sum(shares) <= 100.5
    assert run(monkeypatch, gpu_train.main, data, "--out", tmp_path / "run", *words[2:], "--steps", 8) == 1


def test_a_run_is_scored_without_an_export(data, tmp_path, monkeypatch, capsys):
    assert run(monkeypatch, gpu_train.main, data, "--out", tmp_path, "--steps", 8, "--views", 1) == 0
    assert re.search(r"^8 steps in .* 0 skipped, novel views [\d.]+ dB, albedo", capsys.readouterr().out, re.MULTILINE)
    scores = json.loads((tmp_path / "training.json").read_text())["scores"]
    assert scores["novel_view"]["psnr"] > 5 and not (tmp_path / "mesh.glb").exists()


def test_the_scripts_can_be_read():
    for script in ("gpu.sh", "gpu_bundle.sh"):
        subprocess.run(["bash", "-n", str(BENCH / script)], check=True)
    done = subprocess.run(["bash", str(BENCH / "gpu.sh"), "out", "-"], capture_output=True, text=True)
    assert done.returncode == 2 and "gpu.sh OUT BUNDLE PART" in done.stdout
