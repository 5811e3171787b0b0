"""The page of a run in Chromium: while it trains, and when the connection is cut.

Skipped where Node, Chromium or the packages of the page's sources (`npm ci` there, or `make viewer`) are missing.
"""

import functools
import re
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest
import torch
from looking_at import keys, look_at, needs_chromium, opened, picture, pixels, serving, text, wait
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import write_image
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.loop import Training
from splitnerf.training.observer import Event, together
from splitnerf_tools.view import live as live_module
from splitnerf_tools.view.assets import ViewedAssets
from splitnerf_tools.view.live import Live, training_asset
from splitnerf_tools.view.server import Handler, ViewServer
from tiny_runs import tiny
from viewer_server import triangle

pytestmark = needs_chromium
RESTLESS = {"restless": True}
PHASE, NUMBERS, LOST, SAID = (
    f"document.getElementById('{name}').textContent" for name in ("phase", "numbers", "lost", "said")
)
LOADED = "document.getElementById('said').textContent === ''"
DRAWN = "new Set(document.querySelector('#chart canvas').getContext('2d').getImageData(0, 0, 200, 100).data).size > 20"


def press(selector):
    return {"do": "press", "selector": selector} | RESTLESS


def slowly(event):
    """Leaves the machine to the browser."""
    if event.kind == "step":
        time.sleep(0.1)


@pytest.fixture(scope="module")
def walk(data, tmp_path_factory):
    """What the page said of a run and its pictures, and the run's folder."""
    run = tmp_path_factory.mktemp("page") / "mine"
    run.mkdir()
    live = Live("mine")
    versions = []
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setattr("splitnerf_tools.view.live.training_asset", functools.partial(training_asset, resolution=24))
        patch.setattr(live_module, "ASSET_EVERY", 1.0)
        server = stack.enter_context(serving(ViewServer(live.shown, live=live)))
        training = Training(load_dataset(data), tiny(steps=100_000), run, torch.device("cpu"), together([live, slowly]))

        def deliver():
            training.complete()
            live(Event("export"))
            triangle().write(run / "mesh.glb")
            write_image(run / "environment.exr", np.ones((4, 8, 3), np.float32))
            live(Event("evaluation", path=run))

        thread = threading.Thread(target=deliver)
        patch.setattr("splitnerf.progress.ending_signals", list)  # this thread has none
        thread.start()
        told = look_at(
            server.url,
            [
                *opened(820, 560, **RESTLESS),
                wait(f"{LOADED} && !!document.querySelector('#chart canvas')"),
                lambda: versions.append(live.shown.sources[0].version),
                {"do": "focus", "selector": "#checkpoint"} | RESTLESS,
                keys("Enter")[0] | RESTLESS,
                wait(f"{NUMBERS}.includes('saved')"),
                text("saved", NUMBERS, **RESTLESS),
                press("#pause"),
                wait(f"{PHASE}.includes('paused')"),
                lambda: versions.append(live.shown.sources[0].version),
                picture(run.parent / "paused.png", **RESTLESS),
                text("curve", DRAWN, **RESTLESS),
                text("button", "document.getElementById('pause').textContent", **RESTLESS),
                {"do": "size", "width": 380, "height": 700} | RESTLESS,
                picture(run.parent / "narrow.png", **RESTLESS),
                text("overflow", "document.documentElement.scrollWidth - innerWidth", **RESTLESS),
                text("panel", "(e => e.scrollWidth - e.clientWidth)(document.getElementById('panel'))", **RESTLESS),
                press("#pause"),
                wait(f"!{PHASE}.includes('paused')"),
                press("#stop"),
                wait(f"{PHASE}.includes('final') && {LOADED}"),
                text("buttons", "document.getElementById('buttons').hidden", **RESTLESS),
                lambda: threading.Thread(target=live.events.end, args=("the run is done",)).start(),
                wait(f"{LOST}.includes('The end')"),
                picture(run.parent / "ended.png", **RESTLESS),
                text("ended", LOST, **RESTLESS),
            ],
        )
        thread.join()
    return told["texts"], told["console"], versions, training, run


