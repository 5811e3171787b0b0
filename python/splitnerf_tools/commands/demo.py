"""splitnerf demo."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from splitnerf.cli.common import DONE, INTERRUPTED, Stages, examples, print_summary
from splitnerf.cli.train import budget
from splitnerf.errors import InputError


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "demo",
        help="render a small scene, reconstruct it and print the errors against its truth",
        description="Makes a scene with known shape, materials and sky, renders it with the built-in path tracer, "
        "trains on it and prints the errors. Nothing is downloaded.",
        epilog=examples("splitnerf demo", "splitnerf demo --max-minutes 1 --out runs/short --overwrite"),
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("runs/demo"), metavar="RUN", help="the run's folder (default: runs/demo)")
    add("--max-minutes", type=float, default=4.0, metavar="M", help="time of training and refinement (default: 4)")
    add("--no-refine", action="store_true", help="no refinement: training gets all minutes")
    add("--seed", type=int, default=0)
    add("--overwrite", action="store_true", help="replace the run in --out")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import preset
    from splitnerf.data.frames import refuse_data
    from splitnerf.files import locked, own_folder
    from splitnerf.pipeline import reconstruct
    from splitnerf.run_folder import check_run, present_in

    from splitnerf_tools.demo.scene import write_demo_dataset

    settings = {"run.seed": args.seed, "refinement.enabled": not args.no_refine, **budget(None, args.max_minutes)}
    config, data = preset("cpu").replace(settings), args.out / "data"
    with locked(args.out):
        if present_in(args.out) and not args.overwrite:
            again = f"continue with `splitnerf train {data} --out {args.out} --resume`"
            raise InputError(
                f"{args.out}: holds a run already; {again}, replace it with --overwrite, or give another --out"
            )
        check_run(args.out, resume=False, overwrite=args.overwrite)
        if not args.overwrite:
            refuse_data(data)
        own_folder(data)
        print(f"rendering the demo scene into {data} ...", file=sys.stderr)
        write_demo_dataset(data, seed=args.seed)
        trained, evaluation = reconstruct(data, args.out, config, overwrite=args.overwrite, observer=Stages())
    if evaluation is None:
        print(f"stopped; the state is in {args.out}. To continue: splitnerf train {data} --out {args.out} --resume")
        return INTERRUPTED
    print_summary(args.out, evaluation, trained.step, trained.seconds)
    return DONE
