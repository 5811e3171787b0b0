"""The scripts that measure on a GPU, rehearsed on the CPU with small sizes."""

from __future__ import annotations

import csv
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from op_cases import CASES

from splitnerf.demo.scene import write_demo_dataset

BENCH = Path(__file__).parents[1] / "bench"
SMALL = dict(target_samples=256, max_rays=64, grid_resolution=16, mesh_resolution=24, light_resolution=16)


def run(script: str, *arguments: object, code: int = 0) -> str:
    done = subprocess.run(
        [sys.executable, str(BENCH / script), *map(str, arguments)], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == code, done.stderr[-2000:]
    return done.stdout


def test_every_operator_has_its_line(tmp_path):
    said = run("gpu_ops.py", "--out", tmp_path, "--device", "cpu", "--tiny", "--seconds", 0.001)
    with (tmp_path / "ops.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    timed = [line for line in lines if line["cold_ms"]]
    operators = {line["case"].split(",")[0] for line in timed}
    assert operators >= {"copy", "product float32", "product tf32", "product bfloat16"} | set(CASES)
    assert all(line["note"].startswith("refused") for line in lines if not line["cold_ms"])
    for line in timed[4:]:
        limit = 5e-3 if line["dtype"] in ("float16", "bfloat16") else 1e-4
        assert float(line["error"]) < limit, line
        assert float(line["cold_ms"]) > 0 and float(line["bytes"]) > 0
        assert math.isnan(float(line["operations"])) or float(line["operations"]) > 0
        assert float(line["floor_ms"]) > 0, line
    assert "0 failed" in said and "| hash_encode | float32 |" in (tmp_path / "ops.md").read_text()


def test_a_line_that_takes_too_long_fails_alone(tmp_path):
    seconds = ("--seconds", 2.0, "--stalled", 1e-4)  # the watching thread may itself wait for a core
    arguments = ("--out", tmp_path, "--device", "cpu", "--tiny", "--only", "prefilter_light", *seconds)
    assert "1 of 1 lines, 1 failed" in run("gpu_ops.py", *arguments, code=1)
    assert "failed: took too long" in (tmp_path / "ops.md").read_text()


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return write_demo_dataset(tmp_path_factory.mktemp("gpu") / "data", size=24, n_train=6, n_test=2, spp=4)


def test_a_profile_names_what_takes_the_time(data, tmp_path):
    settings = [part for key, value in SMALL.items() for part in ("--set", f"{key}={value}")]
    page = tmp_path / "profile.md"
    run("gpu_train.py", data, "--out", tmp_path / "run", "--device", "cpu", "--preset", "cpu", "--steps", 60,
        "--profile", page, *settings)  # fmt: skip
    text = page.read_text()
    assert text.startswith("20 steps after 39: ") and "sdf_layer_backward" in text


def test_a_step_has_no_more_launches_than_it_had(tmp_path):
    """Those of our operators are as many as their launchers make, each once a step."""
    said = run("launches.py", "--steps", 8, "--out", tmp_path / "launches.md")
    launches = float(re.match(r"(\d+) launches a step", said)[1])
    assert 200 < launches <= 279
    for line in ("| sample_rays | 4.0 |", "| spread_samples | 7.0 |", "| sdf_layer_backward | 4.0 |"):
        assert line in said
    counted = [float(x) for x in re.findall(r"^\| [a-z_]+ \| ([\d.]+) \|$", said, re.MULTILINE)]
    assert sum(counted) == pytest.approx(launches, rel=0.01)
    assert said.strip() in (tmp_path / "launches.md").read_text()


@pytest.mark.parametrize("script", ["gpu.sh", "gpu_bundle.sh"])
def test_the_scripts_can_be_read(script):
    subprocess.run(["bash", "-n", str(BENCH / script)], check=True)
