"""Completion of commands, options and file names in a shell."""

from __future__ import annotations

import argparse
from pathlib import Path

SHELLS = ("bash", "zsh", "tcsh")


class PrintCompletion(argparse.Action):
    """Prints the script that completes a parser's commands in a shell, and ends the program."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: object, shell: str, option: str | None = None
    ) -> None:
        import shtab  # here: other commands need not load it

        complete_files(parser, shtab.FILE)
        print(shtab.complete(parser, shell))
        parser.exit()


def complete_files(parser: argparse.ArgumentParser, files: dict[str, str]) -> None:
    """Marks all arguments of a parser and of its commands that are paths, so that names of files complete them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                complete_files(command, files)
        elif action.type is Path:
            action.complete = files
