"""The viewer's server: what it serves is what was given, to nobody but the page that it printed the address of."""

import http.client
import json
import math
import os
import re
import resource
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from socket import create_connection
from unittest.mock import Mock
from urllib.parse import quote, urlsplit

import numpy as np
import pytest
import splitnerf_tools.view
from blender_data import edit
from gltf_builder import beside
from splitnerf.cli import DONE, main
from splitnerf.data.environment import rotate_environment
from splitnerf.data.frames import read_frames
from splitnerf.data.images import area_average, decode_image, encode_image, read_image, write_image
from splitnerf.data.reading import Reading
from splitnerf.relight.studio import STUDIO_LIGHTS, studio_light
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.view import final
from splitnerf_tools.view import server as server_module
from splitnerf_tools.view.assets import ViewedAssets, ViewedPhotos, light_of
from splitnerf_tools.view.final import Camera, Tracer
from splitnerf_tools.view.server import ViewServer
from tiny_runs import refused
from viewer_server import ask, camera_of, error_of, halves, numbered_sky, serving, triangle

PAGE = Path(splitnerf_tools.view.__file__).parent


def test_what_is_served_is_what_is_on_the_disk(shown_run, served):
    script = (PAGE.parent / "report/pages.js").read_bytes()
    assert ask(served, "")[2] == (PAGE / "viewer.html").read_bytes().replace(b"{{SCRIPT}}", script)
    assert ask(served, "assets/0")[2] == (shown_run / "mesh.glb").read_bytes()
    scene = json.loads(ask(served, "scene.json")[2])
    facts = "1 faces, no textures; 1 x 0 x 1 units wide, deep and high"
    assert scene["sources"] == [{"name": "mine", "light": 0, "version": 1, "facts": facts}] and scene["problems"] == []
    assert [scene[name] for name in ("first_light", "white", "training", "cameras")] == [None, 1, False, []]
    assert [light["name"] for light in scene["lights"]] == ["recovered light of mine", "white", *STUDIO_LIGHTS]
    light = halves(ask(served, "lights/0"))
    assert np.array_equal(light[..., :3], numbered_sky().astype(np.float16)) and (light[..., 3] == 1).all()
    assert (halves(ask(served, "lights/1")) == 1).all() and ask(served, "photos/0")[0] == 404


def test_two_assets_and_a_given_light(shown_run, tmp_path):
    """A light beside a file that is no run's is not its own; the camera shows the first asset."""
    large = triangle()
    large.json["nodes"][0]["scale"] = [3, 3, 3]
    other = large.write(tmp_path / "other.glb")
    shutil.copy(shown_run / "environment.exr", tmp_path)
    write_image(tmp_path / "studio.hdr", np.full((4, 8, 3), 2, np.float32))
    with serving(shown_run, other, light=tmp_path / "studio.hdr") as server:
        scene = json.loads(ask(server, "scene.json")[2])
        assert [(source["name"], source["light"]) for source in scene["sources"]] == [("mine", 1), ("other.glb", None)]
        assert scene["first_light"] == 0 and scene["lights"][0]["name"] == "studio.hdr"
        assert scene["camera"]["target"] == [0.5, 0, 0.5] and scene["camera"]["radius"] == pytest.approx(0.5**0.5)
        assert ask(server, "assets/1")[2] == other.read_bytes() and ask(server, "assets/2")[0] == 404


def test_a_studio_light_is_shown_first_and_what_is_damaged_beside_the_asset_becomes_a_line(shown_run, capsys):
    (shown_run / "environment.exr").write_bytes((shown_run / "environment.exr").read_bytes()[:200])
    with serving(shown_run, light=Path("sunset")) as server:
        scene = json.loads(ask(server, "scene.json")[2])
        shown = halves(ask(server, f"lights/{scene['first_light']}"))[..., :3]
    assert {"number": scene["first_light"], "name": "sunset"} in scene["lights"]
    assert np.allclose(shown, studio_light("sunset"), rtol=1e-3)
    assert [line.split(": ")[0] for line in scene["problems"]] == [str(shown_run / "environment.exr")]
    assert scene["sources"][0]["light"] is None and capsys.readouterr().err.count("note: ") == 1


