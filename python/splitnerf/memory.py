"""Total and available memory, and its release."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

SHARE_OF_PHOTOS = 0.5  # of the available memory, by default


def memory_bytes() -> tuple[int, int]:
    """Total and available memory in bytes; of the control group where that is smaller."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        sizes = {name: int(rest.split()[0]) * 1024 for name, rest in (line.split(":") for line in lines)}
        total, free = sizes["MemTotal"], sizes["MemAvailable"]
    except OSError:  # not Linux: the available memory is unknown
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
    """Returns freed memory to the system where the C library is glibc, which keeps what does not end the heap: arrays of a photo's
    size between small ones that stay."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
