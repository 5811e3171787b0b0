"""Launches of a training step on a GPU, counted on the CPU, by operator and by calling line.

    python tests/bench/launches.py [--steps 20] [--preset fast] [--set KEY=VALUE ...]

Trains the demo scene with tiny sizes, without graphs, and counts the calls that reach a device in some steps, forward,
backward and optimiser: an operator of torch is one launch unless it is a view or an allocation; one of ours is as many
as its launcher in cpp/cuda/ makes. Calls on tensors that a GPU's training keeps on the CPU are left out: the
optimiser's counts of steps, and the sharpness as a number. The time of as many steps without counting is the host's own
and that of tiny kernels on the CPU. How often a step waits for the GPU is counted by tests/python/test_device.py.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import torch
from torch.utils._python_dispatch import TorchDispatchMode

from splitnerf.config import parse_setting, preset
from splitnerf.data.dataset import load_dataset
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.loop import Training
from splitnerf_tools.bench.provenance import header, provenance
from splitnerf_tools.demo.scene import write_demo_dataset

# Kernels and memory sets of an operator with more than one, as its launcher in cpp/cuda/ and cpp/torch/ makes them.
KERNELS = {
    "pixel_losses": 2, "gradient_losses": 2, "gradient_losses_backward": 2, "light_prior": 2,
    "quadratic_entropy": 4, "sdf_values": 2, "sdf_field": 2,
    "sdf_field_backward": 5, "hash_encode_backward": 2, "light_lookup_backward": 3,
    "summed_light_backward": 2, "prefilter_light": 2, "prefilter_light_backward": 2, "interpolate_backward": 2, "march_rays": 3,
    "sample_rays": 6, "spread_samples": 3, "adamw_steps_": 1,
}  # fmt: skip
# The same where no count is waited for: `room` of samples, or a tensor with the number of candidates.
WITH_ROOM = {"sample_rays": 7}
NO_LAUNCH = {
    "empty", "empty_like", "empty_strided", "new_empty", "new_empty_strided", "_unsafe_view", "_reshape_alias", "lift_fresh",
    "_local_scalar_dense", "_record_function_enter_new", "_record_function_exit",
}  # fmt: skip
# operators, and the functions whose calls are the CPU's
ON_THE_HOST = {"_foreach_add_": "_step", "exp": "s_value", "mul": "s_value", "clamp": "s_value"}
PACKAGE = "/python/splitnerf/"
SMALL = dict(
    n_levels=4, log2_table_size=10, target_samples=2048, initial_rays=64, max_rays=256, grid_resolution=16, light_resolution=16,
    light_samples=64, light_queries=16, eikonal_points=32, smoothness_points=32, mesh_resolution=24, open_below=0.0, cuda_graphs=False,
)  # fmt: skip
SOURCES = ("tests/bench/launches.py", "python/splitnerf/training", "python/splitnerf/render", "python/splitnerf/fields")


class Launches(TorchDispatchMode):
    """Within its block every call that reaches a device is counted.

    Attributes:
        launches: By operator.
        places: Launches by the line of the package that calls; those of a backward pass stand at its start.
    """

    def __init__(self) -> None:
        super().__init__()
        self.launches: Counter[str] = Counter()
        self.places: Counter[str] = Counter()

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func._schema.name.split("::")[1]
        ours = func.namespace == "splitnerf"
        looks = any(r.alias_info is not None and not r.alias_info.is_write for r in func._schema.returns)
        if not looks and name not in NO_LAUNCH and not calls_from(ON_THE_HOST.get(name)):
            kernels = WITH_ROOM if name in WITH_ROOM and args[-1] else KERNELS
            n = kernels.get(name, 1) if ours else 1
            self.launches[name] += n
            self.places[place()] += n
        return func(*args, **(kwargs or {}))


def place() -> str:
    """The innermost line of the package on the stack."""
    frame = sys._getframe(2)
    while frame is not None and PACKAGE not in frame.f_code.co_filename:
        frame = frame.f_back
    return "elsewhere" if frame is None else f"{frame.f_code.co_filename.split(PACKAGE)[1]}:{frame.f_lineno}"


def calls_from(function: str | None) -> bool:
    """Whether a function of this name is on the stack."""
    frame = sys._getframe(2) if function else None
    while frame is not None and frame.f_code.co_name != function:
        frame = frame.f_back
    return frame is not None


class Silent:
    """A progress bar that shows nothing."""

    def show(self, share: float, told: str) -> None:
        """Nothing."""


def measured(config, folder: Path, steps: int) -> tuple[Launches, float]:
    """The counts of `steps` steps, and the seconds of as many before them."""
    write_demo_dataset(folder / "data", size=32, n_train=6, n_test=2, spp=4)
    training = Training(load_dataset(folder / "data"), config, folder, torch.device("cpu"))
    of_a_step = training.model, training.grid, training.mesh, training.generator, training.optimiser, training.exposures
    training.take_step = GpuStep(*of_a_step)

    def advance(n: int) -> None:
        for _ in range(n):
            training.refresh()
            training.advance(Silent())

    advance(60)
    training.mesh.request(0.0)  # so that light is hidden by the object and sent by it
    training.mesh.poll(wait=True)
    advance(steps)
    begin = time.perf_counter()
    advance(steps)
    seconds = time.perf_counter() - begin
    with Launches() as counted:
        advance(steps)
    return counted, seconds


def table(title: str, counts: Counter[str], steps: int) -> list[str]:
    """The lines of a table of counts a step; those below a tenth are left out."""
    lines = [f"| {name} | {n / steps:.1f} |" for name, n in counts.most_common() if n >= 0.1 * steps]
    return [f"| {title} | launches a step |", "|---|---|", *lines]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=32, metavar="N", help="steps that are counted (default: 32)")
    parser.add_argument("--preset", choices=["cpu", "fast"], default="fast")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")
    parser.add_argument("--out", type=Path, metavar="PAGE", help="also writes the table there")
    args = parser.parse_args()
    config = preset(args.preset).replace(SMALL | dict(parse_setting(text) for text in args.settings))
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "metrics.jsonl").touch()
        counted, seconds = measured(config, Path(folder), args.steps)
    total = sum(counted.launches.values()) / args.steps
    page = "\n".join([
        f"{total:.0f} launches a step; {1e3 * seconds / args.steps:.1f} ms a step on the CPU", "",
        *table("operator", counted.launches, args.steps), "", *table("called at", counted.places, args.steps), "",
    ])  # fmt: skip
    print(page)
    if args.out:
        command = f"tests/bench/launches.py --preset {args.preset} --steps {args.steps}"
        args.out.write_text(f"# Launches of a training step\n\n{header(provenance(SOURCES, command))}\n\n{page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
