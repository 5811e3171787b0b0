"""The report without its script: self-contained, escaped, and complete with and without truth."""

import base64
import gzip
import html
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from painted_ball import with_textures
from PIL import Image
from splitnerf.cli.common import print_scores
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb
from splitnerf.evaluate.score_table import graded
from splitnerf.export.writers import write_glb
from splitnerf.relight.cameras import MARGIN
from splitnerf.relight.studio import STUDIO_LIGHTS, studio_light
from splitnerf_tools.report import run as report_run
from splitnerf_tools.report import write_report
from splitnerf_tools.report.drawings import curve_data, line_chart, plan
from splitnerf_tools.report.embedding import data_uri, script_json
from splitnerf_tools.report.run import RELIT_GREY, relit_pictures
from splitnerf_tools.report.sections import averaged, fitted

VOID = {"meta", "img", "br", "link", "line", "circle", "polyline"}
HOSTILE = "</script><script>alert(1)</script><!--"


class Balanced(HTMLParser):
    """Fails on a closing tag that does not match; keeps pictures, scripts by their id, and what other elements refer to."""

    def __init__(self):
        super().__init__()
        self.open, self.pictures, self.scripts, self.references, self.script = [], [], {}, [], None

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            self.pictures.append(dict(attributes))
        if tag == "script":
            self.script = dict(attributes).get("id", "bundle")
            assert self.script not in self.scripts
            self.scripts[self.script] = ""
        self.references += [value for name, value in attributes if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_data(self, text):
        if self.open and self.open[-1] == "script":
            self.scripts[self.script] += text

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def make_view(with_truth):
    shape = (6, 6)
    maps = {"alpha": np.ones(shape), "roughness": np.full(shape, 0.4), "metallic": np.zeros(shape)}
    maps |= {name: np.full((*shape, 3), value) for name, value in (("rgb", 0.5), ("albedo", 0.2), ("normal", 0.577))}
    occlusion = {"occlusion_diffuse": np.ones((*shape, 1)), "occlusion_specular": np.ones((*shape, 3))}
    truth = maps | {"rgb": maps["rgb"] + 0.1, "normal_mask": np.ones(shape, bool)} if with_truth else {"albedo": None}
    return {"name": "r_<0>", "truth": truth, "prediction": maps | occlusion}


def write(tmp_path, **changes):
    light, nan = np.ones((4, 8, 3)), {"loss_nan": np.nan}
    contents = {
        "title": "a <script>alert(1)</script> scene",
        "grades": graded({"novel_view": {"psnr": 29.321}, "roughness_mae": 0.06348}),
        "relit": [("studio", np.full((8, 8, 3), 0.5)), ("sunset", np.full((8, 8, 3), 0.25))],
        "summary": {"Config": {"light": "<mlp>", "nested": {"on": True, "none": None, "sizes": [0.12345, 2]}}},
        "views": [make_view(True)],
        "lights": [{"roughness": r, "g": light * (1 + r), "g_bar": light / (1 + r)} for r in (0, 0.25, 0.5, 1)],
        "light_truth": light,
        "light": light,
        "history": [{"step": s, "loss": 1 / (s + 1), "psnr": 20 + s, "loss_light": 0.1} | nan for s in range(9)],
        "timings": {"hash_encode": 37.5, "other": 10.0, "export": 2.5},
    } | changes
    write_report(tmp_path / "report.html", **contents)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    parser = Balanced()
    parser.feed(page)
    assert parser.open == []
    return page, parser


def data_of(parsed):
    """What the page's script reads."""
    return json.loads(parsed.scripts["data"], parse_constant=lambda constant: pytest.fail(f"{constant} in JSON"))


def halves_of(light):
    """[h, w, 4] of a light in the page."""
    content = gzip.decompress(base64.b64decode(light["packed"]))
    return np.frombuffer(content, "<f2").reshape(light["height"], light["width"], 4).astype(np.float32)


def picture_of(image):
    """The pixels of an <img>."""
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(image["src"].partition(",")[2]))), np.float32) / 255