OWN = ("127.0.0.1:{port}", "localhost:{port}", "[::1]:{port}")
FOREIGN = ("evil.example:{port}", "127.0.0.1", "127.0.0.1:1{port}", "", "127.0.0.1:{port}.evil.example", "[", "a:b")
FOREIGN += ("192.168.1.20:{port}",)
ORIGINS = ("null", "http://evil.example", "https://127.0.0.1:{port}", "http://evil.example:{port}", "http://127.0.0.1")
ABSENT = (
    *("secret.txt", "../secret.txt", "assets/../../secret.txt", "assets/%2e%2e/secret.txt", "assets//etc/passwd"),
    *("assets/-1", "assets/0/x", "assets/", "assets/1e0", "assets/٠", "lights/99999999999999", "page/package.json"),
    "scene.json/x",
)
CAMERAS = (
    *({"width": 0}, {"width": 1 << 20}, {"width": 4000, "height": 4000}, {"height": None}, {"turn": 1e9}),
    *({"intrinsics": [1, 1, 8]}, {"intrinsics": [0, 1, 8, 8]}, {"intrinsics": ["x", 1, 8, 8]}, {"turn": math.nan}),
    *({"pose": [0] * 16}, {"pose": [1] * 4}, {"pose": None}, {"lights": []}, {"lights": [7]}),
    *({"width": 4097}, {"width": 2049, "height": 2048}, {"paths": 0}, {"paths": 1025}, {"turn": -3601}),
    *({"intrinsics": [2, 1e-3, 8, 8]}, {"intrinsics": [2, 2, 8, -1e7]}),
)
BORDERS = (
    *({"width": 4096, "height": 1024}, {"width": 1, "height": 4096}, {"paths": 1}, {"paths": 1024}, {"turn": -3600}),
    {"intrinsics": [9e6, 2e-3, -9e6, 8]},
)


def post(body: bytes = b"x", **headers: object) -> dict[str, object]:
    return {"method": "POST", "body": body} | headers


def drop(server, name, content, **headers):
    return ask(server, f"lights?name={quote(name)}", **post(content, **headers))


REQUESTS = [  # the status, the path, and what differs from a request of the page
    *((200, "scene.json", {"Host": host}) for host in OWN),
    *((200, "scene.json", {"Origin": f"http://{host}"}) for host in OWN),
    *((403, "scene.json", {"Host": host}) for host in FOREIGN),
    *((403, "lights?name=a.exr", post(Origin=origin)) for origin in ORIGINS),
    *((403, path, {"token": False}) for path in ("", "scene.json", "assets/0", "x/scene.json", "{token}scene.json")),
    (403, "lights", post(token=False)),
    *((404, quote(path, safe="/%"), {}) for path in ABSENT),
    (404, "assets/0", post(b"")),
    (501, "assets/0", {"method": "PUT", "body": b""}),
    *((411, "lights?name=a.exr", post(b"", Content_Length=length)) for length in ("", "-1", "1e3", "9" * 40)),
    *((422, "final", post(json.dumps(camera_of(16, 16) | changes).encode())) for changes in CAMERAS),
    (422, "final", post(b"[]")),
    (400, "final", post(b"{")),
    *((status, "final", post(b" " * (65_536 + more))) for status, more in ((400, 0), (413, 1))),
]


def test_each_request_gets_its_status_and_one_line(shown_run, served):
    (shown_run / "secret.txt").write_text("secret")
    words = {"port": served.server_address[1], "token": served.url[-10:]}
    for status, path, how in REQUESTS:
        how = {key: value.format(**words) if isinstance(value, str) else value for key, value in how.items()}
        answer = ask(served, path.format(**words), **how)
        assert answer[0] == status, (path, how)
        assert status in (200, 501) or "\n" not in error_of(answer)[1], (path, how)


def test_a_camera_at_the_border_of_reason_is_taken_and_a_smaller_picture_shows_the_same():
    assert all(Camera.of(camera_of(16, 16) | changes, 1) for changes in BORDERS)
    camera = Camera.of(camera_of(60, 40, intrinsics=[90, 80, 31, 22]), 1)
    small = camera.scaled(20)
    assert camera.paths == 256 and not camera.ground and camera.scaled(100) == camera
    assert (small.width, small.height) == (20, 13) and small.intrinsics == pytest.approx((30, 26, 31 / 3, 7.15))
    assert (camera.scaled(1).width, Camera.of(camera_of(60, 10), 1).scaled(2).height) == (1, 1)


