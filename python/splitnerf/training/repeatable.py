"""Runs that give the same bits each time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def same_bits(on: bool) -> Iterator[None]:
    """With ``on``, makes torch add in a fixed order within the block; the program's own operators always do so.

    Without it, threads that scatter into one tensor add in the order in which they arrive. Sums still depend on the
    number of threads and on the processor's instruction set.
    """
    before = torch.are_deterministic_algorithms_enabled(), torch.utils.deterministic.fill_uninitialized_memory
    try:
        if on:
            torch.use_deterministic_algorithms(True)
            torch.utils.deterministic.fill_uninitialized_memory = False  # no code reads memory before it writes it
        yield
    finally:
        torch.use_deterministic_algorithms(before[0])
        torch.utils.deterministic.fill_uninitialized_memory = before[1]
