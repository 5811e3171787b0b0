"""The viewer's page in Chromium: its picture is that of the path tracer, and its controls do what they say.

Skipped where Node, Chromium or the packages of the page's sources (`npm ci` there, or `make viewer`) are missing.
"""

import json
import re

import numpy as np
import pytest
from looking_at import keys, look_at, middle, needs_chromium, opened, pixels, serving, text, wait
from looking_at import picture as picture_at
from painted_ball import lamps, looking, with_textures
from scipy.ndimage import maximum_filter
from splitnerf.data.environment import rotate_environment
from splitnerf.data.images import area_average, linear_to_srgb, read_image, write_image
from splitnerf.export.writers import write_glb
from splitnerf.relight.cameras import HALF_FIELD, bounding_sphere, turntable
from splitnerf.relight.rendering import lowest
from splitnerf.relight.studio import studio_light
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.view.assets import ViewedAssets, ViewedPhotos
from splitnerf_tools.view.server import ViewServer

SIZE = 160
TURN = 90
CLICKED = 2  # the number of the photo whose camera is clicked
EXPOSURE = "document.querySelector('[name=exposure]')"
BARE = "#names, #said, #fold, .bar3d { display: none !important }"  # the picture alone

pytestmark = needs_chromium


def look(shown, steps, photos=None):
    """What the page says while it does the steps."""
    with serving(ViewServer(shown, photos)) as server:
        return look_at(server.url, steps)


@pytest.fixture(scope="module")
def run(ball, tmp_path_factory):
    """A run's folder with a ball whose halves differ."""
    folder = tmp_path_factory.mktemp("page") / "mine"
    folder.mkdir()
    materials = np.full((64, 64, 2), (0.4, 0.0), np.float32)
    write_glb(folder / "mesh.glb", with_textures(ball, roughness_metallic_texture=materials))
    write_image(folder / "environment.exr", lamps())
    return folder


@pytest.fixture(scope="module")
def seen(run):
    """Pictures by name, and what the page said, of one walk through the page."""
    folder = run.parent
    write_image(folder / "red.hdr", np.full((8, 16, 3), (1.0, 0.1, 0.1), np.float32))
    (folder / "cut.exr").write_bytes((run / "environment.exr").read_bytes()[:300])

    def picture(name):
        return picture_at(folder / f"{name}.png")

    said = {"do": "text", "script": "document.getElementById('said').textContent"}
    names = ("albedo", "roughness", "metallic", "normals", "occlusion")
    background, lit = "document.querySelector('[name=background]')", "document.querySelector('[name=light]')"
    linked = "HTMLAnchorElement.prototype.click = function () { window.saved = this.download; }"
    steps = [
        {"do": "before", "script": linked},
        *opened(700, 440),
        picture("whole"),
        *keys("s"),
        text("saved", "window.saved"),
        text("bar", "(b => [b.textContent, b.offsetWidth])(document.querySelector('.bar3d'))"),
        text("axes", "document.querySelector('.axes3d').innerHTML"),
        text("file", "(a => [a.download, a.parentElement.textContent])(document.querySelector('#panel a'))"),
        text("titles", "[...document.querySelectorAll('#panel [title]')].map((e) => e.title)"),
        {"do": "set", "selector": "[name=exposure]", "value": 3},
        text("reset", f"(e => (e.dispatchEvent(new Event('dblclick', {{bubbles: true}})), e.value))({EXPOSURE})"),
        *keys("2"),
        text("greyed", f"[{lit}.matches(':disabled'), {EXPOSURE}.matches(':disabled')]"),
        *keys(".", "b", "1"),
        text("untouched", f"[{EXPOSURE}.value, {background}.checked]"),
        said | {"name": "start"},
        {"do": "style", "content": BARE},
        {"do": "size", "width": SIZE, "height": SIZE},
        *keys("h"),
        picture("shaded"),
        {"do": "set", "selector": "[name=turn]", "value": TURN},
        picture("turned"),
        {"do": "set", "selector": "[name=turn]", "value": 0},
        *(step for i, name in enumerate(names) for step in (*keys(str(i + 2)), picture(name))),
        *keys("3", "u"),
        picture("unfolded"),
        *keys("u", "w"),
        picture("wires"),
        *keys("w", "1", "."),
        picture("brighter"),
        *keys(",", "t"),
        picture("neutral"),
        *keys("t"),
        picture("agx"),
        *keys("t"),
        *keys("ArrowLeft", "ArrowUp", "-"),
        picture("moved"),
        text("home", "document.querySelector('[name=home]').click()"),
        picture("home"),
        {"do": "drag", "from": [80, 80], "to": [110, 80]},
        picture("dragged"),
        *keys("r"),
        {"do": "key", "key": "a", "restless": True},
        wait("performance.now() > (window.spun ??= performance.now()) + 3000"),
        *keys("a"),
        picture("spun"),
        *keys("r"),
        {"do": "drop", "path": str(folder / "red.hdr")},
        picture("red"),
        text("light", "document.querySelector('[name=light] option:checked').textContent"),
        {"do": "drop", "path": str(folder / "cut.exr")},
        picture("kept"),
        said | {"name": "damaged"},
        *keys("b"),
        {"do": "set", "selector": "[name=blur]", "value": 0},
        picture("background"),
        text("sunny", f"{lit}.value = [...{lit}.options].find((o) => o.text === 'sunny').value"),
        *keys("b", "-", "-", "-"),
        picture("shadow"),
        *keys("g"),
        picture("shadowless"),
        *keys("g", "h"),
        {"do": "size", "width": 340, "height": 600},
        picture("narrow"),
        text("overflow", "document.documentElement.scrollWidth - innerWidth"),
        text("stage", "[canvas.clientWidth, canvas.clientHeight]"),
    ]
    told = look(ViewedAssets([run]), steps)
    return told, {path.stem: pixels(path) for path in folder.glob("*.png")}


