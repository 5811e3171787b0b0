"""Plugins: how the program finds commands and hooks, and what the core does without any."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from types import ModuleType, SimpleNamespace

import pytest
from splitnerf import plugins
from splitnerf.cli import BAD_INPUT, COMMANDS, DONE, build_parser
from splitnerf.plugins import Plugin, installed
from splitnerf.run_folder import is_finished
from splitnerf_tools.plugin import PLUGIN
from tiny_runs import train


@pytest.fixture
def found(monkeypatch):
    """Makes these entry points all that the metadata hold; whether the bundled tools can be imported is said, too."""

    def finds(*points: EntryPoint, tools: bool = True) -> None:
        monkeypatch.setattr(plugins, "entry_points", lambda group: points)
        monkeypatch.setattr(plugins, "find_spec", lambda name: SimpleNamespace() if tools else None)
        installed.cache_clear()

    yield finds
    installed.cache_clear()


@pytest.fixture
def other(monkeypatch) -> EntryPoint:
    """A plugin of another distribution, with one command, `polish`."""
    module = ModuleType("other")
    command = SimpleNamespace(add_parser=lambda commands: commands.add_parser("polish", help="make it shine"))
    module.PLUGIN = Plugin({"results": (command,)}, write_report=print)
    monkeypatch.setitem(sys.modules, "other", module)
    return EntryPoint("other", "other:PLUGIN", plugins.GROUP)


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


def test_the_tools_are_found_where_metadata_are_old(found):
    found()
    hooks = {name: hook for name, hook in vars(PLUGIN).items() if name != "commands"}
    assert vars(installed()) == {"commands": installed().commands} | hooks
    assert all(installed().commands[title] == modules for title, modules in PLUGIN.commands.items())


def test_a_plugin_of_another_distribution_adds_its_command_and_hooks(found, other):
    found(other)
    assert build_parser().parse_args(["polish"]).command == "polish"
    assert installed().write_report is print and installed().find_masks is PLUGIN.find_masks


def test_a_plugin_that_cannot_be_loaded_is_named_and_left_out(found, capsys):
    found(EntryPoint("gone", "no_such_package:PLUGIN", plugins.GROUP))
    assert build_parser().parse_args(["doctor"]).command == "doctor"
    reason = "which cannot be loaded: No module named 'no_such_package'"
    assert capsys.readouterr().err == f"splitnerf: note: without the plugin no_such_package:PLUGIN, {reason}\n"


def test_the_core_does_without_the_tools(found, data, tmp_path, capsys):
    """A run ends without a report, and is finished all the same; what needs a tool says so."""
    found(tools=False)
    run = tmp_path / "run"
    assert train(data, run, "--steps", "2") == DONE
    assert is_finished(run) and (run / "evaluation.json").is_file() and not (run / "report.html").exists()
    capsys.readouterr()
    assert train(data, tmp_path / "other", "--view") == BAD_INPUT and "--view" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        build_parser().parse_args(["doctor"])
