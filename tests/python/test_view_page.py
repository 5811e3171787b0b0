"""The viewer's page in Chromium: its picture is that of the path tracer, and its controls do what they say.

Skipped where Node, Chromium or the packages of the page's sources (`npm ci` there, or `make viewer`) are missing.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from painted_ball import sky, with_textures
from PIL import Image

import splitnerf.view
from splitnerf.data.environment import rotate_environment
from splitnerf.data.images import linear_to_srgb, write_image
from splitnerf.export.glb import write_glb
from splitnerf.relight.cameras import turntable
from splitnerf.render.path_traced import AssetRenderer
from splitnerf.view.server import ViewServer
from splitnerf.view.shown import Shown

SOURCES = Path(splitnerf.view.__file__).parent / "page"
LOOK = Path(__file__).parents[1] / "viewer/look.mjs"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SIZE = 160
TURN = 90
BARE = "#names, #said, #fold, #legend { display: none !important } #canvas { outline: 0 !important }"  # the picture alone

pytestmark = pytest.mark.skipif(
    not (shutil.which("node") and CHROMIUM and (SOURCES / "node_modules/playwright-core").is_dir()),
    reason="needs node, chromium and `make viewer`",
)


def lamps():
    """A grey sky with a warm and a blue lamp; no turn looks like another."""
    light = sky(32)
    light[10:16, 4:10] = (1, 4, 14)
    return light


def look(shown, steps):
    """What the page says while it does the steps."""
    with ViewServer(shown) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            words = ["node", str(LOOK), str(SOURCES), CHROMIUM, server.url]
            done = subprocess.run(words, input=json.dumps(steps), capture_output=True, text=True, timeout=300)
        finally:
            server.shutdown()
            thread.join()
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"), np.float32) / 255


@pytest.fixture(scope="module")
def run(ball, tmp_path_factory):
    """A run's folder with a ball whose halves differ."""
    folder = tmp_path_factory.mktemp("page") / "mine"
    folder.mkdir()
    materials = np.full((64, 64, 2), (0.4, 0.0), np.float32)
    write_glb(folder / "mesh.glb", with_textures(ball, roughness_metallic_texture=materials))
    write_image(folder / "environment.exr", lamps())
    write_image(folder / "uncertainty.exr", np.full((8, 8, 4), (0.05, 9, 0.1, 0.1), np.float32))
    return folder


@pytest.fixture(scope="module")
def seen(run):
    """Pictures by name, and what the page said, of one walk through the page."""
    folder = run.parent
    write_image(folder / "red.hdr", np.full((8, 16, 3), (1.0, 0.1, 0.1), np.float32))
    (folder / "cut.exr").write_bytes((run / "environment.exr").read_bytes()[:300])

    def picture(name):
        return {"do": "picture", "path": str(folder / f"{name}.png")}

    def keys(*names):
        return [{"do": "key", "key": name} for name in names]

    said = {"do": "text", "script": "document.getElementById('said').textContent"}
    names = ("albedo", "roughness", "metallic", "normals", "uncertainty")
    steps = [
        {"do": "size", "width": 700, "height": 440}, {"do": "open"}, picture("whole"), said | {"name": "start"},
        {"do": "style", "content": BARE}, {"do": "size", "width": SIZE, "height": SIZE}, *keys("h", "b"), picture("shaded"),
        {"do": "set", "selector": "#turn", "value": TURN}, picture("turned"),
        {"do": "set", "selector": "#turn", "value": 0},
        *(step for i, name in enumerate(names) for step in (*keys(str(i + 2)), picture(name))),
        {"do": "set", "selector": "#quantity", "value": 1}, picture("unknown"), *keys("1"),
        *keys("."), picture("brighter"), *keys(",", "t"), picture("aces"), *keys("t"),
        *keys("ArrowLeft", "ArrowUp", "-"), picture("moved"), *keys("r"), picture("home"),
        {"do": "drag", "from": [80, 80], "to": [110, 80]}, picture("dragged"), *keys("r"),
        {"do": "drop", "path": str(folder / "red.hdr")}, picture("red"),
        {"do": "text", "name": "light", "script": "document.querySelector('#light option:checked').textContent"},
        {"do": "drop", "path": str(folder / "cut.exr")}, picture("kept"), said | {"name": "damaged"},
        *keys("b"), {"do": "set", "selector": "#blur", "value": 0}, picture("background"),
        *keys("h"), {"do": "size", "width": 340, "height": 600}, picture("narrow"),
        {"do": "text", "name": "overflow", "script": "document.documentElement.scrollWidth - innerWidth"},
        {"do": "text", "name": "stage", "script": "document.getElementById('canvas').clientHeight"},
    ]  # fmt: skip
    told = look(Shown([run]), steps)
    return told, {path.stem: pixels(path) for path in folder.glob("*.png")}


