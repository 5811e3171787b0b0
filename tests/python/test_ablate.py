"""The ablation: its rows, its runs on a tiny scene, and its tables."""

import csv
import dataclasses

import numpy as np
import pytest
from splitnerf.cli import DONE, main
from splitnerf.config import Config, preset
from splitnerf.errors import InputError
from splitnerf.evaluate.score_table import values_of
from splitnerf_tools.ablate import runs
from splitnerf_tools.ablate.rows import FULL, PAPER, REFERENCES, SWITCHES, Row, make_rows
from splitnerf_tools.ablate.scores import Score, csv_table, differences, markdown_table
from test_train import flat
from tiny_runs import SMALL, as_options, refused


def score(row: str, seed: int, relight: float | None, novel_view: float = 30.0) -> Score:
    maps = {"albedo": {"psnr": 20.0}, "normal_mae_deg": 5.0, "roughness_mae": 0.1, "metallic_balanced_accuracy": None}
    views = {"relight": relight and {"psnr": relight, "ssim": 0.91, "lpips": None}, "novel_view": {"psnr": novel_view}}
    evaluation = maps | views | {"light_psnr": 15.0, "seconds": 360.0}
    return Score("scene", row, seed, values_of(evaluation))


@pytest.mark.parametrize(("name", "n_rows"), [("cpu", 22), ("paper", 7)])
def test_every_row_is_possible(name, n_rows):
    """Most switches of the other preset are what preset paper does anyway."""
    rows = make_rows(preset(name))
    names = {row.name for row in rows}
    assert len(names) == len(rows) == n_rows
    assert all(row.reference in names and row.reference != row.name for row in rows[1:])
    assert REFERENCES.keys() <= (PAPER | SWITCHES).keys()
    weights = {value for row in (PAPER | SWITCHES).values() for key, value in row.items() if key.endswith("_weight")}
    assert weights == {0.0}


@pytest.mark.parametrize("name", PAPER)
def test_each_of_the_papers_ablations_changes_one_thing_of_its_preset(name):
    rows = {row.name: row for row in make_rows(preset("paper"), [name])}
    ablated, reference = (flat(dataclasses.asdict(rows[row].config)) for row in (name, rows[name].reference))
    assert rows[name].reference == FULL
    assert [key for key in ablated if ablated[key] != reference[key]] == [next(reversed(PAPER[name]))]


def test_a_row_brings_what_it_is_compared_with():
    by_mlp = "split sum, occlusion by MLP"
    rows = make_rows(Config(), [f"{by_mlp}, no occlusion loss"])
    references = {row.name: row.reference for row in rows[1:]}
    split = "light by the split sum"
    assert references == {f"{by_mlp}, no occlusion loss": by_mlp, by_mlp: split, split: FULL}
    assert "summed light" not in {row.name for row in make_rows(Config())}
    split = make_rows(Config().replace({"shading.method": "split"}), ["split sum, no occlusion"])
    assert [(row.name, row.reference) for row in split[1:]] == [("split sum, no occlusion", FULL)]


def test_rows_that_change_nothing_are_left_out_and_unknown_ones_named():
    base = Config()
    rows = make_rows(base)
    assert rows[0].name == FULL and rows[0].config == base
    assert all(a.config != b.config for i, a in enumerate(rows) for b in rows[:i])
    assert len({row.slug for row in rows}) == len(rows)
    assert [r.name for r in make_rows(base.replace({"mask_weight": 0.0}), ["no mask loss"])] == [FULL]
    with pytest.raises(InputError, match="'no such row'"):
        make_rows(Config(), ["no such row"])


def test_differences_are_by_seed():
    scores = [score(FULL, 0, 30.0), score(FULL, 1, 31.0), score("b", 0, 30.5), score("b", 1, 31.1), score("c", 0, 30.2)]
    b, c = differences(scores, "scene")
    assert b.mean == pytest.approx(0.3) and b.error == pytest.approx(0.2)
    assert c.mean == pytest.approx(0.2) and c.error is None and c.verdict() == "no difference"
    assert dataclasses.replace(c, mean=-0.4).verdict() == "-0.40 dB" and b.verdict().startswith("no difference (+0.30")
    assert dataclasses.replace(b, error=0.14).verdict() == "+0.30 ± 0.14 dB"
    assert [dataclasses.replace(c, mean=mean).verdict() for mean in (-0.29, 0.3)] == ["no difference", "+0.30 dB"]


