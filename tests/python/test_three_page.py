"""`examples/three/index.html` in Chromium: the picture of three.js is that of the path tracer.

Skipped where Node, Chromium or the packages of the viewer's sources (`npm ci` there, or `make viewer`) are missing.
"""

import functools
import shutil
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from looking_at import SOURCES, look_at, needs_chromium, opened, picture, pixels, serving
from painted_ball import lamps, orange
from splitnerf.cli import main
from splitnerf.data.images import read_image, write_image
from splitnerf.evaluate.metrics import psnr
from splitnerf.export.writers import write_glb

ROOT = Path(__file__).parents[2]
SIZE = 128

pytestmark = needs_chromium


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass


@pytest.fixture
def folder(ball, tmp_path):
    """The page, three.js as npm installs it, an orange ball, and a light without symmetry."""
    shutil.copy(ROOT / "examples/three/index.html", tmp_path)
    (tmp_path / "node_modules").symlink_to(SOURCES / "node_modules")
    write_glb(tmp_path / "mesh.glb", orange(ball))
    write_image(tmp_path / "environment.hdr", lamps())
    return tmp_path


def pictures(folder: Path, queries: list[str]) -> list[np.ndarray]:
    """What the page shows for these queries."""
    shown = []
    with serving(ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))) as server:
        for i, query in enumerate(queries):
            path = folder / f"{i}.png"
            url = f"http://127.0.0.1:{server.server_port}/index.html?{query}"
            said = look_at(url, [*opened(SIZE, SIZE), picture(path)])
            assert [line for line in said["console"] if line.startswith("error")] == []
            shown.append(pixels(path))
    return shown


def test_three_draws_what_relight_draws(folder):
    plain, turned = pictures(folder, ["", "turn=90&exposure=-1"])
    for name, words, image in (("plain", [], plain), ("turned", ["--rotate-env", "90", "--exposure", "-1"], turned)):
        asked = ["relight", str(folder / "mesh.glb"), "--env", str(folder / "environment.hdr"), "--size", str(SIZE)]
        assert main([*asked, "--spp", "64", "--background", "white", "--out", str(folder / name), *words]) == 0
        traced = read_image(folder / name / "000.png")[..., :3]
        assert psnr(image, traced) > 28.5, (name, psnr(image, traced))
