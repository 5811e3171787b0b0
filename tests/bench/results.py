"""Whole reconstructions with their scores: pages of docs/benchmarks, made by `splitnerf` alone.

    python tests/bench/results.py [shapes|scenes|kinds|time|skips ...] [--list] [--work runs/results]

    shapes    eight hollow shapes in three materials, 4 minutes each
    scenes    objects with full truth, and NeRF's chair with photos and normals alone, 30 minutes each
    kinds     objects of kinds that nothing else here is of, 8 minutes each, with pictures
    time      error against time: half a minute to 30 minutes, two objects, two seeds
    skips     training with and without what a step leaves out, by equal time and by equal steps
    paper     the published method with all its steps and 1/64 of its samples, beside preset cpu; hours
    ablation  what each part of the method is worth behind the refinement, by equal steps (splitnerf ablate); hours
    step, hash_grid, shading, split_sum, prefilter, occlusion, stability   by programs of their own

Renders what has to be rendered into WORK, trains, and scores what training alone exports and what the refinement delivers.
Each run becomes rows of PAGE.csv as soon as it ends; the command goes on where it was interrupted. Rows of other minutes or
images stay. --list says what is missing and how long it takes. Scenes of the folder SPLITNERF_DATA are left out where it is
not there. A run that fails leaves no row, and the next one begins. --blender PYTHON, an interpreter with bpy==5.0.1, has
Blender's Cycles relight the same views, by examples/blender_import.py; its images are scored as our own are.
"""

import argparse
import csv
import datetime
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import write_image
from splitnerf.data.json_files import read_json
from splitnerf.evaluate.scoring import Protocol, RelitViews, choose_views, relight_scores
from splitnerf.files import atomic_path
from splitnerf.refinement.refine import source_of
from splitnerf.training.metrics import METRICS
from splitnerf_tools.bench.charts import write_csv
from splitnerf_tools.bench.provenance import header, provenance
from splitnerf_tools.demo.scene import build_environment
from splitnerf_tools.synth.shapes import MATERIALS, SHAPES

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench.kinds import KINDS  # noqa: E402
from bench.programs import DATA, PROGRAMS, ROOT, SOURCES, is_fresh, run_program, splitnerf  # noqa: E402

SCORES = {  # column: the evaluation's keys, digits
    "relit, dB": (("relight", "psnr"), 1),
    "albedo, dB": (("albedo", "psnr"), 1),
    "unscaled relit, dB": (("relight", "raw", "psnr"), 1),
    "relit by Blender, dB": (("blender", "psnr"), 1),
    "novel views, dB": (("novel_view", "psnr"), 1),
    "normals, degrees": (("normal_mae_deg",), 1),
    "roughness": (("roughness_mae",), 2),
    "metallic": (("metallic_balanced_accuracy",), 2),
    "light, dB": (("light_psnr",), 1),
    "F-score": (("f_score",), 3),
    "steps": (("training", "step"), 0),
    "ms a step": (("training", "ms"), 1),
    "refinement, seconds": (("refinement", "seconds"), 0),
}
SKIPS = {  # what a step leaves out, with the settings that have it done
    "faint samples": ("sampling.min_weight=0",),
    "every other sample": ("step_scale=1", "min_step=0.005"),
    "shading of most samples": ("shades_per_ray=0",),
    "most steps of the light": ("light_step_every=1",),
}
ALONE = "--set", "refinement.enabled=false"  # training, without what comes after it


def with_settings(words: tuple, settings: tuple[str, ...]) -> tuple:
    """Words of `splitnerf train` with further settings."""
    return (*words, *(word for setting in settings for word in ("--set", setting)))


