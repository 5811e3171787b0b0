"""Writes docs/licences.md: the licence of every package that an installation brings, as its metadata state it.

    python third_party/list_licences.py

Asks the environment that it runs in: install the extras first whose packages are to be listed.
"""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PAGE = Path(__file__).parents[1] / "docs" / "licences.md"
EXTRAS = ("photos", "heic", "raw", "video", "bench", "usd", "blender", "batch", "tensorboard")
SHORT = 40  # characters of a licence's name; longer is its text
# What the first licence in a text begins with; a BSD licence is told by what follows within FAR characters.
MIT, BSD, THIRD_CLAUSE, FAR = "Permission is hereby granted, free of charge", "Redistribution and use in source", "Neither the name", 1500
HEAD = """# Licences

SplitNeRF is under the MIT licence. A wheel carries Embree and oneTBB (Apache-2.0), and three.js and uPlot (MIT) in the page of
`splitnerf view` and in the script of `report.html`; their licences lie beside them. What pip installs besides, with the licences
that the packages' metadata state (`python third_party/list_licences.py`, {python}):

| package | version | licence | needed by |
|---|---|---|---|
"""


def licence(package: metadata.Distribution) -> str:
    """The licence of a package in a few words."""
    fields = package.metadata
    for text in (fields.get("License-Expression"), fields.get("License")):
        if text and len(text.strip()) <= SHORT and text.strip().upper() != "UNKNOWN":
            return text.strip()
    named = [line.split(" :: ")[-1] for line in fields.get_all("Classifier") or [] if line.startswith("License :: ")]
    if named:
        return ", ".join(named)
    texts = [fields.get("License") or ""]
    texts += [f.locate().read_text(errors="replace") for f in package.files or [] if re.search("licen[cs]e", f.name, re.IGNORECASE)]
    return next((f"{name}, by its text" for text in texts if (name := licence_of_text(" ".join(text.split())))), "not stated")


def licence_of_text(text: str) -> str:
    """The name of the licence that a text begins with; empty where it is none of those known here."""
    mit, bsd = text.find(MIT), text.find(BSD)
    if mit < 0 and bsd < 0:
        return ""
    if bsd < 0 or 0 <= mit < bsd:
        return "MIT"
    return "BSD-3-Clause" if THIRD_CLAUSE in text[bsd : bsd + FAR] else "BSD-2-Clause"


def needs(name: str, extra: str = "") -> list[Requirement]:
    """What an installed package requires here, with or for one of its extras alone."""
    found = []
    for line in metadata.requires(name) or []:
        requirement = Requirement(line)
        marker = requirement.marker
        plain = marker is None or marker.evaluate({"extra": ""})
        if plain if not extra else (not plain and marker.evaluate({"extra": extra})):
            found.append(requirement)
    return found


def closure(requirements: list[Requirement]) -> set[str]:
    """The names of all installed packages that requirements lead to."""
    found, left = set(), [(canonicalize_name(r.name), tuple(r.extras)) for r in requirements]
    while left:
        name, extras = left.pop()
        try:
            metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        if name in found:
            continue
        found.add(name)
        for extra in ("", *extras):
            left += [(canonicalize_name(r.name), tuple(r.extras)) for r in needs(name, extra)]
    return found


def rows() -> list[str]:
    """The lines of the table: what the package needs first, then each extra's packages."""
    lines, listed = [], set()
    for extra in ("", *EXTRAS):
        for name in sorted(closure(needs("splitnerf", extra)) - listed):
            listed.add(name)
            package = metadata.distribution(name)
            wanted = f"splitnerf[{extra}]" if extra else "splitnerf"
            lines.append(f"| {name} | {package.version} | {licence(package)} | {wanted} |")
    return lines


if __name__ == "__main__":
    head = HEAD.format(python=f"Python {sys.version_info[0]}.{sys.version_info[1]}, {sys.platform}")
    PAGE.write_text(head + "\n".join(rows()) + "\n")
    print(PAGE)