def test_report_holds_every_part_and_is_self_contained_and_escaped(tmp_path):
    page, parsed = write(tmp_path)
    # 5 maps of truth and 7 of the prediction; two lights; 4 roughnesses with estimates; two relit pictures.
    assert len(parsed.pictures) == 12 + 2 + 8 + 2 and page.replace(parsed.scripts["bundle"], "").count("<svg") == 3
    assert ">0.1</text>" in re.search(r"Loss</figcaption>.*", page)[0]  # decades, not quarters
    words = "20.00 dB; 29.3 dB; 0.06 off; sunset; ρ = 0.25; true light; hash_encode; width:75.0%; one factor per colour channel"
    words += (
        "; >38 s<; >10 s<; >2.5 s<; >nested.on</td><td>yes<; >nested.none</td><td>–<; >nested.sizes</td><td>0.123, 2<"
    )
    words += "; White is a radiance of 3, 3 times the mean."  # of the light that the smoothest surface reflects
    assert [text for text in words.split("; ") if text not in page] == []
    shown = {image["alt"]: picture_of(image)[0, 0, 0] for image in parsed.pictures}
    for name, white in {"recovered light": 3, "ρ = 1": 1.5, "Monte Carlo estimate, ρ = 1": 6}.items():
        assert shown[name] == pytest.approx(linear_to_srgb(np.float32([1 / white]))[0], abs=0.005)
    assert [chart["log"] for chart in data_of(parsed)["charts"]] == [False, True, True]
    for anchor in (reference for reference in parsed.references if reference.startswith("#")):
        assert f'id="{anchor[1:]}"' in page
    assert all(re.match("data:image/(png|jpeg);base64,", picture["src"]) for picture in parsed.pictures)
    assert all(reference.startswith(("data:", "#")) for reference in parsed.references)
    own = page.replace(parsed.scripts["bundle"], "")
    assert not re.search(r"https?://|@import", own) and "default-src 'none'" in own
    assert "&lt;script&gt;" in page and "&lt;mlp&gt;" in page and "r_&lt;0&gt;" in page


def test_no_name_ends_the_script(tmp_path):
    history = [{"step": s, "loss": 1.0, f"loss_{HOSTILE}": 0.5} for s in range(3)]
    changes = {"title": HOSTILE, "summary": {HOSTILE: {HOSTILE: HOSTILE}}, "timings": {HOSTILE: 1.0}}
    page, parsed = write(tmp_path, views=[make_view(True) | {"name": HOSTILE}], history=history, **changes)
    assert set(parsed.scripts) == {"data", "bundle"} and data_of(parsed)["charts"][1]["series"][0]["name"] == HOSTILE
    assert "alert(1)</script>" not in page and "<!--" not in page


def test_what_is_not_finite_never_reaches_the_script(tmp_path):
    light = np.full((4, 8, 3), 2.0)
    light[0, 0] = (np.nan, np.inf, 1e9)
    history = [{"step": s, "loss": value, "psnr": value} for s, value in enumerate((1.0, np.nan, np.inf, 2.0))]
    _, parsed = write(tmp_path, light=light, history=history)
    found = data_of(parsed)
    assert found["charts"][0]["x"] == [0, 3] and found["charts"][0]["series"][0]["values"] == [1.0, 2.0]
    assert np.isfinite(found["lights"][0]["white"]) and np.isfinite(halves_of(found["lights"][0])).all()
    assert "null" not in script_json([1.0, {"a": (2, "x")}])
    assert script_json({"a": [np.float32("nan")]}) == '{"a":[null]}'


def test_report_without_truth_or_history(tmp_path):
    nothing = {"light_truth": None, "light": None, "timings": {}}
    nothing |= {name: [] for name in ("lights", "history", "relit", "grades")}
    page, parsed = write(tmp_path, views=[make_view(False)], **nothing)
    assert len(parsed.pictures) == 7
    page = page.replace(parsed.scripts["bundle"], "")
    assert "<h2>Light</h2>" not in page and "<svg" not in page and "dB<" not in page and "<h2>Object</h2>" not in page
    assert data_of(parsed)["charts"] == [] and data_of(parsed)["lights"] == []


