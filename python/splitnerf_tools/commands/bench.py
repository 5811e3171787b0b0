"""splitnerf bench."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.common import DONE

# Modules of splitnerf_tools.bench, each with run(quick, rounds), and what they compare.
BENCHMARKS = {
    "prefilter": "estimators of the light's integral over a lobe: time against error",
    "occlusion": "traced rays against cached bits, and against Open3D, trimesh and Mitsuba",
}


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bench",
        help="measure run time against error",
        description="Checks the operators, times them and the peers that are installed (drjit, open3d, mitsuba), and writes for "
        "each benchmark a page, a CSV file and a picture. Measured maps and meshes are taken from the folder SPLITNERF_DATA, "
        "else procedural ones.",
    )
    parser.add_argument(
        "name",
        nargs="?",
        choices=tuple(BENCHMARKS),
        metavar="BENCHMARK",
        help="; ".join(f"{name}: {what}" for name, what in BENCHMARKS.items()) + " (default: all)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="small inputs: a few minutes, to run before and after a change"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=Path("docs/benchmarks") if Path("docs").is_dir() else Path(),
        help="folder of the files (default: docs/benchmarks in a checkout, else here)",
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf_tools.bench.harness import run_benchmarks

    modules = [f"splitnerf_tools.bench.{name}" for name in ([args.name] if args.name else BENCHMARKS)]
    for path in run_benchmarks(modules, args.quick, args.out, lambda line: print(line, flush=True)):
        print(path)
    return DONE
