"""The commands' parsers as the reference shows them."""

from __future__ import annotations

import argparse

from splitnerf import cli
from splitnerf.cli.common import TITLE, examples_in


def documented() -> argparse.ArgumentParser:
    """The parser of `splitnerf`; the examples at the end of each command's help are a block of code."""
    parser = cli.build_parser()
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    for command in commands.choices.values():
        paragraph, lines = (command.epilog or "").partition(TITLE)[0].strip(), examples_in(command.epilog)
        block = ["Examples:", "", ".. code-block:: console", "", *(f"   $ {line}" for line in lines)] if lines else []
        command.epilog = "\n".join([paragraph, "", *block])
    return parser