PAPER = with_settings(("--preset", "paper"), ("target_samples=4096", "mesh.resolution=192", "run.preview_every=1"))
PAPER = with_settings(PAPER, ("light_samples=2048", "light_queries=2048"))
SETTINGS: dict[str, tuple] = {  # by name: words of `splitnerf train`
    "cpu": (),
    "paper": PAPER,
    "all skips": ALONE,
    **{f"without: {name}": with_settings(ALONE, offs) for name, offs in SKIPS.items()},
    "no skips": with_settings(ALONE, tuple(off for offs in SKIPS.values() for off in offs)),
}
STEPS_TAKE = {"paper": 570, "ablation": 128, "stability": 60}  # minutes on two cores; other programs and runs: 3
MOST_LINES = 9  # of a page's table; a longer one lists what runs deliver, and its CSV file has the rest
KEYS = ("scene", "settings", "minutes", "seed", "images", "threads", "asset")
COLUMNS = (*KEYS, *SCORES, "seconds", "kernels", "commit", "date")
HARD = {  # the light of the photos; three others relight it
    "knot": "lebombo_1k.hdr",
    "rings": "christmas_photo_studio_07_1k.hdr",
    "basket": "potsdamer_platz_1k.hdr",
    "helm": "potsdamer_platz_1k.hdr",
    "casket": "christmas_photo_studio_07_1k.hdr",
    "brushed": "blender_interior.exr",
    "wheel": "blender_courtyard.exr",
    "porcelain": "potsdamer_platz_1k.hdr",
    "gilded": "blender_forest.exr",
    "wires": "lebombo_1k.hdr",
}
SIZES = {"chair": 400}  # of images that are not the page's
RELIGHTS = "blender_city.exr", "blender_sunset.exr", "kloppenheim_05_1k.hdr"
Row = dict[str, str]


@dataclass(frozen=True)
class Page:
    """A page: its title, what it holds, and its runs: settings and minutes, 0 for as long as `steps` take."""

    title: str
    scenes: tuple[str, ...]
    runs: tuple[tuple[str, float], ...]
    size: int
    seeds: int = 1
    pictures: bool = False
    steps: int = 0
    table: tuple[str, tuple[str, ...], tuple[str, ...]] | None = (
        None  # by lines and columns, and what it holds; None: all rows
    )


PAGES = {
    "shapes": Page(
        "Hollow shapes",
        tuple(f"{shape} {material}" for shape in SHAPES for material in MATERIALS),
        (("cpu", 4),),
        120,
        table=("shape", ("material",), ("F-score", "normals, degrees", "albedo, dB", "novel views, dB")),
    ),
    "scenes": Page(
        "Objects",
        ("boombox", "avocado", "corset", "teapot", "knot", "rings", "basket", "helm", "casket", "chair"),
        (("cpu", 30),),
        200,
    ),
    "kinds": Page("Unseen kinds", tuple(KINDS), (("cpu", 8),), 100, pictures=True),
    "time": Page(
        "Error against time",
        ("boombox", "knot"),
        tuple(("cpu", m) for m in (0.5, 1, 2, 4, 8, 15, 30)),
        200,
        2,
        table=("minutes", ("scene", "asset"), ("relit, dB", "albedo, dB")),
    ),
    "skips": Page(
        "Training with and without its skips",
        ("boombox", "knot"),
        tuple((name, minutes) for minutes in (2, 0) for name in SETTINGS if "skips" in name or "without" in name),
        200,
        steps=3000,
        table=("settings", ("scene", "minutes"), ("relit, dB", "albedo, dB", "ms a step")),
    ),
    "paper": Page(
        "The published method, 1/64 of the samples, all steps",
        ("boombox",),
        (("cpu", 8), ("paper", 0)),
        200,
        steps=20000,
    ),
}
NAMES = *PAGES, *PROGRAMS


def data_of(scene: str, size: int, work: Path) -> Path | None:
    """The folder of a scene's images, which are rendered if they are not there yet; None where that is impossible."""
    if (ready := DATA / ("nerf_synthetic_400" if scene in SIZES else "scenes") / scene).is_dir():
        return ready
    data, counts = (
        work / f"data/{scene.replace(' ', '_')}_{size}",
        ("--size", size, "--train", 60, "--test", 6, "--spp", 64),
    )
    if (data / "transforms_test.json").is_file():  # the last file of a data set
        return data
    shutil.rmtree(data, ignore_errors=True)
    if scene in HARD:
        light, relights = DATA / "hdri" / HARD[scene], [DATA / "hdri" / name for name in RELIGHTS]
        if not light.is_file():
            return None
        script = Path(__file__).with_name("hard_scenes.py")
        subprocess.run([sys.executable, script, work, "--only", scene], check=True)
        words = work / f"{scene}.glb", "--light", light, "--relight", *relights
    elif " " in scene:
        light = work / "demo_sky.hdr"
        write_image(light, build_environment())
        shape, material = scene.split()
        words = "--shape", shape, "--material", material, "--light", light
    else:
        return None
    return data if splitnerf("synth", *words, "--out", data, *counts) else None


