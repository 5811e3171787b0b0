"""splitnerf info."""

from __future__ import annotations

import argparse

from splitnerf.cli import doctor
from splitnerf.cli.exit_codes import DONE
from splitnerf.cli.help import examples


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "info", help="show the settings of a preset; without --settings the same as doctor",
        epilog=examples("splitnerf info --settings fast"),
    )  # fmt: skip
    parser.add_argument(
        "--settings",
        metavar="PRESET",
        nargs="?",
        const="cpu",
        help="print every setting of a preset: its value, unit, range and meaning (default: cpu)",
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import preset, settings_table

    if not args.settings:
        return doctor.run(args)
    print(settings_table(preset(args.settings)))
    return DONE
