"""Pages of docs/benchmarks that have programs of their own, for `make results`; and what those pages share with results.py."""

import os
import subprocess
import sys
from pathlib import Path

from bench import tables
from splitnerf.files import atomic_path
from splitnerf_tools.bench.provenance import header, provenance

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("SPLITNERF_DATA", ROOT.parent / "shared/data"))
SOURCES = "cpp", "python/splitnerf", ":!cpp/cuda", ":!python/splitnerf/cli"
ABLATION = (
    *("--steps", 6000, "--downscale", 2, "--views", 6, "--spp", 32, "--rows"),
    "no refinement; MLP light; light by the split sum; no indirect light; no neutral light; no smoothness of normals; "
    "no material entropy",
)
PROGRAMS: dict[str, tuple] = {  # by page: what Python is called with, before the folder of the pages
    "ablation": (),
    "step": ("tests/bench/step.py",),
    **{name: ("tests/bench/operators.py", name) for name in ("hash_grid", "shading", "split_sum")},
    **{name: ("-m", "splitnerf", "bench", name) for name in ("prefilter", "occlusion")},
    "stability": ("-m", "stability", "--jobs", os.cpu_count()),
}


def splitnerf(*words: object) -> bool:
    """Runs a command of the program; whether it succeeded."""
    return subprocess.run([sys.executable, "-m", "splitnerf", *map(str, words)]).returncode == 0


def is_fresh(page: Path) -> bool:
    """Whether a page is there whose sources have not changed since."""
    return page.is_file() and tables.state(page.read_text(), ROOT)[0] == "fresh"


def run_program(name: str, out: Path, work: Path) -> bool:
    """Writes a page of :data:`PROGRAMS`; whether that succeeded."""
    if name == "ablation":
        return write_ablation(out, work)
    words, folder, run = [*PROGRAMS[name]], out.resolve(), work.resolve() / "runs/boombox_cpu_8_0"
    if name == "step":
        words += [run, DATA / "scenes/boombox"]
        if not run.is_dir():
            print(f"step: {run} is missing; PAGE=time makes it", file=sys.stderr)
            return False
    if folder != ROOT / "docs/benchmarks":  # a page's head has the command without what is usual
        words += ["--out", folder / "step.md" if name == "step" else folder]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tests")}
    return subprocess.run([sys.executable, *map(str, words)], cwd=ROOT, env=environment).returncode == 0


def write_ablation(out: Path, work: Path) -> bool:
    """Runs the ablation and writes its page; whether it succeeded."""
    scenes, folder = (DATA / "scenes/boombox", DATA / "scenes/corset"), work / "ablation"
    head = header(provenance(SOURCES, "make results PAGE=ablation"))  # before, as the sources may change meanwhile
    if not all(map(Path.is_dir, scenes)) or not splitnerf("ablate", *scenes, "--out", folder, *ABLATION):
        return False
    (out / "ablation.csv").write_bytes((folder / "ablation.csv").read_bytes())
    words = " ".join(map(str, ABLATION[:-1]))
    lines = [
        "# Ablation",
        "",
        head,
        "",
        f"`splitnerf ablate boombox corset {words} ...`: each row has the same steps, the refinement included.",
        "One run a row, so less than 0.3 dB is no difference; minutes are as the machine had time. [Benchmarks](README.md)",
        "say what it tells.",
        "",
        (folder / "ablation.md").read_text(),
    ]
    with atomic_path(out / "ablation.md") as temporary:
        temporary.write_text("\n".join(lines))
    return True
