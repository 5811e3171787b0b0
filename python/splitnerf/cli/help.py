"""How the commands' help looks: examples stand at its end, a line each."""

from __future__ import annotations

import argparse

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
