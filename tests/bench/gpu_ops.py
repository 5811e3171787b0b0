"""Times every operator of a training step with that step's own inputs, and compares its results with the CPU's in
float64.

    python tests/bench/gpu_ops.py DATA --out DIR [--device cuda] [--preset fast] [--steps 200] [--set KEY=VALUE ...]

Trains some steps without graphs, makes a mesh, and records the inputs of the operators of one more step; of several
calls of an operator the largest. Times are medians: of one call with the L2 cache filled with something else before and
the stream kept busy until the call is queued ("cold"), and of a call in a graph of ten. Where the package has the
operator as torch code, that is timed in a graph as well. The share is the time that the copy of as many bytes as inputs
and results have takes, over the cold time; of a table of which few numbers are read it is too large. Writes ops.md.
With --device cpu it is a rehearsal, whose times are meaningless.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tempfile
import timeit
from collections.abc import Callable
from pathlib import Path

import torch
from splitnerf.config import parse_setting, preset
from splitnerf.data.dataset import load_dataset
from splitnerf.devices import tensor_cores
from splitnerf.training.loop import Training
from splitnerf_tools.bench.provenance import header, provenance
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

sys.path[:0] = [str(Path(__file__).parents[1] / "python"), str(Path(__file__).parents[1])]
import reference  # noqa: E402
from bench.gpu_train import Silence  # noqa: E402
from op_cases import ROUNDED_ALIKE, truth  # noqa: E402
from op_checks import as_tuple  # noqa: E402

SOURCES = ("cpp", "python/splitnerf/ops")
# an operator may be so many times as far from the truth as the CPU in float32 is, and so much more
FACTOR, FLOOR = 10.0, 1e-5
HEAD = ("operator", "ms, cold (quartiles)", "ms in a graph", "torch's", "GB/s", "share", "error", "")
HALVES = (torch.float16, torch.bfloat16)
Call = tuple[Callable, tuple]


class Recorded(TorchDispatchMode):
    """Within its block the largest call of each of our operators is kept, with copies of its arguments."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: dict[str, Call] = {}

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func._schema.name.split("::")[1]
        if func.namespace == "splitnerf" and not func._schema.is_mutable:
            if name not in self.calls or n_bytes(args) > n_bytes(self.calls[name][1]):
                self.calls[name] = func, tree_map(lambda x: x.detach().clone() if isinstance(x, Tensor) else x, args)
        return func(*args, **(kwargs or {}))


def n_bytes(values: object) -> int:
    return sum(x.numel() * x.element_size() for x in tree_leaves(values) if isinstance(x, Tensor))


def calls_of_a_step(data: Path, config, device: str, steps: int) -> dict[str, Call]:
    """The largest call of each operator in a step that follows `steps` others and a mesh."""
    with tempfile.TemporaryDirectory() as run:
        (Path(run) / "metrics.jsonl").touch()
        training = Training(
            load_dataset(data),
            config.replace({"cuda_graphs": False, "steps": 100 * steps}),
            Path(run),
            torch.device(device),
        )
        for i in range(steps):
            training.refresh()
            training.advance(Silence())
        training.mesh.request(training.progress)
        training.mesh.poll(wait=True)
        with Recorded() as recorded:
            training.refresh()
            training.advance(Silence())
    return recorded.calls


class Clock:
    """Times calls on one device; `seconds` are what one measurement may take, about."""

    def __init__(self, device: str, seconds: float):
        self.cuda, self.seconds = device == "cuda", seconds
        if self.cuda:
            l2 = getattr(torch.cuda.get_device_properties(0), "L2_cache_size", 64 << 20)
            self.other = torch.empty(4 * l2, dtype=torch.uint8, device=device)

    def __call__(self, call: Callable[[], object], cold: bool) -> tuple[float, float, float]:
        """Seconds of one call: lower quartile, median, upper quartile."""
        call()
        once = self._seconds(call, cold, 2)[-1]
        seconds = self._seconds(call, cold, max(7, min(100, int(self.seconds / max(once, 1e-6)))))
        return tuple(statistics.quantiles(seconds, n=4, method="inclusive"))

    def in_a_graph(self, call: Callable[[], object], n: int = 10) -> str:
        """Milliseconds of a call among `n` in a graph, on the CPU of a call alone; "waits" where it needs the host."""
        if not self.cuda:
            return f"{1e3 * self(call, False)[1]:.4f}"
        graph, side = torch.cuda.CUDAGraph(), torch.cuda.Stream()
        torch.cuda.set_sync_debug_mode("error")  # a recording that fails would leave torch's allocator in disorder
        try:
            with torch.cuda.stream(side):
                call()  # loads its kernels
        except RuntimeError as failure:
            return "waits" if "synchroniz" in str(failure) else str(failure).splitlines()[0][:200]
        finally:
            torch.cuda.set_sync_debug_mode("default")
        torch.cuda.synchronize()
        with torch.cuda.graph(graph):
            for _ in range(n):
                call()
        return f"{1e3 * self(graph.replay, False)[1] / n:.4f}"

    def _seconds(self, call: Callable[[], object], cold: bool, n: int) -> list[float]:
        if not self.cuda:
            return timeit.repeat(call, number=1, repeat=n)
        torch.cuda.synchronize()
        events = [(torch.cuda.Event(enable_timing=True), torch.cuda.Event(enable_timing=True)) for _ in range(n)]
        for begin, end in events:
            if cold:
                self.other.zero_()
            torch.cuda._sleep(300_000)  # a fraction of a millisecond in which the call is queued
            begin.record()
            call()
            end.record()
        torch.cuda.synchronize()
        return [begin.elapsed_time(end) / 1e3 for begin, end in events]


