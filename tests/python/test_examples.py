"""Every example runs, and prints numbers that are as good as it claims."""

from __future__ import annotations

import re
import runpy
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from tiny_runs import SMALL, as_options

from splitnerf.data.images import read_image

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs an example as a script and returns what it printed."""

    def run_example(name: str, *arguments: str) -> str:
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run_example


def number(pattern: str, text: str) -> float:
    found = re.search(pattern, text)
    assert found, f"{pattern!r} is not in {text!r}"
    return float(found.group(1))


def test_every_example_is_tested():
    tested = set(re.findall(r'run\("(\w+\.py)"', Path(__file__).read_text()))
    assert tested == {path.name for path in EXAMPLES.glob("*.py")}


def test_hash_grid(run):
    out = run("hash_grid.py")
    assert number(r"mean ([\d.]+)", out) < 0.003
    assert number(r"normals: ([\d.]+)", out) < 8


def test_shading(run, tmp_path):
    run("shading.py", str(tmp_path / "spheres.png"))
    image = read_image(tmp_path / "spheres.png")
    assert image.shape == (256, 384, 3)
    gold, plastic = image[32, 64], image[224, 320]
    assert gold[0] > gold[2] and plastic[0] > 2 * plastic[1]  # gold is yellow, the plastic red


def test_prefilter(run):
    lines = run("prefilter.py").splitlines()
    assert len(lines) == 5
    for line in lines:
        assert number(r"lattice ([\d.]+)", line) < 0.01 < number(r"independent ([\d.]+)", line)


def test_occlusion(run):
    out = run("occlusion.py")
    assert number(r"error ([\d.]+)", out) < 2e-3
    factors = [float(x) for x in re.findall(r"o_d = ([\d.]+)", out)]
    assert factors == sorted(factors) and factors[-1] > 0.98  # the plane opens away from the sphere


def test_rays(run, tmp_path):
    out = run("rays.py", str(tmp_path / "normals.png"))
    assert number(r"depth error ([\d.]+)", out) < 0.005
    assert number(r"opacity ([\d.]+)", out) > 0.999
    centre = read_image(tmp_path / "normals.png")[80, 80]
    assert centre == pytest.approx([0.5, 0, 0.5], abs=0.02)  # the normal towards the camera, -y


# A signal warns a job while it waits for its process.
WARNED = """
import runpy, signal, subprocess, sys
job, again, start = runpy.run_path(sys.argv[1], run_name="example")["Training"](), [], subprocess.Popen
subprocess.Popen = lambda command: start(["sleep", "600"])
signal.signal(signal.SIGALRM, lambda *_: again.append(job.checkpoint("a", "b", ["c"])))
signal.setitimer(signal.ITIMER_REAL, 0.5)
code = job("a", "b", ["c"])
print(type(again[0].function).__name__, again[0].args, code)
"""


def test_slurm_batch(run, data, tmp_path, monkeypatch):
    """Without Slurm: submitit runs the jobs here. A damaged scene stops no other."""
    submitit = pytest.importorskip("submitit", reason="submitit is not installed: pip install submitit")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/transforms_train.json").write_text("{")
    monkeypatch.setattr(sys, "exit", lambda code: codes.append(code))
    codes: list[int] = []
    words = [str(data), str(tmp_path / "bad"), "--out", str(tmp_path / "out"), "--cluster", "local", "--"]
    out = run("slurm_batch.py", *words, "--steps", "4", *as_options(SMALL))
    assert codes == [1] and (tmp_path / "out/tiny/mesh.glb").is_file() and not (tmp_path / "out/bad").exists()
    assert out.splitlines()[0] == "tiny: done" and out.splitlines()[1].startswith("bad: failed (2), see ")

    warned = subprocess.run([sys.executable, "-c", WARNED, str(EXAMPLES / "slurm_batch.py")], capture_output=True, text=True, timeout=120)
    assert warned.stdout == f"Training ('a', 'b', ['c']) {-signal.SIGTERM}\n", warned.stderr
