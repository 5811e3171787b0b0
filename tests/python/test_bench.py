"""The benchmarks' own arithmetic: fronts, files, lights, and that a wrong subject is refused before it is timed."""

import csv
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from bench import operators, results, split_sum, tables
from splitnerf.config import parse_setting, preset
from splitnerf_tools.bench import harness, provenance
from splitnerf_tools.bench.charts import Chart, Point, Result, csv_rows, markdown, write_csv
from splitnerf_tools.bench.harness import CheckFailed, interleaved
from splitnerf_tools.bench.prefilter import Truth, filtered_importance, harmonics, lobe_integral
from splitnerf_tools.bench.subjects import LEFT_OUT, MapLight, leave_out, pyramid_of
from torch.nn import functional as F


def point(name: str, cost: float, error: float, default: bool = False) -> Point:
    return Point(name, "", cost, error, cost, cost, default)


CHART = Chart("work", "ms", "error", [point("a", 1, 3), point("b", 2, 1), point("c", 3, 2), point("d", 4, 0.5, True)])


def test_the_front_holds_what_nothing_beats():
    assert [p.series for p in CHART.front()] == ["a", "b", "d"]


def test_files_mark_the_front_and_the_default(tmp_path):
    result = Result("work", "Work", ("cpp",), ["b is twice as fast"], [CHART], [("More", ["x"], [[1]])])
    facts = provenance.provenance(result.sources)
    text = markdown(result, facts)
    assert "- b is twice as fast" in text and "[work.csv](work.csv)" in text and "## More" in text
    write_csv(tmp_path / "work.csv", facts, csv_rows(result.charts))
    lines = (tmp_path / "work.csv").read_text().splitlines()
    heads = [line for line in lines if line.startswith("#")]
    for fact in ("processor", "commit", "date", "command", "measures"):
        assert any(line.startswith(f"# {fact}: ") for line in heads) and f"; {fact} " in f"; {text}".replace("\n", "; ")
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert [row["on_front"] for row in rows] == ["1", "1", "0", "1"] and rows[3]["default"] == "1"


def test_a_table_is_stale_once_what_it_measures_has_changed(tmp_path, monkeypatch):
    (tmp_path / "cpp").mkdir()
    pages = tmp_path / "docs/benchmarks"
    pages.mkdir(parents=True)
    monkeypatch.setattr(tables, "MOST_BEHIND", 1)

    def change(path: str, text: str) -> None:
        (tmp_path / path).write_text(text)
        who = ["git", "-c", "user.name=a", "-c", "user.email=a@example.org"]
        for words in (["add", "-A"], ["commit", "--quiet", "-m", path]):
            subprocess.run([*who, *words], cwd=tmp_path, check=True, capture_output=True)

    def said(text: str | None = None) -> tuple[str, int]:
        """Of a page with this text, or measured now; and the program's exit code."""
        head = text or provenance.header(provenance.provenance(("cpp/*hash*", "python"), root=tmp_path))
        (pages / "grid.md").write_text(f"# Grid\n\n{head}\n")
        return tables.states(tmp_path)[Path("docs/benchmarks/grid.md")][0], tables.main(tmp_path)

    subprocess.run(["git", "init", "--quiet"], cwd=tmp_path, check=True)
    change("cpp/hash_grid.h", "1")
    assert said() == ("fresh", 0)
    measured = (pages / "grid.md").read_text()
    change("cpp/other.h", "1")
    assert said(measured) == ("fresh", 0)
    for n in (1, 2):
        change("cpp/hash_grid.h", f"changed {n}")
        text, code = said(measured)
        assert f"stale: {n} commits since" in text and code == n - 1
    (tmp_path / "cpp/hash_grid.h").write_text("3")
    assert "stale: made beside changes" in said()[0] and said()[1] == 1
    assert said("commit 1234567.") == ("unknown: no head with commit and sources", 1)
    assert said("commit 1234567; measures `cpp`.") == ("unknown: no commit 1234567 here", 0)


