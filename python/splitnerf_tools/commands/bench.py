"""splitnerf bench."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from splitnerf.cli.exit_codes import DONE, INTERRUPTED
from splitnerf.errors import InputError

# Modules of splitnerf_tools.bench, each with run(quick, rounds), and what they compare.
OPERATORS = {
    "prefilter": "estimators of the light's integral over a lobe: time against error",
    "normals": "analytic normals against finite differences: time against angle",
    "occlusion": "traced rays against cached bits, and against Open3D, trimesh and Mitsuba",
    "path_tracer": "error against time, with Mitsuba",
}


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bench", help="measure run time against error",
        description=f"Without BENCHMARK: {', '.join(OPERATORS)}. Each checks the operators, times them and "
        "the peers that are installed (drjit, open3d, mitsuba), and writes a page, a CSV file and a picture. "
        "Measured maps and meshes are taken from the folder SPLITNERF_DATA, else procedural ones.",
    )  # fmt: skip
    add_quick(parser, default=False)
    add_out(parser, default=None)
    parser.set_defaults(execute=run_operators)
    benchmarks = parser.add_subparsers(dest="benchmark", metavar="BENCHMARK")
    for name, what in OPERATORS.items():
        operator = benchmarks.add_parser(name, help=what, description=f"Measures {what}.")
        add_quick(operator)
        add_out(operator)
    add_whole(benchmarks)


def add_whole(benchmarks: argparse._SubParsersAction) -> None:
    whole = benchmarks.add_parser(
        "whole", help="error of novel views, albedo and relit views against wall time",
        description="Trains on each DATA for each of the times, with the preset cpu, with the preset paper, and with one setting "
        "changed at a time that buys time with error or error with time, and draws what each reaches. Repeat the command with the "
        "same --runs to continue or to add times.",
    )  # fmt: skip
    whole.add_argument("--data", type=Path, action="append", required=True, metavar="DATA", help="may be repeated")
    whole.add_argument("--minutes", default="0.5,2", metavar="LIST", help="training times, by commas (default: 0.5,2)")
    whole.add_argument("--only", metavar="LIST", help="names of configurations, by semicolons (default: all)")
    whole.add_argument("--runs", type=Path, default=Path("runs/whole"), metavar="RUNS", help="default: runs/whole")
    whole.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    whole.add_argument("--views", type=int, metavar="N", help="test views to score (default: all)")
    whole.add_argument("--spp", type=int, default=32, metavar="N", help="paths a pixel of relit views (default: 32)")
    whole.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="change a setting of all runs"
    )
    add_out(whole)
    whole.set_defaults(execute=run_whole)


def add_quick(parser: argparse.ArgumentParser, default: object = argparse.SUPPRESS) -> None:
    where = "small inputs: a few minutes, to run before and after a change"
    parser.add_argument("--quick", action="store_true", default=default, help=where)


def add_out(parser: argparse.ArgumentParser, default: object = argparse.SUPPRESS) -> None:
    where = "folder of the files (default: docs/benchmarks in a checkout, else here)"
    parser.add_argument("--out", type=Path, default=default, metavar="DIR", help=where)


def default_folder() -> Path:
    return Path("docs/benchmarks") if Path("docs").is_dir() else Path()


def run_operators(args: argparse.Namespace) -> int:
    from splitnerf_tools.bench.harness import run_benchmarks

    names = [args.benchmark] if args.benchmark else OPERATORS
    modules = [f"splitnerf_tools.bench.{name}" for name in names]
    for path in run_benchmarks(modules, args.quick, args.out or default_folder(), print_now):
        print(path)
    return DONE


def print_now(line: str) -> None:
    print(line, flush=True)


def run_whole(args: argparse.Namespace) -> int:
    from splitnerf.config import parse_setting
    from splitnerf.evaluate.jobs import Protocol
    from splitnerf.files import locked
    from splitnerf_tools.ablate.job import Interrupted
    from splitnerf_tools.bench.charts import write_result
    from splitnerf_tools.bench.whole import NAMES, configurations, whole

    try:
        minutes = [float(text) for text in args.minutes.split(",")]
    except ValueError:
        minutes = []
    if not minutes or not all(0 < value < math.inf for value in minutes):
        raise InputError(f"--minutes takes positive numbers with commas between them, got {args.minutes!r}")
    names = NAMES if args.only is None else [name.strip() for name in args.only.split(";") if name.strip()]
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        raise InputError(f"--only: no configuration is called {unknown[0]!r}; there are: {'; '.join(NAMES)}")
    scenes = list(dict.fromkeys(path.resolve() for path in args.data))
    if len({scene.name for scene in scenes}) < len(scenes):
        raise InputError("two DATA folders have the same name; measure them into different --runs")
    configs = configurations(names, dict(parse_setting(text) for text in args.settings))
    protocol = Protocol(args.downscale, args.views, args.spp)
    try:
        with locked(args.runs):
            result = whole(scenes, configs, minutes, protocol, args.runs, print_now)
    except Interrupted:
        print(f"stopped; the state is in {args.runs}. To continue, repeat the command.")
        return INTERRUPTED
    for path in write_result(result, args.out or default_folder()):
        print(path)
    return DONE
