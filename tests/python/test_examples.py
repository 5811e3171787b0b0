"""Every example runs, and prints numbers that are as good as it claims."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

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
