"""Scores of runs and assets: free scales, relighting, tables and sheets by closed forms; what the command refuses; LPIPS."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from painted_ball import bare
from splitnerf.cli import DONE, main
from splitnerf.data.asset import Material
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, over_background, read_image, srgb_to_linear, to_uint8, write_image
from splitnerf.data.truth import ViewTruth, map_files, read_relit, relight_maps
from splitnerf.errors import InputError
from splitnerf.evaluate import scoring, sheet
from splitnerf.evaluate.protocol import ScaledView, evaluate_maps, scaled_scores
from splitnerf.evaluate.score_table import evaluation_table, table_of_lights
from splitnerf.evaluate.scoring import Evaluated, Protocol, RelitViews, choose_views, evaluate_asset, relight_scores
from splitnerf.evaluate.sheet import picture_grid, write_sheet
from splitnerf.export.writers import write_glb
from tiny_runs import refused

SIZE, HEIGHT, WIDTH, TILTED = 16, 12, 16, np.float32([0.6, 0, 0.8])


def view(group, prediction, truth, alpha=1.0, truth_alpha=1.0):
    colours = [np.broadcast_to(np.float32(c), (SIZE, SIZE, 3)) for c in (prediction, truth)]
    alphas = [np.full((SIZE, SIZE), a, np.float32) for a in (alpha, truth_alpha)]
    return ScaledView(group, colours[0], alphas[0], colours[1], alphas[1])


def test_one_scale_for_all_views_of_all_groups():
    views = [view("a", (0.1, 0.2, 0.4), (0.2, 0.2, 0.2)), view("b", (0.3, 0.2, 0.4), (0.3, 0.2, 0.2))]
    scores, groups = scaled_scores(lambda: views)
    # Red: (0.1 0.2 + 0.3 0.3) / (0.1^2 + 0.3^2) = 1.1.
    assert scores["lsq"]["scale"] == pytest.approx([1.1, 1, 0.5], rel=1e-5)
    assert scores["raw"]["scale"] == [1, 1, 1]
    assert scores["psnr"] == scores["lsq"]["psnr"] == pytest.approx((groups["a"]["psnr"] + groups["b"]["psnr"]) / 2)
    assert groups["b"]["psnr"] > groups["a"]["psnr"] > scores["raw"]["psnr"]
    assert scores["lpips"] is None


def test_only_foreground_of_both_counts_for_the_scale_and_values_are_clipped():
    seen = view("a", (0.25, 0.25, 0.25), (0.5, 0.5, 0.5))
    views = [seen, view("a", (0.9, 0.9, 0.9), (0.1, 0.1, 0.1), truth_alpha=0.9), view("a", 0.9, 0.1, alpha=0.9)]
    assert scaled_scores(lambda: views)[0]["lsq"]["scale"] == pytest.approx([2, 2, 2])
    bright = [view("a", 0.8, 1.0), view("a", 0.8, 2.2)]
    # The fit is 2, the scaled prediction 1.6, clipped to white as the truth is: no error is left.
    assert scaled_scores(lambda: bright)[0]["psnr"] == 100


def toy(root: Path, lenses: np.ndarray, size: tuple[int, int], lights: dict[str, float], step: float, alpha: float):
    """Grey test views and their relit images, brighter by a step from view to view; an alpha of 0: as large as their colours."""
    images = np.full((len(lenses), *size, 4), [0.5, 0.5, 0.5, alpha or 0.5], np.float32)
    paths = [root / f"test/r_{i}.png" for i in range(len(lenses))]
    for i, path in enumerate(paths):
        write_image(path, images[i])
        for name, level in lights.items():
            rgba = np.full((*size, 4), [level + step * i] * 3 + [alpha or level + step * i])
            write_image(path.with_name(f"r_{i}_relit_{name}.png"), rgba)
    eyes = np.tile(np.eye(4, dtype=np.float32), (len(lenses), 1, 1))
    return Dataset("toy", root, "test", 1, images, eyes, lenses, [p.stem for p in paths], paths, np.eye(4))


@pytest.fixture
def views(tmp_path):
    """Five test views, with relit images of two maps and three map files."""
    for name in ("relight_city.hdr", "relight_my_sun.exr", "relight_night.hdr", "light.hdr"):
        write_image(tmp_path / name, np.ones((4, 8, 3)))
    return toy(tmp_path, np.ones((5, 4), np.float32), (SIZE, SIZE), {"city": 0.2, "my_sun": 0.6}, 0.05, 1.0)


def test_what_is_scored_finds_the_scale_that_was_planted(views):
    """Of relit views and of the albedo, a factor of its own for each channel, and nearly no error behind it."""
    factors = np.float32([0.7, 1.6, 1.0])
    relit = {name: [read_relit(views, i, name) for i in range(5)] for name in ("city", "my_sun")}
    scored = lambda: relight_scores(RelitViews({k: [*map(to_uint8, images)] for k, images in relit.items()}, views, 8))
    assert scored()["psnr"] == scored()["raw"]["psnr"] == 100
    for image in (image for images in relit.values() for image in images):
        image[..., :3] = linear_to_srgb(srgb_to_linear(image[..., :3]) / factors)
    albedo = np.float32(np.random.default_rng(0).uniform(0.1, 0.5, (SIZE, SIZE, 3)))
    prediction = {"alpha": np.ones((SIZE, SIZE)), "albedo": albedo / factors}
    of_albedo = evaluate_maps([prediction], views.select([0]), [ViewTruth(albedo=albedo)])["albedo"]
    for scores in (scored(), of_albedo):
        assert scores["lsq"]["scale"] == pytest.approx(factors, rel=0.01) and scores["raw"]["scale"] == [1, 1, 1]
        assert scores["psnr"] > 45 and scores["raw"]["psnr"] < 25


def test_maps_of_the_data_are_those_with_truth(views):
    assert relight_maps(views) == {"city": views.root / "relight_city.hdr", "my_sun": views.root / "relight_my_sun.exr"}
    assert read_relit(views, 3, "city")[0, 0] == pytest.approx([0.35, 0.35, 0.35, 1], abs=0.002)
    small = replace(views, downscale=2, images=views.images[:, ::2, ::2], sizes=None)
    assert read_relit(small, 3, "city").shape == (8, 8, 4)
    with pytest.raises(InputError, match="r_2_relit_night.png: no such image, the truth of r_2 under night"):
        read_relit(views, 2, "night")
    write_image(views.image_paths[1].with_name("r_1_relit_city.png"), np.ones((4, 4, 4)))
    with pytest.raises(InputError, match="r_1_relit_city.png: is 4x4"):
        read_relit(views, 1, "city")


def test_maps_of_a_folder(views, tmp_path):
    folder = tmp_path / "maps"
    for name in ("my_sun.hdr", "my_sun.exr", "other.hdr"):
        write_image(folder / name, np.ones((4, 8, 3)))
    assert map_files(folder) == {"my_sun": folder / "my_sun.exr", "other": folder / "other.hdr"}
    assert relight_maps(views, folder) == {"my_sun": folder / "my_sun.exr"}
    (folder / "my_sun.hdr").unlink(), (folder / "my_sun.exr").unlink()
    with pytest.raises(InputError, match="maps: no map has truth images such as r_0_relit_other.png"):
        relight_maps(views, folder)
    with pytest.raises(InputError, match="nowhere: no such folder"):
        relight_maps(views, tmp_path / "nowhere")


def test_published_protocols_demand_their_numbers(views, tmp_path):
    with pytest.raises(InputError, match="holds 3 maps, --lights low needs 8"):
        choose_views(views, Protocol(lights="low", views=2))
    folder = tmp_path / "seven"
    for i in range(7):
        write_image(folder / f"m{i}.hdr", np.ones((4, 8, 3)))
    with pytest.raises(InputError, match="has 5 test views, --lights high needs 20"):
        choose_views(views, Protocol(lights="high", maps=folder))
    many = views.select(list(range(5)) * 8)
    chosen, maps = choose_views(many, Protocol(lights="high", maps=folder))
    assert len(chosen) == 20 and list(maps) == [f"m{i}" for i in range(7)]


def test_views_are_evenly_spread(views):
    assert choose_views(views, Protocol(views=3))[0].frame_names == ["r_0", "r_2", "r_4"]
    assert len(choose_views(views, Protocol())[0]) == 5
    for count in (0, 6):
        with pytest.raises(InputError, match=f"has 5 test views, {count} were requested"):
            choose_views(views, Protocol(views=count))
    with pytest.raises(InputError, match="--spp must be at least 1"):
        choose_views(views, Protocol(spp=0))


FULL = {"novel_view": {"psnr": 30.0, "ssim": 0.9, "lpips": 0.05}, "albedo": None}
FULL |= {"relight": {"psnr": 27.126, "ssim": 0.9412, "lpips": None}, "normal_mae_deg": 4.0, "roughness_mae": 0.1234}
FULL |= dict(metallic_balanced_accuracy=0.875, light_psnr=20.0, chamfer=0.01, f_score=0.97, seconds=90.0)


def test_table():
    other = {"novel_view": {"psnr": 34.0, "ssim": 0.92, "lpips": None}, "relight": None, "normal_mae_deg": 6.0}
    lines = evaluation_table([("chair", FULL), ("lego", other)]).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert [row[0] for row in cells] == ["scene", "---", "chair", "lego", "**mean**"]
    assert len({len(row) for row in cells}) == 1
    assert cells[2] == "chair 27.13 0.9412 - - - - 30.00 0.9000 0.0500 4.00 0.123 0.875 20.00 0.0100 0.970 1.5".split()
    lego, mean = (dict(zip(cells[0], row)) for row in cells[3:])
    assert (lego["relight, dB"], mean["novel view, dB"], mean["normals, degrees"]) == ("-", "32.00", "5.00")
    assert (mean["relight, dB"], mean["novel view, LPIPS"], mean["albedo, dB"]) == ("27.13 (1)", "0.0500 (1)", "-")
    assert "mean" not in evaluation_table([("chair", FULL)])


def test_published_scores_stand_below_ours():
    table = table_of_lights(FULL | {"albedo": {"psnr": 26.0, "ssim": None}}, "chair")
    head, ours, *published, source = table.splitlines()
    assert "relight, dB" in head
    assert ours.split() == ["chair,", "this", "scene", "27.13", "0.941", "-", "26.00", "-", "-"]
    assert published[0].split()[-6:] == ["27.81", "0.944", "0.058", "-", "-", "-"]
    assert published[1].split() == ["SplitNeRF", "27.31", "0.941", "0.061", "25.29", "0.924", "0.108"]
    assert "the SplitNeRF paper" in source and len(published) == 2


def test_tables_are_made_from_scores_written_before(tmp_path, capsys):
    for name in ("chair", "lego"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "evaluation.json").write_text(json.dumps(FULL))
    for name in ("old", "new"):
        (tmp_path / f"{name}_evaluation.json").write_text(json.dumps(FULL))
    targets = [str(tmp_path / name) for name in ("chair", "lego", "old.GLB", "new.gltf")]
    assert main(["evaluate", *targets, "--table", str(tmp_path / "out.md")]) == DONE
    assert (tmp_path / "out.md").read_text().count("| 27.13 |") == 5
    assert "relit views            PSNR 27.13 dB" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["RUN"], "evaluation.json: no such evaluation; make it with"),
        (["RUN", "--views", "3"], "--views needs --data"),
        (["RUN", "--lights", "low"], "--lights needs --data"),
        (["RUN", "RUN", "--data", "d", "--data", "d", "--data", "d"], "--data was given 3 times for 2 runs"),
        (["RUN", "RUN", "--data", "d", "--out", "x.json"], "--out takes one run, got 2"),
        (["RUN", "--data", "d", "--sheet", "x.pdf"], "must end in .png or .jpg"),
        (["RUN", "--data", "d", "--env", "m.hdr"], "a run has its own light; leave --env out"),
        (["RUN/gone.glb", "--data", "d"], "gone.glb: no such file"),
    ],
)
def test_usage_that_makes_no_sense(tmp_path, capsys, arguments, message):
    (tmp_path / "run").mkdir()
    assert message in refused(capsys, "evaluate", *(a.replace("RUN", str(tmp_path / "run")) for a in arguments))
    assert not list(tmp_path.glob("run/*"))


def test_a_run_knows_where_its_data_are(done, tmp_path):
    out = tmp_path / "scores.json"
    assert main(["evaluate", str(done), "--views", "1", "--spp", "1", "--out", str(out)]) == DONE
    assert json.loads(out.read_text())["novel_view"]["psnr"] > 5


def test_a_published_protocol_says_that_it_lacks_lpips(data, monkeypatch, capsys):
    """Where relit views were scored, above the paper's own scores."""
    monkeypatch.setattr("splitnerf.cli.evaluate.evaluate_target", lambda *_: FULL)
    for lights, n_methods in (("low", 2), ("high", 0)):
        assert main(["evaluate", "a.glb", "--data", str(data), "--lights", lights]) == DONE
        printed = capsys.readouterr().out
        assert printed.count("note: LPIPS was not computed; give --lpips vgg16-397923af.pth, from https://") == 1
        assert printed.count("\nSplitNeRF") == n_methods