def test_lights_are_carried_in_16_bits(tmp_path):
    """256 x 128 texels of the delivered light, the true one, and the one before the refinement, in the light's own order."""
    light = np.random.default_rng(0).gamma(0.5, 2.0, (256, 512, 3)).astype(np.float32)
    light[0, 0] = 1e6
    _, parsed = write(tmp_path, light=light)
    delivered, true = data_of(parsed)["lights"]
    assert (delivered["name"], true["name"]) == ("recovered light", "true light")
    expected = np.minimum(light.reshape(128, 2, 256, 2, 3).mean((1, 3)), 65504)
    assert np.allclose(halves_of(delivered)[..., :3], expected, rtol=1e-3, atol=1e-6)
    assert (halves_of(delivered)[..., 3] == 1).all() and delivered["white"] == pytest.approx(3 * light.mean(), rel=1e-5)


def test_pictures_have_at_most_512_pixels_a_side_and_count_by_coverage(tmp_path):
    view = make_view(True)
    wide = {"rgb": np.zeros((4, 1536, 3)), "alpha": np.zeros((4, 1536)), "roughness": np.full((4, 1536), 0.25)}
    wide["alpha"][:, ::3], wide["roughness"][:, ::3] = 1.0, 0.75
    _, parsed = write(tmp_path, views=[view | {"truth": {}, "prediction": wide}])
    rough = next(picture_of(image) for image in parsed.pictures if image.get("data-picture") == "roughness")
    assert rough.shape == (1, 512, 4)
    assert np.allclose(rough[..., 0], 0.75, atol=0.01) and np.allclose(rough[..., 3], 1 / 3, atol=0.01)
    assert averaged(np.ones((2, 1536, 1)))[0].shape == (1, 768, 1)  # no block is higher than the map


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize(("side", "kind"), [(200, "png"), (201, "webp")])
def test_pictures_are_carried_without_loss(side, kind, channels):
    codes = np.random.default_rng(0).integers(1, 256, (side, side, channels))
    uri = data_uri(codes / np.float32(255))
    assert uri.startswith(f"data:image/{kind};base64,")
    mode = {1: "L", 3: "RGB", 4: "RGBA"}[channels]
    found = Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert(mode)
    assert np.array_equal(np.asarray(found).reshape(codes.shape), codes)


def test_albedo_is_shown_under_the_factor_of_its_score_and_colours_are_scored_on_white(tmp_path):
    """Of half the coverage, half the difference of 0.1 is left. A normal that is not known is clear."""
    view, half = make_view(True), {"alpha": np.full((6, 6), 0.5)}
    view["truth"]["normal_mask"][0] = False
    views = [view | {side: view[side] | half for side in ("truth", "prediction")}]
    page, parsed = write(tmp_path, views=views, albedo_scale=[1.0, 2.0, 10.0])
    found = {image.get("data-picture"): picture_of(image) for image in parsed.pictures}
    expected = linear_to_srgb(np.float32([0.2, 0.4, 1.0]))
    assert np.allclose(found["albedo"][0, 0, :3], expected, atol=0.01) and "one times 1, 2, 10 (red" in page
    assert np.allclose(found["truth albedo"][0, 0, :3], expected[0], atol=0.01) and "26.02 dB" in page
    assert found["normal"][0, 0] == pytest.approx([0.5 + 0.577 / 2] * 3 + [0.5], abs=0.005)
    assert found["truth normal"][:2, 0, 3] == pytest.approx([0, 0.5], abs=0.005)


def test_every_comparison_names_pictures_that_are_there(tmp_path):
    page, parsed = write(tmp_path)
    pairs = json.loads(html.unescape(re.search(r'data-pairs="([^"]*)"', page)[1]))
    there = {image.get("data-picture") for image in parsed.pictures}
    names, kinds = ["image", "albedo", "roughness", "metallic", "normals"], ["colour"] * 2 + ["number"] * 2 + ["normal"]
    said = [(pair["name"], pair["kind"], pair["largest"]) for pair in pairs]
    assert said[:5] == list(zip(names, kinds, (0.25, 0.25, 0.5, 0.5, 45))) and pairs[0]["sides"] == ["photo", "render"]
    assert all(pair["right"] in there for pair in pairs) and all(pair["left"] in there for pair in pairs[:5])


