"""Plugins: packages beside this one that add commands to the program and do parts of its jobs.

A distribution names its plugin in the entry-point group ``splitnerf.commands``; what it names is a :class:`Plugin`. That of
``splitnerf_tools``, which comes in the same wheel, is also found where the metadata are older than the sources.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Protocol

from splitnerf.errors import note

GROUP = "splitnerf.commands"
BUNDLED = EntryPoint("tools", "splitnerf_tools.plugin:PLUGIN", GROUP)
TITLES = ("data", "reconstruction", "results", "many runs", "this installation")  # of `splitnerf --help`, in order


class Command(Protocol):
    """A module that adds one command; the parser's default ``execute`` runs it and returns the exit code."""

    def add_parser(self, commands: argparse._SubParsersAction) -> None: ...


@dataclass(frozen=True)
class Plugin:
    """What a package adds. A hook that is None is left out of the job.

    Attributes:
        commands: Modules by the title of their group in the help, one of :data:`TITLES`.
        find_masks: ``(train, test, folder, *, steps, minutes, seed) -> seconds``: writes masks for the photos of both
            :class:`splitnerf.data.dataset.Dataset` into the folder. Without it photos need masks.
        write_report: ``(run, model, evaluated, timings)``: writes report.html into a run's folder.
        watch: ``(name, port)``: a context in which a page shows a training; it gives the
            :class:`splitnerf.training.observer.Observer` to call.
        failing_operators: ``(device) -> (names of those that fail, number of those tested)``.
    """

    commands: Mapping[str, tuple[Command, ...]] = field(default_factory=dict)
    find_masks: Callable[..., float] | None = None
    write_report: Callable[..., None] | None = None
    watch: Callable[[str, int], AbstractContextManager[Any]] | None = None
    failing_operators: Callable[[str], tuple[list[str], int]] | None = None


@cache
def installed() -> Plugin:
    """All plugins as one: the commands of all, each hook of the first that has it. A note names one that cannot be loaded."""
    points = {point.name: point for point in entry_points(group=GROUP)}
    if find_spec(BUNDLED.module.partition(".")[0]) is not None:
        points[BUNDLED.name] = BUNDLED
    found = []
    for point in points.values():
        try:
            found.append(point.load())
        except (ImportError, AttributeError) as error:
            note(f"without the plugin {point.value}, which cannot be loaded: {error}")
    commands = {title: sum((plugin.commands.get(title, ()) for plugin in found), ()) for title in TITLES}
    hooks = {
        hook.name: next((f for plugin in found if (f := getattr(plugin, hook.name)) is not None), None)
        for hook in fields(Plugin)
        if hook.name != "commands"
    }
    return Plugin(commands, **hooks)
