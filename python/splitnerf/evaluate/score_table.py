"""The scores of an evaluation as columns and in words, and several evaluations as one markdown table."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

# Name, title, format, and keys in evaluation.json.
COLUMNS = (
    *(
        (name + end, f"{title}, {unit}", text, (name, measure))
        for name, title in (("relight", "relight"), ("albedo", "albedo"), ("novel_view", "novel view"))
        for end, unit, text, measure in (
            ("", "dB", "{:.2f}", "psnr"),
            ("_ssim", "SSIM", "{:.4f}", "ssim"),
            ("_lpips", "LPIPS", "{:.4f}", "lpips"),
        )
    ),
    ("normals", "normals, degrees", "{:.2f}", ("normal_mae_deg",)),
    ("roughness", "roughness, error", "{:.3f}", ("roughness_mae",)),
    ("metallic", "metallic, accuracy", "{:.3f}", ("metallic_balanced_accuracy",)),
    ("light", "light, dB", "{:.2f}", ("light_psnr",)),
    ("chamfer", "chamfer", "{:.4f}", ("chamfer",)),
    ("f_score", "F-score", "{:.3f}", ("f_score",)),
    ("minutes", "time, min", "{:.1f}", ("seconds",)),
)


# What the SplitNeRF paper (Zarzar and Ghanem) reports of 20 test views under 8 low-frequency probes, with one factor per channel
# on the images: relit views, then albedo, each as PSNR, SSIM and LPIPS; means over its four scenes.
PUBLISHED: dict[str, Sequence[float]] = {
    "SplitNeRF, mip-map light": (27.81, 0.944, 0.058),
    "SplitNeRF": (27.31, 0.941, 0.061, 25.29, 0.924, 0.108),
}
SOURCE = "published: the SplitNeRF paper, collected by this project in November 2026; mean of its four scenes"


def value_at(evaluation: object, keys: Sequence[str]) -> float | None:
    """A number of an evaluation.json by its keys; None where there is none."""
    for key in keys:
        evaluation = evaluation.get(key) if isinstance(evaluation, dict) else None
    return float(evaluation) if isinstance(evaluation, (int, float)) else None


def values_of(evaluation: dict) -> dict[str, float | None]:
    """The columns of an evaluation.json by name; None where the data have no truth."""
    values = {name: value_at(evaluation, keys) for name, _, _, keys in COLUMNS}
    seconds = values["minutes"]
    return values | {"minutes": None if seconds is None else seconds / 60}


def evaluation_table(evaluations: Sequence[tuple[str, dict]]) -> str:
    """Markdown with a row per name and evaluation and, for more than one, their mean. A missing value is '-'; a mean is
    over the scenes that have the value, and is marked with their number where it is not all."""
    rows = [(name, values_of(evaluation)) for name, evaluation in evaluations]
    lines = [["scene", *(title for _, title, *_ in COLUMNS)], ["---"] + ["---:"] * len(COLUMNS)]
    lines += [[name] + [_cell(text, values[key]) for key, _, text, _ in COLUMNS] for name, values in rows]
    if len(rows) > 1:
        lines.append(["**mean**"] + [_cell(text, *(v[key] for _, v in rows)) for key, _, text, _ in COLUMNS])
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def table_of_lights(evaluation: dict, label: str) -> str:
    """Lines of text: the scores of an evaluation with `--lights low` above those that were published so, and where they are from."""
    values, columns = values_of(evaluation), COLUMNS[:6]
    rows = {f"{label}, this scene": [values[name] for name, *_ in columns], **PUBLISHED}
    texts = ("{:.2f}", "{:.3f}", "{:.3f}") * 2
    lines = [["", *(title for _, title, *_ in columns)]]
    lines += [[name, *map(_cell, texts, [*row, *[None] * 3])] for name, row in rows.items()]
    widths = [max(map(len, column)) for column in zip(*lines)]
    shown = ["  ".join([name.ljust(widths[0]), *map(str.rjust, cells, widths[1:])]) for name, *cells in lines]
    return "\n".join([*shown, SOURCE])


def _cell(text: str, *values: float | None) -> str:
    """The mean of the values that there are, and their number where it is not all; "-" without any."""
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    share = "" if len(known) == len(values) else f" ({len(known)})"
    return text.format(sum(known) / len(known)) + share


# ---- what scores mean in words: the one table of thresholds ----


# What a score is of, its keys in `evaluation.json`, its format, and from where on it is good and poor; in between it is fair.
# For scale: of four rendered scenes, the true shape in plain grey gets 20 to 24 dB under other lights and 17 to 21 dB of albedo, the
# published methods 23 to 32 dB and 25 to 29 dB, and the truth rendered once more 40 to 50 dB.
SCORES = (
    ("New views", ("novel_view", "psnr"), "{:.1f} dB", 30, 25),
    ("Other lights", ("relight", "psnr"), "{:.1f} dB", 29, 24),
    ("Albedo", ("albedo", "psnr"), "{:.1f} dB", 27, 22),
    ("Normals", ("normal_mae_deg",), "{:.1f}° off", 5, 12),
    ("Roughness", ("roughness_mae",), "{:.2f} off", 0.08, 0.16),
    ("Metallic", ("metallic_balanced_accuracy",), "{:.0%} right", 0.95, 0.8),
    ("Light", ("light_psnr",), "{:.1f} dB", 22, 17),
    ("Shape", ("f_score",), "{:.0%} near", 0.9, 0.7),
)


def graded(evaluation: Mapping) -> list[dict]:
    """For each score that is there: `name`, `place`, `value` and `word` (good, fair or poor), and `scale`, where the words begin."""
    rows = []
    for name, place, text, good, poor in SCORES:
        if (value := value_at(evaluation, place)) is None:
            continue
        sign = 1 if good > poor else -1
        word = "good" if sign * value >= sign * good else "poor" if sign * value < sign * poor else "fair"
        good, poor = (re.sub(r"\.0(?!\d)", "", text.format(limit)) for limit in (good, poor))
        scale = f"good from {good}, poor below {poor}" if sign > 0 else f"good up to {good}, poor above {poor}"
        rows.append({"name": name, "place": place, "value": text.format(value), "word": word, "scale": scale})
    return rows
