"""The tables of gpu.sh: prints them, or writes them into a page, so that nobody copies numbers by hand.

    python tests/bench/gpu_table.py OUT [OUT ...] [--write docs/cuda.md]

OUT is what gpu.sh wrote: first.tsv and second.tsv, with facts of the machine and a line for each part. The page gets the tables
between its two marker lines, in place of what stands there; a rehearsal on the CPU is refused. Needs nothing but Python.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import NamedTuple

BEGIN, END = "<!-- what gpu.sh measured: begin -->", "<!-- what gpu.sh measured: end -->"
COMMANDS = ("first", "second")
FACTS = ("card", "driver", "python", "torch", "CUDA", "nvcc", "commit", "date")


class Run(NamedTuple):
    """One command of gpu.sh: its name, facts by name, and parts as (name, result, seconds, what it said)."""

    command: str
    facts: dict[str, str]
    parts: list[tuple[str, str, str, str]]


def read(path: Path) -> Run:
    """Reads a file that gpu.sh wrote, as far as it came."""
    run = Run(path.stem, {}, [])
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        kind, *cells = line.split("\t")
        if kind == "fact" and len(cells) == 2:
            run.facts[cells[0]] = cells[1]
        elif kind == "part" and len(cells) == 4:
            run.parts.append(tuple(cells))
    return run


def runs_of(folders: list[Path]) -> list[Run]:
    """The commands that the folders hold, first before second."""
    return [read(path) for name in COMMANDS for folder in folders if (path := folder / f"{name}.tsv").is_file()]


def markdown(run: Run) -> str:
    """The facts in a sentence, and a table of the parts."""
    facts = "; ".join(f"{name} {run.facts.get(name) or 'unknown'}" for name in FACTS)
    rehearsal = f" A rehearsal {run.facts['rehearsal']}: no number of it counts." if run.facts.get("rehearsal") else ""
    lines = [f"`tests/bench/gpu.sh {run.command}`: {facts}.{rehearsal}", "", "| part | | seconds | |", "|---|---|---|---|"]
    for cells in run.parts:
        shown = [re.sub(r"(?<!\S)/\S*/", "", cell).replace("|", "/") for cell in cells]  # without folders of that machine
        lines.append("| " + " | ".join(shown) + " |")
    return "\n".join(lines)


def written(page: str, tables: str) -> str:
    """The page with the tables between its markers.

    Raises:
        ValueError: The page has not both markers, once each and in order.
    """
    before, begin, rest = page.partition(BEGIN)
    old, end, after = rest.partition(END)
    if not begin or not end or BEGIN in old + after or END in before + after:
        raise ValueError(f"the page needs the lines {BEGIN} and {END}, once each")
    return f"{before}{BEGIN}\n\n{tables}\n\n{END}{after}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", type=Path, nargs="+", metavar="OUT")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    args = parser.parse_args()
    runs = runs_of(args.folders)
    tables = "\n\n".join(map(markdown, runs))
    if args.write is None:
        print(tables)
        return 0
    if not any(run.parts for run in runs):
        print("nothing was measured there", file=sys.stderr)
        return 1
    if any(run.facts.get("rehearsal") for run in runs):
        print("a rehearsal on the CPU measures nothing: the page stays as it is", file=sys.stderr)
        return 1
    try:
        page = written(args.write.read_text(encoding="utf-8"), tables)
    except ValueError as error:
        print(f"{args.write}: {error}", file=sys.stderr)
        return 1
    args.write.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