def test_close_rows_and_what_they_are_compared_with_get_more_seeds(tmp_path, monkeypatch):
    """Two seeds more where the first differs by less than 0.3 dB."""
    gains = {FULL: 30.0, "far": 29.7, "base": 25.0, "near base": 24.71}
    rows = [Row(name, Config(), "base" if name == "near base" else FULL) for name in gains]
    monkeypatch.setattr(runs, "run_row", lambda plan, scene, row, seed: {"relight": {"psnr": gains[row.name] + seed}})
    shown, plan = [], runs.AblationPlan([tmp_path / "a"], rows, 3, None, tmp_path)
    scores = runs.ablate(plan, lambda so_far: shown.append(len(so_far)))
    again = [(name, seed) for name in ("base", "near base") for seed in (1, 2)]
    assert [(s.row, s.seed) for s in scores] == [*((name, 0) for name in gains), *again] and shown == [*range(1, 9)]
    assert [s.values["relight"] for s in scores[-2:]] == [25.71, 26.71] and scores[-1].reference == "base"


def test_a_row_is_compared_with_its_reference():
    scores = [score(FULL, 0, 30.0), score("b", 0, 28.0), dataclasses.replace(score("c", 0, 29.0), reference="b")]
    b, c = differences(scores, "scene")
    assert b.mean == pytest.approx(-2.0) and c.mean == pytest.approx(1.0)
    assert "| +1.00 dB | b |" in markdown_table(scores)
    (b,) = differences([score(FULL, 0, None, 30.0), score("b", 0, None, 31.0)], "scene")
    assert b.mean == pytest.approx(1.0)  # without relit views, novel views judge


def test_tables_hold_what_is_known():
    scores = [score(FULL, 0, 30.0), score("b", 0, None)]
    rows = list(csv.DictReader(csv_table(scores).splitlines()))
    assert rows[0]["relight"] == "30.0" and rows[1]["relight"] == "" and rows[0]["metallic"] == ""
    assert rows[0]["minutes"] == "6.0" and rows[0]["normals"] == "5.0" and rows[0]["reference"] == FULL
    text = markdown_table([score(FULL, 0, 30.0), score(FULL, 1, 31.0), score("b", 0, 29.0)])
    assert "| full | 30.50 | 0.9100 | 20.00 | 30.00 | 5.00 | 0.100 | 15.00 | 6.0 | 2 |" in text
    assert "| b | 29.00 |" in text and "| -1.00 dB | full |" in text and "LPIPS" not in text and "Mean" not in text


def test_the_mean_over_scenes_is_that_of_rows_and_scores_that_all_have():
    """Two seeds of one scene count as one."""
    here = [score(FULL, 0, 30.0), score(FULL, 1, 31.0), score("b", 0, 29.0), score("c", 0, 28.0)]
    there = [dataclasses.replace(s, scene="other") for s in (score(FULL, 0, 32.0), score("b", 0, None))]
    *_, mean = markdown_table([*here, *there]).split("## ")
    lines = mean.splitlines()
    assert lines[0] == "Mean over the scenes" and len(lines) == 6
    assert lines[4].startswith("| full | 31.25 | 0.9100 | 20.00 | 30.00 |")
    assert lines[5].startswith("| b | - | - | 20.00 | 30.00 |") and lines[5].endswith("| 1 | no difference | full |")


def test_it_runs_and_goes_on(data, tmp_path, capsys):
    command = ["ablate", str(data), "--out", str(tmp_path / "out"), "--steps", "6", "--spp", "1", *as_options(SMALL)]
    command += ["--set", "surface.n_levels=9", "--set", "surface.least_cell=100"]  # a run leaves levels out
    assert main([*command, "--rows", "no mask loss"]) == DONE
    runs = tmp_path / "out" / "tiny"
    assert {p.name for p in runs.iterdir()} == {"full", "no_mask_loss"}
    first = (runs / "full" / "checkpoint.pt").stat().st_mtime_ns
    (runs / "no_mask_loss" / "scores.json").unlink()  # as if it had been interrupted
    assert main([*command, "--rows", "no mask loss; no metal regulariser", "--seeds", "3"]) == DONE
    assert (runs / "full" / "checkpoint.pt").stat().st_mtime_ns == first and (runs / "no_metal_regulariser").is_dir()
    rows = list(csv.DictReader((tmp_path / "out" / "ablation.csv").read_text().splitlines()))
    assert {r["row"] for r in rows} == {FULL, "no mask loss", "no metal regulariser"}
    assert all(np.isfinite(float(r["novel_view"])) for r in rows)
    capsys.readouterr()
    assert "other settings" in refused(capsys, *command, "--set", "mask_weight=0.5")
    # Before it trains.
    assert "none: no such folder" in refused(capsys, command[0], tmp_path / "none", *command[1:])
    assert main(["ablate", "--list"]) == DONE
    assert "no metal regulariser: losses.metal_weight = 0.0" in capsys.readouterr().out