@pytest.fixture(scope="module")
def traced(run):
    """By turns of the light: the picture of `splitnerf relight`, and where it shows the object alone."""
    source = ViewedAssets([run]).sources[0]
    view = turntable(source.asset, 1, size=(SIZE, SIZE))[0]

    def picture(turn):
        light = rotate_environment(lamps(), turn)
        images = AssetRenderer(source.asset).render(light, view.pose, view.intrinsics, SIZE, SIZE, spp=64)
        return linear_to_srgb(np.clip(images["radiance"], 0, 1)), images["alpha"] > 0.999

    return {turn: picture(turn) for turn in (0, TURN, -TURN, 180)}


@pytest.fixture(scope="module")
def photos(run):
    """The ball through three cameras whose lens looks past the middle, path traced, as a data set."""
    folder = run.parent / "data"
    source, frames = ViewedAssets([run]).sources[0], []
    lens = (200.0, 190.0, 95.0, 50.0)
    for i, (azimuth, elevation) in enumerate(((0.4, 0.5), (-2.0, 0.2), (2.5, -0.3))):
        pose = looking(azimuth, elevation, 5.0)
        images = AssetRenderer(source.asset).render(lamps(), pose, lens, SIZE, 120, spp=64)
        straight = linear_to_srgb(np.clip(images["radiance"] / np.maximum(images["alpha"], 1e-6)[..., None], 0, 1))
        write_image(folder / f"{i}.png", np.dstack([straight, images["alpha"]]))
        frames.append({"file_path": f"{i}.png", "transform_matrix": pose.tolist()})
    intrinsics = dict(zip(("fl_x", "fl_y", "cx", "cy"), lens)) | {"w": SIZE, "h": 120}
    (folder / "transforms.json").write_text(json.dumps(intrinsics | {"frames": frames}))
    return ViewedPhotos(folder)


