"""splitnerf bench."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from splitnerf.cli.exit_codes import DONE, FAILED
from splitnerf.errors import InputError

# Modules of splitnerf.bench, each with run(quick, rounds).
BENCHMARKS = ("prefilter", "split_sum", "hash_grid", "shading", "occlusion")


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bench", help="measure run time against error",
        description="Without BENCHMARK: checks the operators, times them beside plain torch and whatever peers are installed "
        "(drjit, open3d, mitsuba), and writes a table, a CSV file and a picture each. Measured maps and meshes are taken from "
        "the folder SPLITNERF_DATA, else procedural ones.",
    )  # fmt: skip
    parser.add_argument(
        "--quick", action="store_true", help="small inputs: a few minutes, to run before and after a change"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", choices=BENCHMARKS,
        help=f"only this one of {', '.join(BENCHMARKS)}; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of the files (default: docs/benchmarks in a checkout, else here)",
    )
    parser.set_defaults(execute=run_operators)
    benchmarks = parser.add_subparsers(dest="benchmark", metavar="BENCHMARK")
    skip = benchmarks.add_parser(
        "skip", help="what it is worth to leave out what a scene does not need",
        description="Trains on DATA without any skip, with one at a time, and with all, for M minutes and for as many steps as "
        "the first run made, and prints steps a second as a ratio, and the PSNR of novel views at equal steps and time.",
    )  # fmt: skip
    skip.add_argument("--data", type=Path, required=True, metavar="DATA")
    skip.add_argument("--minutes", type=float, default=3.0, metavar="M", help="training time of each run (default: 3)")
    skip.add_argument("--downscale", type=int, default=1, metavar="N", help="average images down by N (default: 1)")
    skip.add_argument(
        "--against", type=Path, metavar="SPLITNERF", help="the program of another build, for the first line"
    )
    skip.add_argument("--out", type=Path, metavar="OUT", help="keep the runs (default: a folder that is removed)")
    skip.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="settings", help="change a setting of all runs"
    )
    skip.set_defaults(execute=run_skip)
    stability = benchmarks.add_parser(
        "stability", help="how far each operator is from the truth on inputs made to break it",
        description="Compares every operator in float32 with float64 on adversarial inputs, searches for the worst of them, asks "
        "these again in 50 digits, and writes the worst errors and their inputs. Exits with 1 where one breaks its promise.",
    )  # fmt: skip
    stability.add_argument(
        "--cases", type=int, default=10**7, metavar="N", help="inputs of an operator (default: 10^7)"
    )
    stability.add_argument(
        "--op", action="append", default=[], metavar="NAME", help="only this operator; may be repeated"
    )
    stability.add_argument("--seed", type=int, default=0, metavar="S", help="of the inputs (default: 0)")
    stability.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of the tables (default: docs/benchmarks in a checkout, else here)",
    )
    stability.set_defaults(execute=run_stability)


def default_folder() -> Path:
    return Path("docs/benchmarks") if Path("docs").is_dir() else Path()


def run_operators(args: argparse.Namespace) -> int:
    from splitnerf.bench.operators import run_benchmarks

    for path in run_benchmarks(args.only or BENCHMARKS, args.quick, args.out or default_folder(), print_now):
        print(path)
    return DONE


def print_now(line: str) -> None:
    print(line, flush=True)


def run_skip(args: argparse.Namespace) -> int:
    from splitnerf.bench.skip import run_other, skip_table
    from splitnerf.config import parse_setting, preset
    from splitnerf.workflow import load_splits

    if args.minutes <= 0:
        raise InputError(f"--minutes must be positive, got {args.minutes}")
    if args.out is not None and args.out.exists() and any(args.out.iterdir()):
        raise InputError(f"{args.out}: is not empty; give another --out")
    full = preset("cpu").replace(dict(parse_setting(text) for text in args.settings))
    training, test = load_splits(args.data, args.downscale)
    if test is None:
        raise InputError(f"{args.data}: has no test views to score")
    with tempfile.TemporaryDirectory() as temporary:
        out = args.out or Path(temporary)
        out.mkdir(parents=True, exist_ok=True)
        other = None
        if args.against is not None:
            other = lambda: run_other(args.against, args.data, args.minutes, args.downscale, out / "against")  # noqa: E731
        skip_table(full, args.minutes, training, test, out, other, print_now)
    return DONE


def run_stability(args: argparse.Namespace) -> int:
    if args.cases < 1:
        raise InputError(f"--cases must be positive, got {args.cases}")
    from splitnerf.bench.stability.table import chosen, run_all, write

    out = args.out or default_folder()
    results, verdicts = run_all(chosen(args.op), args.cases, args.seed, print_now)
    for path in write(results, verdicts, args.seed, out):
        print(path)
    return DONE if all(x.holds for x in (*results, *verdicts)) else FAILED
