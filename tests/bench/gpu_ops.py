"""Times every operator that has a kernel on a GPU, beside the card's own limits and its errors against the CPU in float64.

    python tests/bench/gpu_ops.py --out DIR [--device cuda] [--only hash_encode ...] [--tiny]

First the ceilings are measured: a large copy on the device, and a large matrix product in float32, tf32 and bfloat16. The floor
of an operator is the longer of two times: its bytes at the copy's rate, its operations at that of the float32 product; a share
is that floor over the time. Times are medians of events around one call, once with the L2 cache filled with something else
before each call ("cold"), once without ("warm"); in both the stream is kept busy until the call is queued, so that its launch is
not counted. Results are compared with the operator of the CPU on the same numbers in float64, where they depend on roundings (of which
a point beside a cell's face is enough for a Jacobian) with that in float32. Operators run in a process of their own, which is started again behind one that takes it down. Writes ops.csv,
line by line, and ops.md. --tiny with --device cpu is a rehearsal, whose times say nothing.
"""

from __future__ import annotations

import argparse
import csv
import faulthandler
import math
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import torch

from splitnerf.bench.provenance import header, provenance

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf/ops")
sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "python")]
from gpu_cases import Case, all_cases, bytes_moved  # noqa: E402
from gpu_world import TINY, Sizes, World, lib  # noqa: E402
from op_checks import as_tuple, has_cuda_kernel  # noqa: E402
from op_cases import ROUNDED_ALIKE, moved, truth  # noqa: E402

STORED = {"float32": torch.float32, "float16": torch.float16, "bfloat16": torch.bfloat16}
WORST = {"float32": 1e-4, "float16": 5e-3, "bfloat16": 5e-3}  # error beyond which a line has failed
CEILINGS = ("copy", "product float32", "product tf32", "product bfloat16")
COLUMNS = ("case", "dtype", "cold_ms", "low_ms", "high_ms", "warm_ms", "calls", "bytes", "operations", "GB_s", "GFLOP_s",
           "floor_ms", "limit", "share", "error", "eager_ms", "note")  # fmt: skip


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

    def _seconds(self, call: Callable[[], object], cold: bool, n: int) -> list[float]:
        if not self.cuda:
            times = []
            for _ in range(n):
                started = time.perf_counter()
                call()
                times.append(time.perf_counter() - started)
            return times
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


def ceilings(clock: Clock, device: str, tiny: bool) -> list[list[str]]:
    """A line for each: bytes or operations a second, as measured now."""
    source = torch.rand((1 << 16) if tiny else (1 << 29), device=device)
    target, rows = torch.empty_like(source), []
    moved_bytes = 2 * source.numel() * source.element_size()

    def line(name: str, dtype: str, spread: Spread, n_bytes: float, operations: float) -> list[str]:
        rates = [f"{n_bytes / spread.median / 1e9:.1f}", f"{operations / spread.median / 1e9:.1f}"]
        numbers = [*milliseconds(spread), "", str(spread.calls), f"{n_bytes:.0f}", f"{operations:.0f}", *rates]
        return [name, dtype, *numbers, *[""] * 6]

    rows.append(line("copy", "float32", clock(lambda: target.copy_(source), False), moved_bytes, 0))
    source = target = None
    n = 128 if tiny else 8192
    for name, dtype, precision in (
        ("float32", torch.float32, "highest"), ("tf32", torch.float32, "high"), ("bfloat16", torch.bfloat16, "highest"),
    ):  # fmt: skip
        torch.set_float32_matmul_precision(precision)
        a, b = (torch.randn(n, n, device=device).to(dtype) for _ in range(2))
        rows.append(line(f"product {name}", name, clock(lambda: a @ b, False), 0, 2 * n**3))
    torch.set_float32_matmul_precision("highest")
    return rows


