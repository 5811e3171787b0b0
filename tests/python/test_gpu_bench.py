"""The scripts that measure on a GPU, rehearsed on the CPU with small sizes."""

from __future__ import annotations

import csv
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from bench import gpu_limits, gpu_ops, gpu_smoke, gpu_table
from op_cases import CASES

BENCH = Path(__file__).parents[1] / "bench"
SMALL = dict(target_samples=256, max_rays=64, grid_resolution=16, mesh_resolution=24, light_resolution=16)


def run(script: str, *arguments: object, code: int = 0) -> str:
    done = subprocess.run(
        [sys.executable, str(BENCH / script), *map(str, arguments)], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == code, done.stderr[-2000:]
    return done.stdout


def test_every_operator_has_its_line(tmp_path):
    said = run("gpu_ops.py", "--out", tmp_path, "--device", "cpu", "--tiny", "--seconds", 0.001)
    with (tmp_path / "ops.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    timed = [line for line in lines if line["cold_ms"]]
    operators = {line["case"].split(",")[0] for line in timed}
    assert operators >= {"copy", "product float32", "product tf32", "product bfloat16"} | set(CASES)
    assert all(line["note"].startswith("refused") for line in lines if not line["cold_ms"])
    for line in timed[4:]:
        limit = 5e-3 if line["dtype"] in ("float16", "bfloat16") else 1e-4
        assert float(line["error"]) < limit, line
        assert float(line["cold_ms"]) > 0 and float(line["bytes"]) > 0
        assert math.isnan(float(line["operations"])) or float(line["operations"]) > 0
        assert float(line["floor_ms"]) > 0, line
    assert "0 failed" in said and "| hash_encode | float32 |" in (tmp_path / "ops.md").read_text()


def test_a_line_that_takes_too_long_fails_alone(tmp_path):
    seconds = ("--seconds", 2.0, "--stalled", 1e-4)  # the watching thread may itself wait for a core
    arguments = ("--out", tmp_path, "--device", "cpu", "--tiny", "--only", "prefilter_light", *seconds)
    assert "1 of 1 lines, 1 failed" in run("gpu_ops.py", *arguments, code=1)
    assert "failed: took too long" in (tmp_path / "ops.md").read_text()


def test_a_profile_names_what_takes_the_time(data, tmp_path):
    settings = [part for key, value in SMALL.items() for part in ("--set", f"{key}={value}")]
    page = tmp_path / "profile.md"
    run("gpu_train.py", data, "--out", tmp_path / "run", "--device", "cpu", "--preset", "cpu", "--steps", 60,
        "--profile", page, *settings)  # fmt: skip
    text = page.read_text()
    assert text.startswith("20 steps after 39: ") and "sdf_field_backward" in text


def test_a_step_has_no_more_launches_than_it_had(tmp_path):
    """Those of our operators are as many as their launchers make, each once a step."""
    said = run("launches.py", "--steps", 8, "--out", tmp_path / "launches.md")
    launches = float(re.match(r"(\d+) launches a step", said)[1])
    assert 80 < launches <= 105
    for line in ("| sample_rays | 7.0 |", "| spread_samples | 3.0 |", "| sdf_field_backward | 5.0 |"):
        assert line in said
    counted = [float(x) for x in re.findall(r"^\| [a-z_]+ \| ([\d.]+) \|$", said, re.MULTILINE)]
    assert sum(counted) == pytest.approx(launches, rel=0.02)  # each line is rounded to a tenth
    assert said.strip() in (tmp_path / "launches.md").read_text()


class Off:
    """The operators, their float32 results too large by a share."""

    def __init__(self, share: float):
        self.share = share

    def __getattr__(self, name: str):
        op = getattr(torch.ops.splitnerf, name)
        return lambda x, *rest: op(x, *rest) * (1 + self.share * (x.dtype == torch.float32))


@pytest.mark.parametrize(("share", "fails"), [(2e-4, True), (2e-5, False)])
def test_a_line_with_a_large_error_fails(monkeypatch, share, fails):
    monkeypatch.setattr(gpu_ops, "lib", Off(share))
    case = next(case for case in gpu_ops.all_cases() if case.op == "linear_to_srgb")
    clock = gpu_ops.Clock("cpu", 0.001)
    line = gpu_ops.measure(case, "float32", gpu_ops.World(gpu_ops.TINY), clock, "cpu", (1e9, 1e9))
    assert ("failed: the error is above 1e-04" in line[-1]) == fails
    assert abs(float(line[gpu_ops.COLUMNS.index("error")]) / share - 1) < 0.1


def test_the_costly_operators_come_first():
    ops = [case.op for case in gpu_ops.all_cases()]
    assert ops[:4] == ["sample_rays", "sdf_field_backward", "cached_occlusion", "cached_visibility"]
    assert set(ops) == set(CASES)


def test_families_are_tried_apart(monkeypatch, capfd, tmp_path):
    """One that takes its process down fails alone; a tool in front is asked for its summary."""
    families = gpu_smoke.families("cpu")
    assert set(CASES) < set().union(*families.values()) and len(families) >= 5
    tool = tmp_path / "tool"
    tool.write_text('#!/bin/sh\necho "===== ERROR SUMMARY: 3 errors"\ncase "$*" in *rays*) kill -11 $$ ;; esac\nexec "$@"\n')
    tool.chmod(0o755)
    command = ["gpu_smoke.py", "--device", "cpu", "--only", "rays", "--only", "losses", "--jobs", "2", "--under", str(tool)]
    monkeypatch.setattr("sys.argv", command)
    assert gpu_smoke.main() == 1
    said = capfd.readouterr().out.splitlines()
    assert said[0].startswith("rays: failed (-11): ") and said[-1] == "2 families, 1 failed"
    n = len(families["losses"])
    assert f"losses: {n} of {n} operators agree; ERROR SUMMARY: 3 errors" in said


def test_a_wrong_operator_is_named(monkeypatch, capsys):
    from op_cases import CASES as inputs

    monkeypatch.setitem(inputs, "composite", lambda t: inputs["linear_to_srgb"](t))
    assert gpu_smoke.try_here("rays", "cpu") == 1
    said = capsys.readouterr().out
    assert said.startswith("wrong: composite, torch.float64: ") and f"of {len(gpu_smoke.families('cpu')['rays'])} operators" in said


LINES = "fact\tcard\tA card\nfact\tcommit\tabc1234\nfact\tdate\t2026-01-02\npart\tstep\tdone\t12\tall | agree in /a/b/step.md\n"


def test_the_table_goes_into_a_page(tmp_path, monkeypatch, capsys):
    first, second, page = tmp_path / "a", tmp_path / "b", tmp_path / "page.md"
    for folder, name in ((first, "first"), (second, "second")):
        folder.mkdir()
        (folder / f"{name}.tsv").write_text(LINES + "part\thalf a li")
    page.write_text(f"before\n{gpu_table.BEGIN}\nold\n{gpu_table.END}\nafter\n")
    monkeypatch.setattr("sys.argv", ["gpu_table.py", str(second), str(first), "--write", str(page)])
    assert gpu_table.main() == gpu_table.main() == 0
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nafter\n") and "old" not in text and text.count("| step |") == 2
    assert text.index("gpu.sh first`: card A card; driver unknown;") < text.index("gpu.sh second`")
    assert "commit abc1234; date 2026-01-02." in text and "| step | done | 12 | all / agree in step.md |" in text
    page.write_text("no markers")
    assert gpu_table.main() == 1 and page.read_text() == "no markers"
    page.write_text(text)
    (first / "first.tsv").write_text("fact\trehearsal\ton the CPU\n" + LINES)
    assert gpu_table.main() == 1 and page.read_text() == text
    assert "measures nothing" in capsys.readouterr().err
    (first / "first.tsv").unlink()
    (second / "second.tsv").unlink()
    assert gpu_table.main() == 1 and page.read_text() == text


def test_the_docs_have_the_tables_place():
    docs = (BENCH.parents[1] / "docs" / "cuda.md").read_text()
    assert gpu_table.written(docs, "tables").count("tables\n\n" + gpu_table.END) == 1


PROFILE = """
| 2.5 | 38% | 1.0 | 2568.9 | `field_kernel<float>(long, SdfLayer<float>)` |
| 1.0 | 15% | 1.1 | 973.1 | `for_each_group_kernel<CachedOcclusionBody<float> >(long, CachedOcclusionBody<float>)` |
| 0.9 | 10% | 1.0 | 9.1 | `at::native::index_elementwise_kernel<128, 4>` |
| 0.8 | 10% | 1.0 | 9.1 | `gemm_of_somebody_kernel<128, 4>` |
"""
COUNTS = """==PROF== Connected
"ID","Kernel Name","dram","us","sm","cache","warps"
"","","%","ns","%","%","%"
"0","void splitnerf::field_kernel<float>(long)","10","1,000","55.5","30","20"
"1","void splitnerf::field_kernel<float>(long)","10","3,000","56.5","30","20"
"2","other","10","3,000","56.5","30","20"
"""
IN_COUNTS = dict(zip(("us", "sm", "cache", "dram", "warps"), gpu_limits.METRICS))


def test_the_costliest_kernels_are_counted(tmp_path, monkeypatch, capsys):
    """By a program that says what Nsight Compute would."""
    counts = COUNTS
    for ours, theirs in IN_COUNTS.items():
        counts = counts.replace(f'"{ours}"', f'"{theirs}"')
    (tmp_path / "counts").write_text(counts)
    ncu = tmp_path / "ncu"
    ncu.write_text(f'#!/bin/sh\necho "$*" >{tmp_path}/asked\n[ ! -e {tmp_path}/counts ] || cp {tmp_path}/counts {tmp_path}/limits.csv\n')
    ncu.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    profile = tmp_path / "profile.md"
    profile.write_text(PROFILE)
    monkeypatch.setattr("sys.argv", ["gpu_limits.py", str(profile), "--out", str(tmp_path), "--", "train", "--steps", "9"])
    assert gpu_limits.main() == 0
    assert capsys.readouterr().out == "share of the limit: field_kernel 56 %\n"
    asked = (tmp_path / "asked").read_text()
    assert "regex:field_kernel|CachedOcclusionBody " in asked and asked.endswith("all train --steps 9\n")
    text = (tmp_path / "limits.md").read_text()
    assert "| `field_kernel` | 2.0 | 56.0 | 30.0 | 10.0 | 20.0 |" in text and "| `CachedOcclusionBody` | not seen |" in text
    for name in ("counts", "limits.csv"):
        (tmp_path / name).unlink()
    assert gpu_limits.main() == 1 and "counted nothing" in capsys.readouterr().out
    profile.write_text("nothing")
    assert gpu_limits.main() == 1


@pytest.mark.parametrize("script", ["gpu.sh", "gpu_bundle.sh", "gpu_sources.sh"])
def test_the_scripts_can_be_read(script):
    subprocess.run(["bash", "-n", str(BENCH / script)], check=True)


def test_the_script_wants_a_command_and_a_folder():
    for words in ([], ["first"], ["third", "out"]):
        done = subprocess.run(["bash", str(BENCH / "gpu.sh"), *words], capture_output=True, text=True)
        assert done.returncode == 2 and "gpu.sh first OUT [BUNDLE]" in done.stdout