@pytest.fixture
def glb(ball, tmp_path):
    """A ball with textures of noise, which do not compress."""
    noise = np.random.default_rng(0).random((512, 256, 3)).astype(np.float32)
    write_glb(tmp_path / "mesh.glb", with_textures(ball, albedo_texture=noise))
    return tmp_path / "mesh.glb"


def test_a_small_glb_is_carried_as_it_is(tmp_path, glb):
    """The camera stands before the object, a tenth farther off than its sphere would touch the picture's edge."""
    page, parsed = write(tmp_path, asset=glb)
    assert gzip.decompress(base64.b64decode(parsed.scripts["glb"])) == glb.read_bytes()
    camera = data_of(parsed)["camera"]
    assert camera["radius"] == pytest.approx(1.0, abs=0.01) and "<h2>Object</h2>" in page
    away, high = 1.1 / np.sin(np.radians(19.8)), np.radians(20)
    assert camera["position"] == pytest.approx([0, -away * np.cos(high), away * np.sin(high)], abs=0.05)
    assert camera["half_field"] == pytest.approx(np.radians(19.8)) and np.abs(camera["target"]).max() < 0.01


def test_textures_of_a_large_glb_are_averaged_down_until_it_fits(glb, tmp_path):
    whole = read_asset(glb)
    content, note = fitted(glb, glb.stat().st_size - 1)
    assert note.endswith(f"at most 256 pixels a side here, as the file has {glb.stat().st_size / 1e6:.1f} MB.")
    assert len(content) < glb.stat().st_size / 2
    (tmp_path / "small.glb").write_bytes(content)
    small = read_asset(tmp_path / "small.glb")
    for name in ("vertices", "triangles", "normals", "uv", "tangents"):
        assert np.array_equal(getattr(small, name), getattr(whole, name)), name
    stored = linear_to_srgb(whole.materials[0].albedo_texture)
    expected = stored.reshape(256, 2, 128, 2, 3).mean((1, 3))
    assert np.abs(linear_to_srgb(small.materials[0].albedo_texture) - expected).max() < 0.005
    assert fitted(glb, glb.stat().st_size)[1] == ""


def test_a_glb_that_does_not_fit_or_cannot_be_read_is_said(tmp_path, glb, monkeypatch):
    content, note = fitted(glb, 1000)
    assert content is None and "too much for this page" in note
    monkeypatch.setattr("splitnerf_tools.report.sections.MOST_BYTES", 1000)
    (tmp_path / "cut.glb").write_bytes(glb.read_bytes()[:500])
    for path, words in ((glb, "too much for this page"), (tmp_path / "cut.glb", "truncated GLB")):
        page, parsed = write(tmp_path, asset=path)
        assert words in page and "glb" not in parsed.scripts
    assert "<h2>Object</h2>" not in write(tmp_path, asset=tmp_path / "none.glb")[0]


