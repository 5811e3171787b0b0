"""The report's page in Chromium, from a file: its controls do what they say, and what they show is what was written.

Skipped where Node, Chromium or the packages of the pages' sources (`npm ci` there, or `make viewer`) are missing.
"""

import numpy as np
import pytest
from looking_at import keys, look_at, middle, needs_chromium, opened, pixels
from looking_at import text as say
from painted_ball import sky, with_textures
from splitnerf.data.images import linear_to_srgb, write_image
from splitnerf.export.writers import write_glb
from splitnerf_tools.report import write_report

RED, BLUE = (0.8, 0.2, 0.2), (0.2, 0.2, 0.7)
FILES = "above.exr", "above.hdr"
LAMP = (5, 12)  # row and column of a texel of the true light
CHANNELS = ["shaded", "albedo", "roughness", "metallic", "normals", "occlusion"]
LIGHT, INPUT = "document.querySelector('#object [name=light]')", "l.dispatchEvent(new Event('input', {bubbles: true}))"
NO_WEBGL = """const plain = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind.startsWith("webgl") ? null : plain.call(this, kind, ...rest); };"""

pytestmark = needs_chromium


def plain(colour, alpha=1.0):
    maps = {"rgb": np.full((40, 60, 3), colour), "alpha": np.full((40, 60), alpha), "roughness": np.full((40, 60), 0.5)}
    return maps | {"albedo": np.full((40, 60, 3), 0.25), "normal": np.tile(np.float32([0, 0, 1]), (40, 60, 1))}


@pytest.fixture(scope="module")
def report(ball, tmp_path_factory):
    """Two views, red beside blue; a light with one bright texel; a ball; nine steps of training."""
    folder = tmp_path_factory.mktemp("report")
    materials = np.full((64, 64, 2), (0.25, 0.0), np.float32)
    brown = np.full((64, 64, 3), (0.6, 0.3, 0.1), np.float32)
    asset = with_textures(ball, albedo_texture=brown, roughness_metallic_texture=materials)
    write_glb(folder / "mesh.glb", asset, np.full((64, 64), 0.8, np.float32))
    tilted = plain(BLUE) | {"normal": np.tile(np.float32([0.5, 0, 0.75**0.5]), (40, 60, 1))}
    tilted["roughness"] = tilted["roughness"] + 0.25
    views = [{"name": f"r_{i}", "truth": plain(RED), "prediction": tilted} for i in range(2)]
    true = np.full((128, 256, 3), 0.5, np.float32)
    true[LAMP] = (64.0, 8.0, 1.0)
    above = np.repeat(np.linspace(3, 0, 64, dtype=np.float32), 128 * 3).reshape(64, 128, 3)
    maps = dict.fromkeys(FILES, above) | {"square.exr": above[:, :64], "negative.exr": above - 1}
    for file, picture in maps.items():
        write_image(folder / file, picture)
    (folder / "cut.exr").write_bytes((folder / "above.exr").read_bytes()[:900])
    (folder / "notes.txt").write_text("no light")
    terms = [{"loss_colour": 10.0**-i, "loss_light": 0.5, "loss_late": 0.0 if i < 5 else 1e-3} for i in range(9)]
    history = [{"step": 100 * i, "loss": 2.0**-i, "psnr": 20.0 + i} | terms[i] for i in range(9)]
    summary = {"Settings": {f"s{i}": i for i in range(30)}}
    lights = {"lights": [{"roughness": 0.0, "g": sky(32)}], "light_truth": true, "light": sky(32)}
    shown = {"summary": summary, "views": views, "asset": folder / "mesh.glb", "timings": {"training": 3.0}}
    write_report(folder / "report.html", title="two </script> views", history=history, **shown, **lights)
    return folder / "report.html"


