"""Reconstructions of the built-in hollow shapes: docs/benchmarks/shapes.csv and shapes.md.

    python tests/bench/shapes.py WORK [--only mug bowl] [--materials glossy] [--minutes 4] [--light MAP.hdr] [--again]

Renders each shape in each material into WORK, trains on it with `splitnerf train`, and takes the scores that training
writes at its end. Existing rows with the same minutes and images are kept, so that an interrupted
table continues; --again makes them and their data anew. A run that fails leaves no row, and the next one begins.
"""

import argparse
import csv
import datetime
import shutil
import subprocess
import sys
from pathlib import Path

from splitnerf.data.images import write_image
from splitnerf.evaluate.scoring import read_evaluation
from splitnerf.files import atomic_path
from splitnerf_tools.bench.charts import write_csv
from splitnerf_tools.bench.provenance import header, provenance
from splitnerf_tools.demo.scene import build_environment
from splitnerf_tools.synth.shapes import MATERIALS, SHAPES

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf")
SCORES = {  # column: the evaluation's keys, digits
    "F-score": (("f_score",), 3),
    "chamfer": (("chamfer",), 4),
    "normals, degrees": (("normal_mae_deg",), 1),
    "novel views, dB": (("novel_view", "psnr"), 1),
    "albedo, dB": (("albedo", "psnr"), 1),
    "light, dB": (("light_psnr",), 1),
}
KEYS = ("shape", "material", "minutes", "images")
COLUMNS = (*KEYS, *SCORES, "commit", "date")
Row = dict[str, str]


def splitnerf(*words: object) -> bool:
    """Runs a command of the program; returns whether it succeeded."""
    return subprocess.run([sys.executable, "-m", "splitnerf", *map(str, words)]).returncode == 0


def evaluation(shape: str, material: str, images: str, light: Path, args: argparse.Namespace) -> dict | None:
    """Renders the data if they are not there yet, trains, and returns the run's scores; None where it failed."""
    data, run = (args.work / kind / images / f"{shape}_{material}" for kind in ("data", "runs"))
    if args.again or not (data / "transforms_test.json").is_file():  # the last file of a data set
        shutil.rmtree(data, ignore_errors=True)
        counts = ("--size", args.size, "--train", args.train, "--test", args.test, "--spp", args.spp)
        if not splitnerf("synth", "--shape", shape, "--material", material, "--light", light, "--out", data, *counts):
            return None
    if not splitnerf("train", data, "--out", run, "--max-minutes", args.minutes, "--overwrite"):
        return None
    return read_evaluation(run)


def score_row(key: tuple[str, ...], scores: dict, commit: str) -> Row:
    """A line of the table; scores without truth are empty."""
    row = dict(zip(KEYS, key))
    for column, (keys, digits) in SCORES.items():
        value = scores
        for name in keys:
            value = None if value is None else value[name]
        row[column] = "" if value is None else f"{value:.{digits}f}"
    now = datetime.datetime.now(datetime.timezone.utc)
    return row | {"commit": commit, "date": f"{now:%Y-%m-%d %H:%M}"}


def read_rows(path: Path) -> list[Row]:
    """The rows of an earlier table; none without a file."""
    if not path.is_file():
        return []
    with open(path, newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def place(row: Row) -> tuple:
    """Where a row stands in the table."""
    shape, material = list(SHAPES).index(row["shape"]), list(MATERIALS).index(row["material"])
    return shape, material, float(row["minutes"]), row["images"]


def write_tables(out: Path, rows: list[Row]) -> None:
    """Writes shapes.csv and shapes.md; the head names the commit of the oldest row, from which the table is stale."""
    oldest = min(rows, key=lambda row: row["date"])
    facts = provenance(SOURCES) | {"commit": oldest["commit"], "date": oldest["date"][:10]}
    write_csv(out / "shapes.csv", facts, [COLUMNS, *([row[column] for column in COLUMNS] for row in rows)])
    lines = [
        "# Hollow shapes",
        "",
        header(facts),
        "",
        "`splitnerf train` on the shapes that `splitnerf synth --shape` renders, for the minutes named. Images: width,",
        "train + test views, paths a pixel, light. Chamfer: in radii of the sphere around the shape. F-score: at 1 %",
        "of the bounding box's diagonal. [results.md](../results.md) defines the others.",
        "",
        "| " + " | ".join(COLUMNS) + " |",
        "|" + " --- |" * len(COLUMNS),
        *("| " + " | ".join(row[column] or "-" for column in COLUMNS) + " |" for row in rows),
    ]
    with atomic_path(out / "shapes.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path, help="folder of data and runs")
    parser.add_argument("--only", nargs="+", choices=SHAPES, default=list(SHAPES), help="shapes (default: all)")
    parser.add_argument("--materials", nargs="+", choices=MATERIALS, default=list(MATERIALS), help="default: all")
    parser.add_argument("--minutes", type=float, default=4.0, help="of each training (default: 4)")
    parser.add_argument("--light", type=Path, help="environment map (default: the sky of `splitnerf demo`)")
    parser.add_argument("--size", type=int, default=120, help="of the images in pixels (default: 120)")
    parser.add_argument("--train", type=int, default=60, help="number of train views (default: 60)")
    parser.add_argument("--test", type=int, default=6, help="number of test views (default: 6)")
    parser.add_argument("--spp", type=int, default=64, help="paths a pixel (default: 64)")
    parser.add_argument("--again", action="store_true", help="make rows anew that are there")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/benchmarks", help="default: docs/benchmarks")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    light = args.light
    if light is None:
        light = args.work / "demo_sky.hdr"
        write_image(light, build_environment())
    images = f"{args.size}px_{args.train}+{args.test}_{args.spp}spp_{light.stem}"
    rows = {tuple(row[key] for key in KEYS): row for row in read_rows(args.out / "shapes.csv")}
    failed = False
    for shape in args.only:
        for material in args.materials:
            key = (shape, material, f"{args.minutes:g}", images)
            if key in rows and not args.again:
                continue
            commit = provenance(SOURCES)["commit"]  # before, as the sources may change meanwhile
            scores = evaluation(shape, material, images, light, args)
            if scores is None:
                print(f"{shape}, {material}: failed, no row", file=sys.stderr)
                failed = True
                continue
            rows[key] = score_row(key, scores, commit)
            write_tables(args.out, sorted(rows.values(), key=place))
            print(", ".join(f"{column} {rows[key][column]}" for column in COLUMNS))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