def test_commands_hold_no_path_of_the_machine(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/x/bin/splitnerf", "ablate", "/data/chair", "--rows", "a; b"])
    assert provenance.command_line() == "splitnerf ablate chair --rows 'a; b'"
    monkeypatch.setattr("sys.argv", [".venv/bin/splitnerf", "bench"])
    assert provenance.command_line() == "splitnerf bench"
    monkeypatch.setattr("sys.argv", ["tests/bench/limits.py", "--out"])
    assert provenance.command_line() == "python tests/bench/limits.py --out"


def test_a_page_says_which_library_was_missing(tmp_path, monkeypatch):
    result = Result("work", "Work", ("cpp",), ["b is twice as fast"])
    work = SimpleNamespace(run=lambda *_: (leave_out("c is left out"), result)[1])
    monkeypatch.setattr(harness.importlib, "import_module", lambda _: work)
    for _ in range(2):  # its own page is replaced
        harness.run_benchmarks(["work"], True, tmp_path, print)
    assert "- b is twice as fast\n- c is left out\n" in (tmp_path / "work.md").read_text() and not LEFT_OUT


def test_errors_are_refused_before_they_are_timed():
    harness.check("work", {("a", "b"): 0.5, "c": 0.9}, 1.0)
    for wrong in (1.0, math.nan):
        with pytest.raises(CheckFailed, match="work: a b is wrong by"):
            harness.check("work", {("a", "b"): wrong}, 1.0)


def test_calls_are_timed_in_turns_and_compared_round_by_round():
    order: list[str] = []
    times = interleaved({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, rounds=3)
    assert len(times.seconds["a"]) == len(times.seconds["b"]) == 3
    last_a, last_b = len(order) - 1 - order[::-1].index("a"), len(order) - 1 - order[::-1].index("b")
    assert last_a < last_b and "b" in order[:last_a]
    times.seconds = {"a": [2.0, 4.0, 9.0], "b": [1.0, 2.0, 3.0]}
    assert times.ratio("a", "b") == (2.0, 2.0, 2.5) and times["a"].median == 4.0


class TestLights:
    def test_a_map_is_read_where_it_was_written(self):
        """Texel (row, column) of an equirectangular map lies in the direction that synthesis gives it."""
        sky = np.random.default_rng(0).random((64, 128, 3), np.float32)
        light = MapLight(sky)
        polar, azimuth = 20.5 / 64 * math.pi, math.pi - 40.5 / 64 * math.pi
        w = [math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar)]
        np.testing.assert_allclose(light(torch.tensor([w], dtype=torch.float32))[0].numpy(), sky[20, 40], rtol=1e-3)

    def test_a_constant_light_is_itself_in_every_form(self):
        light = MapLight(np.full((32, 64, 3), 2.0, np.float32))
        axes = F.normalize(torch.randn(30, 3), dim=1)
        for rho in (0.05, 0.3, 1.0):
            roughness = torch.full((30, 1), rho)
            ways = [filtered_importance(light, 8)] + [harmonics(light)] * (rho >= 0.1)
            for estimate in (Truth(light, 64, 64)(axes, rho), *(way(axes, roughness) for way in ways)):
                torch.testing.assert_close(estimate, torch.full((30, 3), 2.0), rtol=1e-3, atol=0)
        assert torch.allclose(pyramid_of(light, 16)(axes, roughness), torch.full((30, 3), 2.0), rtol=1e-3)

    def test_the_lobes_integral(self):
        c = (torch.arange(200000, dtype=torch.float64) + 0.5) / 200000
        for rho in (0.2, 0.5, 0.9, 1.0):
            a2 = rho**4
            d = a2 / (math.pi * (a2 + (1 - a2) * (1 - c) / 2) ** 2)
            expected = float((d * c).mean() * 2 * math.pi)
            assert lobe_integral(torch.tensor([[rho]])).item() == pytest.approx(expected, rel=1e-3)


def test_a_page_with_its_picture_and_points_is_written(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(sys, "argv", ["operators.py", "shading", "--quick", "--out", str(tmp_path)])
    operators.main()
    assert {path.name for path in tmp_path.iterdir()} == {"shading.md", "shading.csv", "shading.png"}
    assert "as fast as torch eager" in capsys.readouterr().out


def test_lamps_and_the_rest_are_the_light():
    sky = np.random.default_rng(0).random((32, 64, 3), np.float32)
    sky[9, 20:22] = 500.0
    light, w = split_sum.SplitLight(sky), F.normalize(torch.randn(500, 3), dim=1)
    torch.testing.assert_close(light.lamps(w) + light.rest(w), light.whole(w), rtol=1e-4, atol=1e-4)
    sun = torch.tensor(sky[9, 20:22] - light.rest.levels[0][9, 20:22].numpy()).sum(0)
    texel = 2 * math.pi**2 / (32 * 64) * math.sin(9.5 / 32 * math.pi)
    found = (light.lamps(light.directions) * light.solid_angles[:, None]).sum(0)
    torch.testing.assert_close(found, sun * texel, rtol=0.02, atol=0)


# ---- the program of the result pages ----

SCORES = {column: "1.0" for column in results.SCORES}


def row(scene, minutes, asset, relit, **other):
    values = {"scene": scene, "minutes": minutes, "asset": asset, "date": "2026-01-02 10:00"} | SCORES
    values |= dict(zip(("settings", "seed", "images", "threads", "kernels", "commit"), "cpu 0 9 1 avx2 abc".split()))
    return values | {"seconds": "3"} | {"relit, dB": relit} | other


def test_means_are_over_what_is_delivered():
    rows = [row("knot", "8", "trained", "20.0"), row("knot", "8", "refined", "30.0")]
    rows += [row("rings", "8", "refined", "31.0"), row("rings", "30", "refined", "", **{"albedo, dB": "40.0"})]
    eight, thirty, _ = results.means(rows)
    assert eight.startswith("Mean of 2 runs of 8 minutes: relit 30.5 dB, albedo 1.0 dB")
    assert thirty.startswith("Mean of 1 runs of 30 minutes: albedo 40.0 dB")


def test_scores_are_taken_by_their_keys():
    evaluation = {"relight": {"psnr": 31.26, "raw": {"psnr": 30.04}}, "normal_mae_deg": None, "seconds": 12.6}
    found = results.scored(evaluation | {"training": {"step": 90}})
    assert [found[k] for k in ("relit, dB", "unscaled relit, dB", "seconds", "steps")] == ["31.3", "30.0", "13", "90"]
    assert found["normals, degrees"] == found["albedo, dB"] == ""


def test_a_table_of_means_has_a_place_for_each_line_and_column():
    rows = [row("knot", "8", "refined", relit, seed=seed) for seed, relit in (("0", "30.0"), ("1", "31.0"))]
    lines = results.table_of_means([*rows, row("rings", "0", "trained", "20.0")], results.PAGES["time"])[2:]
    assert lines[0] == "| minutes | knot, refined | rings, trained |"
    assert lines[2:] == ["| 8 | 30.5 / 1.0 | - / - |", "| 0 steps | - / - | 20.0 / 1.0 |"]


def test_the_program_makes_each_page_and_its_settings_are_known():
    pages = {page.stem for page in (results.ROOT / "docs/benchmarks").glob("*.md")} - {"README", "detail"}
    assert pages == set(results.NAMES)
    for page in results.PAGES.values():
        for name, _ in page.runs:
            words = [str(word) for word in results.SETTINGS[name]]
            base = words[words.index("--preset") + 1] if "--preset" in words else "cpu"
            preset(base).replace(dict(parse_setting(value) for key, value in zip(words, words[1:]) if key == "--set"))


def test_a_late_step_is_timed_without_the_start(tmp_path):
    """100 steps in the 4 seconds after the 400th; a second of the first ones is the start."""
    seconds = [*(1 + 0.02 * k for k in range(1, 401)), *(9 + 0.04 * k for k in range(1, 101))]
    lines = [json.dumps({"step": k, "seconds": at}) for k, at in enumerate(seconds, 1)]
    (tmp_path / "metrics.jsonl").write_text("\n".join(lines) + "\n")
    assert results.late_steps(tmp_path) == {"step": 500, "ms": pytest.approx(40.0)}


def test_a_page_says_its_rows_and_the_commit_of_the_oldest(monkeypatch, tmp_path):
    rows = [
        row("knot", "30", "refined", "32.5", date="2026-01-03 10:00", commit="def"),
        row("rings", "30", "refined", "29.5", kernels="avx512"),
    ]
    results.write_page(tmp_path, "scenes", rows, tmp_path)
    assert results.read_rows(tmp_path / "scenes.csv") == rows
    text = (tmp_path / "scenes.md").read_text()
    head, lines = text.splitlines()[2], [line for line in text.splitlines() if line.startswith("| ")]
    assert "commit abc" in head and "date 2026-01-02" in head and "avx" not in head  # each row names its kernels
    assert "| knot | 30 |" in lines[2] and " 32.5 " in lines[2] and "avx2" in lines[2] and "avx512" in lines[3]
    assert "Mean of 2 runs of 30 minutes: relit 31.0 dB" in text


def test_the_readme_shows_scores_of_the_page():
    rows = results.read_rows(results.ROOT / "docs/benchmarks/scenes.csv")
    measured = {
        (row["scene"], row["relit, dB"], row["albedo, dB"])
        for row in rows
        if (row["minutes"], row["asset"]) == ("8", "refined")
    }
    shown = re.findall(
        r"^\| (\w+)[^|]* \| ([\d.]+) dB \| ([\d.]+) dB \|$", (results.ROOT / "README.md").read_text(), re.M
    )
    assert shown and measured.issuperset(shown)
