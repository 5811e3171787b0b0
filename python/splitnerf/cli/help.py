"""The format of the commands' help: examples at its end, a line each."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

TITLE = "examples:"


def examples(*lines: str, after: str = "") -> str:
    """The end of a command's help: command lines to copy, after a paragraph."""
    return "\n".join(([after, ""] if after else []) + [TITLE, *(f"  {line}" for line in lines)])


def examples_in(epilog: str | None) -> list[str]:
    """The command lines in the end of a command's help."""
    _, _, lines = (epilog or "").partition(TITLE)
    return [line.strip() for line in lines.splitlines() if line.strip()]


class Help(argparse.HelpFormatter):
    """Wraps paragraphs, but leaves examples as they are."""

    def __init__(self, prog: str):
        super().__init__(prog, max_help_position=28)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraph, title, lines = text.partition(TITLE)
        filled = super()._fill_text(paragraph, width, indent) if paragraph.strip() else ""
        return "\n\n".join(part for part in (filled, title + lines if title else "") if part)


class ProgramHelp(Help):
    """The help of the program: a title stands above each group of commands.

    Args:
        groups: The title by the group's first command.
    """

    def __init__(self, prog: str, groups: Mapping[str, str]):
        super().__init__(prog)
        self._groups = groups

    def _format_action(self, action: argparse.Action) -> str:
        text, title = super()._format_action(action), self._groups.get(action.dest)
        return f"{'':{self._current_indent - 2}}{title}:\n{text}" if title else text
