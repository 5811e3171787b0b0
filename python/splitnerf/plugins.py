"""What the package ``splitnerf_tools`` beside this one adds to the program: commands, and parts of its jobs.

This package imports nothing of it: :func:`installed` looks for it when the program starts, and all but these parts works without.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pkgutil import resolve_name
from types import ModuleType
from typing import Any

TITLES = ("data", "reconstruction", "results", "many runs", "this installation")  # of `splitnerf --help`, in order


@dataclass(frozen=True)
class Plugin:
    """What a package adds. A hook that is None is left out of the job.

    Attributes:
        commands: Modules by the title of their group in the help, one of :data:`TITLES`. Each has ``add_parser(commands)``, which
            adds one command to argparse's; the parser's default ``execute`` runs it and returns the exit code.
        find_masks: ``(train, test, folder, *, steps, minutes, seed) -> seconds``: writes masks for the photos of both
            :class:`splitnerf.data.dataset.Dataset` into the folder. Without it photos need masks.
        write_report: ``(run, model, evaluated, timings)``: writes report.html into a run's folder.
        watch: ``(name, port)``: a context in which a page shows a training; it gives the
            :class:`splitnerf.training.observer.Observer` to call.
        failing_operators: ``(device) -> (names of those that fail, number of those tested)``.
    """

    commands: Mapping[str, tuple[ModuleType, ...]] = field(default_factory=dict)
    find_masks: Callable[..., float] | None = None
    write_report: Callable[..., None] | None = None
    watch: Callable[[str, int], AbstractContextManager[Any]] | None = None
    failing_operators: Callable[[str], tuple[list[str], int]] | None = None


@cache
def installed() -> Plugin:
    """What the tools add; nothing where they are not installed."""
    if find_spec("splitnerf_tools") is None:
        return Plugin()
    return resolve_name("splitnerf_tools.plugin:PLUGIN")
