"""Evaluations of several runs as one markdown table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

GROUPS = (("relight", "relight"), ("albedo", "albedo"), ("novel_view", "novel view"))
SCORES = (("psnr", "PSNR", "{:.2f}"), ("ssim", "SSIM", "{:.3f}"), ("lpips", "LPIPS", "{:.3f}"))
COLUMNS = (
    ("normal_mae_deg", "normals, degrees", "{:.2f}"),
    ("roughness_mae", "roughness, error", "{:.3f}"),
    ("metallic_balanced_accuracy", "metallic, accuracy", "{:.3f}"),
    ("light_psnr", "light, PSNR", "{:.2f}"),
    ("chamfer", "chamfer", "{:.4f}"),
    ("f_score", "F", "{:.3f}"),
    ("seconds", "time, min", "{:.1f}"),
)


def evaluation_table(evaluations: Sequence[tuple[str, dict]]) -> str:
    """Markdown with a row per name and evaluation and, for more than one, their mean. A missing value is '-'; a mean is
    over the scenes that have the value, and is marked with their number where it is not all."""
    header, formats = ["scene"], []
    for _, group in GROUPS:
        for _, score, text in SCORES:
            header.append(f"{group} {score}")
            formats.append(text)
    for _, title, text in COLUMNS:
        header.append(title)
        formats.append(text)
    rows = [(name, _values(evaluation)) for name, evaluation in evaluations]
    lines = [header, ["---"] + ["---:"] * len(formats)]
    lines += [[name] + [_cell(value, text) for value, text in zip(values, formats)] for name, values in rows]
    if len(rows) > 1:
        lines.append(["**mean**"] + [_mean([v[i] for _, v in rows], text) for i, text in enumerate(formats)])
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def holds_table(path: Path) -> bool:
    """Whether a file is a table of scores."""
    with open(path, "rb") as file:
        return file.read(9) == b"| scene |"


def _values(evaluation: dict) -> list[float | None]:
    values = [(evaluation.get(group) or {}).get(score) for group, _ in GROUPS for score, *_ in SCORES]
    for key, *_ in COLUMNS:
        value = evaluation.get(key)
        values.append(value / 60 if key == "seconds" and value is not None else value)
    return values


def _cell(value: float | None, text: str) -> str:
    return "-" if value is None else text.format(value)


def _mean(values: Sequence[float | None], text: str) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    share = "" if len(known) == len(values) else f" ({len(known)})"
    return text.format(sum(known) / len(known)) + share
