"""The walk of a training step: the Python files of the package that it goes through.

python tests/python/test_walk.py    lists them
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import splitnerf
import torch
from splitnerf.data.dataset import load_dataset
from splitnerf.training.loop import Training
from tiny_runs import tiny

PACKAGE = Path(splitnerf.__file__).parent
MOST = 13  # files beside those of splitnerf/ops/


class Silent:
    """A progress bar that shows nothing."""

    def show(self, *_: object) -> None:
        pass


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


def step_files(data: Path, run: Path) -> Counter[str]:
    """The files of a step of preset cpu that is not logged, with a mesh and at which the light moves."""
    training = Training(load_dataset(data), tiny(steps=200, open_below=0.0), run, torch.device("cpu"))

    def steps(n: int) -> None:
        for _ in range(n):
            training.refresh()
            training.advance(Silent())

    steps(21)
    training.mesh.request(training.progress)
    steps(2)
    calls: Counter[str] = Counter()
    for _ in range(8):
        calls += files_of(lambda: steps(1))
    return calls


def test_a_step_goes_through_few_files(data, tmp_path):
    """By now; the files of a group of steps in which the light moves once and no line is logged."""
    files = step_files(data, tmp_path)
    assert {"training/loop.py", "training/step.py", "render/renderer.py"} <= files.keys()
    assert len([name for name in files if not name.startswith("ops/")]) <= MOST, sorted(files)


def main() -> None:
    from splitnerf_tools.demo.scene import write_demo_dataset

    with tempfile.TemporaryDirectory() as folder:
        write_demo_dataset(Path(folder) / "data", size=24, n_train=6, n_test=2, spp=4)
        files = step_files(Path(folder) / "data", Path(folder))
    for name, calls in sorted(files.items()):
        print(f"{calls / 8:6.1f} calls a step  {name}")
    of_ops = sum(name.startswith("ops/") for name in files)
    print(f"{len(files)} files: {len(files) - of_ops} and {of_ops} of operators")


if __name__ == "__main__":
    main()