# ---- assets ----


class Answers:
    """A renderer that notes what it is asked and answers with constants, brighter under brighter light."""

    def __init__(self):
        self.asked = []

    def render(self, environment, pose, lens, width, height, *, spp, seed):
        self.asked.append((environment, pose, lens, width, height, spp, seed))

        def constant(*values):
            return np.broadcast_to(np.float32(values), (height, width, len(values)))

        level = 0.1 * environment.mean() + 0.05 * (len(self.asked) - 1)
        return {
            "radiance": constant(0.5 * level, 0.25 * level, 2.0),
            "alpha": constant(0.5)[..., 0],
            "albedo": constant(0.1, 0.2, 0.3),
            "roughness": constant(0.4)[..., 0],
            "metallic": constant(0.7)[..., 0],
            "normal": constant(0, 0, 1),
            "smooth_normal": 0.5 * constant(*TILTED),
        }


@pytest.fixture
def asset_views(tmp_path) -> Dataset:
    """Three test views of their own poses and lenses, in a frame half as large as the world, each under two lights."""
    for name, level in (("day", 4.0), ("night", 1.0)):
        write_image(tmp_path / f"relight_{name}.exr", np.full((4, 8, 3), level))
    lenses = np.float32([[10, 11, 8, 6], [12, 13, 7, 5], [14, 15, 9, 4]])
    data = toy(tmp_path, lenses, (HEIGHT, WIDTH), {"day": 0.3, "night": 0.1}, 0.2, 0.0)
    data.poses[:, :3, 3] = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    return replace(data, box_from_world=np.diag([0.5, 0.5, 0.5, 1.0]))


