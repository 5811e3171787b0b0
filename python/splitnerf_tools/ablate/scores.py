"""An ablation's scores as CSV and as Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from splitnerf_tools.ablate.rows import FULL

CLOSE = 0.3  # dB: a smaller difference of single runs is not significant
# Name, title, format, and keys in evaluation.json.
COLUMNS = (
    ("relight", "relight, dB", "{:.2f}", ("relight", "psnr")),
    ("albedo", "albedo, dB", "{:.2f}", ("albedo", "psnr")),
    ("novel_view", "novel view, dB", "{:.2f}", ("novel_view", "psnr")),
    ("normals", "normals, degrees", "{:.2f}", ("normal_mae_deg",)),
    ("roughness", "roughness, error", "{:.3f}", ("roughness_mae",)),
    ("metallic", "metallic, accuracy", "{:.3f}", ("metallic_balanced_accuracy",)),
    ("light", "light, dB", "{:.2f}", ("light_psnr",)),
    ("minutes", "time, min", "{:.1f}", ("seconds",)),
)


@dataclass(frozen=True)
class Score:
    """One run's scores by the names of :data:`COLUMNS`, None where the data have no truth; the titles give the units.
    `reference` names the row that the run is compared with."""

    scene: str
    row: str
    seed: int
    values: dict[str, float | None]
    reference: str = FULL


@dataclass(frozen=True)
class Difference:
    """The difference of a row's PSNR from its reference in one scene, over relit views or, without any, novel views.

    Attributes:
        row: The name of the row.
        mean: The mean difference in dB over the seeds that both have; positive is better than the reference.
        error: The standard error of the mean in dB; None with one seed.
    """

    row: str
    mean: float
    error: float | None

    def verdict(self) -> str:
        """The difference in words: a number, or "no difference" if it is too small."""
        if self.error is None:
            return "no difference" if abs(self.mean) < CLOSE else f"{self.mean:+.2f} dB"
        text = f"{self.mean:+.2f} ± {self.error:.2f} dB"
        return f"no difference ({text})" if abs(self.mean) < 2 * self.error else text


def value_at(evaluation: object, keys: Sequence[str]) -> float | None:
    """A number of an evaluation.json by its keys; None where there is none."""
    for key in keys:
        evaluation = evaluation.get(key) if isinstance(evaluation, dict) else None
    return float(evaluation) if isinstance(evaluation, (int, float)) else None


def score_of(scene: str, row: str, reference: str, seed: int, evaluation: dict) -> Score:
    """The columns of an evaluation.json."""
    values = {name: value_at(evaluation, keys) for name, _, _, keys in COLUMNS}
    seconds = values["minutes"]
    return Score(scene, row, seed, values | {"minutes": None if seconds is None else seconds / 60}, reference)


def differences(scores: Sequence[Score], scene: str) -> list[Difference]:
    """Each row of a scene against its reference there, seed by seed."""
    here = [s for s in scores if s.scene == scene]
    by_run = {(s.row, s.seed): s for s in here}
    found = []
    for name in dict.fromkeys(s.row for s in here if s.row != FULL):
        runs = [s for s in here if s.row == name and (s.reference, s.seed) in by_run]
        gaps = [_judged(s) - _judged(by_run[s.reference, s.seed]) for s in runs]
        if gaps:
            error = float(np.std(gaps, ddof=1) / np.sqrt(len(gaps))) if len(gaps) > 1 else None
            found.append(Difference(name, float(np.mean(gaps)), error))
    return found


def _judged(score: Score) -> float:
    return score.values["novel_view"] if score.values["relight"] is None else score.values["relight"]


def csv_table(scores: Sequence[Score]) -> str:
    """A line per run."""
    text = io.StringIO()
    names = ["scene", "row", "seed", *(name for name, *_ in COLUMNS), "reference"]
    writer = csv.DictWriter(text, names, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(vars(s) | s.values for s in scores)
    return text.getvalue()


def markdown_table(scores: Sequence[Score]) -> str:
    """A table per scene, means over the seeds of a row, and the difference to the row's reference."""
    parts = []
    for scene in dict.fromkeys(s.scene for s in scores):
        verdicts = {d.row: d.verdict() for d in differences(scores, scene)}
        lines = [["", *(title for _, title, *_ in COLUMNS), "seeds", "difference", "to"]]
        lines.append(["---"] + ["---:"] * (len(COLUMNS) + 2) + ["---"])
        for name in dict.fromkeys(s.row for s in scores if s.scene == scene):
            runs = [s for s in scores if s.scene == scene and s.row == name]
            cells = [_mean([s.values[key] for s in runs], text) for key, _, text, _ in COLUMNS]
            lines.append(
                [name, *cells, str(len(runs)), verdicts.get(name, ""), "" if name == FULL else runs[0].reference]
            )
        parts.append(f"## {scene}\n\n" + "".join("| " + " | ".join(line) + " |\n" for line in lines))
    return "\n".join(parts)


def _mean(values: Sequence[float | None], text: str) -> str:
    known = [value for value in values if value is not None]
    return text.format(sum(known) / len(known)) if known else "-"
