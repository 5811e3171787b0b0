"""A run's folder: the files that it may hold, whether a run can be made there, and what it delivers."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from splitnerf.config import Config
from splitnerf.data.asset import ORIGIN
from splitnerf.data.dataset import EXPOSURES, Dataset
from splitnerf.data.frames import layout_of, refuse_data, run_in
from splitnerf.data.json_files import read_json, write_json
from splitnerf.data.reading import SEPARATED
from splitnerf.devices import refuse_one_processor
from splitnerf.errors import InputError
from splitnerf.plugins import installed
from splitnerf.refinement.refine import RECORD, STATE, TRAINED
from splitnerf.training.metrics import METRICS, PREVIEWS

DATA = "data.json"  # where the photos of the run are
ASSET_FILES = ("mesh.glb", "environment.exr", "environment.hdr")
REFINED = "refined"  # the folder in a run of what `refine` made of it
REFINEMENT_FILES = (RECORD, STATE, *(f"{TRAINED}/{name}" for name in ASSET_FILES))
RUN_FILES = ("config.toml", "checkpoint.pt", METRICS, "mesh.ply", *ASSET_FILES, "evaluation.json", "report.html")
RUN_FILES += (ORIGIN, DATA, EXPOSURES, *REFINEMENT_FILES)
# By request, beside those of a run.
EXPORTED = (
    "mesh.obj",
    "mesh.mtl",
    "mesh.usdz",
    *(f"mesh_{map}.png" for map in ("albedo", "normal", "roughness", "metallic")),
)


def check_run(run: Path, *, resume: bool, overwrite: bool) -> None:
    """Checks that a run can be made in a locked folder, and what stands where it is to be. Raises InputError where the
    folder holds a run or a data set, or the machine has one processor."""
    refuse_one_processor()
    refuse_data(run)
    refuse_links(run)
    if not present_in(run) and any((run / PREVIEWS).glob("step_*.png")):
        raise InputError(f"{run / PREVIEWS}: is of no run, and would be replaced; give another --out")
    if not (resume or overwrite) and present_in(run):
        raise InputError(
            f"{run}: holds a run already; continue with --resume, replace it with --overwrite, or give another --out"
        )
    if overwrite and present_in(run) and not is_run(run):
        raise InputError(f"{run / present_in(run)[0]}: is of no run, and would be deleted; give another --out")


def refuse_links(run: Path) -> None:
    """Raises InputError where a folder of a run is a link: what it points to is not the run's."""
    for name in (TRAINED, REFINED, PREVIEWS, SEPARATED):
        if (run / name).is_symlink():
            raise InputError(f"{run / name}: is a link, and files there would be replaced; remove it")


def refuse_no_run(run: Path) -> None:
    """Raises InputError where a path is no folder, or a data set's."""
    if not run.is_dir():
        raise InputError(f"{run}: no such run; train one with `splitnerf train DATA --out {run}`")
    if layout_of(run) is not None:
        raise InputError(f"{run}: is a data set, not a run; train one with `splitnerf train {run} --out RUN`")
    if not (run / "checkpoint.pt").is_file() and (inner := run_in(run)):
        raise InputError(f"{run}: holds runs; give one, such as {inner}")


def check_results(out: Path, run: Path, *, overwrite: bool) -> None:
    """Checks that results of a run can be written into a folder. Raises InputError where they would replace a data set,
    what belongs to another run or, unless ``overwrite``, files that the run's training did not write."""
    refuse_data(out)
    if own_results(out, run):
        refuse_links(run)
        if out.resolve() != (run / REFINED).resolve():
            return
    if (out / "checkpoint.pt").exists():
        raise InputError(f"{out}: holds another run, whose results would be replaced; give another --out")
    present = [name for name in (*RUN_FILES, *EXPORTED) if (out / name).exists()]
    if present and not overwrite:
        raise InputError(f"{out / present[0]}: would be replaced; give another --out, or --overwrite")