def test_an_assets_maps_are_those_of_each_view(asset_views):
    """Seen in the world, by each view's lens, under its turn of the light, with noise of its own; normals are the mesh's."""
    renderer, sky = Answers(), np.float32([5, 5, 11, 11] * 2).reshape(2, 4, 1).repeat(3, axis=2)
    turns = np.stack([np.diag([c, c, 1]).astype(np.float32) for c in (1, -1, 1)])
    predictions = scoring.asset_predictions(renderer, replace(asset_views, light_turns=turns), sky, spp=5)
    for i, (light, pose, lens, width, height, spp, seed) in enumerate(renderer.asked):
        np.testing.assert_allclose(pose[:3, 3], 2 * asset_views.poses[i, :3, 3])
        assert lens == tuple(asset_views.intrinsics[i]) and (width, height, spp) == (WIDTH, HEIGHT, 5)
        np.testing.assert_array_equal(light > 8, (sky[:, ::-1] if i == 1 else sky) > 8)
    seeds = {asked[-1] for asked in renderer.asked}
    assert len(seeds) == len(predictions) == 3 and min(seeds) >= 2**31
    prediction = predictions[0]
    assert prediction["rgb"][3, 4] == pytest.approx(linear_to_srgb(np.float32([0.8, 0.4, 1])))
    known = {"alpha": 0.5, "albedo": [0.1, 0.2, 0.3], "roughness": 0.4, "metallic": 0.7}
    known |= {"normal": TILTED, "shading_normal": [0, 0, 1]}
    assert all(prediction[name][3, 4] == pytest.approx(value) for name, value in known.items())
    assert "rgb" not in scoring.asset_predictions(Answers(), asset_views, None, spp=1)[0]


