"""The scenes of a batch: names, outcomes, the file that stores them, and the table."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from splitnerf.data.json_files import read_json, write_json
from splitnerf.errors import InputError, plain
from splitnerf.evaluate.score_table import value_at
from splitnerf.files import LOCK, atomic_path

STATE, TABLE, LOGS = "batch.json", "batch.md", "logs"  # in the batch's folder, beside the runs
FORMAT = 1
WAITING, DONE, FAILED, REFUSED, STOPPED = "waiting", "done", "failed", "refused", "stopped"
MOST_LETTERS = 80  # of a name
LONGEST = 28  # letters of a name on the terminal
# Title, keys in evaluation.json, format.
COLUMNS = (
    ("views", ("novel_view", "psnr"), "{:.2f}"),
    ("relit", ("relight", "psnr"), "{:.2f}"),
    ("albedo", ("albedo", "psnr"), "{:.2f}"),
    ("normals", ("normal_mae_deg",), "{:.1f}"),
    ("light", ("light_psnr",), "{:.2f}"),
)
HEAD = ["state", "steps", "minutes", *(title for title, *_ in COLUMNS)]
UNITS = "PSNR in dB, normals in degrees"


@dataclass
class Scene:
    """A scene and its outcome.

    Attributes:
        name: The name of its run, in the batch's folder.
        data: Its folder, an absolute path.
        state: One of "waiting", "done", "failed", "refused" (bad input) and "stopped".
        steps: Optimiser steps; None before the first.
        minutes: Time of training, and of the refinement where the scene is done.
        scores: Scores by the titles of :data:`COLUMNS`, as far as known.
        error: The reason of a failure, one line.
    """

    name: str
    data: str
    state: str = WAITING
    steps: int | None = None
    minutes: float = 0.0
    scores: dict[str, float] = field(default_factory=dict)
    error: str = ""

    def read_scores(self, run: Path) -> None:
        """Takes scores and minutes from a finished run."""
        try:
            evaluation = read_json(run / "evaluation.json", "novel_view")
        except InputError:
            return
        for title, keys, _ in COLUMNS:
            if (value := value_at(evaluation, keys)) is not None:
                self.scores[title] = value
        self.minutes = evaluation.get("seconds", 60 * self.minutes) / 60

    def cells(self) -> list[str]:
        """The columns of the scene's row after its name: state, steps, minutes and scores; '-' where there is none."""
        scores = [text.format(self.scores[title]) if title in self.scores else "-" for title, _, text in COLUMNS]
        minutes = f"{self.minutes:.1f}" if self.minutes > 0 else "-"
        return [self.state, "-" if self.steps is None else str(self.steps), minutes, *scores]


def scene_name(data: str, taken: Iterable[str]) -> str:
    """A run's name: that of its folder without unsafe characters, with a number where it is taken; case makes no difference."""
    safe = re.sub(r"[^\w.+=@-]+", "_", os.path.basename(data), flags=re.ASCII).lstrip(".-")[:MOST_LETTERS] or "scene"
    own = {STATE, TABLE, LOGS, LOCK, "ray"}  # logs/ray.log is Ray's
    used = {name.lower() for name in (*taken, *own)}
    name, number = safe, 2
    while name.lower() in used:
        name, number = f"{safe}-{number}", number + 1
    return name


def known_scenes(out: Path) -> list[Scene]:
    """The scenes of earlier calls. Raises InputError where the file that stores them cannot be read."""
    path = out / STATE
    if not path.exists():
        return []
    content = read_json(path, "scenes")
    if content.get("format") != FORMAT:
        raise InputError(f"{path}: is not of this version of the program; give another --out")
    names = {f.name for f in fields(Scene)}
    try:
        scenes = [Scene(**{key: entry[key] for key in names}) for entry in content["scenes"]]
        if not all(re.fullmatch(r"[\w+=@][\w.+=@-]*", scene.name, re.ASCII) for scene in scenes):  # a path, perhaps
            raise TypeError
        return scenes
    except (KeyError, TypeError):
        raise InputError(f"{path}: is damaged; remove it: the runs stay and are continued") from None


def requested_scenes(known: list[Scene], folders: Sequence[Path]) -> list[Scene]:
    """The scenes of these folders, each once; new ones join the known, which keep their names."""
    by_data = {scene.data: scene for scene in known}
    for data in map(os.path.abspath, folders):
        if data not in by_data:
            by_data[data] = Scene(scene_name(data, (scene.name for scene in known)), data)
            known.append(by_data[data])
    return list({data: by_data[data] for data in map(os.path.abspath, folders)}.values())


def keep_scenes(out: Path, scenes: Sequence[Scene]) -> None:
    """Writes the outcomes and the table."""
    write_json(out / STATE, {"format": FORMAT, "scenes": [asdict(scene) for scene in scenes]})
    with atomic_path(out / TABLE) as temporary:
        temporary.write_text(markdown(scenes), encoding="utf-8", errors="backslashreplace")


def terminal_row(scene: Scene | None = None) -> str:
    """A scene's row on the terminal, the reason of a failure in place of its scores; None: the titles."""
    name, cells, reason = ("scene", HEAD, "") if scene is None else (scene.name, scene.cells(), "")
    if scene is not None and scene.state != DONE and scene.error:
        cells, reason = cells[:3], f"  {plain(scene.error)}"
    name = name if len(name) <= LONGEST else name[: LONGEST - 1] + "~"
    return f"{name:{LONGEST}}  {cells[0]:8}" + "".join(f"{cell:>8}" for cell in cells[1:]) + reason


def markdown(scenes: Sequence[Scene]) -> str:
    """The table of all scenes, with links to the reports of those that are done."""
    lines = [["scene", *HEAD, "error", "data"], ["---", "---", *["---:"] * (2 + len(COLUMNS)), "---", "---"]]
    for scene in scenes:
        name = f"[{scene.name}]({scene.name}/report.html)" if scene.state == DONE else scene.name
        lines.append([name, *scene.cells(), _cell(scene.error), _cell(scene.data)])
    table = "".join("| " + " | ".join(line) + " |\n" for line in lines)
    return f"{table}\n{UNITS}.\n"


def _cell(text: str) -> str:
    """A text escaped for a cell of a Markdown table."""
    text = plain(text).replace("&", "&amp;").replace("<", "&lt;")
    return "".join("\\" + c if c in "\\|`*_[]" else c for c in text)
