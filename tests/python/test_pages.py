"""The lines of the examples that the pages show are the examples' own."""

import json
import re
from pathlib import Path

from splitnerf.relight.cameras import path_views

ROOT = Path(__file__).parents[2]
SHOWN = re.compile(r"<!-- not run: lines of (\S+),.*?-->\n```\w+\n(.*?)```", re.DOTALL)


def test_what_a_page_shows_of_an_example_is_in_it():
    shown = SHOWN.findall((ROOT / "docs" / "own_code.md").read_text())
    assert len(shown) == 2
    for name, lines in shown:
        script = [line.strip() for line in (ROOT / name).read_text().splitlines()]
        wanted = [line.strip() for line in lines.splitlines()]
        runs = (script[i : i + len(wanted)] for i in range(len(script)))
        assert wanted in list(runs), (name, wanted[0])


def test_the_camera_that_a_page_gives_looks_at_the_front(tmp_path):
    (text,) = re.findall(r"```json\n(.*?)```", (ROOT / "docs" / "other_programs.md").read_text(), re.DOTALL)
    (tmp_path / "camera.json").write_text(text)
    (view,) = path_views(tmp_path / "camera.json", None)
    assert (view.pose[:3, 3] == (0, -3, 0)).all() and (view.pose[:3, 2] == (0, -1, 0)).all()
    assert (view.width, view.height) == (512, 512) == tuple(json.loads(text)[name] for name in "wh")