def test_relit_views_stand_beside_their_truth(asset_views):
    """By map and view, under that map's light, in 8 bit with the coverage; both in linear light once they are compared."""
    relit = scoring.relight(Answers(), asset_views, relight_maps(asset_views), spp=3)
    expected = {"day": [0.4, 0.45, 0.5], "night": [0.25, 0.3, 0.35]}
    for name, levels in expected.items():
        for i, level in enumerate(levels):
            found = relit.view(name, i)
            assert found.group == name and found.prediction[0, 0] == pytest.approx([level, level / 2, 1], abs=0.005)
            assert found.alpha[0, 0] == pytest.approx(0.5, abs=0.002)
            true = {"day": 0.3, "night": 0.1}[name] + 0.2 * i
            assert found.truth[0, 0] == pytest.approx(srgb_to_linear(np.float32([true] * 3)), abs=0.003)
            assert found.truth_alpha[0, 0] == pytest.approx(true, abs=0.002)
    asked = []
    scores = relight_scores(relit, lambda image, truth: asked.append(1) or 0.5)
    assert (scores["spp"], scores["views"], scores["lpips"], len(asked)) == (3, 3, 0.5, 6)
    assert list(scores["maps"]) == list(expected)


def test_truth_that_is_missing_is_named_before_anything_is_rendered(asset_views):
    asset_views.image_paths[2].with_name("r_2_relit_night.png").unlink()
    renderer = Answers()
    with pytest.raises(Exception, match="r_2_relit_night.png: no such image"):
        scoring.relight(renderer, asset_views, relight_maps(asset_views), spp=3)
    assert not renderer.asked


