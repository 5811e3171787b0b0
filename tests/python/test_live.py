"""A run in the page while it trains: what the server tells and serves of it, and what its buttons do."""

import functools
import json
import re
import socket
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace
from unittest.mock import Mock
from urllib.parse import urlsplit

import numpy as np
import pytest
import torch
from looking_at import serving
from scipy.ndimage import map_coordinates
from splitnerf.config.settings import UNLIMITED
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import write_image
from splitnerf.export.scene import surface_of
from splitnerf.export.surface import surface_materials
from splitnerf.export.writers import glb_content
from splitnerf.relight.studio import STUDIO_LIGHTS
from splitnerf.render.model import SceneModel
from splitnerf.training.loop import Training
from splitnerf.training.observer import NOBODY, Event, Request
from splitnerf_tools.view import live as live_module
from splitnerf_tools.view.assets import ViewedAssets
from splitnerf_tools.view.events import EventStream
from splitnerf_tools.view.live import LINEAR, Live, training_asset
from splitnerf_tools.view.server import ViewServer
from splitnerf_tools.view.training_page import training_page
from test_train import flat, same
from tiny_runs import lines_of, tiny
from viewer_server import ask, error_of, halves, triangle

CPU = torch.device("cpu")
OWN = 1 + len(STUDIO_LIGHTS)  # the number of the recovered light: white and the built-in ones come first


@pytest.fixture
def eager(monkeypatch):
    """States and surfaces without waits between them."""
    for name, value in {"STATE_EVERY": 0.0, "ASSET_EVERY": 0.0, "ASSET_SHARE": 1e9}.items():
        monkeypatch.setattr(live_module, name, value)
    monkeypatch.setattr("splitnerf_tools.view.live.training_asset", functools.partial(training_asset, resolution=16))


class Stepped:
    """A run whose steps the test makes, and its page's server."""

    def __init__(self, data, run, **settings):
        run.mkdir(exist_ok=True)
        self.live = Live("mine")
        self.server = ViewServer(self.live.shown, live=self.live)
        self.training = Training(load_dataset(data), tiny(**{"steps": 1000} | settings), run, CPU, self.live)
        self.live(Event("begun", self.training))

    def between(self):
        return self.live(Event("step", self.training))

    def button(self, name):
        return ask(self.server, f"control/{name}", method="POST", body=b"")


@pytest.fixture
def stepped(data, tmp_path, eager):
    stepped = Stepped(data, tmp_path / "mine")
    with serving(stepped.server):
        yield stepped


@contextmanager
def page_of(server):
    """What an open page hears: a function that returns the next state."""
    with socket.create_connection(server.server_address, timeout=20) as page, page.makefile("rb") as stream:
        url = urlsplit(server.url)
        page.sendall(f"GET {url.path}events HTTP/1.1\r\nHost: {url.netloc}\r\n\r\n".encode())

        def heard(wanted=lambda state: True):
            while True:
                line = stream.readline()
                assert line, "the stream ended"
                if line.startswith(b"data: ") and wanted(state := json.loads(line[6:])):
                    return state

        assert b"text/event-stream" in b"".join(iter(stream.readline, b"\r\n"))
        yield heard


def test_a_training_asset_has_the_materials_of_the_fields(tmp_path):
    torch.manual_seed(3)
    model = SceneModel(tiny())
    model.open_levels(1.0)
    with torch.no_grad():  # else all materials are alike
        for parameter in model.material.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    world_from_box = np.diag([2.0, 2.0, 2.0, 1.0])
    world_from_box[:3, 3] = 1, 2, 3
    (tmp_path / "grown.glb").write_bytes(glb_content(training_asset(model, world_from_box, 24), filtering=LINEAR))
    asset = read_asset(tmp_path / "grown.glb")
    points = ((asset.vertices - [1, 2, 3]) / 2).astype(np.float32)
    assert np.abs(surface_of(model).sdf(torch.from_numpy(points)).detach().numpy()).max() < 0.1  # cells are 0.13 wide
    albedo, roughness, metallic, normals = surface_materials(surface_of(model), points)
    assert np.ptp(roughness) > 0.2 and np.ptp(metallic) > 0.2 and np.ptp(albedo) > 0.2
    assert asset.colors == pytest.approx(albedo, abs=1e-3)
    assert (asset.normals * normals).sum(axis=1) == pytest.approx(1, abs=1e-3)
    material = asset.materials[0]
    texture = material.roughness_metallic_texture * [material.roughness, material.metallic]
    places = (asset.uv * texture.shape[0] - 0.5).T[::-1]  # rows, columns
    read = [map_coordinates(values, places, order=1, mode="nearest") for values in np.moveaxis(texture, 2, 0)]
    assert np.transpose(read) == pytest.approx(np.column_stack([roughness, metallic]), abs=3e-3)


