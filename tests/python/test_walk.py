"""The walk of a training step: the Python files of the package that it goes through."""

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import splitnerf
import torch
from splitnerf.data.dataset import load_dataset
from splitnerf.training.loop import Training
from tiny_runs import tiny

PACKAGE = Path(splitnerf.__file__).parent
MOST = 13  # files beside those of splitnerf/ops/


def files_of(work: Callable[[], None]) -> Counter[str]:
    """The calls within each file of the package while `work` runs."""
    calls: Counter[str] = Counter()

    def count(frame, event, _) -> None:
        path = Path(frame.f_code.co_filename)
        if event == "call" and PACKAGE in path.parents:
            calls[path.relative_to(PACKAGE).as_posix()] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(before)
    return calls


def test_a_step_goes_through_few_files(data, tmp_path):
    """By now; those of eight steps of preset cpu, with a mesh, in which the light moves and no line is logged."""
    training = Training(load_dataset(data), tiny(steps=200, open_below=0.0), tmp_path, torch.device("cpu"))

    def steps(n: int) -> None:
        for _ in range(n):
            training.refresh()
            training.advance(SimpleNamespace(show=lambda *_: None))

    steps(21)
    training.mesh.request(training.progress)
    steps(2)
    files = files_of(lambda: steps(8))
    assert {"training/loop.py", "training/step.py", "render/renderer.py"} <= files.keys()
    assert len([name for name in files if not name.startswith("ops/")]) <= MOST, sorted(files)