def relit_by_blender(python: Path, asset: Path, data: Path, run: Path, n_views: int = 6, spp: int = 64) -> dict:
    """The scores of an asset's views under the data's maps, rendered and denoised by Cycles; empty where there is no map."""
    views, maps = choose_views(load_dataset(data, "test"), Protocol(views=n_views))
    if not maps:
        return {}
    cameras, picture, images = run / "cameras.json", run / "blender.png", {name: [] for name in maps}
    keys = "fl_x", "fl_y", "cx", "cy"
    frames = [
        {"transform_matrix": pose.tolist(), "w": views.width, "h": views.height} | dict(zip(keys, map(float, lens)))
        for pose, lens in zip(views.world_poses, views.intrinsics)
    ]
    cameras.write_text(json.dumps({"frames": frames}))
    script, words = ROOT / "examples/blender_import.py", ("--denoise", "--spp", spp, "--out", picture)
    for name, light in maps.items():
        for frame in range(n_views):
            command = [python, script, asset, light, cameras, *words, "--frame", frame]
            subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
            images[name].append(np.asarray(Image.open(picture)))
    return relight_scores(RelitViews(images, views, spp))


def rows_of(
    scene: str, settings: str, minutes: float, seed: int, page: Page, work: Path, blender: Path | None
) -> list[Row]:
    """Trains on a scene and scores the run; no rows where that failed or the data are not there."""
    if (data := data_of(scene, page.size, work)) is None:
        print(f"{scene}: no data, left out", file=sys.stderr)
        return []
    run = work / f"runs/{scene} {settings} {minutes:g} {seed}".replace(" ", "_").replace(":", "")
    facts = provenance(SOURCES)  # before, as the sources may change meanwhile
    limits = ("--max-minutes", minutes, "--overwrite")
    if not minutes:  # this may take hours
        limits = "--steps", page.steps, "--resume", "auto"
    if not splitnerf("train", data, "--out", run, *SETTINGS[settings], *limits, "--seed", seed):
        return []
    rows, files = [], {"trained": source_of(run) / "mesh.glb", "refined": run}
    if source_of(run) == run:
        del files["refined"]
    for asset, file in files.items():
        scores = run / f"{asset}.json"
        if not splitnerf("evaluate", file, "--data", data, "--spp", 64, "--views", 6, "--out", scores):
            return []
        threads = os.environ.get("OMP_NUM_THREADS", "all")
        size = SIZES.get(scene, page.size)
        key = dict(zip(KEYS, (scene, settings, f"{minutes:g}", str(seed), str(size), threads, asset)))
        whole = read_json(run / "evaluation.json", "seconds")
        found = read_json(scores, "novel_view") | {name: whole.get(name) for name in ("seconds", "refinement")}
        found["training"] = late_steps(run)
        if blender:
            found["blender"] = relit_by_blender(blender, file if file.is_file() else file / "mesh.glb", data, run)
        rows.append(key | scored(found) | {name: facts[name] for name in ("kernels", "commit")})
    if page.pictures:
        (sheet := sheet_of(scene, work)).unlink(missing_ok=True)
        splitnerf("evaluate", run, "--data", data, "--spp", 64, "--views", 1, "--sheet", sheet)
    return rows


def late_steps(run: Path) -> dict:
    """How many steps a run made, and the time of one in its last fifth."""
    lines = [json.loads(line) for line in (run / METRICS).read_text().splitlines()]
    last = lines[-1]
    first = min(
        lines[:-1], key=lambda line: abs(line["step"] - 0.8 * last["step"]), default={"step": 0, "seconds": 0.0}
    )
    return {"step": last["step"], "ms": 1e3 * (last["seconds"] - first["seconds"]) / (last["step"] - first["step"])}


def sheet_of(scene: str, work: Path) -> Path:
    """The pictures of the newest run of a scene."""
    return work / f"{scene.replace(' ', '_')}.png"


def scored(evaluation: dict) -> Row:
    """The columns of a row that follow from an evaluation; scores without truth are empty."""
    row = {"seconds": f"{evaluation.get('seconds') or 0:.0f}"}
    for column, (keys, digits) in SCORES.items():
        value = evaluation
        for name in keys:
            value = value.get(name) if isinstance(value, dict) else None
        row[column] = "" if value is None else f"{value:.{digits}f}"
    return row | {"date": f"{datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M}"}


def read_rows(path: Path) -> list[Row]:
    """The rows of an earlier table; none without a file."""
    if not path.is_file():
        return []
    with open(path, newline="") as file:
        lines = list(file)
    of_all = {"settings": "cpu"} | dict(
        line[2:].strip().split(": ", 1) for line in lines if line.startswith("# kernels: ")
    )
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    return [dict.fromkeys(COLUMNS, "") | of_all | row for row in rows]