def test_an_asset_is_scored_by_the_test_views_with_the_light_beside_it(data_with_mesh, tmp_path):
    """The demo's true ball: where it is, and by what light; the train views are others."""
    data = data_with_mesh
    mesh = trimesh.load(data / "mesh.ply", process=False)
    assert len(mesh.vertices) > 100
    path = tmp_path / "ball.glb"
    write_glb(path, bare(mesh, Material("grey", (0.5, 0.5, 0.5), 0.5)))
    plain = evaluate_asset(path, data, Protocol(spp=1, views=1))
    assert plain.dataset.split == "test" and len(plain.predictions) == 1
    assert plain.scores["novel_view"] is plain.scores["light_psnr"] is None
    assert plain.scores["chamfer"] < 0.02 and plain.scores["f_score"] > 0.9
    light = read_image(data / "light.hdr")
    write_image(tmp_path / "environment.exr", light)
    write_image(tmp_path / "environment.hdr", np.ones_like(light))
    beside = evaluate_asset(path, data, Protocol(spp=2, downscale=2))
    assert beside.scores["light_psnr"] > 50 and beside.scores["novel_view"] and beside.scores["views"] == 2
    assert beside.dataset.images.shape[1:3] == (12, 12) and (beside.dataset.exposures == 1).all()
    assert evaluate_asset(path, data, Protocol(spp=1, views=1), tmp_path / "environment.hdr").scores["light_psnr"] < 40


def test_a_photos_exposure_is_the_median_ratio_of_what_counts(views):
    """Of means over the channels, where both have the object and the camera, at its exposure of 2, saw nothing dark or clipped."""
    seen = np.full((5, SIZE, SIZE, 3), 0.5, np.float32)
    seen[:, :3], seen[:, 3:6], seen[:, 6], seen[:, 7] = 0.009, 0.96, 0.012, 0.94
    ratio = np.full((SIZE, SIZE, 1), 7.0)
    ratio[6:8], ratio[6, :4] = 1.5, 1000.0  # two of the three rows that count
    photo, alpha = np.ones((5, SIZE, SIZE, 4), np.float32), np.ones((SIZE, SIZE), np.float32)
    photo[..., :3], photo[:, 9:12, :, 3], alpha[12:] = linear_to_srgb(seen), 0.9, 0.9
    found = {"rgb": linear_to_srgb(seen[0] / 2 / ratio * np.float32([0.5, 0.5, 2.0])), "alpha": alpha}
    data = replace(views, images=photo).exposed(np.full(5, 2.0))
    exposures = scoring.exposed_like(data, [found] * 4 + [found | {"alpha": 0 * alpha}]).exposures
    assert exposures[:, 1] == pytest.approx([3.0, 3.0, 3.0, 3.0, 2.0], rel=1e-3)


