"""What a benchmark ran on."""

from __future__ import annotations

import platform
import subprocess
from pathlib import Path

import torch

import splitnerf
from splitnerf import _core


def processor_name(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """As Linux names it, else as Python's platform module does."""
    try:
        lines = cpuinfo.read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def commit() -> str:
    """Of the checkout that this package stands in, with a + where that has changes; "unknown" outside of one."""
    commands = (["git", "rev-parse", "--short", "HEAD"], ["git", "status", "--porcelain", "--untracked-files=no"])
    try:
        number, changes = (
            subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=10)
            for command in commands
        )
    except (OSError, subprocess.TimeoutExpired):
        return "unknown"
    return number.stdout.strip() + ("+" if changes.stdout.strip() else "") if number.returncode == 0 else "unknown"


def describe_machine() -> dict[str, str]:
    """Processor, versions and commit, for the head of a table."""
    return {
        "processor": processor_name(), "threads": str(torch.get_num_threads()), "kernels": _core.instruction_set(),
        "Embree": _core.embree_version() or "none", "splitnerf": splitnerf.__version__,
        "torch": torch.__version__, "python": platform.python_version(), "commit": commit(),
    }  # fmt: skip