def milliseconds(spread: Spread) -> list[str]:
    return [f"{1e3 * x:.5f}" for x in spread[:3]]


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
    """One line of the table; `rates` are bytes and operations a second."""
    inputs = case.inputs(world)
    if case.table is not None:
        inputs = tuple(x.to(STORED[dtype]) if i == case.table else x for i, x in enumerate(inputs))
    op, there = getattr(lib, case.op), moved(case.op, inputs, device)
    got = as_tuple(op(*there))
    if clock.cuda:
        torch.cuda.synchronize()
    n_bytes, operations = bytes_moved(case, world.sizes, there, got), case.operations(world.sizes, got)
    alike = case.op in ROUNDED_ALIKE or case.op.startswith("hash_encode_jacobian")  # a Jacobian jumps at a cell's face
    error = difference(got, as_tuple(op(*(inputs if alike else truth(inputs)))))
    finite, kept = all(bool(x.isfinite().all()) for x in got), got[0].numel()
    del got
    cold, warm = clock(lambda: op(*there), True), clock(lambda: op(*there), False)
    notes, eager_ms = [], ""
    if case.plain is not None and dtype == "float32":
        try:
            with torch.device(device):
                eager_ms = f"{1e3 * clock(lambda: case.plain(*there), True).median:.5f}"
        except Exception as failure:  # for want of memory, say: the operator's own line stands
            notes.append(f"eager: {first_line(failure)}")
    by_bytes, by_operations = n_bytes / rates[0], (0.0 if math.isnan(operations) else operations) / rates[1]
    floor = max(by_bytes, by_operations)
    if case.op == "sample_rays" and math.isnan(error) and finite:
        notes.append(f"the network's roundings decide which samples are kept: {kept} of them here")
    elif math.isnan(error):
        notes.append("failed: results differ in shape or are not finite")
    elif error > WORST[dtype]:
        notes.append(f"failed: the error is above {WORST[dtype]:.0e}")
    return [
        case.name, dtype, *milliseconds(cold), f"{1e3 * warm.median:.5f}", str(cold.calls), f"{n_bytes:.0f}",
        f"{operations:.0f}", f"{n_bytes / cold.median / 1e9:.1f}", f"{operations / cold.median / 1e9:.1f}",
        f"{1e3 * floor:.5f}", "bytes" if by_bytes >= by_operations else "operations", f"{floor / cold.median:.3g}",
        f"{error:.1e}", eager_ms, "; ".join(notes),
    ]  # fmt: skip


def first_line(failure: Exception) -> str:
    return (str(failure).strip().splitlines() or [type(failure).__name__])[0][:200]


def failed(name: str, dtype: str, why: str) -> list[str]:
    return [name, dtype, *[""] * (len(COLUMNS) - 3), why]


def wanted(only: list[str]) -> list[tuple[Case, str]]:
    cases = [case for case in all_cases() if not only or case.op in only]
    return [(case, dtype) for case in cases for dtype in (STORED if case.table is not None else ["float32"])]


def lines_of(path: Path) -> list[list[str]]:
    if not path.is_file():
        return []
    with path.open(newline="") as file:
        return list(csv.reader(file))[1:]