@pytest.fixture(scope="module")
def seen(report):
    """Pictures by name, and what the page said, of one walk through the page."""
    folder = report.parent / "pictures"
    folder.mkdir()
    part = lambda name, selector: {"do": "part", "selector": selector, "path": str(folder / f"{name}.png")}
    point = lambda selector, x, y, press=False: {"do": "point", "selector": selector, "place": [x, y], "press": press}
    over = lambda chart, x: point(f"{chart} .u-over", x, 0.5)
    text = lambda name, selector: say(name, f"document.querySelector('{selector}')?.innerText")

    def click(words, section):
        script = f"[...document.querySelectorAll('#{section} button')].find((b) => b.textContent === '{words}').click()"
        return say(words, script)

    def choose(channel):
        number = CHANNELS.index(channel)
        return say(channel, f"document.querySelectorAll('#object [name=channel]')[{number}].click()")

    def light(name):
        script = f"(l => {{ l.selectedIndex = [...l.options].findIndex(o => o.text === '{name}'); {INPUT} }})({LIGHT})"
        return say(name, script)

    def dropped(file):
        path = {"do": "drop", "path": str(report.parent / file)}
        return path, say(f"said of {file}", "document.querySelector('#object .hint + input + .hint').innerText")

    stage, object_ = "#views .stage", "#object canvas"
    true_light = "#light .widget figure:nth-child(2) canvas"
    hidden = ".tag, .divider, .cross { display: none !important } .sky { border-radius: 0 !important }"
    bare = {"do": "style", "content": hidden + ".stage:focus-within { outline: 0 !important } .bar3d { display: none }"}
    asked = "performance.getEntriesByType('resource').map((e) => e.name).filter((n) => !/^(blob|data):/.test(n))"
    maps = [step for name in CHANNELS[1:] for step in (choose(name), part(name, object_))]
    chart, terms = "#training figure:nth-child(2)", "#training figure:nth-child(3)"
    said, tip, hidden_curve = "#views .said", f"{terms} .tip", f"{terms} .u-legend .u-series:nth-child(2)"
    exposures = (f"#{section} [name=exposure]" for section in ("light", "object"))
    darker, brighter = ({"do": "set", "selector": one, "value": stops} for one, stops in zip(exposures, (-5, 2)))
    steps = [
        *(*opened(700, 600), bare, say("asked", asked)),
        say("live", "[...document.querySelectorAll('.live')].map((e) => e.id)"),
        say("static", "[...document.querySelectorAll('.static')].filter((e) => e.checkVisibility()).length"),
        *(part("half", stage), point(stage, 0.25, 0.5, press=True), part("quarter", stage), text("readout", said)),
        {"do": "focus", "selector": "#views .stage input"},
        *(*keys("PageUp", "ArrowLeft", "ArrowLeft"), part("keys", stage)),
        *(click("error", "views"), part("error", stage)),
        *(text("mean", said), text("scale", "#views .legend-row"), click("normals", "views"), text("angle", said)),
        *(
            click("roughness", "views"),
            text("rough", said),
            part("light", true_light),
            darker,
            part("dark", true_light),
        ),
        *(point(true_light, (LAMP[1] + 0.5) / 256, (LAMP[0] + 0.5) / 128), text("radiance", "#light .said")),
        *(
            step
            for x, name in ((0.25, "tip"), (0.99, "last"))
            for step in (over(chart, x), text(name, f"{chart} .tip"))
        ),
        *(over(terms, 0.99), text("terms", tip), point(hidden_curve, 0.5, 0.5, press=True)),
        *(over(terms, 0.98), text("fewer", tip)),
        say("linear", f"document.querySelector('{terms} .axis input').click()"),
        *(over(terms, 0.02), text("zero", tip), part("shaded", object_), *maps, choose("shaded")),
        *(step for name in ("true light", "sunset") for step in (light(name), part(name, object_))),
        *(*dropped("negative.exr"), *(step for file in FILES for step in (*dropped(file), part(file, object_)))),
        *(step for file in ("square.exr", "cut.exr", "notes.txt") for step in dropped(file)),
        *(say("chosen", f"{LIGHT}.selectedOptions[0].text"), part("kept", object_), light("true light"), brighter),
        *(part("brighter", object_), {"do": "size", "width": 380, "height": 700}),
        say("unfolded", "document.querySelectorAll('details').forEach((e) => (e.open = true))"),
        say("overflow", "document.documentElement.scrollWidth - innerWidth"),
    ]
    told = look_at(report.as_uri(), steps)
    return told, {path.stem: pixels(path) for path in folder.glob("*.png")}