def own_results(out: Path, run: Path) -> bool:
    """Whether a folder is one of a run's own, for its results."""
    return out.resolve() in [(run / name).resolve() for name in (".", TRAINED, REFINED)]


def asset_name(run: Path) -> str:
    """What the mesh, the material and the images of a run are called: as its folder."""
    return re.sub(r"[^\w.-]+", "_", run.resolve().name) or "object"


def write_data_of(run: Path, dataset: Dataset) -> None:
    """Writes where the photos of a run are, and how much their edges were averaged down."""
    write_json(run / DATA, {"data": str(dataset.root.resolve()), "downscale": dataset.downscale})


def data_of(run: Path) -> tuple[Path, int] | None:
    """The folder of a run's data and their downscale; None where it is not known, or gone."""
    if not (run / DATA).is_file():
        return None
    content = read_json(run / DATA, "data")
    root, downscale = content.get("data"), content.get("downscale")
    if not isinstance(root, str) or type(downscale) is not int or downscale < 1:
        raise InputError(f"{run / DATA}: is damaged; delete it, and give --data")
    return (Path(root), downscale) if Path(root).is_dir() else None


def present_in(run: Path) -> list[str]:
    """The files of a run that a folder holds."""
    return [name for name in RUN_FILES if (run / name).exists()]


def is_run(run: Path) -> bool:
    """Whether a folder holds a run, which begins with its settings."""
    settings = run / "config.toml"
    try:
        return (run / "checkpoint.pt").is_file() or (bool(Config.read(settings)) and "[run]" in settings.read_text())
    except InputError:
        return False


def clear_run(run: Path) -> None:
    """Deletes the files of a run, and nothing else."""
    previews = list((run / PREVIEWS).glob("step_*.png")) if is_run(run) else []
    discard_refinement(run)
    for path in [*previews, *(run / name for name in RUN_FILES)]:
        path.unlink(missing_ok=True)


def begin_or_resume(run: Path) -> tuple[bool, bool]:
    """Whether to resume the run of a folder, or to overwrite it: one that ended before its first checkpoint."""
    if (run / "checkpoint.pt").is_file():
        return True, False
    return False, set(present_in(run)) <= {"config.toml", METRICS, ORIGIN, DATA}


def is_finished(run: Path) -> bool:
    """Whether a run has delivered what its checkpoint holds: its evaluation, the last file, says of which checkpoint it is."""
    checkpoint, scores = run / "checkpoint.pt", run / "evaluation.json"
    expected = [checkpoint, scores, *([run / "report.html"] if installed().write_report else [])]
    if not all(path.is_file() for path in expected) or (run / STATE).exists():
        return False
    try:
        return read_json(scores, "checkpoint").get("checkpoint") == digest_of(checkpoint)
    except InputError:
        return False


def write_scores(run: Path, scores: dict) -> None:
    """Writes a run's evaluation.json, which says of which checkpoint it is."""
    write_json(run / "evaluation.json", scores | {"checkpoint": digest_of(run / "checkpoint.pt")})


def digest_of(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def is_refined(run: Path) -> bool:
    """Whether a run delivers what a refinement fitted."""
    return (run / RECORD).is_file() and (run / "mesh.glb").is_file()


def export_folder(run: Path) -> Path:
    """Where a run's trained asset is written: the run, or RUN/trained where the run delivers a refined one."""
    return run / TRAINED if is_refined(run) else run


def move_assets(source: Path, target: Path) -> None:
    """Moves the asset and its light, as far as they are there."""
    target.mkdir(exist_ok=True)
    for name in ASSET_FILES:
        if (source / name).is_file():
            os.replace(source / name, target / name)


def discard_refinement(run: Path) -> None:
    """Deletes the files of a refinement except the asset, and those it started from."""
    for name in REFINEMENT_FILES:
        (run / name).unlink(missing_ok=True)
    if (run / TRAINED).is_dir() and not any((run / TRAINED).iterdir()):
        (run / TRAINED).rmdir()
