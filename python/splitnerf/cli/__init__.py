"""The command line: one module a command, each with `add_parser` and `run`; the tools add commands.

Exit codes: 0 done, 1 failed, 2 bad input or usage, 130 interrupted (state saved).
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial

import splitnerf
from splitnerf.cli import evaluate, export, info, refine, relight, train
from splitnerf.cli.common import BAD_INPUT, DONE, FAILED, INTERRUPTED, Help, Parser, ProgramHelp, commands_of
from splitnerf.cli.streams import lasting_streams
from splitnerf.errors import InputError, plain
from splitnerf.files import reason
from splitnerf.plugins import TITLES, installed
from splitnerf.progress import ended_by_signals

COMMANDS = {"reconstruction": (train, refine), "results": (export, relight, evaluate), "this installation": (info,)}


def build_parser() -> Parser:
    parser = Parser(
        prog="splitnerf",
        description="From photographs of one object with known cameras to a mesh, PBR materials and the HDR environment.",
    )
    parser.add_argument("--version", action="version", version=f"splitnerf {splitnerf.__version__}")
    commands = parser.add_subparsers(title="commands", dest="command", required=True, metavar="COMMAND")
    groups = {}
    for title in TITLES:
        n_before = len(commands.choices)
        for command in COMMANDS.get(title, ()) + installed().commands.get(title, ()):
            command.add_parser(commands)
        groups |= {name: title for name in list(commands.choices)[n_before : n_before + 1]}
    parser.formatter_class = partial(ProgramHelp, groups=groups)
    for command in commands.choices.values():
        command.formatter_class = Help
    return parser


def main(argv: list[str] | None = None) -> int:
    # torch's OpenMP threads spin for milliseconds before they sleep; on a shared machine each barrier would then wait
    # for a whole time slice. A short spin costs nothing on an idle machine.
    os.environ.setdefault("GOMP_SPINCOUNT", "30000")
    with lasting_streams():
        parser = build_parser()
        if not (sys.argv[1:] if argv is None else argv):
            parser.print_help()
            return DONE
        args, rest = parser.parse_known_args(argv)
        commands_of(parser)[args.command].refuse_unknown(rest)
        with ended_by_signals():
            code, words = execute(args)
        if words:
            print(f"splitnerf: {plain(words)}", file=sys.stderr)
        return code


def execute(args: argparse.Namespace) -> tuple[int, str]:
    """Runs a command; returns the exit code and, if it failed, one line with the reason."""
    try:
        code = args.execute(args)
        sys.stdout.flush()
        return code, ""
    except InputError as error:
        return BAD_INPUT, str(error)
    except KeyboardInterrupt as interrupt:
        return INTERRUPTED, str(interrupt) or "interrupted"
    except OSError as error:
        where = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
        return FAILED, f"{where}{reason(error)}"
    except RuntimeError as error:
        return FAILED, str(error)
    except MemoryError as error:
        return FAILED, f"not enough memory{f' ({error})' if str(error) else ''}; use smaller sizes"
    except Exception as error:
        if os.environ.get("SPLITNERF_TRACEBACK"):
            raise
        return FAILED, f"unexpected {type(error).__name__}: {error}; to report it, SPLITNERF_TRACEBACK=1 says where"