@pytest.fixture(scope="module")
def through(run, photos):
    """Pictures by name, and what the page said, of a second walk: through the photos' cameras, path traced, two assets."""
    folder = run.parent / "through"
    folder.mkdir()

    def picture(name):
        return picture_at(folder / f"{name}.png")

    def split(value):
        return {"do": "set", "selector": ".stage input", "value": value}

    x, y = place_of_camera(run, photos, CLICKED)
    bare = {"do": "style", "content": BARE + ".divider, .tag { display: none !important }"}
    chosen = {"do": "text", "script": "document.querySelector('[name=through]').selectedOptions[0].textContent"}
    steps = [
        *opened(700, 440),
        *keys("n"),
        picture("whole"),
        *keys("r"),
        bare,
        {"do": "size", "width": SIZE, "height": SIZE},
        *keys("h", "n", "n"),
        split(100),
        picture("photo"),
        split(0),
        picture("render"),
        *keys("5"),
        picture("outline"),
        *keys("1"),
        chosen | {"name": "second"},
        {"do": "drag", "from": [80, 80], "to": [82, 80]},
        chosen | {"name": "left"},
        *keys("r"),
        *keys("c", "-", "-", "-", "-", "-", "-", "-", "-"),
        picture("frusta"),
        {"do": "click", "x": x, "y": y},
        chosen | {"name": "clicked"},
        *keys("r", "c"),
        {"do": "set", "selector": "[name=paths]", "value": 16},
        *keys("f"),
        picture("denoised"),
        {"do": "set", "selector": "[name=denoise]", "value": False},
        picture("noisy"),
        {"do": "set", "selector": "[name=paths]", "value": 256},
        picture("final"),
        text("said", "document.getElementById('said').textContent"),
        {"do": "set", "selector": "[name=turn]", "value": TURN},
        picture("turned"),
        *keys("f"),
        picture("again"),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("splitnerf_tools.view.final.PASSES", (1, 1, 14, 16))
        told = look(ViewedAssets([run]), steps, photos)
    return told, {path.stem: pixels(path) for path in folder.glob("*.png")}


def place_of_camera(run, photos, number):
    """The pixel in which a photo's camera is seen from the front, eight keys farther away."""
    view = turntable(ViewedAssets([run]).sources[0].asset, 1, size=(SIZE, SIZE))[0]
    centre = bounding_sphere(ViewedAssets([run]).sources[0].asset)[0]
    eye = centre + (view.pose[:3, 3] - centre) / 0.9**8
    place = view.pose[:3, :3].T @ (np.reshape(photos.cameras()[number]["pose"], (4, 4))[:3, 3] - eye)
    assert place[2] < 0
    return [SIZE / 2 + view.intrinsics[0] * place[0] / -place[2], SIZE / 2 - view.intrinsics[1] * place[1] / -place[2]]


def psnr(picture, traced):
    truth, inside = traced
    return -10 * np.log10(((picture - truth)[inside] ** 2).mean())


def smooth_psnr(picture, traced):
    """Of the means of 8 x 8 pixels, in which the noise of both is small, where the object fills them."""
    truth, inside = traced
    full = area_average(inside.astype(np.float32), 8) == 1
    return psnr(area_average(picture, 8), (area_average(truth, 8), full))


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
    assert middle(pictures["occlusion"]) == pytest.approx([1] * 3, abs=0.01)  # the file holds none
    # The middle of the ball looks at the camera: from the front (-y), from 20 degrees above.
    towards = np.array([0, -np.cos(np.radians(20)), np.sin(np.radians(20))])
    assert middle(pictures["normals"]) == pytest.approx(0.5 * towards + 0.5, abs=0.02)


def test_textures_and_wires_are_shown(seen, ball):
    """Unfolded, the roughness stands where the texture has a face; between wires, the background."""
    _, pictures = seen
    shown = np.abs(pictures["unfolded"] - 0.4).max(axis=2) < 0.01
    corners = ball.uv[ball.triangles].mean(axis=1)
    rows, columns = np.int64(corners[:, 1] * SIZE), np.int64(corners[:, 0] * SIZE)
    covered = maximum_filter(shown, 3)  # a face has few pixels here
    print(covered[rows, columns].mean(), covered[SIZE - 1 - rows, columns].mean())
    assert covered[rows, columns].mean() > 0.99  # the first row of the texture is the upper one
    assert covered[SIZE - 1 - rows, columns].mean() < 0.9
    wires = np.abs(pictures["wires"] - 0.4).max(axis=2) < 0.1
    assert 0.02 < wires.mean() < 0.8 * (np.abs(pictures["roughness"] - 0.4).max(axis=2) < 0.01).mean()


def test_the_ground_shows_the_shadow_of_the_path_tracer(seen, run):
    _, pictures = seen
    source = ViewedAssets([run]).sources[0]
    view = turntable(source.asset, 1, size=(SIZE, SIZE))[0]
    centre = bounding_sphere(source.asset)[0]
    pose = view.pose.copy()
    pose[:3, 3] = centre + (pose[:3, 3] - centre) / 0.9**3
    images = AssetRenderer(source.asset).render(
        studio_light("sunny"), pose, view.intrinsics, SIZE, SIZE, spp=64, catcher_height=lowest(source.asset)
    )
    grey = np.float32([0x8F, 0x92, 0x96]) / 255
    outside = images["alpha"] < 1e-3
    drawn = 1 - (pictures["shadow"] / grey).mean(axis=2)  # of sRGB codes, which the page mixes
    assert np.abs(pictures["shadowless"][outside] - grey).max() < 0.01
    dark, bright = (outside & (images["shadow"] > 0.7)), (outside & (images["shadow"] < 0.02))
    print(dark.sum(), drawn[dark].mean(), drawn[bright].mean())
    assert dark.sum() > 100 and drawn[dark].mean() > 0.4 and drawn[bright].mean() < 0.03


def test_what_the_controls_say(seen):
    texts = seen[0]["texts"]
    assert texts["saved"] == "mine.png"
    length, pixels_wide = texts["bar"]
    # The picture is 440 pixels high; the ball's middle is 1.1 / sin of the half field away.
    focal = 220 / np.tan(HALF_FIELD)
    assert pixels_wide == pytest.approx(float(length) * focal * np.sin(HALF_FIELD) / 1.1, abs=2) and pixels_wide <= 90
    ends = sorted(re.findall(r'class="(.)" d="M0 0L(\S+) (\S+)"', texts["axes"]))  # at the front, from 20 degrees above
    seen_so = 20 * np.array([[1, 0], [0, -np.sin(np.radians(20))], [0, -np.cos(np.radians(20))]])
    np.testing.assert_allclose(np.float64([end[1:] for end in ends]), seen_so, atol=1e-3)
    assert texts["file"][0] == "mine.glb" and " faces, textures of " in texts["file"][1]
    assert texts["reset"] == "0" and texts["greyed"] == [True, True] and texts["untouched"] == ["0", False]
    for words in ("(b)", "([ ]); a double click resets it", "(f)", "(w)"):
        assert any(words in title for title in texts["titles"]), words


def test_keys_and_the_pointer_move_what_they_say(seen):
    _, pictures = seen
    before = middle(pictures["shaded"])
    brighter = middle(pictures["brighter"])
    assert (brighter > before + 0.03).all()
    for name in ("neutral", "agx", "moved", "dragged", "spun"):
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
    assert told["texts"]["overflow"] == 0
    width, height = told["texts"]["stage"]
    assert width == 340 and height > 250


def test_a_photo_lies_where_its_camera_draws_the_object(through, run):
    """The lens looks past the middle, and is not square."""
    told, pictures = through
    complaints = [line for line in told["console"] if not line.startswith("warning: ")]
    assert complaints == [] and told["texts"]["second"] == "1"
    stored = read_image(run.parent / "data/1.png")
    inside = stored[..., 3] > 0.999
    grey = np.float32([0x8F, 0x92, 0x96]) / 255
    photo, render = (pictures[name][20:140] for name in ("photo", "render"))
    assert np.abs(photo - (stored[..., :3] * stored[..., 3:] + grey * (1 - stored[..., 3:])))[inside].max() < 0.01
    assert psnr(render, (stored[..., :3], inside)) > 30
    drawn = np.abs(pictures["outline"][20:140] - grey).max(axis=2) > 0.05
    wrong = {shift: (drawn != (np.roll(stored[..., 3], shift, axis=(0, 1)) > 0.15)).sum() for shift in (0, -1, 1)}
    print(wrong)
    assert wrong[0] < 0.01 * inside.sum() and wrong[0] < min(wrong[-1], wrong[1]) / 2
    assert np.abs(pictures["render"][:20] - grey).max() < 0.01  # beside the photo


def test_cameras_are_left_and_clicked(through):
    told, pictures = through
    assert told["texts"]["left"] == "none" and told["texts"]["clicked"] == str(CLICKED)
    rows, columns = np.indices((SIZE, SIZE)) - SIZE / 2
    lines = (pictures["frusta"][..., 2] - pictures["frusta"][..., 0] > 0.1) & (np.hypot(rows, columns) > 40)
    assert 20 < lines.sum() < 1000


def test_the_final_picture_is_the_path_tracers(through, traced):
    told, pictures = through
    assert told["texts"]["said"] == "path traced, 32 paths a pixel"
    for name, turn in (("final", 0), ("turned", TURN)):
        scores = {other: smooth_psnr(pictures[name], traced[other]) for other in traced}
        print(name, scores, smooth_psnr(pictures["again"], traced[turn]))
        assert scores[turn] > 45 and all(scores[other] < 35 for other in traced if other != turn)
    assert not np.array_equal(pictures["again"], pictures["turned"])


def test_few_paths_are_denoised_on_demand(through, traced):
    """16 paths a pixel against 64: the middle one of 3 x 3 pixels is nearer than the pixel itself."""
    _, pictures = through
    noisy, denoised = (psnr(pictures[name], traced[0]) for name in ("noisy", "denoised"))
    print(noisy, denoised)
    assert denoised > noisy + 2


def test_two_assets_stand_side_by_side(run, ball, tmp_path):
    dark = np.full((64, 64, 3), 0.02, np.float32)
    write_glb(tmp_path / "dark.glb", with_textures(ball, albedo_texture=dark))
    steps = [
        *opened(2 * SIZE, SIZE),
        text("names", "document.getElementById('names').innerText"),
        {"do": "style", "content": BARE},
        *keys("h", "2"),
        picture_at(tmp_path / "two.png"),
    ]
    told = look(ViewedAssets([run, tmp_path / "dark.glb"]), steps)
    picture = pixels(tmp_path / "two.png")
    assert told["texts"]["names"].split() == ["mine", "dark.glb"]
    for half, albedo in ((picture[:, :SIZE], 0.4), (picture[:, SIZE:], 0.02)):
        assert middle(half) == pytest.approx([float(linear_to_srgb(np.float32([albedo]))[0])] * 3, abs=0.02)
