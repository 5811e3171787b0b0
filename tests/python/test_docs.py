"""The documentation: its commands and snippets run, its reference is complete, and it builds.

Commands run on a tiny scene with options that make them short; :mod:`doc_blocks` says how a page marks what cannot run.
"""

import argparse
import importlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import splitnerf.ops as ops
from doc_blocks import PAGES, ROOT, Block, blocks_of, inline_commands, name_of
from splitnerf.cli import DONE, build_parser, main
from splitnerf.config.settings import tomllib
from splitnerf.data.images import write_image
from splitnerf.relight.cameras import path_views
from tiny_runs import SMALL, as_options, train

COMMANDS = next(a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction)).choices
PAGES_WITH_CODE = [page for page in PAGES if not all(block.language.startswith("{") for block in blocks_of(page))]
SPHINX = ("sphinx", "myst_parser", "furo", "sphinxarg", "sphinx_copybutton", "sphinx-mathjax-offline")
INNER = set("TableCopy refuse_rounded_gradients rounded mirror_images quarter sparse_map".split())  # the trainer's own

# What is put behind a command's own options: the last one counts.
SHORTER = {
    "train": ["--steps", "8", "--overwrite", *as_options(SMALL)],
    "export": ["--faces", "500", "--texture-size", "64", "--resolution", "32", "--formats", "glb,obj"],
    "refine": ["--sweeps", "1"],
    "relight": ["--spp", "1", "--size", "16", "--overwrite"],
    "synth": ["--size", "16", "--train", "4", "--test", "2", "--spp", "1"],
}


@pytest.fixture(scope="session")
def small_world(data, tmp_path_factory) -> Path:
    """A folder with what the pages call DATA, runs/..., studio.exr and so on, all of them tiny."""
    world = tmp_path_factory.mktemp("world")
    shutil.copytree(data, world / "DATA")
    assert train(data, world / "runs" / "demo", "--steps", "8") == DONE
    shutil.copytree(data, world / "runs" / "demo" / "data")
    for name in ("mine", "other", "boombox"):
        shutil.copytree(world / "runs" / "demo", world / "runs" / name)
    shutil.copy(world / "runs" / "demo" / "mesh.glb", world / "asset.glb")
    for name in ("studio.exr", "city.hdr", "sunset.hdr"):
        write_image(world / name, np.random.default_rng(0).random((8, 16, 3), dtype=np.float32))
    return world


@pytest.fixture
def world(small_world, tmp_path, monkeypatch) -> Path:
    """A copy of it to work in."""
    monkeypatch.chdir(shutil.copytree(small_world, tmp_path / "world"))
    return Path.cwd()


def shorter(words: list[str]) -> list[str]:
    """A command as it is run: file names in place of patterns, few pixels and steps."""
    words = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
    turns = ["--turntable", "2"] if "--turntable" in words else []
    views = ["--spp", "1", "--views", "1"] if words[1] == "evaluate" and "--data" in words else []
    return [*words[1:], *SHORTER.get(words[1], []), *turns, *views]


def run_shell(block: Block) -> None:
    """Parses the commands of a block, and runs those that are not marked."""
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for words in block.commands:
        if words[0] == "splitnerf":
            build_parser().parse_args(words[1:])
            if block.runs_command(words):
                made = Path(words[words.index("--out") + 1]) if words[1] == "synth" else None
                if made:
                    shutil.rmtree(made, ignore_errors=True)
                assert main(shorter(words)) == DONE, f"{block}: {words}"
                if made:
                    (made / "mesh.ply").unlink()  # as in conftest.py: distances to it take longer than all else
        elif words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), f"{block}: {words}"
        elif words[:2] == ["pip", "install"]:
            assert set(re.findall(r"splitnerf\[(\w+)\]", " ".join(words))) <= set(known), f"{block}: {words}"
        elif words[0] == "python":
            assert (ROOT / words[1]).is_file(), f"{block}: {words}"
        else:
            assert not block.runs_command(words), f"{block}: {words[0]} cannot be tested; mark it, see doc_blocks.py"