def test_pages_get_states_and_surfaces_in_time(data, tmp_path, monkeypatch):
    """A state each half second, a surface each four in a twentieth of the time; what is left is by what was gained here."""
    now, told, made, costs = 0.0, [], [], [1.0, 0.125, 0.125]

    def grown(*_):
        nonlocal now
        made.append(now)
        now += costs.pop(0)
        return asset

    asset = ViewedAssets([triangle().write(tmp_path / "a.glb")]).sources[0].asset
    monkeypatch.setattr(live_module, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(live_module, "training_asset", grown)
    stepped = Stepped(data, tmp_path / "mine", **{"steps": UNLIMITED, "run.max_minutes": 1.0})
    stepped.server.server_close()
    live, update, training = stepped.live, stepped.live.events.update, stepped.training
    training.seconds = 12.0  # of a minute
    live(Event("begun", training))
    assert live.events.state["left"] is None
    monkeypatch.setattr(live.events, "update", lambda **changes: told.append(now) or update(**changes))
    now = 10.0
    assert stepped.between() is None and not made and not told  # as long as no page is open
    now, live.events.listeners, training.seconds = 0.0, 1, 30.0
    while now < 26:
        now += 0.25
        training.step += 1
        live.taken(live.shown.sources[0])
        assert stepped.between() is None
    assert made == [0.5, 21.5, 25.625] and told[:4] == [1.5, 2.0, 2.5, 3.0]
    state = [live.events.state[name] for name in ("steps", "version", "progress", "left")]
    assert state == [None, 3, 0.5, pytest.approx(30)]  # 18 s for 0.3, and 0.5 are left


def test_an_open_page_gets_surface_light_and_numbers(stepped):
    """The camera shows the ball of radius 1 that the object fills in the training's frame."""
    stepped.training.dataset.box_from_world = np.linalg.inv([[2, 0, 0, 1], [0, 2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]])
    stepped.live(Event("begun", stepped.training))
    scene = json.loads(ask(stepped.server, "scene.json")[2])
    assert [scene["camera"]["radius"], *scene["camera"]["target"]] == pytest.approx([2, 1, 2, 3], abs=1e-5)
    assert scene["sources"] == [{"name": "mine", "light": OWN, "version": 0, "facts": ""}]
    with page_of(stepped.server) as heard:
        state = heard()
        assert state["stage"] == "training" and state["version"] == 0 and not state["paused"]
        stepped.between()
        state = heard(lambda state: state["version"] == 1)
        assert (state["step"], state["steps"], state["progress"], state["left"]) == (0, 1000, 0, None)
        stepped.training.step += 1
        stepped.between()
        assert stepped.live.shown.sources[0].version == 1  # nobody has taken it: no newer one is made
        scene = json.loads(ask(stepped.server, "scene.json")[2])
        assert scene["sources"][0]["version"] == 1 and scene["training"]
        content = ask(stepped.server, "assets/0")[2]
        assert content.startswith(b"glTF") and re.search(rb'"minFilter": ?9729', content)  # smaller ones are not mixed
        light = halves(ask(stepped.server, f"lights/{scene['sources'][0]['light']}"))
        with torch.no_grad():
            expected = stepped.training.model.light.panorama(64).numpy()
        assert light[..., :3] == pytest.approx(expected, rel=2e-3)
        stepped.between()
        assert heard(lambda state: state["version"] == 2)["step"] == 1
        ask(stepped.server, "assets/0")
        stepped.between()
        assert stepped.live.shown.sources[0].version == 2  # the same step has the same surface
    while stepped.live.events.listeners:  # until the server has seen that the page is gone
        time.sleep(0.01)


def test_curves_hold_the_lines_of_the_log(data, tmp_path):
    live = Live("mine")
    (tmp_path / "mine").mkdir()
    Training(load_dataset(data), tiny(steps=24), tmp_path / "mine", CPU, live).complete()
    written, lines = lines_of(tmp_path / "mine"), live.lines(0)
    assert [line["step"] for line in lines] == [line["step"] for line in written]
    assert [line["psnr"] for line in lines] == pytest.approx([line["psnr"] for line in written], rel=1e-4)
    assert {name for name in written[0] if name.startswith("loss")} <= lines[0].keys() and live.lines(20) == lines[20:]
    with serving(ViewServer(live.shown, live=live)) as server:
        assert json.loads(ask(server, "curves/20")[2]) == lines[20:]
    resumed = Live("mine")
    resumed(Event("begun", Training(load_dataset(data), tiny(steps=24), tmp_path / "mine", CPU)))
    assert resumed.lines(0) == lines


def test_buttons_steer_the_run(stepped, capsys):
    assert stepped.button("pause")[0] == 200
    assert [stepped.between(), stepped.between()] == [Request.PAUSE] * 2 and stepped.live.events.state["paused"]
    stepped.button("checkpoint")
    assert [stepped.between(), stepped.between()] == [Request.SAVE, Request.PAUSE]
    assert stepped.live.events.state["saved"] == stepped.training.step
    stepped.button("resume")
    assert stepped.between() is None and not stepped.live.events.state["paused"]
    stepped.button("pause")
    stepped.button("stop")
    assert stepped.between() is Request.STOP and "pauses until its page resumes it" in capsys.readouterr().err
    stepped.live(Event("export"))
    state = [stepped.live.events.state[name] for name in ("stage", "progress", "paused")]
    assert stepped.between() is None and state == ["export", 1, False]
    assert error_of(stepped.button("pause")) == (422, "the run does not train now")
    assert error_of(stepped.button("reboot")) == (422, "there is no such button")


def test_buttons_are_for_the_page_of_a_run_alone(stepped, tmp_path):
    assert ask(stepped.server, "control/stop")[0] == 404  # a GET, as a link or an image is
    for foreign in ({"token": False}, {"Origin": "http://evil.example"}):
        assert ask(stepped.server, "control/stop", method="POST", body=b"", **foreign)[0] == 403
    assert ask(stepped.server, "events", token=False)[0] == ask(stepped.server, "curves/0", token=False)[0] == 403
    assert ask(stepped.server, "curves/-1")[0] == ask(stepped.server, "events/x")[0] == 404
    assert stepped.between() is None
    with serving(ViewServer(ViewedAssets([triangle().write(tmp_path / "a.glb")]))) as server:  # without a run
        assert error_of(ask(server, "control/stop", method="POST", body=b"")) == (404, "no run is trained here")
        with page_of(server) as heard:
            assert ask(server, "curves/0")[0] == 404 and heard() == {"ended": None}


def test_the_delivered_asset_is_shown(stepped, tmp_path):
    """Each time in the place of the one before, with its light; what is read, is read when a page asks."""
    for version, (stage, name) in enumerate((("refinement", "trained"), ("evaluation", "final")), start=1):
        folder = tmp_path / name
        folder.mkdir()
        content = triangle().write(folder / "mesh.glb").read_bytes()
        write_image(folder / "environment.exr", np.full((4, 8, 3), version, np.float32))
        stepped.live(Event(stage, path=folder))
        assert stepped.live.events.state["version"] == version and stepped.live.shown.sources[0].version == version - 1
        scene = json.loads(ask(stepped.server, "scene.json")[2])
        (source,) = scene["sources"]
        assert source.items() >= {"name": "mine", "light": OWN, "version": version}.items()
        assert ask(stepped.server, "assets/0")[2] == content
        assert (halves(ask(stepped.server, f"lights/{OWN}"))[..., :3] == version).all()
        assert scene["camera"]["radius"] == pytest.approx(0.5**0.5)  # it shows the triangle
    (tmp_path / "final/mesh.glb").write_text("hello")
    stepped.live(Event("evaluation", path=tmp_path / "final"))
    scene = json.loads(ask(stepped.server, "scene.json")[2])
    assert scene["sources"][0]["version"] == 2 and "mesh.glb: is neither" in scene["problems"][0]
    assert stepped.live.events.state["version"] == 2  # pages wait for no other one


def test_a_page_changes_no_bit_of_a_deterministic_run(data, tmp_path, eager):
    """Not even one that takes each surface and saves a checkpoint."""

    class Curious(Live):
        buttons = ["checkpoint"]

        def __call__(self, event):
            if event.kind == "step":
                self.taken(self.shown.sources[0])
                if event.training.step == 8 and self.buttons:
                    self.ask(self.buttons.pop())
            return super().__call__(event)

    live = Curious("mine")
    live.events.listeners = 1
    config = tiny(steps=24, deterministic=True, mesh_every=0.2)
    states = []
    for name, observer in (("watched", live), ("alone", NOBODY)):
        (tmp_path / name).mkdir()
        Training(load_dataset(data), config, tmp_path / name, CPU, observer).complete()
        states.append(torch.load(tmp_path / name / "checkpoint.pt", weights_only=True))
    assert live.shown.sources[0].version >= 5 and live.events.state["saved"] == 8
    for key in ("model", "optimiser", "generator", "torch_generator", "occupancy", "mesh_vertices"):
        watched, alone = flat(states[0][key]), flat(states[1][key])
        assert watched.keys() == alone.keys() and all(same(watched[name], alone[name]) for name in alone), key


def test_pages_hear_the_end_and_it_waits_for_them_a_moment(monkeypatch):
    events, heard = EventStream(), []

    def page():
        for state in events.listen(lambda: "over" in heard):
            heard.append(state["ended"])

    thread = threading.Thread(target=page)
    thread.start()
    while not events.listeners:
        time.sleep(0.001)
    events.end("over")
    assert events.listeners == 0 and heard[-1] == "over"
    events.end("again")
    assert events.state["ended"] == "over"
    thread.join()
    monkeypatch.setattr("splitnerf_tools.view.events.FAREWELL", 0.0)
    stubborn = EventStream()
    listening = stubborn.listen(lambda: False)
    next(listening)
    stubborn.end("over")  # does not wait for ever
    listening.close()


def test_a_failure_is_told(capsys):
    with pytest.raises(RuntimeError), training_page("mine", 0) as live:
        raise RuntimeError
    assert live.events.state["ended"].startswith("the command ended before the run was done")
    with training_page("mine", 0) as live:
        live(Event("evaluation"))
    assert live.events.state["ended"].startswith("the run is done")
    with training_page("mine", 0) as live:
        live.events.update(stage="training")
    assert "--resume continues" in live.events.state["ended"]
    assert capsys.readouterr().out.count("http://127.0.0.1:") == 3


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_what_is_not_finite_is_null(value, stepped):
    """JSON has no word for it, and a page that cannot read a line never gets past it."""
    line = {"step": 3, "seconds": 1.234567, "rays": 7, "psnr": 20.123456, "loss": value, "loss_colour": value}
    stepped.live(Event("logged", stepped.training, line))
    content = ask(stepped.server, "curves/0")[2]
    (line,) = json.loads(content, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert line == {"step": 3, "seconds": 1.2346, "psnr": 20.123, "loss": None, "loss_colour": None}
    stepped.training.log.psnr = value
    stepped.live(Event("begun", stepped.training))
    assert stepped.live.events.state["psnr"] is None


@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), MemoryError()])
def test_a_delivered_asset_that_cannot_be_read_is_said(error, stepped, tmp_path, monkeypatch):
    triangle().write(tmp_path / "mesh.glb")
    stepped.live(Event("evaluation", path=tmp_path))
    monkeypatch.setattr(stepped.live.shown, "source_of", Mock(side_effect=error))
    content = ask(stepped.server, "scene.json")[2]
    assert f"{tmp_path}: cannot be shown ({type(error).__name__}" in json.loads(content)["problems"][0]
    assert stepped.live.events.state["version"] == 0  # pages wait for no newer one