def test_a_server_for_all_machines_answers_to_addresses_alone(shown_run):
    with serving(shown_run, host="0.0.0.0") as server:
        for name, status in (("192.168.1.20", 200), (socket.gethostname(), 200), ("evil.example", 403)):
            assert ask(server, "scene.json", Host=f"{name}:{server.server_address[1]}")[0] == status
        assert ask(server, "scene.json", token=False)[0] == 403
        with ViewServer(server.shown) as second:  # each has a token of its own
            assert urlsplit(second.url).path != urlsplit(server.url).path and len(urlsplit(second.url).path) > 20


def test_pages_are_told_to_load_nothing_from_elsewhere(served):
    headers = ask(served, "")[1]
    policy, *others = ("Content-Security-Policy", "Referrer-Policy", "X-Content-Type-Options", "Cache-Control")
    assert headers[policy].startswith("default-src 'none'") and "http" not in headers[policy]
    assert [headers[name] for name in others] == ["no-referrer", "nosniff", "no-store"]
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize("name", ["studio.hdr", "studio.EXR"])
def test_a_dropped_light_is_read_and_served(served, name):
    light = encode_image(numbered_sky(), name[-4:].lower(), "light")
    status, _, content = drop(served, f"C:\\lights\\{name}", light)
    number = json.loads(content)["number"]
    shown = halves(ask(served, f"lights/{number}"))[..., :3]
    assert status == 200 and shown == pytest.approx(numbered_sky(), rel=0.02, abs=0.02)
    assert {"number": number, "name": name} in json.loads(ask(served, "scene.json")[2])["lights"]


def test_damaged_lights_are_refused_in_one_line(served, tmp_path):
    good = encode_image(numbered_sky(), ".exr", "light")
    cases = {"cut.exr": good[:200], "text.hdr": b"hello", "empty.hdr": b"", "../../x\n.exr": good[:99]}
    cases |= {"photo.png": good, "none": good}
    for name, pixels in (("square.exr", np.ones((8, 8, 3))), ("black.exr", np.zeros((8, 16, 3)))):
        cases[name] = encode_image(np.float32(pixels), ".exr", "light")
    for name, content in cases.items():
        status, line = error_of(drop(served, name, content))
        assert status == 422 and "\n" not in line and "/tmp" not in line and str(tmp_path) not in line, (name, line)
    assert len(json.loads(ask(served, "scene.json")[2])["lights"]) == 2 + len(STUDIO_LIGHTS)


def test_uploads_have_limits(served, monkeypatch):
    large = drop(served, "a.exr", b"x", Content_Length=str((128 << 20) + 1))
    assert error_of(large) == (413, "the file is larger than 128 MB; make it smaller")
    good = encode_image(numbered_sky(), ".exr", "light")
    monkeypatch.setattr(server_module, "LARGEST_UPLOAD", len(good))
    first, second, *_ = (json.loads(drop(served, f"{i}.exr", good)[2])["number"] for i in range(9))
    assert error_of(ask(served, f"lights/{first}")) == (404, "this light is no longer kept; drop it again")
    assert ask(served, f"lights/{second}")[0] == ask(served, "lights/0")[0] == 200


def test_a_light_of_many_rows_is_made_smaller(shown_run, tmp_path, monkeypatch):
    monkeypatch.setattr("splitnerf_tools.view.assets.MOST_ROWS", 4)
    light = light_of(shown_run / "environment.exr", "light").radiance
    assert light == pytest.approx(numbered_sky().reshape(4, 2, 8, 2, 3).mean(axis=(1, 3)), rel=1e-3)
    monkeypatch.undo()
    monkeypatch.setattr("splitnerf_tools.view.assets.light_named", lambda _: np.ones((1025, 2050, 3), np.float32))
    assert light_of(tmp_path, "large").radiance.shape == (1024, 2048, 3)


