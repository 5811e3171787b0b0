"""Every example runs, and prints numbers that are as good as it claims."""

import json
import os
import re
import runpy
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from painted_ball import lamps, looking, orange
from splitnerf.cli import main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import read_image, write_image
from splitnerf.export.writers import write_glb
from splitnerf_tools.demo.scene import write_demo_dataset
from tiny_runs import SMALL, as_options

EXAMPLES = Path(__file__).parents[2] / "examples"
BLENDER = os.environ.get("SPLITNERF_BLENDER_PYTHON") or sys.executable  # bpy 5.0 wants an older NumPy than OpenImageIO


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
    tested = set(re.findall(r'run\w*\("(\w+\.py)"', Path(__file__).read_text()))
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


def test_nerf(run, tmp_path):
    data, picture = write_demo_dataset(tmp_path / "data", size=32, n_train=24, n_test=2, spp=16), tmp_path / "nerf.png"
    out = run("nerf.py", str(data), "--steps", "200", "--rays", "200", "--out", str(picture))
    assert number(r"views: ([\d.]+) dB", out) > 19
    assert read_image(picture).shape == (64, 64, 3)


def plane_under_a_ball(height: float) -> tuple[trimesh.Trimesh, int]:
    """A disc of radius 300, dense in the middle and a unit ball this high above it; the disc has so many vertices."""
    radii, n = np.geomspace(0.05, 300, 40), 32
    turns = np.exp(2j * np.pi * np.arange(n) / n)
    rim = np.concatenate([[0], np.outer(radii, turns).ravel()])
    ring = 1 + np.arange(n), 1 + np.roll(np.arange(n), -1)
    faces = [np.column_stack([np.zeros(n, int), *ring])]
    for i in range(len(radii) - 1):
        (a, b), (c, d) = (tuple(x + i * n for x in ring), tuple(x + (i + 1) * n for x in ring))
        faces += [np.column_stack([a, c, d]), np.column_stack([a, d, b])]
    disc = trimesh.Trimesh(np.column_stack([rim.real, rim.imag, 0 * rim.real]), np.concatenate(faces), process=False)
    ball = trimesh.creation.icosphere(4).apply_translation((0, 0, height))
    return trimesh.util.concatenate([disc, ball]), len(rim)


def test_occlusion_bake(run, tmp_path):
    """A ball of radius 1 above a plane hides h / (x^2 + h^2)^(3/2) of it; the plane hides (1 - n_z) / 2 of the ball."""
    height = 1.3
    mesh, n_disc = plane_under_a_ball(height)
    mesh.export(tmp_path / "mesh.ply")
    out = run("occlusion_bake.py", str(tmp_path / "mesh.ply"), str(tmp_path / "baked.ply"), "4096")
    baked = trimesh.load(tmp_path / "baked.ply", process=False)
    assert np.allclose(baked.vertices, mesh.vertices, atol=1e-4)
    x, y, z = np.asarray(mesh.vertices).T
    distance = np.hypot(x, y)
    exact = np.where(np.arange(len(x)) < n_disc, 1 - height / (distance**2 + height**2) ** 1.5, (1 + z - height) / 2)
    error = np.abs(baked.visual.vertex_colors[:, 0] / 255 - exact)[distance < 30]
    assert error.max() < 0.01 and error.mean() < 0.003, (error.max(), error.mean())
    assert number(r"(\d+) vertices", out) == len(x)


def run_blender(name: str, *arguments: str) -> str:
    """What an example prints in a Python that has bpy; skips without one."""
    has_bpy = "import importlib.util as i, sys; sys.exit(i.find_spec('bpy') is None)"
    if subprocess.run([BLENDER, "-c", has_bpy]).returncode:
        pytest.skip("needs bpy: pip install bpy==5.0.1, or SPLITNERF_BLENDER_PYTHON, a Python that has it")
    done = subprocess.run([BLENDER, str(EXAMPLES / name), *arguments], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_blender_photographs_a_matte_jug(tmp_path):
    """Two views and one for testing, that load with their cameras, the jug in their middle."""
    write_image(tmp_path / "light.exr", np.ones((8, 16, 3), np.float32))
    words = ["--kinds", "matte", "--views", "2", "1", "--size", "32", "--samples", "4"]
    run_blender("blender_kinds.py", str(tmp_path / "light.exr"), str(tmp_path), *words)
    views = load_dataset(tmp_path / "matte", "train")
    alpha = views.images[..., 3]
    assert len(views) == 2 and (alpha[:, 16, 16] == 1).all() and (alpha[:, :, [0, -1]] == 0).all()


def test_blender_shows_what_relight_shows(ball, tmp_path):
    """Asset, light with a turn, camera with a shifted lens and oblong pixels, exposure, colours: the same picture."""
    write_glb(tmp_path / "mesh.glb", orange(ball))
    write_image(tmp_path / "light.exr", lamps())
    lens = {"fl_x": 150.0, "fl_y": 165.0, "cx": 70.0, "cy": 40.0, "w": 120, "h": 96}
    cameras = tmp_path / "transforms.json"
    cameras.write_text(json.dumps(lens | {"frames": [{"transform_matrix": looking(0.4, 0.5, 5.0).tolist()}]}))
    out = tmp_path / "lit"
    common = ["--rotate-env", "50", "--exposure", "0.5", "--spp", "64"]
    asked = ["relight", str(tmp_path / "mesh.glb"), "--env", str(tmp_path / "light.exr"), "--path", str(cameras)]
    assert main([*asked, *common, "--out", str(out)]) == 0
    words = [str(tmp_path / name) for name in ("mesh.glb", "light.exr", "transforms.json")]
    blend = ["--blend", str(tmp_path / "scene.blend"), "--out", str(tmp_path / "view.png")]
    said = run_blender("blender_import.py", *words, *common, *blend, "--against", str(out / "000.png"))
    assert number(r"000\.png: ([\d.]+) dB", said) > 35
    assert (tmp_path / "scene.blend").stat().st_size > 10000


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
    pytest.importorskip("submitit", reason="submitit is not installed: pip install submitit")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad/transforms_train.json").write_text("{")
    monkeypatch.setattr(sys, "exit", lambda code: codes.append(code))
    codes: list[int] = []
    words = [str(data), str(tmp_path / "bad"), "--out", str(tmp_path / "out"), "--cluster", "local", "--"]
    out = run("slurm_batch.py", *words, "--steps", "4", *as_options(SMALL))
    assert codes == [1] and (tmp_path / "out/tiny/mesh.glb").is_file() and not (tmp_path / "out/bad").exists()
    assert not (tmp_path / "out/jobs").exists()  # a scene may be called so
    assert out.splitlines()[0] == "tiny: done" and out.splitlines()[1].startswith("bad: failed (2), see ")

    warned = subprocess.run(
        [sys.executable, "-c", WARNED, str(EXAMPLES / "slurm_batch.py")], capture_output=True, text=True, timeout=120
    )
    assert warned.stdout == f"Training ('a', 'b', ['c']) {-signal.SIGTERM}\n", warned.stderr