@pytest.fixture(scope="module")
def traced(run):
    """By turns of the light: the picture of `splitnerf relight`, and where it shows the object alone."""
    source = Shown([run]).sources[0]
    view = turntable(source.asset, 1, size=(SIZE, SIZE))[0]

    def picture(turn):
        light = rotate_environment(lamps(), turn)
        images = AssetRenderer(source.asset).render(light, view.pose, view.intrinsics, SIZE, SIZE, spp=64)
        return linear_to_srgb(np.clip(images["radiance"], 0, 1)), images["alpha"] > 0.999

    return {turn: picture(turn) for turn in (0, TURN, -TURN, 180)}


def psnr(picture, traced):
    truth, inside = traced
    return -10 * np.log10(((picture - truth)[inside] ** 2).mean())


def middle(picture):
    """The mean colour of 10 x 10 pixels."""
    half = SIZE // 2
    return picture[half - 5 : half + 5, half - 5 : half + 5].mean(axis=(0, 1))


def test_the_page_loads_without_a_complaint(seen):
    told, _ = seen
    refused = [line for line in told["console"] if "422" in line]  # Chromium says so of the damaged light
    assert len(refused) == 1
    assert [line for line in told["console"] if not line.startswith("warning: ") and line not in refused] == []
    assert told["texts"]["start"] == ""


def test_the_light_is_turned_as_relight_turns_it(seen, traced):
    _, pictures = seen
    for name, turn in (("shaded", 0), ("turned", TURN)):
        scores = {other: psnr(pictures[name], traced[other]) for other in traced}
        print(name, scores)
        assert scores[turn] > 26
        assert all(scores[turn] > scores[other] + 6 for other in traced if other != turn)


def test_maps_show_their_numbers(seen):
    _, pictures = seen
    assert middle(pictures["albedo"]) == pytest.approx([float(linear_to_srgb(np.float32([0.4]))[0])] * 3, abs=0.01)
    assert middle(pictures["roughness"]) == pytest.approx([0.4] * 3, abs=0.01)
    assert middle(pictures["metallic"]) == pytest.approx([0] * 3, abs=0.01)
    # The middle of the ball looks at the camera: from the front (-y), from 20 degrees above.
    towards = np.array([0, -np.cos(np.radians(20)), np.sin(np.radians(20))])
    assert middle(pictures["normals"]) == pytest.approx(0.5 * towards + 0.5, abs=0.02)


def test_uncertainty_has_the_colours_of_the_report(seen):
    from splitnerf.refinement.uncertainty import UNKNOWN
    from splitnerf.report.last_stage import UNKNOWN_COLOURS, coloured

    _, pictures = seen
    assert 0.05 < float(UNKNOWN[0])
    expected = coloured((np.full((1, 1, 4), 0.05), np.ones((1, 1))), 0)[0, 0]
    assert middle(pictures["uncertainty"]) == pytest.approx(expected, abs=0.01)
    stripes = np.unique((255 * pictures["unknown"][70:90, 70:90]).round().reshape(-1, 3), axis=0)
    assert stripes == pytest.approx(np.sort(255 * UNKNOWN_COLOURS, axis=0).round(), abs=1.01)


def test_keys_and_the_pointer_move_what_they_say(seen):
    _, pictures = seen
    before = middle(pictures["shaded"])
    brighter = middle(pictures["brighter"])
    assert (brighter > before + 0.03).all()
    for name in ("aces", "moved", "dragged"):
        assert np.abs(pictures[name] - pictures["shaded"]).mean() > 0.01, name
    assert np.abs(pictures["home"] - pictures["shaded"]).max() < 0.02


def test_a_dropped_light_lights_and_a_damaged_one_is_said(seen):
    told, pictures = seen
    assert told["texts"]["light"] == "red.hdr"
    red, green, blue = middle(pictures["red"])
    assert red > 2 * green and green == pytest.approx(blue, abs=0.02)
    assert np.array_equal(pictures["kept"], pictures["red"])
    assert told["texts"]["damaged"].startswith("cut.exr: ") and "\n" not in told["texts"]["damaged"]
    corner = pictures["background"][:10, :10].mean(axis=(0, 1))
    assert corner == pytest.approx(linear_to_srgb(np.float32([1, 0.1, 0.1])), abs=0.02)


def test_a_narrow_window_has_room_for_both(seen):
    told, _ = seen
    assert told["texts"]["overflow"] == 0 and told["texts"]["stage"] > 250
