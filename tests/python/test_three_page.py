"""`examples/three/index.html` in Chromium: the picture of three.js is that of the path tracer.

Skipped where Node, Chromium or the packages of the viewer's sources (`npm ci` there, or `make viewer`) are missing.
"""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from painted_ball import lamps, orange
from PIL import Image

import splitnerf.view
from splitnerf.cli import main
from splitnerf.data.images import read_image, write_image
from splitnerf.evaluate.metrics import psnr
from splitnerf.export.glb import write_glb

ROOT = Path(__file__).parents[2]
SOURCES = Path(splitnerf.view.__file__).parent / "page"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SIZE = 128

pytestmark = pytest.mark.skipif(
    not (shutil.which("node") and CHROMIUM and (SOURCES / "node_modules/playwright-core").is_dir()),
    reason="needs node, chromium and `make viewer`",
)


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
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    shown = []
    try:
        for i, query in enumerate(queries):
            path = folder / f"{i}.png"
            window = {"do": "size", "width": SIZE, "height": SIZE}
            steps = [window, {"do": "open"}, {"do": "picture", "path": str(path)}]
            url = f"http://127.0.0.1:{server.server_port}/index.html?{query}"
            words = ["node", str(ROOT / "tests/viewer/look.mjs"), str(SOURCES), CHROMIUM, url]
            done = subprocess.run(words, input=json.dumps(steps), capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, done.stderr
            assert [line for line in json.loads(done.stdout)["console"] if line.startswith("error")] == []
            shown.append(np.asarray(Image.open(path).convert("RGB"), np.float32) / 255)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    return shown


def test_three_draws_what_relight_draws(folder):
    plain, turned = pictures(folder, ["", "turn=90&exposure=-1"])
    for name, words, image in (("plain", [], plain), ("turned", ["--rotate-env", "90", "--exposure", "-1"], turned)):
        asked = ["relight", str(folder / "mesh.glb"), "--env", str(folder / "environment.hdr"), "--size", str(SIZE)]
        assert main([*asked, "--spp", "64", "--background", "white", "--out", str(folder / name), *words]) == 0
        traced = read_image(folder / name / "000.png")[..., :3]
        assert psnr(image, traced) > 28.5, (name, psnr(image, traced))