# ---- the sheet of pictures ----


def test_the_sheet_shows_each_quantity_as_it_is_scored(asset_views, tmp_path, monkeypatch):
    """On white by its own coverage, scaled by the headline's factor; normals where the truth is known."""
    shown = []
    monkeypatch.setattr(sheet, "picture_grid", lambda *asked: shown.append(asked) or picture_grid(*asked))
    data = asset_views.select([0, 1, 2, 0, 1])
    grey = np.full((HEIGHT, WIDTH), 0.25, np.float32)
    colour = np.repeat(grey[..., None], 3, axis=-1)
    normal = np.broadcast_to(TILTED, (HEIGHT, WIDTH, 3))
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[0] = True
    truths = [ViewTruth(colour, grey, 2 * grey, normal, mask)] * 5
    alpha = np.full((HEIGHT, WIDTH), 0.8, np.float32)
    prediction = {"rgb": 3 * colour, "alpha": alpha, "albedo": 2 * colour}
    prediction |= {"roughness": 3 * grey, "metallic": grey, "normal": -normal}
    images = [np.full((HEIGHT, WIDTH, 4), 51 * i, np.uint8) for i in range(5)]
    evaluation = {"relight": {"lsq": {"scale": [2.0] * 3}}, "albedo": {"lsq": {"scale": [0.5, 1.0, 2.0]}}}
    relit = RelitViews({"day": images}, data, 1)
    write_sheet(tmp_path / "s.png", Evaluated(evaluation, data, [prediction] * 5, truths, relit))
    heads, rows = shown[0][0], dict(shown[0][1])
    assert list(rows) == ["novel view", "relit by\nday", "albedo", "roughness", "metallic", "normal"]
    assert [head.split(":")[0] for head in heads] == ["r_0"] * 3 + ["r_2"] * 3 + ["r_1"] * 3

    def on_white(linear, coverage):
        return over_background(np.clip(linear_to_srgb(np.float32(linear)), 0, 1), np.float32(coverage))

    relit = [
        (
            on_white([srgb_to_linear(np.float32(0.3 + 0.2 * (i % 3)))] * 3, 0.3 + 0.2 * (i % 3)),
            on_white([2 * srgb_to_linear(np.float32(0.2 * i))] * 3, 0.2 * i),
        )
        for i in (0, 2, 4)
    ]
    expected = {
        "novel view": [(np.full(3, 0.75), np.full(3, 0.8)) for _ in range(3)],
        "relit by\nday": relit,
        "albedo": [(on_white([0.25] * 3, 0.5), on_white([0.25, 0.5, 1.0], 0.8))] * 3,
        "roughness": [(np.full(3, 0.625), np.full(3, 0.8))] * 3,
        "metallic": [(np.full(3, 0.75), np.full(3, 0.4))] * 3,
        "normal": [(0.5 + 0.5 * TILTED, 0.5 - 0.5 * TILTED)] * 3,
    }
    for name, pairs in expected.items():
        for i, (truth, found) in enumerate(pairs):
            panels = [panel[0, 0] for panel in rows[name][3 * i : 3 * i + 3]]
            for panel, value in zip(panels, (truth, found, np.clip(4 * np.abs(found - truth), 0, 1)), strict=True):
                assert panel == pytest.approx(value, abs=0.03 if name.startswith("relit") else 1e-4), (name, i)
    assert rows["normal"][0][1, 1] == pytest.approx([1, 1, 1])


def test_small_pictures_are_enlarged_and_stand_in_their_rows():
    pictures = [np.full((10, 50, 3), level, np.float32) for level in (0.2, 0.4, 0.6, 0.8)]
    found = picture_grid(["a", "b"], [("one", pictures[:2]), ("two", pictures[2:])])
    assert found.shape == (sheet.LABEL_HEIGHT + 80, sheet.LABEL_WIDTH + 400, 3)
    for k, (row, column) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        at = found[sheet.LABEL_HEIGHT + 40 * row + 39, sheet.LABEL_WIDTH + 200 * column + 150]
        assert at == pytest.approx([0.2 + 0.2 * k] * 3, abs=0.003)
