"""The commands' parsers as the reference shows them."""

from __future__ import annotations

import argparse

from splitnerf import cli
from splitnerf.cli.common import TITLE


def documented() -> argparse.ArgumentParser:
    """The parser of `splitnerf`; the examples at the end of each command's help are a block of code."""
    parser = cli.build_parser()
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    for command in commands.choices.values():
        paragraph, _, lines = (command.epilog or "").partition(TITLE)
        block = [f"   $ {line.strip()}" for line in lines.splitlines() if line.strip()]
        block = ["Examples:", "", ".. code-block:: console", "", *block] if block else []
        command.epilog = "\n".join([paragraph.strip(), "", *block])
    return parser