@pytest.mark.parametrize("page", PAGES_WITH_CODE, ids=name_of)
def test_code_runs(page, world, capsys):
    """In the order of the page, as a reader would type it."""
    names = {"__name__": "__main__"}
    for block in blocks_of(page):
        if block.language == "sh":
            run_shell(block)
        elif block.language == "python" and block.runs:
            exec(compile(block.text, str(block), "exec"), names)
        elif block.language == "json":
            json.loads(block.text)
        else:
            known = block.language == "text" or block.language.startswith("{")
            assert known or not block.runs, f"{block}: {block.language!r} cannot be tested; mark it, see doc_blocks.py"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_in_the_text_have_the_options_that_they_name(page):
    for words in inline_commands(page):
        assert words[1] in COMMANDS, words
        parser = COMMANDS[words[1]]
        nested = [c for a in parser._actions if isinstance(a, argparse._SubParsersAction) for c in a.choices.values()]
        known = {option for p in (parser, *nested) for option in p._option_string_actions}
        assert {word.partition("=")[0] for word in words if word.startswith("--")} <= known, words


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_to_files_and_headings(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for link, anchor in re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", text):
        if "://" in link:
            continue
        target = page.parent / link if link else page
        assert target.exists(), link
        assert not anchor or target.suffix != ".md" or anchor in anchors(target), f"{link}#{anchor}"


def test_the_method_names_tests_and_formulas_that_exist():
    text = (ROOT / "docs" / "method.md").read_text()
    tests = re.findall(r"`(test_\w+)(?:::|\.py)(\w*)`", text)
    assert len(tests) > 20
    for name, function in tests:
        assert f"def {function}" in (ROOT / "tests" / "python" / f"{name}.py").read_text(), (name, function)
    cpp = "\n".join(path.read_text() for path in (ROOT / "tests" / "cpp").glob("*.cpp"))
    for suite, name in re.findall(r"`(?!Suite)([A-Z]\w+)\.([A-Z]\w+)`", text):
        assert re.search(rf"TEST\w*\({suite}, {name}\)", cpp), (suite, name)
    for header, functions in re.findall(r"`(\w+\.(?:h|cpp)): ([\w, ]+)`", text):
        sources = "".join(path.read_text() for path in (ROOT / "cpp").rglob(header))
        assert all(name in sources for name in functions.split(", ")), (header, functions)


def test_messages_that_are_explained_are_those_of_the_program():
    sources = "".join(path.read_text() for path in sorted((ROOT / "python").rglob("*.py")))
    spoken = re.sub(r'"\s*\n\s*f?"', "", sources)
    messages = re.findall(r"^\| `([^`]+)` \|", (ROOT / "docs/troubleshooting.md").read_text(), re.MULTILINE)
    assert len(messages) > 8 and not [message for message in messages if message not in spoken]


def test_the_reference_holds_every_operator():
    held = set()
    for page in (ROOT / "docs" / "reference").glob("*.md"):
        text = page.read_text()
        if of := re.search(r"automodule:: (splitnerf\.ops\.\w+)", text):
            module = importlib.import_module(of[1])
            listed = set(re.findall(r"^\.\. (?:autofunction|autoclass|py:data):: (\w+)$", text, re.MULTILINE))
            own = {name for name, x in vars(module).items() if getattr(x, "__module__", "") == of[1] and name[0] != "_"}
            assert own - listed <= INNER and all(hasattr(module, name) for name in listed), of[1]
            held |= listed
    assert set(ops.__all__) < held


@pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in SPHINX),
    reason="Sphinx is not there: pip install splitnerf[docs]",
)
def test_the_pages_build_without_a_warning(tmp_path):
    command = [sys.executable, *"-m sphinx -W --keep-going -q -b html".split(), str(ROOT / "docs"), str(tmp_path)]
    built = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "reference" / "rays.html").read_text()
    assert r"\alpha = \max" in page and "_static/tex-svg.js" in page
    assert not re.search(r'(?:src|href)="https?://[^"]+\.(?:js|css|woff2?)', page)  # nothing is fetched when it is read


def test_the_method_s_figures_are_those_that_the_program_draws(tmp_path, monkeypatch):
    """Each is shown, and the quick ones are drawn."""
    monkeypatch.syspath_prepend(ROOT / "tests" / "bench")
    import method_figures

    shown = re.findall(r"\(figures/method_(\w+)\.png\)", (ROOT / "docs" / "method.md").read_text())
    assert sorted(shown) == sorted(method_figures.FIGURES)
    for name in ("lobe", "neus"):
        method_figures.FIGURES[name]().savefig(tmp_path / "figure.png")
        assert (tmp_path / "figure.png").stat().st_size > 10_000


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
