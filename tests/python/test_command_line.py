"""What users type: help with examples, names of other programs, completion in a shell."""

from __future__ import annotations

import argparse
import shlex
import shutil
import subprocess

import pytest
from splitnerf.cli import build_parser
from splitnerf.cli.common import SHELLS, examples_in

COMMANDS = next(a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction)).choices


def script(shell: str, capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        build_parser().parse_args(["--print-completion", shell])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_commands_that_can_be_typed(name):
    lines = examples_in(COMMANDS[name].epilog)
    assert lines or name in ("bench", "doctor")
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "splitnerf" and build_parser().parse_args(words).command == name


@pytest.mark.parametrize("name", COMMANDS)
def test_help_keeps_examples_and_wraps_the_rest(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = COMMANDS[name].format_help().splitlines()
    examples = [f"  {line}" for line in examples_in(COMMANDS[name].epilog)]
    assert said[len(said) - len(examples) :] == examples
    assert len(said) <= 66 and all(len(line) <= 80 for line in said if line not in examples)


def test_names_of_other_programs_are_understood():
    """Those of nerfstudio and instant-ngp; the help lists ours alone."""
    theirs = "train D --downscale-factor 3 --max-num-iterations 70 --output-dir R --eval-mode all"
    ours = "train D --downscale 3 --steps 70 --out R --eval-mode all"
    parsed = [build_parser().parse_args(text.split()) for text in (theirs, ours, "train D --n_steps 70 --out R")]
    assert parsed[0] == parsed[1] and parsed[2].steps == 70 and parsed[2].downscale == 1
    assert "--downscale-factor" not in COMMANDS["train"].format_help()


@pytest.mark.parametrize("shell", SHELLS)
def test_a_completion_knows_all_commands_and_their_options(shell, capsys):
    text = script(shell, capsys)
    assert all(name in text for name in COMMANDS)
    assert "--max-minutes" in text or "max-minutes" in text
    assert "--n_steps" not in text


def completed(text: str, *words: str) -> list[str]:
    """What bash offers for the last word."""
    typed = " ".join(map(shlex.quote, words))
    ask = f"COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; _shtab_splitnerf; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    return subprocess.run(["bash", "-c", f"{text}\n{ask}"], capture_output=True, text=True, timeout=60).stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes_commands_options_choices_and_files(capsys, tmp_path, monkeypatch):
    text = script("bash", capsys)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photo.txt").touch()
    assert completed(text, "splitnerf", "pre") == ["prepare"]
    assert completed(text, "splitnerf", "train", "--pre") == ["--preset"]
    assert completed(text, "splitnerf", "train", "--preset", "") == ["cpu", "fast", "paper"]
    assert set(completed(text, "splitnerf", "train", "pho")) >= {"photos", "photo.txt"}
