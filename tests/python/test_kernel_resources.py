"""Registers, spills and shared memory of the CUDA kernels of a training step, against tests/cuda/kernel_resources.tsv."""

from __future__ import annotations

import pytest
from bench import kernel_resources

MOST_SPILLED = 8  # bytes of a thread: around a call of float64's division


def test_the_table_names_the_kernels_that_the_sources_define():
    kernels = kernel_resources.committed()[1]
    assert {kernel.bare for kernel in kernels} == kernel_resources.defined()
    assert {kernel.source for kernel in kernels} <= {source.name for source in kernel_resources.sources()}


def test_no_kernel_of_a_step_spills():
    for kernel in kernel_resources.committed()[1]:
        _, _, stored, loaded, _ = kernel.numbers
        assert max(stored, loaded) <= MOST_SPILLED, kernel


def test_two_blocks_of_the_field_share_a_processor():
    """As the number of blocks that its kernels start says: 2 x 256 threads and 65,536 registers."""
    fields = [
        kernel for kernel in kernel_resources.committed()[1] if kernel.bare in ("field_kernel", "field_backward_kernel")
    ]
    assert len(fields) == 6 and all(kernel.numbers[0] <= 128 for kernel in fields)


@pytest.mark.slow
def test_the_kernels_take_what_the_table_says():
    """To renew the table: python tests/bench/kernel_resources.py --write."""
    version, (head, expected) = kernel_resources.compiler(), kernel_resources.committed()
    if version is None:
        pytest.skip("nvcc was not found")
    if head != kernel_resources.head(version):
        pytest.skip(f"nvcc {version} is not that of the table: {head}")
    assert "\n".join(map(str, kernel_resources.compiled())) == "\n".join(map(str, expected))
