"""The page of the viewer and the script of the report: built from the sources that are there, with licences, by themselves."""

import hashlib
import os
import re
from pathlib import Path

import pytest
import splitnerf_tools

TOOLS = Path(splitnerf_tools.__file__).parent
PAGES = TOOLS / "pages"
BUILD = [PAGES / name for name in ("build.mjs", "package-lock.json", "package.json")]


def built(name: str) -> tuple[str, list[Path], Path]:
    """The text, its sources, and the file with the licences."""
    if name == "viewer.html":
        return (
            (TOOLS / "view/viewer.html").read_text(encoding="utf-8"),
            [*BUILD, *sorted((PAGES / "view").iterdir())],
            TOOLS / "view/LICENSES",
        )
    text = (TOOLS / "report/report.js").read_text(encoding="utf-8")
    named = re.match(r"/\* sources [0-9a-f]{64}: (.*)", text)[1].split()  # after the tools that made it
    assert {Path(path).name for path in named} >= {p.name for p in (PAGES / "report").iterdir()} | {
        "viewer.js",
        "channels.js",
        "halves.js",
    }
    return text, [*BUILD, *(PAGES / path for path in named)], TOOLS / "report/LICENSES"


@pytest.mark.parametrize("name", ["viewer.html", "report.js"])
def test_it_was_built_from_the_sources(name):
    """Where this fails: `make viewer`. The hash is computed as in build.mjs."""
    text, sources, licences = built(name)
    digest = hashlib.sha256()
    for path in sources:
        digest.update(f"{Path(os.path.relpath(path, PAGES)).as_posix()}\n".encode() + path.read_bytes())
        assert path.name == "package-lock.json" or len(path.read_text().splitlines()) < 500
    assert f"sources {digest.hexdigest()}" in text
    for words in (text, licences.read_text()):
        assert "three.js authors" in words and "Leon Sorokin" in words
        assert words.count("Permission is hereby granted") == 2
    if name == "viewer.html":
        assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=\"(?!data:)", text)
        assert not re.search(r"\{\{\w+\}\}", text[:5000])
    else:  # it stands within a page
        assert "</script" not in text.lower() and "<!--" not in text
