"""Times every operator of a training step, beside the card's limits, its errors against the CPU, and torch's own code in a graph.

    python tests/bench/gpu_ops.py --out DIR [--device cuda] [--tiny]

First the ceilings are measured: a large copy on the device, and a large matrix product in float32, tf32 and bfloat16. The floor
of an operator is the longer of two times: its bytes at the copy's rate, its operations at that of the float32 product; a share
is that floor over the time. Times are medians: of one call, with the L2 cache filled with something else before, the stream kept busy
until the call is queued, so that its launch is not counted ("cold"); and of a call in a graph of ten, as a training repeats them. Where the
package has the operator as torch code, that is timed in a graph as well, the backward pass together with the forward one. Results are
compared with the operator of the CPU on the same numbers in float64, where they depend on roundings with that in float32. Writes
ops.md, anew with each line. --tiny with --device cpu is a rehearsal, whose times say nothing.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
import timeit
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import torch

from splitnerf.devices import tensor_cores
from splitnerf.ops import AdamW
from splitnerf_tools.bench.provenance import header, provenance

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf/ops")
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "python")]
from gpu_cases import Case, all_cases, as_torch, bytes_moved  # noqa: E402
from gpu_world import TINY, Sizes, World, lib  # noqa: E402
from op_checks import as_tuple, has_cuda_kernel  # noqa: E402
from op_cases import ROUNDED_ALIKE, moved, truth  # noqa: E402

STORED = {"float32": torch.float32, "float16": torch.float16, "bfloat16": torch.bfloat16}
# Error beyond which a line has failed; the field has the limit of 16 bits, as a position's rounding is 1e-4 of its finest cell.
WORST = {"float32": 1e-4, "float16": 5e-3, "bfloat16": 5e-3}
WAITS = ("sample_rays", "spread_samples")  # without a room for their results
IN_A_GRAPH = 10  # calls
HEAD = ("operator", "dtype", "ms, cold (quartiles)", "ms in a graph", "torch's", "GB/s", "GFLOP/s", "limit", "share", "error", "")


class Spread(NamedTuple):
    """Seconds of one call: median and quartiles, of so many calls."""

    median: float
    low: float
    high: float
    calls: int


class Clock:
    """Times calls on one device.

    Args:
        device: "cuda" or "cpu".
        seconds: That one measurement may take, about.
    """

    def __init__(self, device: str, seconds: float):
        self.cuda, self.seconds = device == "cuda", seconds
        if self.cuda:
            l2 = getattr(torch.cuda.get_device_properties(0), "L2_cache_size", 64 << 20)
            self.other = torch.empty(4 * l2, dtype=torch.uint8, device=device)

    def __call__(self, call: Callable[[], object], cold: bool) -> Spread:
        for _ in range(2):
            call()
        once = self._seconds(call, cold, 1)[0]
        seconds = self._seconds(call, cold, max(7, min(100, int(self.seconds / max(once, 1e-6)))))
        low, median, high = statistics.quantiles(seconds, n=4, method="inclusive")
        return Spread(median, low, high, len(seconds))

    def in_a_graph(self, call: Callable[[], object]) -> float:
        """Seconds of a call among :data:`IN_A_GRAPH` in a graph; on the CPU of a call alone. Raises RuntimeError where it waits."""
        if not self.cuda:
            return self(call, False).median
        graph, side = torch.cuda.CUDAGraph(), torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        torch.cuda.set_sync_debug_mode("error")  # a recording that fails would leave torch's allocator in disorder
        try:
            with torch.cuda.stream(side):
                call()  # loads its kernels
        finally:
            torch.cuda.set_sync_debug_mode("default")
        torch.cuda.current_stream().wait_stream(side)
        torch.cuda.synchronize()
        with torch.cuda.graph(graph):
            for _ in range(IN_A_GRAPH):
                call()
        return self(graph.replay, False).median / IN_A_GRAPH

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


def ceilings(clock: Clock, device: str, tiny: bool) -> dict[str, float]:
    """Bytes a second of a copy, operations a second of products, as measured now."""
    source = torch.rand((1 << 16) if tiny else (1 << 29), device=device)
    target = torch.empty_like(source)
    found = {"copy": 2 * source.numel() * source.element_size() / clock(lambda: target.copy_(source), False).median}
    source = target = None
    n = 128 if tiny else 8192
    for name, dtype in (("float32", torch.float32), ("tf32", torch.float32), ("bfloat16", torch.bfloat16)):
        a, b = (torch.randn(n, n, device=device).to(dtype) for _ in range(2))
        with tensor_cores(name == "tf32"):
            found[f"product {name}"] = 2 * n**3 / clock(lambda: a @ b, False).median
    return found


def difference(got: tuple, true: tuple) -> float:
    """The largest of |got - true| / |true| over the results; nan where one is not finite or has another shape."""
    worst = 0.0
    for a, b in zip(got, true):
        a, b = a.detach().cpu().double(), b.detach().double()
        if a.shape != b.shape:
            return math.nan
        worst = max(worst, float((a - b).norm() / b.norm().clamp(min=1e-30))) if b.numel() else worst
    return worst


def measure(case: Case, dtype: str, world: World, clock: Clock, device: str, rates: tuple[float, float]) -> list[str]:
    """A line of the table but for torch's time; `rates` are bytes and operations a second."""
    inputs = case.inputs(world)
    if case.table is not None:
        inputs = tuple(x.to(STORED[dtype]) if i == case.table else x for i, x in enumerate(inputs))
    op, there = getattr(lib, case.op), moved(case.op, inputs, device)
    got = as_tuple(op(*there))
    n_bytes, operations = bytes_moved(case, world.sizes, there, got), case.operations(world.sizes, got)
    error = difference(got, as_tuple(op(*(inputs if case.op in (*ROUNDED_ALIKE, "place_samples") else truth(inputs)))))
    finite, kept = all(bool(x.isfinite().all()) for x in got), got[0].numel()
    del got
    cold, note = clock(lambda: op(*there), True), ""
    by_bytes, by_operations = n_bytes / rates[0], operations / rates[1]
    if case.op == "sample_rays" and math.isnan(error) and finite:
        note = f"the network's roundings decide which samples are kept: {kept} of them here"
    elif math.isnan(error):
        note = "failed: results differ in shape or are not finite"
    elif error > (worst := WORST["float16" if case.op.startswith("sdf_field") else dtype]):
        note = f"failed: the error is above {worst:.0e}"
    low, median, high = (1e3 * x for x in (cold.low, cold.median, cold.high))
    return [
        case.op, dtype, f"{median:.4f} ({low:.4f} to {high:.4f})", "waits" if case.op in WAITS else graphed(clock, lambda: op(*there)), "",
        f"{n_bytes / cold.median / 1e9:.1f}", f"{operations / cold.median / 1e9:.1f}",
        "bytes" if by_bytes >= by_operations else "operations", f"{max(by_bytes, by_operations) / cold.median:.3g}", f"{error:.1e}", note,
    ]  # fmt: skip


