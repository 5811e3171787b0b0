"""splitnerf evaluate."""

from __future__ import annotations

import argparse
from pathlib import Path

from splitnerf.cli.exit_codes import DONE
from splitnerf.cli.summary import print_summary


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "evaluate", help="score a run's test views again",
        description="Renders the test views of DATA from RUN's checkpoint and rewrites its assets, evaluation.json and "
        "report.html.",
    )  # fmt: skip
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--data", type=Path, required=True, metavar="DATA", help="the data that RUN was trained on")
    parser.add_argument("--downscale", type=int, default=1, metavar="N", help="as in training (default: 1)")
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.workflow import evaluate_run

    print_summary(args.run, evaluate_run(args.run, args.data, args.downscale))
    return DONE
