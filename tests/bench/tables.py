"""Which measured tables under docs/ are stale: the sources that they measure have changed since their commit.

    python tests/bench/tables.py        (make tables)

The head of a table says at which commit it was made and which sources it measures (splitnerf_tools.bench.provenance);
pages of docs/benchmarks without such a head are unknown.
"""

import re
import shlex
import sys
from pathlib import Path

from splitnerf_tools.bench.provenance import git

ROOT = Path(__file__).resolve().parents[2]
HEAD = re.compile(r"\bcommit (?P<commit>\w+)(?P<changed>\+?);.*\bmeasures `(?P<sources>[^`]+)`")


def state(text: str, root: Path) -> str:
    """What is to be said of a page: fresh, stale and since which commit, or unknown and why."""
    found = HEAD.search(text)
    if found is None:
        return "unknown: no head with commit and sources"
    since = git(root, "log", "--format=%h of %cs", f"{found['commit']}..HEAD", "--", *shlex.split(found["sources"]))
    if since is None:
        return f"unknown: no commit {found['commit']} here"
    if found["changed"]:
        return f"stale: made beside changes that {found['commit']} does not hold"
    changes = since.splitlines()
    return f"stale: {len(changes)} commits since {found['commit']}, the last {changes[0]}" if changes else "fresh"


def states(root: Path) -> dict[Path, str]:
    """The state of each measured page."""
    pages = sorted((root / "docs").rglob("*.md"))
    texts = {page: page.read_text() for page in pages if page.name != "README.md"}
    return {
        page.relative_to(root): state(text, root)
        for page, text in texts.items()
        if page.parent.name == "benchmarks" or HEAD.search(text)
    }


def main(root: Path = ROOT) -> None:
    for page, said in states(root).items():
        print(f"{page!s:36} {said}")


if __name__ == "__main__":
    sys.exit(main())
