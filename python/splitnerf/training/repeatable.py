"""Runs that give the same bits each time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def same_bits(on: bool) -> Iterator[None]:
    """Has torch add in a fixed order within the block, where ``on``; the program's own operators always do.

    Threads that scatter into one tensor otherwise add in the order in which they come. Sums still depend on how many
    threads there are, and on what the processor can do.
    """
    before = torch.are_deterministic_algorithms_enabled(), torch.utils.deterministic.fill_uninitialized_memory
    try:
        if on:
            torch.use_deterministic_algorithms(True)
            torch.utils.deterministic.fill_uninitialized_memory = False  # nothing reads what it has not written
        yield
    finally:
        torch.use_deterministic_algorithms(before[0])
        torch.utils.deterministic.fill_uninitialized_memory = before[1]
