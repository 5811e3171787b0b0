"""The code in the Markdown pages: blocks, inline commands, and which of them are not run.

A comment before a block says that it is not run, and why; the commands in it are still parsed:

    <!-- not run: needs photographs -->                     the whole block
    <!-- not run, splitnerf prepare: needs photographs -->  the lines of the block that begin so
    <!-- page not run: ... -->                              all blocks of the page
"""

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NOT_RUN = re.compile(r"<!-- not run(?:, (?P<start>[^:]+))?: (?P<why>.+?) -->", re.DOTALL)
PROGRAMS = ("splitnerf ", "make ", "pip ", "python ")  # a block without a language that begins so is one of commands
PAGE_NOT_RUN = re.compile(r"<!-- page not run: .+? -->", re.DOTALL)


@dataclass
class Block:
    """A block of code.

    Attributes:
        page: The file that holds it.
        line: The number of its first line.
        language: The word behind the fence, or what the code says of itself.
        text: The code.
        runs: Whether it is run.
        left_out: How lines begin that are not run.
    """

    page: Path
    line: int
    language: str
    text: str
    runs: bool = True
    left_out: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a shell block."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [words for words in (shlex.split(line, comments=True) for line in lines) if words]

    def runs_command(self, words: list[str]) -> bool:
        """Whether a command of the block is run."""
        return self.runs and not any(words[: len(start.split())] == start.split() for start in self.left_out)


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks_of(page: Path) -> list[Block]:
    """The blocks of code of a page, in order."""
    text = page.read_text()
    found, before = [], []
    for token in MarkdownIt("commonmark").parse(text):
        if token.type == "html_block":
            before += NOT_RUN.finditer(token.content)
        if token.type in ("fence", "code_block"):
            language = (token.info.split() or ["sh" if token.content.startswith(PROGRAMS) else ""])[0]
            starts = [mark["start"] for mark in before if mark["start"]]
            runs = not PAGE_NOT_RUN.search(text) and not any(mark["start"] is None for mark in before)
            found.append(Block(page, token.map[0] + 1, language, token.content, runs, starts))
        if token.type != "html_block":
            before = []
    return found


def inline_commands(page: Path) -> list[list[str]]:
    """The words of each `splitnerf COMMAND ...` within the text of a page."""
    spans = [
        child.content
        for token in MarkdownIt("commonmark").enable("table").parse(page.read_text())
        for child in token.children or []
        if child.type == "code_inline"
    ]
    return [shlex.split(span) for span in spans if re.match(r"splitnerf [a-z]", span)]
