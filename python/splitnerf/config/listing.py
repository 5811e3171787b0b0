"""The settings as a table to read."""

from __future__ import annotations

from splitnerf.config.settings import FIELDS, GROUPS, Config


def settings_table(config: Config) -> str:
    """Lines of ``group.name = value``, range or choices, unit and meaning, in columns, under their groups' titles."""
    rows = {
        name: (
            f"{name} = {_shown(config[name])}",
            f"{known.metadata['limits']}".removeprefix("in "),
            known.metadata["unit"],
            known.metadata["meaning"],
        )
        for name, known in FIELDS.items()
        if known.metadata["meaning"]
    }
    widths = [max(len(row[i]) for row in rows.values()) for i in range(3)]
    lines = []
    for group, kind in list(GROUPS.items())[:-1]:  # the last one is the record of the method
        lines += ["", f"[{group}] {kind.__doc__.splitlines()[0]}"]
        for name, row in rows.items():
            if name.startswith(f"{group}."):
                lines.append("  ".join([*(cell.ljust(width) for cell, width in zip(row, widths)), row[3]]))
    return "\n".join(lines[1:])


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
