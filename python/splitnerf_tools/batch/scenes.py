"""The scenes of a batch: their names, what became of them, and the file that keeps it."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from splitnerf.data.json_files import read_json, write_json
from splitnerf.errors import InputError

STATE, TABLE, LOGS = "batch.json", "batch.md", "logs"  # in the batch's folder, beside the runs
FORMAT = 1
WAITING, DONE, FAILED, REFUSED, STOPPED = "waiting", "done", "failed", "refused", "stopped"
MOST_LETTERS = 80  # of a name


@dataclass
class Scene:
    """A scene and what became of it.

    Attributes:
        name: Of its run, in the batch's folder.
        data: Its folder, an absolute path.
        options: What `splitnerf train` was given.
        state: One of "waiting", "done", "failed", "refused" (bad input) and "stopped".
        steps: Optimiser steps; None before the first.
        minutes: Time of training, and of the refinement where the scene is done.
        scores: Scores by name, see :data:`splitnerf_tools.batch.table.COLUMNS`.
        error: Why it failed, one line.
        attempts: How many processes it took.
        fingerprint: Of the files of a scene that was refused.
    """

    name: str
    data: str
    options: list[str]
    state: str = WAITING
    steps: int | None = None
    minutes: float = 0.0
    scores: dict[str, float] = field(default_factory=dict)
    error: str = ""
    attempts: int = 0
    fingerprint: str = ""

    def begin(self, options: Sequence[str]) -> None:
        """Forgets what became of it."""
        self.options, self.state, self.error, self.fingerprint = list(options), WAITING, "", ""
        self.steps, self.minutes, self.scores, self.attempts = None, 0.0, {}, 0


def scene_name(data: str, taken: Iterable[str]) -> str:
    """A name for a scene's run: that of its folder, without what a file system, a shell or a terminal takes amiss, and
    with a number where it is taken. Case does not tell names apart."""
    plain = re.sub(r"[^\w.+=@-]+", "_", os.path.basename(data), flags=re.ASCII).lstrip(".-")[:MOST_LETTERS] or "scene"
    own = {STATE, TABLE, LOGS, "lock", "ray"}  # logs/ray.log is Ray's
    used = {name.lower() for name in (*taken, *own)}
    name, number = plain, 2
    while name.lower() in used:
        name, number = f"{plain}-{number}", number + 1
    return name


def known_scenes(out: Path) -> list[Scene]:
    """The scenes of earlier calls; none where there was none.

    Raises:
        InputError: The file that keeps them cannot be read.
    """
    path = out / STATE
    if not path.exists():
        return []
    content = read_json(path, "scenes")
    if content.get("format") != FORMAT:
        raise InputError(f"{path}: is not of this version of the program; give another --out")
    names = {f.name for f in fields(Scene)}
    try:
        return [Scene(**{key: entry[key] for key in names}) for entry in content["scenes"]]
    except (KeyError, TypeError):
        raise InputError(f"{path}: is damaged; remove it, the runs beside it stay and are gone on with") from None


def asked_scenes(known: list[Scene], folders: Sequence[Path], options: Sequence[str]) -> list[Scene]:
    """The scenes of these folders, each once; new ones join the known, which keep their names."""
    by_data = {scene.data: scene for scene in known}
    asked = {}
    for folder in folders:
        data = os.path.abspath(folder)
        if data not in by_data:
            by_data[data] = Scene(scene_name(data, (scene.name for scene in known)), data, list(options))
            known.append(by_data[data])
        asked[data] = by_data[data]
    return list(asked.values())


def keep_scenes(out: Path, scenes: Sequence[Scene]) -> None:
    """Writes what became of the scenes."""
    write_json(out / STATE, {"format": FORMAT, "scenes": [asdict(scene) for scene in scenes]})


def fingerprint(data: str) -> str:
    """A number that changes with the names, the sizes or the times of a folder's files."""
    seen = hashlib.sha256()
    for folder, folders, files in os.walk(data):
        folders.sort()
        for name in sorted(files):
            path = os.path.join(folder, name)
            try:
                status = os.stat(path)
            except OSError:
                continue
            seen.update(f"{os.path.relpath(path, data)!r} {status.st_size} {status.st_mtime_ns}\n".encode())
    return seen.hexdigest()
