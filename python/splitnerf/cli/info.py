"""splitnerf info."""

from __future__ import annotations

import argparse

from splitnerf.cli.common import DONE, examples


def add_parser(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "info", help="show the settings of a preset", epilog=examples("splitnerf info --settings fast")
    )
    parser.add_argument(
        "--settings",
        metavar="PRESET",
        nargs="?",
        const="cpu",
        default="cpu",
        help="print every setting of a preset: its value, unit, range and meaning (default: cpu)",
    )
    parser.set_defaults(execute=run)


def run(args: argparse.Namespace) -> int:
    from splitnerf.config import preset, settings_table

    print(settings_table(preset(args.settings)))
    return DONE
