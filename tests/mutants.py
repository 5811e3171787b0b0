"""Mutation testing: changes a source file in one place after the other and runs the fast tests that concern it each time.

    python tests/mutants.py [--some N] [--out PAGE.md] python/splitnerf/training/schedule.py python/splitnerf/refinement ...

A folder is all of its files; --some takes N changes of each argument, chosen at random with seed 0. A change that no test sees is printed as
a diff; each argument has a row in the end, also in the page.
cosmic-ray writes each change into the file itself and takes it back; so the file must have no changes that are not committed.
"""

import argparse
import contextlib
import functools
import json
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

from splitnerf_tools.bench.provenance import provenance

ROOT = Path(__file__).parents[1]
PACKAGES = Path("python")
PAGE = """# Changes that tests see

`python tests/mutants.py --some N --out docs/mutants.md PACKAGE ...` changes N places of a package's sources, chosen at random, and asks its fast tests.

| package | places | changed | seen by a test | commit | date |
|---|---|---|---|---|---|"""
# The fast tests of each file, by the longest beginning of its path below python/ or python/splitnerf/ that is listed.
TESTS = {
    "cli/": "test_commands.py test_refusals.py test_train.py test_evaluate.py test_own_files.py test_report.py",
    "config/": "test_config.py",
    "data/": "test_data.py test_layouts.py test_inputs.py test_known_pixels.py test_images.py test_photos.py test_pixels.py",
    "data/colours.py": "test_colours.py test_images.py test_inputs.py",
    "data/gltf/": "test_gltf.py",
    "devices.py": "test_device.py test_doctor.py test_refreshes.py test_train.py",
    "errors.py": "test_refusals.py test_bad_files.py",
    "evaluate/": "test_evaluate.py test_metrics.py test_lpips.py",
    "evaluate/score_table.py": "test_evaluate.py test_report.py test_ablate.py",
    "export/": "test_export.py test_bake.py test_meshing.py",
    "files.py": "test_files.py test_own_files.py",
    "fields/": "test_shading_model.py test_views.py",
    "fields/light.py": "test_light_pyramid.py test_shading_model.py test_views.py",
    "fields/surface.py": "test_sdf_field.py test_views.py",
    "fields/occlusion.py": "test_shading_model.py test_visibility.py test_summed_light.py",
    "memory.py": "test_photos.py",
    "ops/": "test_operators.py test_operator_errors.py test_ops_adamw.py test_ops_incoming_light.py test_ops_light_pyramid.py "
    "test_ops_losses.py test_ops_rays.py test_ops_sdf.py test_ops_shading.py test_sdf_field.py test_light_pyramid.py test_visibility.py",
    "pipeline.py": "test_refined_run.py test_own_files.py test_train.py",
    "refinement/": "test_refinement.py test_refinement_steps.py test_held_out.py test_level.py test_outline.py test_refined_run.py",
    "refinement/detail.py": "test_detail.py",
    "plugins.py": "test_commands.py",
    "relight/": "test_relight.py",
    "run_folder.py": "test_own_files.py test_refined_run.py",
    "splitnerf_tools/": "test_commands.py test_doctor.py test_inspect.py",
    "splitnerf_tools/ablate/": "test_ablate.py",
    "splitnerf_tools/batch/": "test_many_scenes.py",
    "splitnerf_tools/bench/": "test_bench.py",
    "splitnerf_tools/capture/": "test_capture.py test_turntable.py test_photo_files.py",
    "splitnerf_tools/commands/": "test_commands.py test_synth.py test_many_scenes.py test_ablate.py",
    "splitnerf_tools/demo/": "test_examples.py",
    "splitnerf_tools/doctor/": "test_doctor.py",
    "splitnerf_tools/inspection/": "test_inspect.py",
    "splitnerf_tools/report/": "test_report.py test_report_page.py",
    "splitnerf_tools/separation/": "test_separation.py test_radiance_field.py",
    "splitnerf_tools/synth/": "test_synth.py",
    "splitnerf_tools/view/": "test_view.py test_live.py",
    "render/": "test_views.py test_shading_model.py test_summed_light.py",
    "render/model.py": "test_views.py test_summed_light.py test_shading_model.py test_schedule.py",
    "render/path_traced.py": "test_path_traced.py",
    "render/rays.py": "test_pixels.py",
    "render/seen.py": "test_meshing.py test_detail.py",
    "render/stereo.py": "test_start.py",
    "training/checkpoint.py": "test_checkpoint.py",
    "training/finite.py": "test_finite.py",
    "training/gpu_step.py": "test_graph_rules.py test_finite.py",
    "training/batches.py": "test_pixels.py",
    "training/exposure.py": "test_exposures.py",
    "training/start.py": "test_start.py",
    "training/metrics.py": "test_refreshes.py test_survival.py",
    "training/observer.py": "test_progress.py test_live.py test_train.py",
    "training/loop.py": "test_refreshes.py test_schedule.py test_finite.py",
    "training/losses.py": "test_light_loss.py test_loss_terms.py test_shading_model.py test_views.py",
    "training/meshes.py": "test_refreshes.py",
    "progress.py": "test_progress.py",
    "training/schedule.py": "test_schedule.py",
    "training/step.py": "test_finite.py test_summed_light.py test_schedule.py test_train.py",
}
# Of each kind of operator one replacement is enough; a bar stands in annotations, which nobody evaluates.
LEFT_OUT = [
    r"core/ReplaceBinaryOperator_(?!Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|FloorDiv_Div|Mod_Mul|MatMul_Mul)",
    r"core/ReplaceUnaryOperator_.*_(Invert|Not)$",
    r"core/ReplaceComparisonOperator_.*_Is(Not)?$",
    r"core/ExceptionReplacer",
    r"core/RemoveDecorator",
]
SETTINGS = """[cosmic-ray]
module-path = "{path}"
timeout = 300.0
excluded-modules = []
test-command = "{command}"
distributor.name = "local"
filters.operators-filter.exclude-operators = {left_out}
"""


