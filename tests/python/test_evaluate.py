"""Free scales, relighting protocols, tables and sheets by closed forms; what the command refuses."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from splitnerf.cli import BAD_INPUT, DONE, main
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import write_image
from splitnerf.data.truth import map_files, read_relit, relight_maps
from splitnerf.errors import InputError
from splitnerf.evaluate.protocol import ScaledView, scaled_scores
from splitnerf.evaluate.score_table import evaluation_table
from splitnerf.evaluate.scoring import Protocol, RelitViews, choose_views, relight_scores

SIZE = 16


def view(group, prediction, truth, alpha=1.0, truth_alpha=1.0):
    colours = [np.broadcast_to(np.float32(c), (SIZE, SIZE, 3)) for c in (prediction, truth)]
    alphas = [np.full((SIZE, SIZE), a, np.float32) for a in (alpha, truth_alpha)]
    return ScaledView(group, colours[0], alphas[0], colours[1], alphas[1])


def test_one_scale_for_all_views_of_all_groups():
    views = [view("a", (0.1, 0.2, 0.4), (0.2, 0.2, 0.2)), view("b", (0.3, 0.2, 0.4), (0.3, 0.2, 0.2))]
    scores, groups = scaled_scores(lambda: views)
    # Red: (0.1 0.2 + 0.3 0.3) / (0.1^2 + 0.3^2) = 1.1; the ratios are 2 and 1, their median 1.5.
    assert scores["lsq"]["scale"] == pytest.approx([1.1, 1, 0.5], rel=1e-5)
    assert scores["median"]["scale"] == pytest.approx([1.5, 1, 0.5], rel=1e-5)
    assert scores["raw"]["scale"] == [1, 1, 1]
    assert scores["psnr"] == scores["lsq"]["psnr"] == pytest.approx((groups["a"]["psnr"] + groups["b"]["psnr"]) / 2)
    assert groups["b"]["psnr"] > groups["a"]["psnr"] > scores["raw"]["psnr"]
    assert scores["lpips"] is None


def test_only_foreground_of_both_counts_for_the_scale_and_values_are_clipped():
    seen = view("a", (0.25, 0.25, 0.25), (0.5, 0.5, 0.5))
    views = [seen, view("a", (0.9, 0.9, 0.9), (0.1, 0.1, 0.1), truth_alpha=0.5), view("a", 0.9, 0.1, alpha=0.9)]
    assert scaled_scores(lambda: views)[0]["lsq"]["scale"] == pytest.approx([2, 2, 2])
    bright = [view("a", 0.8, 1.0), view("a", 0.8, 2.2)]
    # The fit is 2, the scaled prediction 1.6, clipped to white as the truth is: no error is left.
    assert scaled_scores(lambda: bright)[0]["psnr"] == 100


@pytest.fixture
def views(tmp_path):
    """Five test views, with relit images of two maps and three map files."""
    paths = [tmp_path / f"test/r_{i}.png" for i in range(5)]
    images = np.full((5, SIZE, SIZE, 4), 0.5, np.float32)
    images[..., 3] = 1
    for i, path in enumerate(paths):
        write_image(path, images[i])
        for name, level in (("city", 0.2), ("my_sun", 0.6)):
            rgba = np.full((SIZE, SIZE, 4), level + 0.05 * i)
            rgba[..., 3] = 1
            write_image(path.with_name(f"r_{i}_relit_{name}.png"), rgba)
    for name in ("relight_city.hdr", "relight_my_sun.exr", "relight_night.hdr", "light.hdr"):
        write_image(tmp_path / name, np.ones((4, 8, 3)))
    eye, lens = np.tile(np.eye(4, dtype=np.float32), (5, 1, 1)), np.ones((5, 4), np.float32)
    return Dataset("toy", tmp_path, "test", 1, images, eye, lens, [p.stem for p in paths], paths, np.eye(4))


def test_maps_of_the_data_are_those_with_truth(views):
    assert relight_maps(views) == {"city": views.root / "relight_city.hdr", "my_sun": views.root / "relight_my_sun.exr"}
    assert read_relit(views, 3, "city")[0, 0] == pytest.approx([0.35, 0.35, 0.35, 1], abs=0.002)
    assert read_relit(replace(views, downscale=2, images=views.images[:, ::2, ::2], sizes=None), 3, "city").shape == (
        8,
        8,
        4,
    )
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
    with pytest.raises(InputError, match="r_0_relit_m0.png: no such image"):
        read_relit(chosen, 0, "m0")


def test_views_are_evenly_spread(views):
    assert choose_views(views, Protocol(views=3))[0].frame_names == ["r_0", "r_2", "r_4"]
    assert len(choose_views(views, Protocol())[0]) == 5
    for count in (0, 6):
        with pytest.raises(InputError, match=f"has 5 test views, {count} were requested"):
            choose_views(views, Protocol(views=count))
    with pytest.raises(InputError, match="--spp must be at least 1"):
        choose_views(views, Protocol(spp=0))


def test_relit_images_are_scored_with_one_scale_and_per_map(views):
    levels = {"city": 0.2, "my_sun": 0.6}
    images = {}
    for name, level in levels.items():
        rgba = [np.full((SIZE, SIZE, 4), 255 * (level + 0.05 * i)) for i in range(5)]
        images[name] = [np.rint(image).astype(np.uint8) for image in rgba]
        for image in images[name]:
            image[..., 3] = 255
    relit = relight_scores(RelitViews(images, views, 8))
    assert relit["psnr"] == relit["raw"]["psnr"] == 100 and relit["lsq"]["scale"] == pytest.approx([1, 1, 1])
    assert set(relit["maps"]) == set(levels) and (relit["views"], relit["spp"]) == (5, 8)
    for image in images["city"]:
        image[..., :3] = 51
    relit = relight_scores(RelitViews(images, views, 8))
    assert relit["maps"]["my_sun"]["psnr"] > relit["psnr"] > relit["maps"]["city"]["psnr"]


FULL = {
    "novel_view": {"psnr": 30.0, "ssim": 0.9, "lpips": 0.05},
    "albedo": None,
    "relight": {"psnr": 27.126, "ssim": 0.9412, "lpips": None},
    "normal_mae_deg": 4.0,
    "roughness_mae": 0.1,
    "metallic_balanced_accuracy": None,
    "light_psnr": 20.0,
    "chamfer": 0.01,
    "f_score": 0.97,
    "seconds": 90.0,
}


def test_table():
    other = {"novel_view": {"psnr": 34.0, "ssim": 0.92, "lpips": None}, "relight": None, "normal_mae_deg": 6.0}
    lines = evaluation_table([("chair", FULL), ("lego", other)]).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert [row[0] for row in cells] == ["scene", "---", "chair", "lego", "**mean**"]
    assert len({len(row) for row in cells}) == 1
    chair, lego, mean = (dict(zip(cells[0], row)) for row in cells[2:])
    assert (chair["relight PSNR"], chair["relight SSIM"], chair["relight LPIPS"]) == ("27.13", "0.941", "-")
    assert (chair["albedo PSNR"], lego["relight PSNR"], chair["time, min"]) == ("-", "-", "1.5")
    assert (mean["novel view PSNR"], mean["normals, degrees"]) == ("32.00", "5.00")
    assert (mean["relight PSNR"], mean["novel view LPIPS"], mean["albedo PSNR"]) == ("27.13 (1)", "0.050 (1)", "-")
    assert "mean" not in evaluation_table([("chair", FULL)])


def test_tables_are_made_from_scores_written_before(tmp_path, capsys):
    for name in ("chair", "lego"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "evaluation.json").write_text(json.dumps(FULL))
    (tmp_path / "old_evaluation.json").write_text(json.dumps(FULL))
    targets = [str(tmp_path / name) for name in ("chair", "lego", "old.glb")]
    assert main(["evaluate", *targets, "--table", str(tmp_path / "out.md")]) == DONE
    assert (tmp_path / "out.md").read_text().count("| 27.13 |") == 4
    assert "relit views            PSNR 27.13 dB" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["RUN"], "evaluation.json: no such evaluation; make it with"),
        (["RUN", "--views", "3"], "--views needs --data"),
        (["RUN", "--lights", "low"], "--lights needs --data"),
        (["RUN", "RUN", "--data", "d", "--data", "d", "--data", "d"], "--data was given 3 times for 2 runs"),
        (["RUN", "RUN", "--data", "d", "--out", "x.json"], "--out takes one run, got 2"),
        (["RUN", "--data", "d", "--env", "m.hdr"], "a run has its own light; leave --env out"),
        (["RUN/gone.glb", "--data", "d"], "gone.glb: no such file"),
    ],
)
def test_usage_that_makes_no_sense(tmp_path, capsys, arguments, message):
    (tmp_path / "run").mkdir()
    assert main(["evaluate"] + [a.replace("RUN", str(tmp_path / "run")) for a in arguments]) == BAD_INPUT
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not list(tmp_path.glob("run/*"))
