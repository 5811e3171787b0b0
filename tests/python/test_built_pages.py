"""The script of the viewer's page and of the report: built from the sources that are there, with licences."""

import hashlib
import re
from pathlib import Path

import splitnerf_tools

TOOLS = Path(splitnerf_tools.__file__).parent
PAGES = TOOLS / "pages"
BUILD = [PAGES / name for name in ("build.mjs", "package-lock.json", "package.json")]


def test_it_was_built_from_the_sources():
    """Where this fails: `make viewer`. The hash is computed as in build.mjs."""
    text = (TOOLS / "report/pages.js").read_text(encoding="utf-8")
    named = re.match(r"/\* sources [0-9a-f]{64}: (.*)", text)[1].split()  # after the tools that made it
    assert {Path(x).name for x in named} >= {x.name for x in PAGES.glob("*/*.js") if "node" not in str(x)}
    digest = hashlib.sha256()
    for path in [*BUILD, *(PAGES / name for name in named)]:
        digest.update(f"{path.relative_to(PAGES).as_posix()}\n".encode() + path.read_bytes())
        assert path.name == "package-lock.json" or len(path.read_text().splitlines()) < 500
    assert f"sources {digest.hexdigest()}" in text
    for words in (text, (TOOLS / "report/LICENSES").read_text()):
        assert "three.js authors" in words and "Leon Sorokin" in words
        assert words.count("Permission is hereby granted") == 2
    assert "</script" not in text.lower() and "<!--" not in text  # it stands within a page


def test_the_viewers_page_refers_to_nothing_else():
    page = (TOOLS / "view/viewer.html").read_text()
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=\"(?!data:)", page)
    assert re.findall(r"\{\{\w+\}\}", page) == ["{{SCRIPT}}"]
