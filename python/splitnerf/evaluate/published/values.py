"""The protocols by name, and a table of published scores and ours."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

from splitnerf.evaluate.published import nerfactor, shiny, stanford_orb, tensoir
from splitnerf.evaluate.published.common import Column

PROTOCOLS: dict[str, ModuleType] = {
    "stanford-orb": stanford_orb,
    "nerfactor": nerfactor,
    "tensoir": tensoir,
    "shiny": shiny,
}
NUMBERS = Path(__file__).with_name("numbers.json")


def published(name: str) -> dict:
    """The published scores of a protocol: `source`, `date`, and `rows`, each with `method` and some of the columns'
    keys."""
    return json.loads(NUMBERS.read_text(encoding="utf-8")).get(name, {"source": None, "date": None, "rows": []})


def table(name: str, ours: dict[str, float | None], label: str) -> str:
    """Our scores above the published ones, as lines of text, without empty columns."""
    columns: tuple[Column, ...] = PROTOCOLS[name].COLUMNS
    rows = [({"method": label} | ours), *published(name)["rows"]]
    columns = tuple(column for column in columns if any(row.get(column[0]) is not None for row in rows))
    cells = [["", *(title for _, title, _ in columns)]]
    for row in rows:
        values = (row.get(key) for key, _, _ in columns)
        cells.append([row["method"], *("-" if x is None else f.format(x) for x, (_, _, f) in zip(values, columns))])
    widths = [max(len(line[i]) for line in cells) for i in range(len(cells[0]))]
    padded = [[cell.rjust(width) for cell, width in zip(line, widths)] for line in cells]
    return "\n".join("  ".join([line[0].ljust(widths[0]), *rest[1:]]).rstrip() for line, rest in zip(cells, padded))
