"""How much memory there is, and what is given back."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

SHARE_OF_PHOTOS = 0.5  # of the memory that is available, where nothing is said


def memory_bytes() -> tuple[int, int]:
    """Memory of the machine, or of the control group where it has less, and what of it is available."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        sizes = {name: int(rest.split()[0]) * 1024 for name, rest in (line.split(":") for line in lines)}
        total, free = sizes["MemTotal"], sizes["MemAvailable"]
    except OSError:  # not Linux: no number of what is available
        total = free = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit, used = control_group("memory.max"), control_group("memory.stat")  # the latter begins: anon, bytes
    if not limit or limit[0] == "max" or not used:
        return total, free
    return min(total, int(limit[0])), min(free, int(limit[0]) - int(used[1]))


def control_group(name: str) -> list[str]:
    """The words of a limit of Linux's control group; none where there is no such limit."""
    try:
        return Path("/sys/fs/cgroup", name).read_text().split()
    except OSError:
        return []


def give_back() -> None:
    """Gives freed memory back to the system where the C library is glibc.

    It keeps what it cannot cut off at the end: arrays of a photo's size that lie between small ones which stay.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
