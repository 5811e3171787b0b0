"""The command line: help, names, and a program without the tools."""

import shlex
import shutil
import sys

import pytest
from splitnerf import plugins
from splitnerf.cli import BAD_INPUT, COMMANDS, DONE, build_parser, main
from splitnerf.cli.common import TITLE, commands_of
from splitnerf.plugins import installed
from splitnerf.run_folder import is_finished
from splitnerf_tools.plugin import PLUGIN
from tiny_runs import refused, train

PARSERS = commands_of(build_parser())
EXAMPLES = {name: (parser.epilog or "").partition(TITLE)[2].split("\n")[1:] for name, parser in PARSERS.items()}


@pytest.mark.parametrize("name", PARSERS)
def test_examples_are_commands_that_can_be_typed(name):
    assert EXAMPLES[name] or name in ("bench", "doctor")
    for line in EXAMPLES[name]:
        program, *words = shlex.split(line)
        assert program == "splitnerf" and build_parser().parse_args(words).command == name


@pytest.mark.parametrize("name", PARSERS)
def test_help_keeps_examples_and_wraps_the_rest(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = PARSERS[name].format_help().splitlines()
    assert said[len(said) - len(EXAMPLES[name]) :] == EXAMPLES[name]
    assert len(said) <= 66 and all(len(line) <= 80 for line in said if line not in EXAMPLES[name])


def test_the_help_shows_each_command_below_the_title_of_its_group():
    lines = build_parser().format_help().partition("COMMAND\n")[2].partition("\n\n")[0].splitlines()
    shown, title = set(), ""
    for line in lines:
        if line[2] != " ":
            title = line.strip().rstrip(":")
        elif line[4] != " ":
            shown.add((title, line.split()[0]))
    groups = (*COMMANDS.items(), *PLUGIN.commands.items())
    assert shown == {(title, module.__name__.rpartition(".")[2]) for title, modules in groups for module in modules}


@pytest.fixture
def without_tools(monkeypatch):
    monkeypatch.setattr(plugins, "find_spec", lambda name: None)
    installed.cache_clear()
    yield
    installed.cache_clear()


def test_the_core_does_without_the_tools(without_tools, data, tmp_path, capsys):
    """A run ends without a report, and is finished all the same; what needs a tool says so."""
    run = tmp_path / "run"
    assert train(data, run, "--steps", "2") == DONE
    assert is_finished(run) and (run / "evaluation.json").is_file() and not (run / "report.html").exists()
    capsys.readouterr()
    assert train(data, tmp_path / "other", "--view") == BAD_INPUT and "--view" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        build_parser().parse_args(["doctor"])


USAGE = {  # words, and what stands in the one line
    "no such command": (("trian", "data"), "'trian'; did you mean train?"),
    "nothing near": (("xyzzy",), "'xyzzy'; there are prepare, inspect, "),
    "an option misspelled": (
        ("train", "data", "--stepz=3"),
        "'--stepz=3'; did you mean --steps? (see `splitnerf train --help`)",
    ),
    "an option cut short": (("train", "data", "--step", "3"), "'--step'; did you mean --steps?"),
    "no such choice": (("train", "data", "--preset", "gpu"), "--preset: unknown 'gpu'; there are cpu, fast, paper"),
    "no number": (("train", "data", "--max-minutes", "one"), "--max-minutes: invalid float value: 'one'"),
    "something missing": (("relight", "run"), "--env, --out"),
}


@pytest.mark.parametrize("case", USAGE)
def test_wrong_usage_is_one_line_that_says_what_was_meant(case, capsys):
    words, said = USAGE[case]
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    out, err = capsys.readouterr()
    assert ended.value.code == BAD_INPUT and out == "" and err.count("\n") == 1
    assert err.startswith("splitnerf: ") and said in err


def test_no_words_at_all_print_the_help(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["splitnerf"])
    assert main() == DONE
    assert "reconstruction:" in capsys.readouterr().out


ELSEWHERE = {  # the folder that is given, and what stands in the one line
    "photos": ("photos", "holds photos without cameras; `splitnerf prepare"),
    "photos in a folder": ("out", "in a folder; `splitnerf prepare out/trip --out DATA`"),
    "a video": ("turn.mp4", "is a video, whose cameras are not known; `splitnerf prepare"),
    "runs": ("runs", "holds runs; give one, such as "),
    "a part of data": ("data/train", "is a part of the data set"),
    "data sets": ("", "holds data sets; give one, such as"),
    "a run": ("runs/run", "is a run; look at it by `splitnerf view"),
    "nothing known": ("empty", "has neither transforms_"),
}


@pytest.mark.parametrize("case", ELSEWHERE)
def test_data_that_are_none_are_named(case, data, tmp_path, capsys, monkeypatch):
    """Before it is asked where to write: without --out a run would be its own."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(data, tmp_path / "data")
    for name in ("photos/a.JPG", "out/trip/b.jpg", "turn.mp4", "runs/run/checkpoint.pt", "empty/notes.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    folder, said = ELSEWHERE[case]
    assert said in refused(capsys, "train", folder or ".")


@pytest.mark.parametrize("words", [("export",), ("evaluate",), ("refine", "--data", "data")])
def test_a_run_that_is_data_or_a_folder_of_runs_is_named(words, data, tmp_path, capsys):
    assert "is a data set, not a run; train one with" in refused(capsys, words[0], data, *words[1:])
    (tmp_path / "runs/a").mkdir(parents=True)
    (tmp_path / "runs/a/checkpoint.pt").touch()
    error = refused(capsys, words[0], tmp_path / "runs", *words[1:])
    assert f"holds runs; give one, such as {tmp_path / 'runs/a'}" in error
