"""The scripts that measure on a GPU, rehearsed on the CPU with small sizes."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from bench import gpu_limits, gpu_ops, gpu_smoke, gpu_table, gpu_train
from bench.gpu_cases import COSTLY
from op_cases import CASES
from pretend_graphs import PretendGraph, graphs_on_the_cpu

from splitnerf.training import loop

BENCH = Path(__file__).parents[1] / "bench"
SMALL = dict(target_samples=256, max_rays=64, grid_resolution=16, mesh_resolution=24, light_resolution=16, log2_table_size=10)


def run(script: str, *arguments: object, code: int = 0) -> str:
    done = subprocess.run(
        [sys.executable, str(BENCH / script), *map(str, arguments)], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == code, done.stderr[-2000:]
    return done.stdout


def test_every_operator_of_a_step_has_its_line(tmp_path):
    said = run("gpu_ops.py", "--out", tmp_path, "--device", "cpu", "--tiny", "--seconds", 0.001)
    page = (tmp_path / "ops.md").read_text()
    lines = [dict(zip(gpu_ops.HEAD, line.strip("| ").split(" | "))) for line in page.splitlines() if line.startswith("| ")][2:]
    operators = [line for line in lines if not line["operator"].startswith("AdamW")]
    assert {line["operator"] for line in operators} == {case.op for case in gpu_ops.all_cases()} and len(lines) == len(operators) + 3
    for line in operators:
        limit = 5e-3 if line["dtype"] in ("float16", "bfloat16") else 1e-4
        assert float(line["error"]) < limit and float(line["share"]) > 0, line
    beside = {line["operator"] for line in operators if line["torch's"].strip()}
    assert beside >= {"sdf_field", "sdf_field_backward", "composite_backward", "material_network_backward", "pixel_losses"}
    assert f"{len(lines)} lines, 0 failed, {len(beside)} beside torch's code" in said


def test_the_network_of_the_materials_as_torch_s_layers_is_the_operator():
    case = next(case for case in gpu_ops.all_cases() if case.op == "material_network")
    plain, inputs = gpu_ops.as_torch(case)
    given = inputs(gpu_ops.World(gpu_ops.TINY))
    for ours, theirs in zip(torch.ops.splitnerf.material_network(*given), plain(*given), strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-6)


def settings(**changes: object) -> list[str]:
    return [part for key, value in (SMALL | changes).items() for part in ("--set", f"{key}={value}")]


def test_a_look_says_what_took_the_time(data, tmp_path):
    page = tmp_path / "steady.md"
    said = run("gpu_train.py", data, "--out", tmp_path / "run", "--device", "cpu", "--steps", 1000, "--until", 30,
               "--profiled", 4, "--page", page, *settings())  # fmt: skip
    text = page.read_text()
    assert said.startswith("steps 10 to 30: ") and "0 replays, 0 recordings, 20 eager steps, 0 without room" in said
    parts = dict(re.findall(r"^\| ([a-z: ,]+) \| [\d.]+ \| ([\d.]+) \|$", text, re.MULTILINE))
    assert {"draws", "find samples", "optimiser", "numbers", "the rest"} <= set(parts) and set(parts.values()) == {"1.00"}
    assert "\n4 steps: " in text and "| `sdf_field_backward` |" in text
    assert all(f"| {name} | " in text for name in ("occupied cells", "a mesh, and its caches filled", "light on the mesh"))


def test_a_look_sees_graphs(data, tmp_path, monkeypatch):
    used = graphs_on_the_cpu(monkeypatch)
    monkeypatch.setattr(torch.cuda, "CUDAGraph", PretendGraph)
    for owner, name in ((loop, "draw_batch"), (loop.PastStep, "of")):  # what is watched is put back
        monkeypatch.setattr(owner, name, getattr(owner, name))
    page = tmp_path / "steady.md"
    command = ["gpu_train.py", str(data), "--out", str(tmp_path / "run"), "--device", "cpu", "--steps", "1000", "--until", "60",
               "--profiled", "2", "--page", str(page), *settings(levels_open_by=0.0, target_samples=4096)]  # fmt: skip
    monkeypatch.setattr("sys.argv", command)
    assert gpu_train.main() == 0
    assert used["replayed"] > 10 and "| replay | " in page.read_text() and "| recording | " in page.read_text()


def test_a_run_is_scored_without_an_export(data, tmp_path):
    said = run("gpu_train.py", data, "--out", tmp_path, "--device", "cpu", "--steps", 8, "--views", 1, *settings())
    assert re.search(r"^8 steps in .* 0 skipped, novel views [\d.]+ dB, albedo", said, re.MULTILINE)
    scores = json.loads((tmp_path / "training.json").read_text())["scores"]
    assert scores["novel_view"]["psnr"] > 5 and not (tmp_path / "mesh.glb").exists()


def test_time_within_phases_counts_once(monkeypatch):
    """Each without what it calls; a function that is not there is left out."""
    monkeypatch.setattr(gpu_train.time, "perf_counter", itertools.count().__next__)  # a second passes at each look
    phases = gpu_train.Phases()
    outer = phases.timed(phases.timed(lambda: None, "inner"), "outer")
    outer()
    assert not phases.calls
    phases.on = True
    phases.watch(phases, "nothing", "nothing")
    outer()
    assert phases.calls == {"inner": 1, "outer": 1} and phases.seconds == {"inner": 1, "outer": 2}


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
    case = next(case for case in gpu_ops.all_cases() if case.op == "sharpness")
    clock = gpu_ops.Clock("cpu", 0.001)
    line = gpu_ops.measure(case, "float32", gpu_ops.World(gpu_ops.TINY), clock, "cpu", (1e9, 1e9))
    assert ("failed: the error is above 1e-04" in line[-1]) == fails
    assert abs(float(line[gpu_ops.HEAD.index("error")]) / share - 1) < 0.1


def test_the_costly_operators_come_first():
    ops = [case.op for case in gpu_ops.all_cases()]
    assert tuple(dict.fromkeys(ops))[: len(COSTLY)] == COSTLY and set(ops) <= set(CASES)


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


@pytest.mark.parametrize("command", ["first", "second"])
def test_the_parts_of_a_command_fit_into_its_time(command):
    """Every part has a limit, and the sum of them fits."""
    text = (BENCH / "gpu.sh").read_text()
    plan = re.search(rf'^{command}="(.*)"$', text, re.MULTILINE)[1].split()
    parts = dict(zip(plan[::2], map(int, plan[1::2])))
    assert sum(parts.values()) == int(re.search(r"GPU_SECONDS:-(\d+)", text)[1]) <= 570
    body = re.search(rf"^run_{command}\(\) \{{\n(.*?)^\}}", text, re.MULTILINE | re.DOTALL)[1]
    called = re.findall(r"^  (?:part|train|to_the_end|sanitize|tool_part ncu) (\w+)|^  (steady)$", body, re.MULTILINE)
    assert [*"setup wheel data".split(), *("".join(names) for names in called)] == list(parts)


@pytest.mark.parametrize("script", ["gpu.sh", "gpu_bundle.sh", "gpu_sources.sh"])
def test_the_scripts_can_be_read(script):
    subprocess.run(["bash", "-n", str(BENCH / script)], check=True)


def test_the_script_wants_a_command_and_a_folder():
    for words in ([], ["first"], ["third", "out"]):
        done = subprocess.run(["bash", str(BENCH / "gpu.sh"), *words], capture_output=True, text=True)
        assert done.returncode == 2 and "gpu.sh first OUT [BUNDLE]" in done.stdout