def tests_of(path: Path) -> list[str]:
    """The test files that concern a source file."""
    name = path.relative_to(PACKAGES).as_posix().removeprefix("splitnerf/")
    known = [start for start in TESTS if name.startswith(start)]
    if not known:
        sys.exit(f"{path}: no tests are listed for it in {Path(__file__).name}; add a line to TESTS")
    names = TESTS[max(known, key=len)].split()
    return [f"tests/python/{name}" for name in names if (ROOT / "tests/python" / name).is_file()]


def cosmic_ray(*arguments: object) -> str:
    """Runs it in the repository's root; returns what it printed."""
    beside = Path(sys.executable).with_name("cosmic-ray")
    program = str(beside) if beside.is_file() else shutil.which("cosmic-ray")
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run([program, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, env=environment)
    if done.returncode:
        sys.exit(f"cosmic-ray {arguments[0]}: {done.stderr or done.stdout}")
    return done.stdout


def mutants_of(path: Path) -> tuple[Path, Path, list[str]]:
    """The session of a file, its settings, and the names of all its mutants."""
    if subprocess.run(["git", "diff", "--quiet", "HEAD", "--", str(path)], cwd=ROOT).returncode:
        sys.exit(f"{path}: has changes that are not committed; commit them first")
    folder = ROOT / "build" / "mutants" / path.with_suffix("")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    command = " ".join([sys.executable, "-m pytest -q -x -p no:cacheprovider", *tests_of(path)])
    check(command)
    settings, session = folder / "settings.toml", folder / "session.sqlite"
    settings.write_text(SETTINGS.format(path=path.as_posix(), command=command, left_out=json.dumps(LEFT_OUT)))
    cosmic_ray("init", settings, session)
    filters = shutil.which("cr-filter-operators") or Path(sys.executable).with_name("cr-filter-operators")
    subprocess.run([filters, str(session), str(settings)], cwd=ROOT, check=True)
    return session, settings, [job for job, result in outcomes(session).items() if result is None]


@functools.cache
def check(command: str) -> None:
    """Ends the program where tests fail without a mutant."""
    done = subprocess.run(command.split(), cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{command}\n{done.stdout[-2000:]}")


def outcomes(session: Path) -> dict[str, dict | None]:
    """The result of each mutant by its name; None: it has not run."""
    lines = map(json.loads, cosmic_ray("dump", session).splitlines())
    return {item["job_id"]: result for item, result in lines}


def mutate(path: Path, session: Path, settings: Path, chosen: list[str]) -> tuple[int, list[str]]:
    """Runs the tests with the chosen mutants: how many ran, and as diffs those that no test saw."""
    names = ",".join("?" * len(chosen))
    with contextlib.closing(sqlite3.connect(session)) as database, database:
        for table in ("mutation_specs", "work_items"):
            database.execute(f"DELETE FROM {table} WHERE job_id NOT IN ({names})", chosen)
    try:
        cosmic_ray("exec", settings, session)
    finally:
        subprocess.run(["git", "checkout", "--quiet", "--", str(path)], cwd=ROOT, check=True)
    run = [r for r in outcomes(session).values() if r and r["worker_outcome"] == "normal"]
    return len(run), [changed_lines(r["diff"]) for r in run if r["test_outcome"] == "survived"]


def changed_lines(diff: str) -> str:
    """Where a diff begins and its lines that begin with - or +."""
    at = re.search(r"^@@ -(\d+)", diff, re.M)
    lines = [line for line in diff.splitlines() if re.match(r"[-+](?![-+]{2})", line)]
    return "\n".join([f"  near line {at[1] if at else '?'}", *(f"  {line}" for line in lines)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path, metavar="FILE|FOLDER")
    parser.add_argument("--some", type=int, metavar="N", help="mutants of each argument (default: all)")
    parser.add_argument("--out", type=Path, metavar="FILE.md", help="a page whose rows are replaced")
    options = parser.parse_args()
    for path in options.paths:
        made = {file: mutants_of(file) for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path])}
        every = [(file, name) for file, (_, _, names) in made.items() for name in names]
        chosen = random.Random(0).sample(every, min(options.some or len(every), len(every)))
        n, n_left = 0, 0
        for file, (session, settings, _) in made.items():
            names = [name for of, name in chosen if of == file]
            if names:
                run, left = mutate(file, session, settings, names)
                print("\n".join([f"{file}: {run} mutants, {run - len(left)} killed", *left]), flush=True)
                n, n_left = n + run, n_left + len(left)
        facts = provenance((str(path),))
        row = f"| {path.relative_to(PACKAGES)} | {len(every)} | {n} | {n - n_left} | {facts['commit']} | {facts['date']} |"
        print(row, flush=True)
        if options.out:  # in place of an older row
            old = options.out.read_text().splitlines() if options.out.is_file() else []
            kept = [x for x in old if x.startswith("| splitnerf") and x.split(" |")[0] != row.split(" |")[0]]
            options.out.write_text("\n".join([PAGE, *sorted([*kept, row]), ""]))


if __name__ == "__main__":
    main()
