"""The command line: one module a command, each with `add_parser` and `run`.

Exit codes: 0 done, 1 failed, 2 bad input or usage, 130 interrupted (state saved).
"""

from __future__ import annotations

import argparse
import os
import sys

import splitnerf
from splitnerf.cli import ablate, bench, demo, doctor, evaluate, export, info, prepare, refine, relight, synth, train
from splitnerf.cli.exit_codes import BAD_INPUT, DONE, FAILED, INTERRUPTED
from splitnerf.errors import InputError

COMMANDS = (prepare, train, export, refine, relight, evaluate, synth, ablate, bench, demo, doctor, info)
__all__ = ["BAD_INPUT", "DONE", "FAILED", "INTERRUPTED", "build_parser", "main"]


def build_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="splitnerf",
        description="From posed images of one object to a mesh, PBR materials and the HDR environment.",
    )
    parser.add_argument("--version", action="version", version=f"splitnerf {splitnerf.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add_parser(commands)
    return parser


def main(argv: list[str] | None = None) -> int:
    # torch's OpenMP threads spin for milliseconds before they sleep; on a shared machine each barrier would then wait
    # for a whole time slice. A short spin costs nothing on an idle machine.
    os.environ.setdefault("GOMP_SPINCOUNT", "30000")
    args = build_parser().parse_args(argv)
    try:
        return args.execute(args)
    except InputError as error:
        print(f"splitnerf: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("splitnerf: interrupted", file=sys.stderr)
        return INTERRUPTED
    except (RuntimeError, OSError) as error:
        print(f"splitnerf: {error}", file=sys.stderr)
        return FAILED