def append(path: Path, line: list[str]) -> None:
    with path.open("a", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(line)


def work(args: argparse.Namespace, path: Path) -> None:
    """Goes on behind the last line of the file."""
    clock = Clock(args.device, args.seconds)
    lines = lines_of(path)
    if len(lines) < len(CEILINGS):
        lines = ceilings(clock, args.device, args.tiny)
        for line in lines:
            append(path, line)
    known = {line[0]: line for line in lines}
    rates = float(known["copy"][9]) * 1e9, float(known["product float32"][10]) * 1e9
    world = World(TINY if args.tiny else Sizes())
    for case, dtype in wanted(args.only)[len(lines) - len(CEILINGS) :]:
        faulthandler.dump_traceback_later(args.stalled, exit=True)
        if time.time() > args.until:
            line = failed(case.name, dtype, "left out: no time")
        elif args.device == "cuda" and not has_cuda_kernel(case.op):
            line = failed(case.name, dtype, "no kernel in this build")
        else:
            try:
                line = measure(case, dtype, world, clock, args.device, rates)
            except ValueError as refused:  # an argument, such as a dtype
                line = failed(case.name, dtype, f"refused: {first_line(refused)}")
            except Exception as failure:
                append(path, failed(case.name, dtype, f"failed: {first_line(failure)}"))
                raise  # the device may be of no use to this process any more
        append(path, line)
    faulthandler.cancel_dump_traceback_later()


def markdown(lines: list[list[str]], device: str) -> str:
    """The table as a page; of the ceilings one line each."""
    by_name = [dict(zip(COLUMNS, line)) for line in lines]
    head = [row for row in by_name if row["case"] in CEILINGS]
    out = [f"# Operators on {device}", "", header(provenance(SOURCES, root=ROOT)), ""]
    out += [
        f"- {row['case']}: {row['GB_s'] + ' GB/s' if row['case'] == 'copy' else row['GFLOP_s'] + ' GFLOP/s'}"
        for row in head
    ]
    out += ["", "Cold: the L2 cache filled with something else before each call. Share: of the slower of the two limits, bytes at the rate of",
            "the copy and operations at that of the float32 product. Error: |difference| / |truth|, truth on the CPU in float64.", "",
            "| operator | dtype | ms, cold (quartiles) | ms, warm | GB/s | GFLOP/s | limit | share | error | x eager | |",
            "|---|---|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for row in by_name:
        if row["case"] in CEILINGS:
            continue
        if not row["cold_ms"]:
            out.append(f"| {row['case']} | {row['dtype']} |" + " |" * 8 + f" {row['note']} |")
            continue
        cold, low, high, warm = (f"{float(row[k]):.4f}" for k in ("cold_ms", "low_ms", "high_ms", "warm_ms"))
        ratio = f"{float(row['eager_ms']) / float(row['cold_ms']):.1f}" if row["eager_ms"] else ""
        cells = [row["case"], row["dtype"], f"{cold} ({low} to {high})", warm, row["GB_s"], row["GFLOP_s"], row["limit"],
                 row["share"], row["error"], ratio, row["note"]]  # fmt: skip
        out.append("| " + " | ".join(cells) + " |")
    return "\n".join(out) + "\n"


def device_name(device: str) -> str:
    return torch.cuda.get_device_name() if device == "cuda" else "the CPU"


def watch(path: Path, rows: list[tuple[str, str]], until: float) -> None:
    """Keeps a process at work on the lines that are missing; one that ends without a line has failed at it."""
    while len(lines := lines_of(path)) < len(CEILINGS) + len(rows):
        worker = subprocess.run([sys.executable, *sys.argv, "--until", str(until)], stderr=subprocess.PIPE, text=True)
        sys.stderr.write(worker.stderr)
        if len(lines_of(path)) > len(lines):
            continue
        if len(lines) < len(CEILINGS):
            return
        said = worker.stderr.strip().splitlines() or [f"ended with {worker.returncode}"]
        why = "took too long" if said[0].startswith("Timeout (") else said[-1][:200]
        append(path, failed(*rows[len(lines) - len(CEILINGS)], f"failed: {why}"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--only", action="append", default=[], metavar="OP")
    parser.add_argument("--tiny", action="store_true", help="small inputs")
    parser.add_argument("--seconds", type=float, default=0.2, help="of one measurement (default: .2)")
    parser.add_argument("--minutes", type=float, default=5.0, help="after which what is left is left out (default: 5)")
    parser.add_argument(
        "--stalled", type=float, default=45.0, help="seconds after which a line is given up (default: 45)"
    )
    parser.add_argument("--until", type=float, help=argparse.SUPPRESS)  # a process that works, not one that watches
    args = parser.parse_args()
    path = args.out / "ops.csv"
    if args.until is not None:
        work(args, path)
        return 0
    args.out.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    append(path, list(COLUMNS))
    rows = [(case.name, dtype) for case, dtype in wanted(args.only)]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what is there becomes a page all the same
    try:
        watch(path, rows, time.time() + 60 * args.minutes)
    finally:
        lines = lines_of(path)
        (args.out / "ops.md").write_text(markdown(lines, device_name(args.device)))
    n_failed = sum("failed" in line[-1] for line in lines)
    print(f"{len(lines) - len(CEILINGS)} of {len(rows)} lines, {n_failed} failed, in {args.out / 'ops.md'}")
    return 1 if n_failed or len(lines) < len(CEILINGS) + len(rows) else 0


if __name__ == "__main__":
    sys.exit(main())
