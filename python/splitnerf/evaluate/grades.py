"""What scores mean in words: the one table of thresholds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from splitnerf.evaluate.score_table import value_at


@dataclass(frozen=True)
class Score:
    """A score of `evaluation.json`.

    Attributes:
        name: What it is of.
        place: Its keys in the evaluation, from the outside in.
        text: Its format.
        good, poor: From where on it is good, and from where on poor; in between it is fair.
    """

    name: str
    place: tuple[str, ...]
    text: str
    good: float
    poor: float


# For scale: of four rendered scenes, the true shape in plain grey gets 20 to 24 dB under other lights and 17 to 21 dB of albedo, the
# published methods 23 to 32 dB and 25 to 29 dB, and the truth rendered once more 40 to 50 dB.
SCORES = (
    Score("New views", ("novel_view", "psnr"), "{:.1f} dB", 30, 25),
    Score("Other lights", ("relight", "psnr"), "{:.1f} dB", 29, 24),
    Score("Albedo", ("albedo", "psnr"), "{:.1f} dB", 27, 22),
    Score("Normals", ("normal_mae_deg",), "{:.1f}° off", 5, 12),
    Score("Roughness", ("roughness_mae",), "{:.2f} off", 0.08, 0.16),
    Score("Metallic", ("metallic_balanced_accuracy",), "{:.0%} right", 0.95, 0.8),
    Score("Light", ("light_psnr",), "{:.1f} dB", 22, 17),
    Score("Shape", ("f_score",), "{:.0%} near", 0.9, 0.7),
)


def graded(evaluation: Mapping) -> list[dict]:
    """For each score that is there: `name`, `place`, `value` and `word` (good, fair or poor), and `scale`, where the words begin."""
    rows = []
    for score in SCORES:
        value = value_at(evaluation, score.place)
        if value is None:
            continue
        sign = 1 if score.good > score.poor else -1
        word = "good" if sign * value >= sign * score.good else "poor" if sign * value < sign * score.poor else "fair"
        good, poor = (re.sub(r"\.0(?!\d)", "", score.text.format(limit)) for limit in (score.good, score.poor))
        scale = f"good from {good}, poor below {poor}" if sign > 0 else f"good up to {good}, poor above {poor}"
        rows.append(
            {"name": score.name, "place": score.place, "value": score.text.format(value), "word": word, "scale": scale}
        )
    return rows
