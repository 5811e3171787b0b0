"""The options of all commands that read a data set."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from splitnerf.data.reading import Reading


def add_reading_options(parser: argparse.ArgumentParser, default: str = "as the data state or suggest") -> None:
    """Adds --eval-mode, --mask-kind and --max-memory; `default` is the help text of the first two's default."""
    parser.add_argument(
        "--eval-mode",
        choices=["all", "fraction", "filename"],
        help="what of the data is for testing: fraction, every 8th view; filename, the views with `test` or `eval` in "
        f"their path, those with `train` train; all, no view is held out and all are evaluated (default: {default})",
    )
    parser.add_argument(
        "--mask-kind",
        choices=["object", "ignore"],
        help="what mask files mean: object, white is the object; ignore, black is to be ignored and alpha is the "
        f"object (default: {default})",
    )
    parser.add_argument(
        "--max-memory",
        type=float,
        metavar="GB",
        help="memory for photos; more are read from a file in TMPDIR (default: half of what is available)",
    )


def reading_options(args: argparse.Namespace) -> dict[str, object]:
    """The settings that the options give, by name."""
    given = {"data.eval_mode": args.eval_mode, "data.mask_kind": args.mask_kind, "data.max_memory": args.max_memory}
    return {name: value for name, value in given.items() if value is not None}


def reading_of(args: argparse.Namespace, target: Path) -> Reading:
    """How to read data: by the options, else as in the run that `target` is or belongs to, else by default."""
    from splitnerf.config import Config
    from splitnerf.data.reading import SEPARATED, is_separated

    run = next((f for f in (target, *target.absolute().parents[:2]) if (f / "checkpoint.pt").is_file()), None)
    config = Config() if run is None or not (run / "config.toml").is_file() else Config.read(run / "config.toml")
    reading = config.replace(reading_options(args)).reading
    return replace(reading, separated=run / SEPARATED) if run is not None and is_separated(run / SEPARATED) else reading
