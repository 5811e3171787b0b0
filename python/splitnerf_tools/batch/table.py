"""The table of a batch: rows on the terminal as scenes end, and a Markdown file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from splitnerf.data.json_files import read_json
from splitnerf.errors import InputError, plain
from splitnerf_tools.batch.scenes import DONE, Scene

# Title, keys in evaluation.json, format.
COLUMNS = (
    ("views", ("novel_view", "psnr"), "{:.2f}"), ("relit", ("relight", "psnr"), "{:.2f}"),
    ("albedo", ("albedo", "psnr"), "{:.2f}"), ("normals", ("normal_mae_deg",), "{:.1f}"),
    ("light", ("light_psnr",), "{:.2f}"),
)  # fmt: skip
UNITS = "PSNR in dB, normals in degrees"
LONGEST = 28  # letters of a name on the terminal


def scores_of(run: Path) -> tuple[dict[str, float], float | None]:
    """The scores of a finished run by the titles of :data:`COLUMNS`, those that there are, and its minutes."""
    try:
        evaluation = read_json(run / "evaluation.json", "novel_view")
    except InputError:
        return {}, None
    scores = {}
    for title, keys, _ in COLUMNS:
        value = evaluation
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if isinstance(value, (int, float)):
            scores[title] = float(value)
    seconds = evaluation.get("seconds")
    return scores, seconds / 60 if isinstance(seconds, (int, float)) else None


def cells(scene: Scene) -> list[str]:
    """The columns of a scene's row after its name: state, steps, minutes and scores; '-' where there is none."""
    scores = [text.format(scene.scores[title]) if title in scene.scores else "-" for title, _, text in COLUMNS]
    minutes = f"{scene.minutes:.1f}" if scene.minutes > 0 else "-"
    return [scene.state, "-" if scene.steps is None else str(scene.steps), minutes, *scores]


def shortened(name: str, n_letters: int) -> str:
    """A name of at most so many letters; '~' stands for the others."""
    return name if len(name) <= n_letters else name[: n_letters - 1] + "~"


class Rows:
    """The rows of the terminal, as wide as these scenes need it."""

    def __init__(self, scenes: Sequence[Scene]):
        self._width = max([5, *(min(len(scene.name), LONGEST) for scene in scenes)])

    def head(self) -> str:
        return self._row("scene", ["state", "steps", "minutes", *(title for title, *_ in COLUMNS)])

    def row(self, scene: Scene) -> str:
        """A scene's row; why it failed stands in the place of its scores."""
        name = shortened(scene.name, LONGEST)
        if scene.state == DONE or not scene.error:
            return self._row(name, cells(scene))
        return f"{self._row(name, cells(scene)[:3])}  {plain(scene.error)}"

    def _row(self, name: str, values: list[str]) -> str:
        return f"{name:{self._width}}  {values[0]:8}" + "".join(f"{value:>8}" for value in values[1:])


def markdown(scenes: Sequence[Scene]) -> str:
    """The table of all scenes, with links to the reports of those that are done."""
    head = ["scene", "state", "steps", "minutes", *(title for title, *_ in COLUMNS), "error", "data"]
    lines = [head, ["---", "---", *["---:"] * (2 + len(COLUMNS)), "---", "---"]]
    for scene in scenes:
        name = f"[{scene.name}]({scene.name}/report.html)" if scene.state == DONE else scene.name
        lines.append([name, *cells(scene), _cell(scene.error), _cell(scene.data)])
    table = "".join("| " + " | ".join(line) + " |\n" for line in lines)
    return f"{table}\n{UNITS}.\n"


def _cell(text: str) -> str:
    """A text that cannot end its cell, nor be taken for Markdown or HTML."""
    text = plain(text).replace("&", "&amp;").replace("<", "&lt;")
    return "".join("\\" + c if c in "\\|`*_[]" else c for c in text)
