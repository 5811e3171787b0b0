"""One scene in several processes: time and bytes of a step, and three ways to sum the gradients.

    python tests/bench/ranks.py DATA [--preset cpu] [--ranks 2] [--steps 60] [--rounds 3] [--set KEY=VALUE]

Each round trains the same steps in one process and in several, with one thread each, of the same total batch, with all levels of the hash
grid open. Times of the processor count what a process itself works, so that they mean something on a machine that others use too.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace

import torch
import torch.distributed as dist
from torch import Tensor

from splitnerf.config import parse_setting, preset
from splitnerf.data.dataset import load_dataset
from splitnerf.training.loop import Training
from splitnerf.training.ranks import Alone, joined

WARM = 12  # steps before those that are timed


def sum_sparse(table: Tensor, ranks: Alone) -> tuple[Tensor, int]:
    """The sum of a table's gradients [n, f] from the rows that are not 0, and the bytes that a process sends."""
    rows = (table != 0).any(1).nonzero().squeeze(1).int()
    counts = [torch.zeros(1, dtype=torch.int64) for _ in range(ranks.size)]
    dist.all_gather(counts, torch.tensor([len(rows)]))
    most = int(max(counts))
    padded = torch.cat([rows, rows.new_zeros(most - len(rows))])
    values = torch.cat([table[rows], table.new_zeros(most - len(rows), table.shape[1])])
    all_rows = [torch.empty_like(padded) for _ in range(ranks.size)]
    all_values = [torch.empty_like(values) for _ in range(ranks.size)]
    dist.all_gather(all_rows, padded)
    dist.all_gather(all_values, values)
    total = torch.zeros_like(table)
    for at, part in zip(all_rows, all_values):  # in one order, so that all have the same bits
        total.index_add_(0, at, part)
    return total, (ranks.size - 1) * (8 + most * (4 + 4 * table.shape[1]))


class Product(torch.nn.Module):
    """A module whose gradients are what they are set to: those of the sum of its parameters times them."""

    def __init__(self, parameters: list[Tensor]):
        super().__init__()
        self.factors = [torch.zeros_like(p) for p in parameters]
        self.parts = torch.nn.ParameterList(torch.nn.Parameter(p.detach().clone()) for p in parameters)

    def forward(self) -> Tensor:
        return torch.stack([(part * factor).sum() for part, factor in zip(self.parts, self.factors)]).sum()


class ByTorch:
    """Sums gradients by torch's DistributedDataParallel, in a module that does nothing else."""

    def __init__(self, parameters: list[Tensor]):
        self.alone, inner = Product(parameters), Product(parameters)
        divided = torch.nn.parallel.DistributedDataParallel(inner, gradient_as_bucket_view=True)
        self.modules = {self.alone: self.alone, divided: inner}

    def sum(self, gradients: list[Tensor]) -> tuple[list[Tensor], float, float]:
        """The means of gradients over the processes, and the ms that they add to a backward pass: on the wall, of the processor."""
        took = []
        for module, inner in self.modules.items():
            torch._foreach_copy_(inner.factors, gradients)
            module.zero_grad(set_to_none=inner is self.alone)  # the other's are views of its buckets
            loss = module()
            dist.barrier()
            clock, work = time.perf_counter(), time.process_time()
            loss.backward()
            took.append((1e3 * (time.perf_counter() - clock), 1e3 * (time.process_time() - work)))
        (wall, cpu), (wall_summed, cpu_summed) = took
        return [part.grad for part in inner.parts], wall_summed - wall, cpu_summed - cpu


class Timed:
    """Times a method of the processes each time that it is called; on the wall and of the processor, in ms."""

    def __init__(self, ranks: Alone, name: str):
        self.calls: list[tuple[float, float]] = []
        inner = getattr(ranks, name)

        def outer(*arguments):
            before = time.perf_counter(), time.process_time()
            result = inner(*arguments)
            self.calls.append((1e3 * (time.perf_counter() - before[0]), 1e3 * (time.process_time() - before[1])))
            return result

        setattr(ranks, name, outer)