def on_cpu(args: tuple) -> tuple:
    return tree_map(lambda x: x.cpu() if isinstance(x, Tensor) else x, args)


def truth_of(name: str, func: Callable, args: tuple) -> tuple:
    """The results on the CPU in float64; in float32 where they depend on roundings."""
    args = on_cpu(args)
    stored = next((x for x in args if isinstance(x, Tensor) and x.dtype in HALVES), None)
    if stored is not None:  # a copy beside its table in float32: the operator reads the copy
        tables = [isinstance(x, Tensor) and x.shape == stored.shape for x in args]
        args = tuple(
            stored if there and x is not stored else x if not there or sum(tables) == 1 else None
            for x, there in zip(args, tables)
        )
    return as_tuple(func(*(args if name in ROUNDED_ALIKE else truth(args))))


def error_of(got: tuple, true: tuple) -> float:
    """The largest |got - true| / |true| over the results; nan where one is not finite or has another shape."""
    worst = 0.0
    for a, b in zip(got, true):
        a, b = a.cpu().double(), b.double()
        if a.shape != b.shape or not a.isfinite().all():
            return math.nan
        worst = max(worst, float((a - b).norm() / b.norm().clamp(min=1e-30))) if b.numel() else worst
    return worst


def measure(name: str, call: Call, clock: Clock, rate: float) -> list[str]:
    """A line of the table; `rate` is that of a copy, bytes a second."""
    func, args = call
    got = as_tuple(func(*args))
    moved, true = n_bytes(args) + n_bytes(got), truth_of(name, func, args)
    error, limit = error_of(got, true), FACTOR * error_of(as_tuple(func(*on_cpu(args))), true) + FLOOR
    low, cold, high = clock(lambda: func(*args), True)
    note = "" if error <= limit else f"failed: the error is above {limit:.0e}"
    if name == "sample_rays" and note:
        note = "the network's roundings decide which samples are kept"
    plain, beside = getattr(reference, name, None), ""
    if plain is not None:
        with torch.device(args[0].device), tensor_cores(True):
            try:
                beside = clock.in_a_graph(lambda: plain(*args))
            except Exception as failure:  # of other arguments, or for want of memory: the operator's own line stands
                beside = str(failure).splitlines()[0][:80]
    return [
        name,
        f"{1e3 * cold:.4f} ({1e3 * low:.4f} to {1e3 * high:.4f})",
        clock.in_a_graph(lambda: func(*args)),
        beside,
        f"{moved / cold / 1e9:.1f}",
        f"{moved / cold / rate:.3g}",
        f"{error:.1e}",
        note,
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--steps", type=int, default=200, help="before the one that is recorded (default: 200)")
    parser.add_argument("--seconds", type=float, default=0.1, help="of one measurement (default: 0.1)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")
    args = parser.parse_args()
    # all caches are read
    config = preset(args.preset).replace({"open_below": 0.0} | dict(map(parse_setting, args.settings)))
    calls, clock = calls_of_a_step(args.data, config, args.device, args.steps), Clock(args.device, args.seconds)
    source = torch.rand((1 << 29) if args.device == "cuda" else (1 << 16), device=args.device)
    target = torch.empty_like(source)
    rate = 2 * n_bytes(source) / clock(lambda: target.copy_(source), False)[1]
    source = target = None
    lines = [measure(name, call, clock, rate) for name, call in calls.items()]
    n_failed = sum("failed" in line[-1] for line in lines)
    rows = ["| " + " | ".join(cells) + " |" for cells in (HEAD, ["---"] * len(HEAD), *lines)]
    said = f"a copy {rate / 1e9:.0f} GB/s; {len(lines)} operators, {n_failed} failed"
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "ops.md").write_text(
        "\n".join(["# Operators of a step", "", header(provenance(SOURCES)), "", said, "", *rows]) + "\n"
    )
    print(said)
    return 1 if n_failed else 0


if __name__ == "__main__":
    sys.exit(main())
