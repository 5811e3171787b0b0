"""Compares every operator in float32 with float64 on adversarial inputs, searches for the worst of them, asks these
again in 50 digits, and writes the worst errors and their inputs. Exits with 1 where an operator breaks its promise.

    PYTHONPATH=tests python -m stability [--cases 10000000] [--op NAME ...]
"""

import argparse
import sys
from pathlib import Path

import torch
from splitnerf.errors import InputError

DONE, BROKEN, BAD_INPUT = 0, 1, 2


def parse(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="stability", description=__doc__.split("\n\n")[0])
    parser.add_argument("--cases", type=int, default=10**7, metavar="N", help="inputs of an operator (default: 10^7)")
    parser.add_argument("--op", action="append", default=[], metavar="NAME", help="only this operator; may be repeated")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="seed of the inputs (default: 0)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="operators at a time (default: 1)")
    parser.add_argument(
        "--out", type=Path, default=Path("docs/benchmarks"), metavar="DIR", help="default: docs/benchmarks"
    )
    return parser.parse_args(argv)


def command(args: argparse.Namespace) -> str:
    """What makes the same table again."""
    options = [f"--seed {args.seed}", *(f"--op {name}" for name in args.op)]
    return f"make stability STABILITY_CASES={args.cases} STABILITY_OPTIONS='{' '.join(options)}'"


def main(argv: list[str] | None = None) -> int:
    args = parse(argv)
    try:
        if args.cases < 1:
            raise InputError(f"--cases must be positive, got {args.cases}")
        torch.set_num_threads(1)  # before the processes part
        from stability import table

        items, show = table.chosen(args.op), lambda line: print(line, flush=True)
        results, verdicts = table.run_all(items, args.cases, args.seed, show, args.jobs)
    except InputError as error:
        print(f"stability: {error}", file=sys.stderr)
        return BAD_INPUT
    for path in table.write(results, verdicts, command(args), args.out):
        print(path)
    return DONE if all(x.holds for x in (*results, *verdicts)) else BROKEN


if __name__ == "__main__":
    sys.exit(main())