def test_photos_are_served_with_their_cameras(shown_run, data, tmp_path):
    """One of another size and exposure, too; where one is gone, this is said."""
    shutil.copytree(data, tmp_path / "data")
    frames = read_frames(tmp_path / "data", "train", Reading(eval_mode="all"))[0]
    write_image(frames[3].image_path, np.random.default_rng(0).random((20, 30, 4)))
    lens = {"fl_x": 80, "fl_y": 72, "cx": 28, "cy": 22, "w": 60, "h": 40}  # of an image of twice the size
    edit(tmp_path / "data", lambda meta: meta["frames"][3].update(exposure=2.0, **lens))
    with serving(shown_run, photos=ViewedPhotos(tmp_path / "data")) as server:
        cameras = json.loads(ask(server, "scene.json")[2])["cameras"]
        assert len(frames) == 8 and [camera["name"] for camera in cameras] == [frame.name for frame in frames]
        assert np.array_equal(np.reshape(cameras[3]["pose"], (4, 4)), frames[3].pose)
        said = [cameras[3][name] for name in ("width", "height", "exposure", "intrinsics")]
        assert said == [30, 20, 2, [40, 36, 14, 11]]
        status, headers, content = ask(server, "photos/3")
        assert status == 200 and headers["Content-Type"] == "image/png"
        assert np.array_equal(decode_image(content, "photo"), read_image(frames[3].image_path))
        assert ask(server, f"photos/{len(frames)}")[0] == 404
        shutil.rmtree(tmp_path / "data")
        status, line = error_of(ask(server, "photos/0"))
        assert status == 422 and "r_000.png: no such image; check the path" in line


