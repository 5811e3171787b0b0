"""An ablation's scores as CSV and as Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from splitnerf.evaluate.score_table import COLUMNS

from splitnerf_tools.ablate.rows import FULL

CLOSE = 0.3  # dB: a smaller difference of single runs is not significant


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
    """The difference of a row's PSNR from its reference in one scene, over relit views or, without any, novel views."""

    row: str
    mean: float  # in dB, over the seeds that both have; positive is better than the reference
    error: float | None  # the standard error of the mean in dB; None with one seed

    def verdict(self) -> str:
        """The difference in words: a number, or "no difference" if it is too small."""
        if self.error is None:
            return "no difference" if abs(self.mean) < CLOSE else f"{self.mean:+.2f} dB"
        text = f"{self.mean:+.2f} ± {self.error:.2f} dB"
        return f"no difference ({text})" if abs(self.mean) < 2 * self.error else text


def differences(scores: Sequence[Score], scene: str) -> list[Difference]:
    """Each row of a scene against its reference there, seed by seed."""
    here = [s for s in scores if s.scene == scene]
    by_run = {(s.row, s.seed): s for s in here}
    found = []
    for name in dict.fromkeys(s.row for s in here if s.row != FULL):
        runs = [s for s in here if s.row == name and (s.reference, s.seed) in by_run]
        pairs = [(s.values, by_run[s.reference, s.seed].values) for s in runs]
        keys = ["novel_view" if None in (a["relight"], b["relight"]) else "relight" for a, b in pairs]
        gaps = [a[key] - b[key] for key, (a, b) in zip(keys, pairs)]
        if gaps:
            error = float(np.std(gaps, ddof=1) / np.sqrt(len(gaps))) if len(gaps) > 1 else None
            found.append(Difference(name, float(np.mean(gaps)), error))
    return found


def csv_table(scores: Sequence[Score]) -> str:
    """A line per run."""
    text = io.StringIO()
    names = ["scene", "row", "seed", *(name for name, *_ in COLUMNS), "reference"]
    writer = csv.DictWriter(text, names, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(vars(s) | s.values for s in scores)
    return text.getvalue()


def markdown_table(scores: Sequence[Score]) -> str:
    """A table per scene, means over the seeds of a row, and the difference to the row's reference; then, of several scenes,
    the mean over them. Scores that no run has are left out."""
    scenes = list(dict.fromkeys(s.scene for s in scores))
    tables = [_table(scene, [s for s in scores if s.scene == scene]) for scene in scenes]
    if len(scenes) > 1:
        tables.append(_table("Mean over the scenes", list(_over_scenes(scores, scenes))))
    return "\n".join(tables)


def _over_scenes(scores: Sequence[Score], scenes: Sequence[str]) -> Iterator[Score]:
    """The means of the rows that all scenes have, over the scenes' means over seeds; None where a scene does not know a score."""
    for name in dict.fromkeys(s.row for s in scores):
        runs = [[s for s in scores if s.scene == scene and s.row == name] for scene in scenes]
        if all(runs):
            means = {key: [_mean([s.values[key] for s in own]) for own in runs] for key, *_ in COLUMNS}
            values = {key: None if None in known else sum(known) / len(known) for key, known in means.items()}
            yield Score("", name, 0, values, runs[0][0].reference)


def _table(title: str, scores: Sequence[Score]) -> str:
    verdicts = {d.row: d.verdict() for d in differences(scores, scores[0].scene)}
    columns = [column for column in COLUMNS if any(s.values[column[0]] is not None for s in scores)]
    lines = [["", *(heading for _, heading, *_ in columns), "seeds", "difference", "to"]]
    lines.append(["---"] + ["---:"] * (len(columns) + 2) + ["---"])
    for name in dict.fromkeys(s.row for s in scores):
        runs = [s for s in scores if s.row == name]
        means = ((_mean([s.values[key] for s in runs]), text) for key, _, text, _ in columns)
        cells = ["-" if mean is None else text.format(mean) for mean, text in means]
        lines.append([name, *cells, str(len(runs)), verdicts.get(name, ""), "" if name == FULL else runs[0].reference])
    return f"## {title}\n\n" + "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