def test_the_object_comes_first_then_what_was_promised_then_scores(tmp_path, glb):
    """Links name files beside the page; the sheet has each texture; the 3D view has the lights of `splitnerf relight`."""
    (tmp_path / "environment.exr").write_bytes(bytes(1_200_000))
    page, parsed = write(tmp_path, asset=glb)
    sections = re.findall(r'<section id="(\w+)"', page)
    assert sections == ["object", "relit", "scores", "views", "light", "training", "numbers"]
    named = [name for name in parsed.references if not name.startswith(("#", "data:"))]
    assert named == ["mesh.glb", "environment.exr"]
    assert ">1.2 MB<" in page and "1,280 faces, textures of 256 x 512, 64 x 64 pixels; 2 x 2 x 2 units" in page
    names = ("albedo", "roughness", "metallic", "normals")
    textures = {image["alt"]: picture_of(image) for image in parsed.pictures if image["alt"] in names}
    assert textures["albedo"].shape == (512, 256, 3)
    assert textures["albedo"].mean() == pytest.approx(linear_to_srgb(np.linspace(0, 1, 1001)).mean(), abs=0.01)
    assert [float(textures[name].mean()) for name in ("roughness", "metallic")] == pytest.approx([0.5, 0.0], abs=0.01)
    assert textures["normals"].mean(axis=(0, 1)) == pytest.approx([0.5, 0.5, 1.0], abs=0.01)
    assert [light["name"] for light in data_of(parsed)["studio"]] == list(STUDIO_LIGHTS)
    assert np.allclose(halves_of(data_of(parsed)["studio"][0])[..., :3], studio_light(STUDIO_LIGHTS[0]), rtol=1e-3)
    assert page.index("<h2>How good is it?") < page.index("How certain is it?") < page.index("<h2>New views")


def test_scores_are_said_in_words(capsys):
    """Higher is better, lower is better; the limits belong to the better word; what is missing has no row."""
    words = "good", "good", "fair", "fair", "poor"
    limits = {"novel_view": (30, 25), "relight": (29, 24), "albedo": (27, 22), "light_psnr": (22, 17)}
    limits |= {"normal_mae_deg": (5, 12), "roughness_mae": (0.08, 0.16), "f_score": (0.9, 0.7)}
    for name, (good, poor) in (limits | {"metallic_balanced_accuracy": (0.95, 0.8)}).items():
        step = 1e-3 * (good - poor)
        for value, word in zip((good + step, good, good - step, poor, poor - step), words):
            score = {"psnr": value} if name in ("novel_view", "relight", "albedo") else value
            found = graded({"relight": None, "f_score": None, name: score})
            assert [row["word"] for row in found] == [word], (name, value)
    (angle,) = graded({"normal_mae_deg": 7.12345})
    said = angle["name"], angle["value"], angle["scale"]
    assert said == ("Normals", "7.1° off", "good up to 5° off, poor above 12° off")
    scales = [row["scale"] for row in graded({"roughness_mae": 0.0, "novel_view": {"psnr": 31.0}})]
    assert scales == ["good from 30 dB, poor below 25 dB", "good up to 0.08 off, poor above 0.16 off"]
    print_scores({"novel_view": {"psnr": 31.0, "ssim": 0.9, "lpips": None}, "normal_mae_deg": 7.06, "chamfer": 0.01})
    assert capsys.readouterr().out.splitlines() == [
        "novel views            PSNR 31.00 dB, SSIM 0.9000 (good)",
        "normals, mean angle    7.06 degrees (fair)",
        "mesh chamfer           0.01",
    ]


def test_pictures_under_other_lights_are_those_of_the_path_tracer(ball):
    """A white ball casts a shadow on grey ground, and no two lights look alike."""
    pictures = dict(relit_pictures(with_textures(ball, albedo_texture=np.ones((64, 64, 3), np.float32)), 48))
    assert set(pictures) <= set(STUDIO_LIGHTS) and len(pictures) == 3
    ground = linear_to_srgb(np.float32([RELIT_GREY]))[0]
    beside = np.hypot(*(np.indices((96, 96)) - 47.5)) > 48 / MARGIN + 2
    for name, picture in pictures.items():
        shown = picture[beside].mean(axis=1)
        assert shown.max() == pytest.approx(ground, abs=0.01) and shown.min() < 0.85 * ground, name
    assert min(np.abs(pictures[a] - pictures[b]).mean() for a, b in (("studio", "sunny"), ("studio", "sunset"))) > 0.01


def test_pictures_under_other_lights_are_at_most_twice_as_large_as_the_photos(ball, monkeypatch):
    monkeypatch.setattr(report_run, "RELIT_SIDE", 32)
    sizes = [{picture.shape for _, picture in relit_pictures(ball, photo)} for photo in (8, 100)]
    assert sizes == [{(16, 16, 3)}, {(32, 32, 3)}]