def test_large_photos_are_averaged_down_and_masks_hide_nothing(shown_run, data, tmp_path):
    """What lies outside of a photo that is freed from its lens's distortion is clear, and nothing else."""
    shutil.copytree(data, tmp_path / "data")
    edit(tmp_path / "data", lambda meta: [frame.update(mask_path="none.png") for frame in meta["frames"]])
    write_image(tmp_path / "data/none.png", np.zeros((24, 24), np.float32))
    for i, (frame, width) in enumerate(zip(read_frames(tmp_path / "data", "train")[0], (1601, 1600, 24, 24))):
        lens = {"fl_x": width, "fl_y": width, "cx": width / 2, "cy": 12, "w": width, "h": 24, "k1": 0.5 * (i == 3)}
        edit(tmp_path / "data", lambda meta: meta["frames"][i].update(lens))
        write_image(frame.image_path, np.full((24, width, 3), 0.5, np.float32))
    with serving(shown_run, photos=ViewedPhotos(tmp_path / "data")) as server:
        shown = [decode_image(ask(server, f"photos/{number}")[2], "photo") for number in range(4)]
    assert [photo.shape for photo in shown] == [(12, 800, 4), (24, 1600, 4), (24, 24, 4), (24, 24, 4)]
    assert all((photo[..., 3] == 1).all() for photo in shown[:3])
    assert (shown[3][[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all() and (shown[3][8:16, 8:16, 3] == 1).all()


def streamed(server, **camera):
    """(asset, spp, picture) of each picture of a stream."""
    status, _, content = ask(server, "final", **post(json.dumps(camera).encode()))
    assert status == 200
    pictures = []
    while content:
        asset, width, height, spp, length = struct.unpack_from("<5I", content)
        content = content[20:]
        pictures.append((asset, spp, np.frombuffer(content[:length], "<f2").reshape(height, width, 4)))
        content = content[length:]
    return pictures


def test_pictures_are_those_of_the_path_tracer(shown_run, monkeypatch):
    """Strips of a picture and passes add up to what one call of the tracer says, also with the light turned."""
    for name, value in {"PASSES": (1, 1, 62), "FIRST_SIDE": 20, "PATHS_A_CALL": 500}.items():
        monkeypatch.setattr(final, name, value)
    asset = ViewedAssets([shown_run]).sources[0].asset
    lit = np.full((8, 16, 3), 0.5, np.float32)
    lit[3, 9] = 40  # a lamp before the triangle, which 90 degrees turn behind it
    write_image(shown_run / "environment.exr", lit)
    with serving(shown_run) as server:
        for turn in (0, 90):
            camera = camera_of(60, 40, turn=turn)
            pictures = streamed(server, **camera)
            small, *whole = [(asset, spp, picture.shape) for asset, spp, picture in pictures]
            assert small == (0, 1, (13, 20, 4)) and whole == [(0, spp, (40, 60, 4)) for spp in (1, 2, 64)]
            light, pose = rotate_environment(lit, turn), np.reshape(camera["pose"], (4, 4))
            expected = AssetRenderer(asset).render(light, pose, camera["intrinsics"], 60, 40, spp=256)
            small, first, _, best = (picture.astype(np.float32) for _, _, picture in pictures)
            assert 0.1 < expected["alpha"].mean() < 0.9
            off = np.abs(best[..., 3] - expected["alpha"])
            assert off.max() < 0.25 and off.mean() < 0.01
            inside = expected["alpha"] > 0.99
            truth = expected["radiance"][inside]
            assert best[inside, :3].mean(axis=0) == pytest.approx(truth.mean(axis=0), rel=0.03)
            noise = [((picture[inside, :3] - truth) ** 2).mean() for picture in (first, best)]
            assert noise[1] < noise[0] / 100  # of 64 paths and of one; 40 where all calls draw the same numbers
            thirds = area_average(expected["alpha"][:39], 3)
            assert np.abs(small[..., 3] - thirds).mean() < 0.1  # the same view in fewer pixels


def test_two_assets_are_traced_in_turns(shown_run, tmp_path, monkeypatch):
    monkeypatch.setattr(final, "PASSES", (1, 1))
    with serving(shown_run, triangle().write(tmp_path / "other.glb")) as server:
        pictures = streamed(server, **camera_of(16, 16, lights=[0, 1]))
    assert [(asset, spp) for asset, spp, _ in pictures] == [(0, 1), (1, 1), (0, 1), (1, 1), (0, 2), (1, 2)]
    assert {picture.shape for *_, picture in pictures} == {(16, 16, 4)}  # the first is no larger than the others
    bright, white = (np.float32(picture).sum(axis=(0, 1)) for *_, picture in pictures[-2:])
    assert (bright[:3] / bright[3] > 1).all() and white[:3] / white[3] == pytest.approx(0.5, abs=0.1)  # grey in white


def test_final_ends_at_the_paths_that_are_asked_for_and_shows_the_ground(shown_run, monkeypatch):
    monkeypatch.setattr(final, "FIRST_SIDE", 20)
    with serving(shown_run) as server:
        plain = streamed(server, **camera_of(60, 40, paths=4))
        ground = streamed(server, **camera_of(60, 40, paths=64, ground=True))
    assert [spp for _, spp, _ in plain] == [1, 1, 2, 4] and sum(final.PASSES) == 1024
    shadow = (ground[3][2] - plain[3][2]).astype(np.float32)
    assert shadow[..., 3].max() > 0.1 and np.abs(shadow[..., :3]).max() < 1e-3  # it is black
    asset, camera = ViewedAssets([shown_run]).sources[0].asset, camera_of(60, 40)
    lens = np.reshape(camera["pose"], (4, 4)), camera["intrinsics"], 60, 40
    lowest = AssetRenderer(asset).render(numbered_sky(), *lens, spp=64, catcher_height=0.0)["shadow"]
    assert np.float32(ground[-1][2])[34:, :, 3].sum() == pytest.approx(lowest[34:].sum(), rel=0.2)


def test_a_newer_request_ends_the_one_before(shown_run, monkeypatch):
    monkeypatch.setattr(final, "PASSES", (1,) * 1_000_000)
    monkeypatch.setattr(final, "MOST_PATHS", 1_000_000)
    tracer, second = Tracer(ViewedAssets([shown_run])), []
    camera = Camera.of(camera_of(16, 16, paths=1_000_000), 1)
    first = tracer.pictures(camera, lambda: False)
    assert next(first).spp == 1
    thread = threading.Thread(target=lambda: second.append(next(tracer.pictures(camera, lambda: False))))
    thread.start()
    assert sum(1 for _ in first) < 1_000_000  # else it would not end
    thread.join()
    assert second[0].spp == 1 and list(tracer.pictures(camera, lambda: True)) == []
    pictures = tracer.pictures(camera, lambda: False)
    next(pictures)
    assert not tracer._working.locked()  # who reads no pictures holds nothing up
    tracer.stop()
    assert list(pictures) == []


REFUSED = "view", "--no-browser"


def test_what_cannot_be_shown_is_refused_before_anything_is_served(shown_run, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("splitnerf_tools.view.server.ViewServer.__init__", lambda *_: pytest.fail("served"))
    content = (shown_run / "mesh.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(content[: len(content) // 2])
    for name in ("text.glb", "bad.hdr"):
        (tmp_path / name).write_text("hello")
    (tmp_path / "empty").mkdir()
    for said, *words in (
        *(("cut.glb: truncated GLB", tmp_path / "cut.glb"), ("text.glb: is neither", shown_run, tmp_path / "text.glb")),
        *(("a.gltf: is a .gltf", beside(tmp_path, "inside.bin")), ("empty: has no mesh.glb", tmp_path / "empty")),
        ("absent.glb: no such run or .glb file", tmp_path / "absent.glb"),
        ("bad.hdr: ", shown_run, "--light", tmp_path / "bad.hdr"),
        ("absent: no such folder", shown_run, "--data", tmp_path / "absent"),
        ("--port must lie between 0 and 65535", shown_run, "--port", 65536),
    ):
        assert said in refused(capsys, *REFUSED, *words)


def test_a_port_in_use_and_a_foreign_address_are_refused(shown_run, capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = refused(capsys, *REFUSED, shown_run, "--port", port)
        assert f"127.0.0.1, port {port}: cannot be listened at (Address already in use)" in line
    for host in ("192.0.2.1", "no.such.host.invalid"):
        assert "give another --host" in refused(capsys, *REFUSED, shown_run, "--host", host)


def test_another_host_is_said(shown_run, capsys, monkeypatch):
    monkeypatch.setattr(ViewServer, "serve_forever", Mock(side_effect=KeyboardInterrupt))
    for words, printed, noted in (((), r"127\.0\.0\.1", ""), (("--host", "0.0.0.0"), r"\S+", "listens at 0.0.0.0")):
        assert main(["view", "--no-browser", str(shown_run), *words]) == DONE
        said = capsys.readouterr()
        assert re.fullmatch(rf"http://{printed}:\d+/[\w-]{{20,}}/\n", said.out)
        assert noted in said.err and ("note" in said.err) == bool(noted)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_peace(shown_run, number):
    """Also while the path tracer works."""
    words = [sys.executable, "-m", "splitnerf", "view", str(shown_run), "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        url = urlsplit(process.stdout.readline().strip())
        assert url.hostname == "127.0.0.1"
        page = http.client.HTTPConnection(url.hostname, url.port, timeout=60)
        page.request("POST", f"{url.path}final", json.dumps(camera_of(1000, 1000)))
        assert page.getresponse().status == 200
        process.send_signal(number)
        assert process.wait(60) == DONE and process.stderr.read() == ""


def silent(server):
    return create_connection(server.server_address, timeout=5)


def wait_until(wanted) -> None:
    while not wanted():
        time.sleep(0.01)


def test_silent_connections_leave_files_for_the_run(served, monkeypatch):
    monkeypatch.setattr(server_module.Handler, "timeout", 600)
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    used = len(os.listdir("/proc/self/fd"))
    resource.setrlimit(resource.RLIMIT_NOFILE, (used + 2 * server_module.MOST_OPEN + 40, limits[1]))
    try:
        with ExitStack() as stack:
            many = [stack.enter_context(silent(served)) for _ in range(server_module.MOST_OPEN + 20)]
            assert [page.recv(1) for page in many[server_module.MOST_OPEN :]] == [b""] * 20  # closed at once
            open(__file__).close()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    wait_until(lambda: served._open == 0)
    assert ask(served, "scene.json")[0] == 200


def test_a_connection_without_a_token_is_closed_soon(shown_run, monkeypatch):
    assert server_module.Handler.timeout < server_module.TIMEOUT
    monkeypatch.setattr(server_module.Handler, "timeout", 0.2)
    with serving(shown_run) as server, silent(server) as page:
        page.sendall(b"GET /")
        assert page.recv(1) == b""
        wait_until(lambda: server._open == 0)
    with serving(shown_run) as server, silent(server) as page:  # one that sends a byte now and then
        with pytest.raises(OSError):
            for _ in range(200):
                page.sendall(b"G")
                time.sleep(0.02)
        wait_until(lambda: server._open == 0)


def test_a_page_that_goes_ends_its_request(shown_run, monkeypatch):
    """Whatever the number of its file is, which select() refuses above 1023."""
    monkeypatch.setattr(final, "PASSES", (1,) * 1_000_000)
    monkeypatch.setattr(final, "MOST_PATHS", 1_000_000)
    monkeypatch.setattr(select, "select", lambda *_: pytest.fail("select() was called"))
    with serving(shown_run) as server:
        body, url = json.dumps(camera_of(16, 16, paths=1_000_000)).encode(), urlsplit(server.url)
        with create_connection(server.server_address, 20) as page:
            head = f"POST {url.path}final HTTP/1.1\r\nHost: {url.netloc}\r\nContent-Length: {len(body)}\r\n\r\n"
            page.sendall(head.encode() + body)
            assert page.recv(12).startswith(b"HTTP/1.0 200") and server._open == 1
        wait_until(lambda: server._open == 0)  # else it would not end