def test_the_page_of_a_run(walk):
    texts, console, versions, trained, run = walk
    assert [line for line in console if not line.startswith("warning: ")] == []
    assert versions[1] > versions[0] >= 1
    assert texts["button"] == "Resume" and texts["curve"] is True
    step = int(re.search(r"checkpoint of step ([\d,]+) saved", texts["saved"])[1].replace(",", ""))
    assert 0 < step <= trained.step
    assert trained.finished and trained.step < 100_000
    assert load_checkpoint(run / "checkpoint.pt")["step"] == trained.step
    assert texts["buttons"] is True and texts["ended"] == "The end: the run is done."


def test_the_page_of_a_run_in_a_narrow_window(walk):
    texts, *_, run = walk
    assert texts["overflow"] <= 0 and texts["panel"] <= 0
    shown = pixels(run.parent / "narrow.png")
    assert np.ptp(shown[:300].reshape(-1, 3), axis=0).max() > 0.1  # the object stands above the panel


def test_a_cut_connection_is_said_and_mended(tmp_path, monkeypatch):
    """The server ends without a word; it comes back at the same address, then at another one."""
    folder, servers, cutting = tmp_path / "mine", ExitStack(), threading.Event()
    folder.mkdir()
    triangle().write(folder / "mesh.glb")
    is_gone = Handler._is_gone
    monkeypatch.setattr(Handler, "_is_gone", lambda handler: cutting.is_set() or is_gone(handler))
    monkeypatch.setattr("splitnerf_tools.view.events.HEARTBEAT", 0.2)
    monkeypatch.setattr("splitnerf_tools.view.events.EventStream.end", lambda *_: None)

    def start(token, port=0):
        cutting.clear()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("splitnerf_tools.view.server.secrets.token_urlsafe", lambda _: token)
            return servers.enter_context(serving(ViewServer(ViewedAssets([folder]), port=port)))

    def cut():
        cutting.set()
        servers.close()

    first = start("token-of-this-test")
    port = first.server_address[1]
    with servers:
        told = look_at(
            first.url,
            [
                *opened(500, 400, **RESTLESS),
                wait(LOADED),
                cut,
                wait(f"{LOST}.includes('lost')"),
                text("lost", LOST, **RESTLESS),
                picture(tmp_path / "lost.png", **RESTLESS),
                lambda: start("token-of-this-test", port),
                wait(f"{LOST} === ''"),
                cut,
                wait(f"{LOST}.includes('lost')"),
                lambda: start("another-token", port),
                wait(f"{LOST}.includes('token')"),
                text("other", LOST, **RESTLESS),
            ],
        )["texts"]
    assert told["lost"] == "The connection to splitnerf is lost; the page tries again. Does the command still run?"
    assert told["other"] == "the token is missing or wrong; open the address that splitnerf printed"


def test_an_asset_whose_connection_breaks_off_is_asked_for_again(tmp_path, monkeypatch):
    folder = tmp_path / "mine"
    folder.mkdir()
    content = triangle().write(folder / "mesh.glb").read_bytes()
    whole, asked, read = Handler._asset, [], threading.Event()

    def half(handler, rest):
        asked.append(rest)
        if len(asked) > 1:
            read.wait(60)
            return whole(handler, rest)
        handler._send_head("model/gltf-binary", Content_Length=str(len(content)))
        handler.wfile.write(content[: len(content) // 2])

    monkeypatch.setattr(Handler, "_asset", half)
    with serving(ViewServer(ViewedAssets([folder]))) as server:
        steps = [*opened(500, 400, **RESTLESS), text("said", SAID, **RESTLESS), read.set, wait(LOADED)]
        told = look_at(server.url, steps)["texts"]
    assert told["said"] == "the connection broke off; what was missing is asked for again once splitnerf answers"
    assert len(asked) == 2
