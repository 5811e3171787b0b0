"""The provenance of numbers: machine, commit, date, command and measured sources."""

from __future__ import annotations

import datetime
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import splitnerf
import torch
from splitnerf import _core

ROOT = Path(__file__).parents[3]  # root of the checkout, if the package is in one


def processor_name() -> str:
    """The processor's name from Linux, else from Python's platform module."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def git(root: Path, *words: str) -> str | None:
    """The output of git in a folder; None where git fails."""
    try:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def commit(sources: Sequence[str] = (), root: Path = ROOT) -> str:
    """The checkout's commit, with a + if the sources have uncommitted changes; "unknown" outside of a checkout."""
    if not (root / ".git").exists() or (number := git(root, "rev-parse", "--short", "HEAD")) is None:
        return "unknown"
    changes = git(root, "status", "--porcelain", "--untracked-files=no", "--", *sources)
    return number + ("+" if changes else "")


def command_line() -> str:
    """The command as it was typed; an installed program and absolute paths are shortened to their last part."""
    program = Path(sys.argv[0])
    name = "splitnerf" if program.name == "__main__.py" else program.name  # of python -m splitnerf
    first = f"python {program}" if program.suffix == ".py" and not program.is_absolute() else name
    return " ".join([first, *(shlex.quote(Path(word).name if word.startswith("/") else word) for word in sys.argv[1:])])


def provenance(sources: Sequence[str], command: str | None = None, root: Path = ROOT) -> dict[str, str]:
    """Processor, versions, commit, date, command and sources, for the head of a table.

    Args:
        sources: Git patterns of the files whose change makes the numbers stale.
        command: The command that repeats the numbers (default: this process's own).
        root: The checkout.
    """
    return {
        "processor": processor_name(),
        "threads": str(torch.get_num_threads()),
        "kernels": _core.instruction_set(),
        "Embree": _core.embree_version() or "none",
        "splitnerf": splitnerf.__version__,
        "torch": torch.__version__,
        "python": platform.python_version(),
        "commit": commit(sources, root),
        "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
        "command": f"`{command or command_line()}`",
        "measures": f"`{' '.join(sources)}`",
    }


def header(facts: dict[str, str]) -> str:
    """The facts as one line of text."""
    return "; ".join(f"{key} {value}" for key, value in facts.items()) + "."
