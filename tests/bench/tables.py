"""Which measured tables under docs/ are stale: the sources that they measure have changed since their commit.

    python tests/bench/tables.py        (make tables)

The head of a table says at which commit it was made and which sources it measures (splitnerf_tools.bench.provenance);
pages of docs/benchmarks without such a head are unknown. It fails where a page is unknown, was made beside changes, or where its
sources have more than MOST_BEHIND commits since.
"""

import math
import re
import shlex
import sys
from pathlib import Path

from splitnerf_tools.bench.provenance import git

ROOT = Path(__file__).resolve().parents[2]
MOST_BEHIND = 200
HEAD = re.compile(r"\bcommit (?P<commit>\w+)(?P<changed>\+?);.*\bmeasures `(?P<sources>[^`]+)`")


def state(text: str, root: Path) -> tuple[str, float]:
    """What is to be said of a page: fresh, stale and since which commit, or unknown and why; and its sources' commits since."""
    found = HEAD.search(text)
    if found is None:
        return "unknown: no head with commit and sources", math.inf
    since = git(root, "log", "--format=%h of %cs", f"{found['commit']}..HEAD", "--", *shlex.split(found["sources"]))
    if since is None:  # as in a clone without history
        return f"unknown: no commit {found['commit']} here", 0
    if found["changed"]:
        return f"stale: made beside changes that {found['commit']} does not hold", math.inf
    changes = since.splitlines()
    said = f"stale: {len(changes)} commits since {found['commit']}, the last {changes[0]}" if changes else "fresh"
    return said, len(changes)


def states(root: Path) -> dict[Path, tuple[str, float]]:
    """The state of each measured page."""
    pages = sorted((root / "docs").rglob("*.md"))
    texts = {page: page.read_text() for page in pages if page.name != "README.md"}
    return {
        page.relative_to(root): state(text, root)
        for page, text in texts.items()
        if page.parent.name == "benchmarks" or HEAD.search(text)
    }


def main(root: Path = ROOT) -> int:
    found = states(root)
    for page, (said, _) in found.items():
        print(f"{page!s:36} {said}")
    old = [page.stem for page, (_, behind) in found.items() if behind > MOST_BEHIND]
    if old:
        print(f"{', '.join(old)}: too old; measure again by the command in the page's head", file=sys.stderr)
    return bool(old)


if __name__ == "__main__":
    sys.exit(main())
