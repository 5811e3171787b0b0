"""The lines of the examples that the pages show are the examples' own."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHOWN = re.compile(r"<!-- not run: lines of (\S+),.*?-->\n```\w+\n(.*?)```", re.DOTALL)


@pytest.mark.parametrize("page, n_blocks", [("own_code.md", 4)])
def test_what_a_page_shows_of_an_example_is_in_it(page, n_blocks):
    shown = SHOWN.findall((ROOT / "docs" / page).read_text())
    assert len(shown) == n_blocks
    for name, lines in shown:
        script = [line.strip() for line in (ROOT / name).read_text().splitlines()]
        wanted = [line.strip() for line in lines.splitlines()]
        runs = (script[i : i + len(wanted)] for i in range(len(script)))
        assert wanted in [[re.sub(r"^\)  # fmt: skip$", ")", line) for line in run] for run in runs], (name, wanted[0])


def test_the_pages_link_to_files():
    for page in ("own_code.md",):
        links = re.findall(r"\]\(([^)#:]+)[^):]*\)", (ROOT / "docs" / page).read_text())
        assert links and all((ROOT / "docs" / link).exists() for link in links), (page, links)