def write_page(out: Path, name: str, rows: list[Row], work: Path) -> None:
    """Writes NAME.csv and NAME.md; the head names the commit of the oldest row, from which the page is stale."""
    page, oldest = PAGES[name], min(rows, key=lambda row: row["date"])
    facts = provenance(SOURCES, f"make results PAGE={name}") | {key: oldest[key] for key in ("kernels", "commit")}
    facts["date"] = oldest["date"][:10]
    of_rows = ("threads", "processor", "kernels") if len({row["kernels"] for row in rows}) > 1 else ("threads",)
    facts = {name: value for name, value in facts.items() if name not in of_rows}
    write_csv(out / f"{name}.csv", facts, [COLUMNS, *([row[column] for column in COLUMNS] for row in rows)])
    lines = [f"# {page.title}", "", header(facts), ""]
    if name == "time":
        draw(out / f"{name}.png", rows)
        lines += [f"![Relit views and albedo against minutes]({name}.png)", ""]
    if page.pictures:
        sheets = [sheet_of(scene, work) for scene in dict.fromkeys(row["scene"] for row in rows)]
        pictures = [np.asarray(Image.open(sheet).convert("RGB")) for sheet in sheets if sheet.is_file()]
        Image.fromarray(np.concatenate(pictures, axis=1)).reduce(2).save(out / f"{name}.jpg", quality=80)
        lines += [f"![A view of each: truth, prediction, four times the error]({name}.jpg)", ""]
    lines += [
        "*trained* is what training alone exports, *refined* what a run of these minutes delivers. [How scores are defined](../results.md#how-scores-are-defined)",
        "",
        *(table_of(rows, page) if page.table is None else table_of_means(rows, page)),
        "",
        *(means(rows) if page.table is None else ()),
    ]
    with atomic_path(out / f"{name}.md") as temporary:
        temporary.write_text("\n".join(lines))


def table_of(rows: list[Row], page: Page) -> list[str]:
    """A line for each row, those of training alone left out where there are many."""
    always = {"scene", "minutes", *(column for column in SCORES if any(row[column] for row in rows))}
    shown = [column for column in COLUMNS if len({row[column] for row in rows}) > 1 or column in always]
    if len(rows) > MOST_LINES:
        rows = [row for row in rows if row["asset"] == "refined"]
    lines = [shown, ["---"] * len(shown), *([cell(row, column, page) for column in shown] for row in rows)]
    return [f"| {' | '.join(line)} |" for line in lines]


def table_of_means(rows: list[Row], page: Page) -> list[str]:
    """Means over rows that stand at the same place of the page's table."""
    down, across, values = page.table
    if "asset" not in across and any(row["asset"] == "refined" for row in rows):
        rows = [row for row in rows if row["asset"] == "refined"]
    places: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        row = row | dict(zip(("shape", "material"), row["scene"].split()))
        units = (" minutes" * (key == "minutes" and row[key] != "0") for key in across)
        column = ", ".join(cell(row, key, page) + unit for key, unit in zip(across, units))
        places.setdefault((cell(row, down, page), column), []).append(row)
    columns = list(dict.fromkeys(column for _, column in places))
    lines = [[down, *columns], ["---"] * (1 + len(columns))]
    for line in dict.fromkeys(line for line, _ in places):
        found = [places.get((line, column), []) for column in columns]
        lines.append([line, *(" / ".join(mean_of(here, value) for value in values) for here in found)])
    what = f"Each place of the table: {' / '.join(values)}; means over seeds. Commits and all other scores are in the CSV file."
    return [what, "", *(f"| {' | '.join(line)} |" for line in lines)]


def mean_of(rows: list[Row], column: str) -> str:
    """The mean of a column in its digits; "-" without a number."""
    found = [float(row[column]) for row in rows if row[column]]
    return f"{sum(found) / len(found):.{SCORES[column][1]}f}" if found else "-"


def place(row: Row, page: Page) -> tuple:
    """By which the rows of a page are sorted."""
    at = page.scenes.index(row["scene"]) if row["scene"] in page.scenes else len(page.scenes)
    return at, float(row["minutes"]), row["seed"], row["asset"] == "refined"


def cell(row: Row, column: str, page: Page) -> str:
    """The text of a row's column."""
    return f"{page.steps} steps" if (column, row[column]) == ("minutes", "0") else row[column] or "-"