def graphed(clock: Clock, call: Callable[[], object]) -> str:
    """Milliseconds in a graph; or that it waits for the host, or what else stands against it."""
    try:
        return f"{1e3 * clock.in_a_graph(call):.4f}"
    except RuntimeError as failure:
        return "waits" if "synchroniz" in str(failure) else first_line(failure)


def by_torch(case: Case, world: World, clock: Clock, device: str) -> str:
    """The time of torch's code for a case in a graph, in milliseconds; empty where there is none."""
    if (found := as_torch(case)) is None:
        return ""
    plain, inputs = found
    there = moved(case.op, inputs(world), device)
    with torch.device(device), tensor_cores(True):
        return graphed(clock, lambda: plain(*there))


def optimisers(clock: Clock, device: str, spec_entries: int) -> list[list[str]]:
    """A step over the table and 17 small parameters: all rows, those with a gradient (a tenth), and torch's own fused step."""
    shapes = [(spec_entries, 2), *[(64, 64)] * 17]
    params = [torch.nn.Parameter(torch.randn(shape, device=device)) for shape in shapes]
    lines = []
    for variant, share, make in (
        ("all rows", 1.0, lambda: AdamW(params)), ("a tenth of the rows", 0.1, lambda: AdamW(params, sparse=True)),
        ("torch's, fused", 1.0, lambda: torch.optim.AdamW(params, fused=True, capturable=device == "cuda")),
    ):  # fmt: skip
        for x in params:
            x.grad = torch.randn_like(x) * (torch.rand(len(x), 1, device=device) < share)
        step = make().step
        cold = clock(step, True)
        ms = [f"{1e3 * x:.4f}" for x in (cold.median, cold.low, cold.high)]
        lines.append([f"AdamW, {variant}", "float32", f"{ms[0]} ({ms[1]} to {ms[2]})", graphed(clock, step), *[""] * (len(HEAD) - 4)])
    return lines