def test_chart_places_points_and_drops_what_cannot_be_drawn():
    chart = str(line_chart("loss", {"a": [(0, 1.0), (50, 0.0), (75, float("nan")), (100, 0.01)]}, log=True))
    points = [tuple(map(float, p.split(","))) for p in re.search(r'points="([^"]*)"', chart)[1].split()]
    assert points == [(52, 12), (448, 216)]  # the corners of the plot: a step of 0 at 1, of 100 at 0.01
    assert str(line_chart("empty", {"a": [(0, -1.0)]}, log=True)) == ""


def test_ticks_of_a_chart_are_round_numbers():
    """The first is the lowest; the legend says the last value."""
    for end, log, labels in (
        *(
            ((2000, 10.0), 0, "0 2 4 6 8 10 0 500 1k 1.5k 2k"),
            ((999, 0.71234), 0, "0 0.2 0.4 0.6 0.8 0 200 400 600 800"),
        ),
        ((7, 1e-9), 1, "1e-09 1e-07 1e-05 0.001 0.1 0 2 4 6"),
    ):
        chart = str(line_chart("loss", {"a": [(0, float(log)), end]}, log=bool(log)))
        assert re.findall(r">([^<>]+)</text>", chart) == [*labels.split(), "step"] and f"<b>{end[1]:.4g}</b>" in chart
        assert float(re.search(r'<line class="grid" [^>]* y1="([\d.]+)"', chart)[1]) == 216


def test_a_plan_has_cameras_and_points_in_their_places():
    """Of 8 units an edge, 50 of the drawing each; a line of a twenty-fifth of the edge shows where the camera looks, down."""
    pose, points = np.eye(4), np.array([[1.0, 9, 2], [2, 9, 1], [6, 9, 2], [1, 9, 7]])
    pose[:3, 3] = 3, 9, 4
    drawn = str(plan((0, 2), pose[None], points, (["held-out"], "abcd"), np.array([1.0, 5, 2]), 4.0))
    places = set(re.findall(r'<circle class="([\w-]+)" cx="([\d.]+)" cy="([\d.]+)"', drawn))
    assert places == {("a", "200.0", "200.0"), ("b", "250.0", "250.0"), ("held-out", "300.0", "100.0")}
    assert 'd="M300.0 100.0L300.0 116.0"' in drawn


def test_a_runs_report_says_what_was_evaluated(done):
    page, scores = (done / "report.html").read_text(), json.loads((done / "evaluation.json").read_text())
    views = [float(value) for value in re.findall(r"<h3>r_\d+<span>([\d.]+) dB", page)]
    assert len(views) == 2 and np.mean(views) == pytest.approx(scores["novel_view"]["psnr"], abs=0.01)
    assert f"one times {', '.join(f'{factor:.3g}' for factor in scores['albedo']['lsq']['scale'])} (red" in page
    for name in ("ρ = 0", "ρ = 0.25", "ρ = 0.5", "ρ = 1", "occlusion, diffuse"):
        assert f"<th>{name}</th>" in page


def test_curves_for_the_script_share_their_steps():
    data = curve_data("terms", {"a": [(0, 1.0), (2, 0.0)], "b": [(1, 5.0), (2, float("nan"))], "c": []}, log=True)
    assert data["x"] == [0, 1, 2] and data["log"]
    assert data["series"] == [{"name": "a", "values": [1.0, None, 0.0]}, {"name": "b", "values": [None, 5.0, None]}]
    assert curve_data("none", {"a": [(0, float("nan"))]}) is None
    # Long ones are thinned alike: a line that begins late has its values at the steps of the others; the last step is as it is.
    long, late = [(i, float(i)) for i in range(10_001)], [(i, 2.0 * i) for i in range(5_000, 10_001)]
    data = curve_data("terms", {"long": long, "late": late})
    assert len(data["x"]) <= 402 and data["x"][-1] == 10_000 and data["x"][0] == 12.5
    first, second = (one["values"] for one in data["series"])
    assert first == data["x"] and second[:192] == [None] * 192
    assert all(b == 2 * a for a, b in zip(first[193:], second[193:]))