def compare_sums(training: Training, found: dict[str, list[float]]) -> None:
    """Lets each step sum its gradients in three ways, checks that they agree, and notes times and bytes."""
    ranks, table = training.ranks, training.model.sdf_field.grid.table
    summed: Callable[[Iterable[Tensor]], None] = ranks.sum_gradients
    by_torch: dict[int, ByTorch] = {}  # by the number of parameters: the light's are not among them in each step

    def all_ways(parameters: Iterable[Tensor]) -> None:
        parameters = list(parameters)
        if len(parameters) not in by_torch:
            by_torch[len(parameters)] = ByTorch(parameters)
        gradients = [torch.zeros_like(p) if p.grad is None else p.grad.clone() for p in parameters]
        means, wall, cpu = by_torch[len(parameters)].sum(gradients)
        found["torch ms"].append(wall)
        found["torch cpu ms"].append(cpu)
        own = table.grad.detach().clone().view(-1, training.config.surface.n_features)
        dist.barrier()
        clock, work = time.perf_counter(), time.process_time()
        sparse, n_bytes = sum_sparse(own, ranks)
        found["sparse ms"].append(1e3 * (time.perf_counter() - clock))
        found["sparse cpu ms"].append(1e3 * (time.process_time() - work))
        dist.barrier()
        clock, work = time.perf_counter(), time.process_time()
        summed(parameters)
        found["dense ms"].append(1e3 * (time.perf_counter() - clock))
        found["dense cpu ms"].append(1e3 * (time.process_time() - work))
        n = sum(p.numel() for p in parameters)
        found["dense bytes"].append(2 * (ranks.size - 1) / ranks.size * 4 * n)
        found["sparse bytes"].append(n_bytes + 2 * (ranks.size - 1) / ranks.size * 4 * (n - table.numel()))
        found["rows"].append(float((own != 0).any(1).sum()))
        found["entries"].append(float(len(own)))
        error = (sparse.view_as(table) - table.grad).abs().max() / table.grad.abs().max()
        largest = max(float(p.grad.abs().max()) for p in parameters if p.grad is not None)
        apart = [(ranks.size * mean - p.grad).abs().max() for mean, p in zip(means, parameters) if p.grad is not None]
        of_torch = float(max(apart))
        if not max(float(error), of_torch / largest) < 1e-5:
            raise SystemExit(f"the sums are {error:.1e} and {of_torch / largest:.1e} apart")

    ranks.sum_gradients = all_ways


def work(args: argparse.Namespace) -> None:
    """Trains in this process, alone or with others; the first one prints medians as JSON."""
    with joined() as ranks, tempfile.TemporaryDirectory() as folder:
        fixed = {"steps": 2000, "background_meshes": False, "cuda_graphs": False, "levels_open_by": 0.0}
        config = preset(args.preset).replace(fixed | dict(parse_setting(text) for text in args.settings))
        dataset = load_dataset(args.data, downscale=args.downscale)
        training = Training(dataset, config, Path(folder), torch.device("cpu"), ranks=ranks)
        found: dict[str, list[float]] = {name: [] for name in (
            "sparse ms", "sparse cpu ms", "dense ms", "dense cpu ms", "torch ms", "torch cpu ms", "dense bytes", "sparse bytes", "rows",
            "entries",
        )}  # fmt: skip
        if args.compare:
            compare_sums(training, found)
        collectives = {name: Timed(ranks, name) for name in ("agree", "sum_gradients") if ranks.several}
        wall, cpu = [], []
        for _ in range(WARM + args.steps):
            clock, process = time.perf_counter(), time.process_time()
            ranks.stops(False, training.started)
            training.refresh()
            training.advance(SimpleNamespace(show=lambda *_: None))
            wall.append(1e3 * (time.perf_counter() - clock))
            cpu.append(1e3 * (time.process_time() - process))
        numbers = {"wall ms": wall[WARM:], "rays": [float(training.n_rays)]}
        numbers |= {name: values[WARM:] for name, values in found.items() if values}
        for name, timed in collectives.items():
            numbers |= {f"{name} ms": [x for x, _ in timed.calls[WARM:]], f"{name} cpu ms": [x for _, x in timed.calls[WARM:]]}
        medians = {name: statistics.median(values) for name, values in numbers.items() if values}
        medians["cpu ms, mean"] = statistics.mean(cpu[WARM:])  # with the grid's refreshes
        every = gathered(medians, ranks) if ranks.several else medians
        if ranks.is_first:
            print(json.dumps(every))


def gathered(medians: dict[str, float], ranks: Alone) -> dict[str, float]:
    """Of each number the largest of all processes."""
    parts: list[dict[str, float]] = [{}] * ranks.size
    dist.all_gather_object(parts, medians)
    return {name: max(part[name] for part in parts) for name in medians}


def measured(args: argparse.Namespace, n: int, compare: bool) -> dict[str, float]:
    """The medians of n processes with one thread each."""
    launcher = ["-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(n)] if n > 1 else []
    own = [__file__, str(args.data), "--worker", "--preset", args.preset, "--steps", str(args.steps), "--downscale", str(args.downscale)]
    own += [part for text in args.settings for part in ("--set", text)]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *launcher, *own, *(["--compare"] if compare else [])], env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--set", action="append", default=[], dest="settings", metavar="KEY=VALUE")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--compare", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        work(args)
        return
    rounds = []
    for i in range(args.rounds):
        one, several = measured(args, 1, False), measured(args, args.ranks, False)
        rounds.append((one["wall ms"] / several["wall ms"], one["cpu ms, mean"] / several["cpu ms, mean"]))
        print(f"round {i + 1}: load {os.getloadavg()[0]:.1f}")
        for n, numbers in ((1, one), (args.ranks, several)):
            print(f"  {n} processes: {', '.join(f'{name} {value:.2f}' for name, value in numbers.items())}", flush=True)
    for name, values in zip(("wall, medians of steps", "processor, means of steps"), zip(*rounds)):
        print(f"speed-up by {name}: {statistics.median(values):.2f} ({', '.join(f'{x:.2f}' for x in values)})")
    compared = measured(args, args.ranks, True)
    print(f"three sums in each step: {', '.join(f'{name} {value:.2f}' for name, value in compared.items())}")


if __name__ == "__main__":
    main()