def first_line(failure: Exception) -> str:
    return (str(failure).strip().splitlines() or [type(failure).__name__])[0][:200]


def markdown(rates: dict[str, float], lines: list[list[str]], device: str) -> str:
    """The table as a page; of the ceilings one line each."""
    out = [f"# Operators on {device}", "", header(provenance(SOURCES, root=ROOT)), ""]
    out += [f"- {name}: {rate / 1e9:.1f} {'GB/s' if name == 'copy' else 'GFLOP/s'}" for name, rate in rates.items()]
    out += ["", "Cold: the L2 cache filled with something else before each call. In a graph: a call among ten. Torch's: the same as torch code in a",
            "graph with products in TF32, a backward pass with its forward one; \"waits\": it needs the host. Share: of the slower of the two",
            "limits, bytes at the rate of the copy and operations at that of the float32 product. Error: |difference| / |truth|, truth on the CPU in float64.", ""]  # fmt: skip
    return "\n".join([*out, *("| " + " | ".join(cells) + " |" for cells in (HEAD, ["---"] * len(HEAD), *lines))]) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--tiny", action="store_true", help="small inputs")
    parser.add_argument("--seconds", type=float, default=0.1, help="of one measurement (default: .1)")
    parser.add_argument("--minutes", type=float, default=5.0, help="after which what is left is left out (default: 5)")
    args = parser.parse_args()
    until, clock, world = time.monotonic() + 60 * args.minutes, Clock(args.device, args.seconds), World(TINY if args.tiny else Sizes())
    args.out.mkdir(parents=True, exist_ok=True)
    rates, lines = ceilings(clock, args.device, args.tiny), []
    cases = [(case, dtype) for case in all_cases() for dtype in (STORED if case.table is not None else ["float32"])]
    device = torch.cuda.get_device_name() if args.device == "cuda" else "the CPU"

    def keep(line: list[str] | None = None) -> None:
        lines.extend([line] if line else [])
        (args.out / "ops.md").write_text(markdown(rates, lines, device))

    for case, dtype in cases:
        if time.monotonic() > until:
            keep([case.op, dtype, *[""] * (len(HEAD) - 3), "left out: no time"])
            continue
        try:
            known = args.device == "cpu" or has_cuda_kernel(case.op)
            note = "no kernel in this build"
            line = measure(case, dtype, world, clock, args.device, (rates["copy"], rates["product float32"])) if known else None
        except ValueError as refused:  # an argument, such as a dtype
            line, note = None, f"refused: {first_line(refused)}"
        except Exception as failure:  # the next one is tried
            line, note = None, f"failed: {first_line(failure)}"
        keep(line or [case.op, dtype, *[""] * (len(HEAD) - 3), note])
    for line in optimisers(clock, args.device, world.sizes.spec.n_entries):
        keep(line)
    for (case, dtype), line in zip(cases, lines):
        if dtype == "float32" and line[2] and time.monotonic() < until:
            try:
                line[4] = by_torch(case, world, clock, args.device)
            except Exception as failure:  # for want of memory, say: the operator's own line stands
                line[-1] += f" torch's: {first_line(failure)}"
            keep()
    n_failed = sum("failed" in line[-1] for line in lines)
    print(f"{len(lines)} lines, {n_failed} failed, {sum(bool(line[4]) for line in lines)} beside torch's code, in {args.out / 'ops.md'}")
    return 1 if n_failed else 0


if __name__ == "__main__":
    sys.exit(main())