def share_of(picture, colour):
    """The share of a picture's middle row that has a colour."""
    return (np.abs(picture[picture.shape[0] // 2] - np.float32(colour)).max(axis=1) < 0.02).mean()


def test_the_file_loads_without_a_complaint_or_a_request(seen):
    """And a narrow window does not scroll sideways."""
    told, _ = seen
    assert told["texts"]["overflow"] == 0
    assert [line for line in told["console"] if not line.startswith("warning: ")] == [] and told["texts"]["asked"] == []
    assert told["texts"]["live"] == ["object", "views", "light", "training"] and told["texts"]["static"] == 0


def test_the_slider_parts_truth_and_prediction(seen):
    told, pictures = seen
    for name, share in (("half", 0.5), ("quarter", 0.25), ("keys", 0.34)):
        assert share_of(pictures[name], RED) == pytest.approx(share, abs=0.02), name
        assert share_of(pictures[name], BLUE) == pytest.approx(1 - share, abs=0.02), name
    assert told["texts"]["readout"].startswith("15, 20: photo 0.80 0.20 0.20 · render 0.20 0.20 0.70 · difference 0.36")


def test_the_error_map_has_the_difference_and_says_its_scale(seen):
    told, pictures = seen
    texts = told["texts"]
    means = {name: float(texts[name].removeprefix("mean ").removesuffix("°")) for name in ("mean", "rough", "angle")}
    assert means["mean"] == pytest.approx(1.1 / 3, abs=0.005) and means["rough"] == pytest.approx(0.25, abs=0.005)
    assert means["angle"] == pytest.approx(30.0, abs=0.5)
    assert texts["angle"].endswith("°") and "0.25 and more" in texts["scale"]
    assert middle(pictures["error"]) == pytest.approx(np.float32([252, 240, 150]) / 255, abs=0.02)  # beyond the scale


def test_the_exposure_changes_the_lights_pixels(seen):
    """The lights lie on a card whose white is three times the mean; five stops darker, the lamp alone is left."""
    told, pictures = seen
    white = 3 * (0.5 + (64 + 8 + 1 - 1.5) / (3 * 128 * 256))
    for name, stops in (("light", 0), ("dark", -5)):
        expected = float(linear_to_srgb(np.float32([0.5 / white * 2.0**stops]))[0])
        assert middle(pictures[name]) == pytest.approx([expected] * 3, abs=0.01), name
    red = pictures["dark"][2:-2, 2:-2, 0]  # without what the browser rounds to
    y, x = (place + 2.5 for place in np.unravel_index(red.argmax(), red.shape))
    height, width = pictures["dark"].shape[:2]
    assert (y / height * 128, x / width * 256) == pytest.approx((LAMP[0] + 0.5, LAMP[1] + 0.5), abs=1)
    radiance = told["texts"]["radiance"]
    assert radiance.startswith("azimuth 162°, elevation 82°: recovered light") and "true light 64 8 1" in radiance


def test_curves_say_the_values_under_the_pointer(seen):
    texts = seen[0]["texts"]
    said = {"tip": "step 200, loss 0.25", "last": "step 800, loss 0.003906", "zero": "step 0, colour 1, light 0.5"}
    said |= {"terms": "step 800, colour 1e-8, late 0.001, light 0.5", "fewer": "step 800, colour 1e-8, light 0.5"}
    assert {name: ", ".join(texts[name].split("\n")) for name in said} == said


def test_the_asset_turns_up_in_each_channel(seen):
    _, pictures = seen
    albedo = linear_to_srgb(np.float32([0.6, 0.3, 0.1]))
    front = np.float32([0, -np.cos(np.radians(20)), np.sin(np.radians(20))]) / 2 + 0.5
    channels = {"albedo": albedo, "normals": front, "roughness": 0.25, "metallic": 0.0, "occlusion": 0.8}
    for name, value in channels.items():
        assert middle(pictures[name]) == pytest.approx(np.broadcast_to(value, 3), abs=0.02), name
    shaded = middle(pictures["shaded"])
    assert shaded[0] > shaded[1] > shaded[2] > 0.02
    assert np.abs(pictures["true light"] - pictures["shaded"]).mean() > 0.01  # of the ball, on plain grey
    assert np.abs(pictures["sunset"] - pictures["true light"]).mean() > 0.02
    assert (middle(pictures["brighter"]) > middle(pictures["true light"]) + 0.1).all()


def test_lights_of_the_readers_own_files_light_the_object(seen):
    """One that is bright above lights the ball from above, from either kind of file."""
    told, pictures = seen
    for file in FILES:
        height, width, _ = pictures[file].shape
        column = pictures[file][:, width // 2, 0]
        assert told["texts"][f"said of {file}"] == "" and column[height // 3] > column[height - height // 3] + 0.1
    assert told["texts"]["chosen"] == "above.hdr" and np.abs(pictures["above.exr"] - pictures["above.hdr"]).max() < 0.02
    assert np.array_equal(pictures["kept"], pictures["above.hdr"])
    assert told["texts"]["said of square.exr"].endswith("is 64x64; an equirectangular map is twice as wide as high")
    assert told["texts"]["said of negative.exr"] == "Its negative radiance is shown as 0."
    assert told["texts"]["said of cut.exr"].startswith("cut.exr: ")
    assert told["texts"]["said of notes.txt"] == "notes.txt: is no .hdr or .exr file"


def test_without_webgl_one_line_takes_the_place_of_the_object(report):
    steps = [
        {"do": "before", "script": NO_WEBGL},
        *opened(700, 440),
        say("said", "document.querySelector('#object').innerText"),
        say("live", "[...document.querySelectorAll('.live')].map((e) => e.id)"),
    ]
    told = look_at(report.as_uri(), steps)
    assert told["console"] == [] and told["texts"]["live"] == ["views", "light", "training"]
    assert "no WebGL 2" in told["texts"]["said"]
