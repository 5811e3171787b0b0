"""The benchmarks of the operators: which there are, and how they become files."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path

from splitnerf.bench.charts import write_result

ROUNDS, QUICK_ROUNDS = 15, 7


def run_benchmarks(names: Sequence[str], quick: bool, out: Path, show: Callable[[str], None]) -> list[Path]:
    """Checks and times the operators, writes the charts, and shows what they say as they come.

    Args:
        names: Modules beside this one, each with ``run(quick, rounds)``.
        quick: Small inputs and few rounds: minutes in all.
        out: A folder; made where it is missing.
        show: Called with each line.

    Raises:
        CheckFailed: An operator's results are wrong.
        InputError: matplotlib is missing.
    """
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for name in names:
        module = importlib.import_module(f"splitnerf.bench.{name}")
        result = module.run(quick, QUICK_ROUNDS if quick else ROUNDS)
        files += write_result(result, out)
        show(result.title)
        for finding in result.findings:
            show(f"  {finding}")
    return files