def means(rows: list[Row]) -> list[str]:
    """A line for each number of minutes: the means of the refined rows over scenes and seeds."""
    lines = []
    for minutes in sorted({row["minutes"] for row in rows}, key=float):
        here = (row for row in rows if row["minutes"] == minutes and row["asset"] == "refined")
        chosen = [row for row in here if any(row[column] for column in list(SCORES)[:4])]
        values = {column: [float(row[column]) for row in chosen if row[column]] for column in list(SCORES)[:4]}
        text = ", ".join(f"{column[:-4]} {sum(v) / len(v):.1f} dB" for column, v in values.items() if v)
        if chosen:
            lines.append(f"Mean of {len(chosen)} runs of {minutes} minutes: {text}.")
    return [*lines, ""]


def draw(path: Path, rows: list[Row]) -> None:
    """Relit views and albedo against minutes, a line for each scene and asset through the means of the seeds."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for axis, column in zip(axes, list(SCORES)[:2]):
        for k, scene in enumerate(dict.fromkeys(row["scene"] for row in rows)):
            for asset, style in (("trained", "--"), ("refined", "-")):
                found: dict[float, list[float]] = {}
                for row in rows:
                    if row["scene"] == scene and row["asset"] == asset and row[column]:
                        found.setdefault(float(row["minutes"]), []).append(float(row[column]))
                x = sorted(found)
                axis.plot(
                    x, [sum(found[m]) / len(found[m]) for m in x], style, color=f"C{k}", label=f"{scene}, {asset}"
                )
                axis.plot([m for m in x for _ in found[m]], [v for m in x for v in found[m]], ".", color=f"C{k}")
        axis.set(xscale="log", xlabel="minutes", ylabel=column, xticks=x, xticklabels=[f"{m:g}" for m in x])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].legend()
    figure.savefig(path, dpi=110)


def key_of(row: Row) -> tuple:
    """What a run of a page is known by."""
    return tuple(row[key] for key in KEYS[:4])


def missing(name: str, args: argparse.Namespace) -> Iterator[tuple[str, str, float, int]]:
    """Scene, settings, minutes and seed of each run that a page lacks."""
    if name in PROGRAMS:
        if args.again or not is_fresh(args.out / f"{name}.md"):
            yield "by a program of its own", name, 0, 0
        return
    page, there = PAGES[name], set(map(key_of, () if args.again else read_rows(args.out / f"{name}.csv")))
    for seed in range(page.seeds):
        for scene in args.only or page.scenes:
            for settings, minutes in [("cpu", m) for m in args.minutes or ()] or page.runs:
                if (scene, settings, f"{minutes:g}", str(seed)) not in there:
                    yield scene, settings, minutes, seed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", metavar="PAGE", help=f"{', '.join(NAMES)} (default: all)")
    parser.add_argument("--work", type=Path, default=ROOT / "runs/results", help="folder of data and runs")
    parser.add_argument("--only", nargs="+", metavar="SCENE", help="these scenes of a page")
    parser.add_argument("--minutes", nargs="+", type=float, help="of each run, in place of the page's")
    parser.add_argument("--again", action="store_true", help="make rows anew that are there")
    parser.add_argument("--list", action="store_true", help="say what is missing, and run nothing")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks", help="default: docs/benchmarks")
    parser.add_argument("--blender", type=Path, metavar="PYTHON", help="relight by Blender too; needs bpy==5.0.1 there")
    args = parser.parse_args()
    if unknown := [name for name in args.pages if name not in NAMES]:
        parser.error(f"unknown page {unknown[0]}; there are {', '.join(NAMES)}")
    args.work.mkdir(parents=True, exist_ok=True)
    runs = [(name, *run) for name in args.pages or NAMES for run in missing(name, args)]
    takes = [minutes or STEPS_TAKE.get(settings, 3) for _, _, settings, minutes, _ in runs]
    for (name, scene, settings, _, seed), minutes in zip(runs, takes) if args.list else ():
        print(f"{name}: {scene}, {settings}, {minutes:g} minutes, seed {seed}")
    print(f"{sum(takes):g} minutes are missing", flush=True)
    failed = False
    for name, scene, settings, minutes, seed in () if args.list else runs:
        if name in PROGRAMS:
            failed |= not run_program(name, args.out, args.work)
            continue
        found = rows_of(scene, settings, minutes, seed, PAGES[name], args.work, args.blender)
        failed |= not found
        if found:
            key, now = key_of(found[0]), read_rows(args.out / f"{name}.csv")  # a second process may have added rows
            rows = sorted([*(r for r in now if key_of(r) != key), *found], key=lambda row: place(row, PAGES[name]))
            write_page(args.out, name, rows, args.work)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
