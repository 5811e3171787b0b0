"""The budget of a training step: the time of each operator on one and two threads, by instruction set, and its share of a limit.

    python tests/bench/step.py RUN DATA [--steps 200] [--out docs/benchmarks/step.md]

RUN is a finished training of DATA. The steps are those near its end. The operators must pass `splitnerf doctor`'s test with each
instruction set before anything is timed. Beside them stands the same step in plain torch: the same samples, and every operator that
tests/reference.py has in that form.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

CASES = tuple((isa, threads) for isa in ("avx2", "avx512") for threads in (1, 2))
OTHERS = {  # what keeps torch to an instruction set, too
    "avx2": {"ATEN_CPU_CAPABILITY": "avx2", "MKL_ENABLE_INSTRUCTIONS": "AVX2", "ONEDNN_MAX_CPU_ISA": "AVX2"},
    "avx512": {},
}
LATE = 0.9  # the progress of the timed steps
LEAST = 0.3  # ms, below which an operator is counted with the others
# Arguments of which operators read what they need at random; the others are read once, from end to end.
GATHERED = {"table", "stored", "vertices", "vertex_normals", "starts", "order", "bits", "hits", "levels", "cells"}
GROUPS = {
    "splitnerf::": "other operators of splitnerf",
    "aten::": "other operators of torch",
    "": "autograd's nodes and the rest",
}
SOURCES = tuple(f"cpp/{name}" for name in ("src", "include", "torch"))
SOURCES += tuple(f"python/splitnerf/{name}" for name in ("training", "render", "fields"))


def use_plain_torch() -> None:
    """From here on the operators that tests/reference.py has are its functions."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    import reference
    import torch
    from splitnerf.ops import light, rays, sdf, shading, training, visibility

    in_form = {  # where an operator returns its terms in one tensor, or what its backward pass reads as well
        "sdf_field": lambda *inputs: reference.sdf_field(*inputs[:-1]),
        "pixel_losses": lambda *inputs: torch.stack(reference.pixel_losses(*inputs)),
        "gradient_losses": lambda *inputs: (torch.stack(reference.gradient_losses(*inputs)),),
        "quadratic_entropy": lambda x: (reference.quadratic_entropy(x),),
    }

    class Plain:
        def __getattr__(self, name: str):
            return in_form.get(name) or getattr(reference, name, None) or getattr(torch.ops.splitnerf, name)

    for module in (light, rays, sdf, shading, training, visibility):
        module.lib = Plain()


def measured(run: Path, data: Path, n_steps: int, plain: bool) -> dict:
    """Times and counts of this process's steps: ms a step, then for each operator ms, calls and bytes a step; of a step in plain torch the
    time alone."""
    import torch
    from splitnerf.pipeline import load_splits
    from splitnerf.training.checkpoint import config_of, load_checkpoint
    from splitnerf.training.loop import Training
    from splitnerf_tools.doctor.self_test import failures
    from torch.profiler import ProfilerActivity, profile
    from torch.utils._python_dispatch import TorchDispatchMode
    from torch.utils._pytree import tree_leaves

    if failed := failures("cpu"):
        sys.exit(f"nothing is timed, as operators fail their test: {failed}")

    class Work(TorchDispatchMode):
        """Adds up what each operator does: bytes of the tensors that it reads and writes, random reads, flops."""

        def __init__(self):
            super().__init__()
            self.moved, self.gathers, self.flops = Counter(), Counter(), Counter()

        def __torch_dispatch__(self, func, types, args=(), kwargs=None):
            result, name = func(*args, **(kwargs or {})), func.name().split(".")[0]
            of = dict(zip((argument.name for argument in func._schema.arguments), args))
            whole = ([x for key, x in of.items() if key not in GATHERED], kwargs, result)
            tensors = {id(x): x for x in tree_leaves(whole) if isinstance(x, torch.Tensor)}
            self.moved[name] += sum(x.numel() * x.element_size() for x in tensors.values())
            if name.startswith("splitnerf::"):
                gathers, flops = work_at_a_point(name.removeprefix("splitnerf::"), of)
                points = int(result[4].sum()) if name.endswith("sample_rays") else len(args[0])
                self.gathers[name] += points * gathers
                self.flops[name] += points * flops
            return result

    class Silent:
        def show(self, progress: float, message: str) -> None:
            pass

    config = config_of(load_checkpoint(run / "checkpoint.pt"))
    dataset, _ = load_splits(data, 1, config.reading)
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(run / "checkpoint.pt", folder)
        training = Training(dataset, config, Path(folder), torch.device("cpu"))
        training.restore()
        training.progress_at = lambda step, seconds: LATE
        training.mesh.asked_at = 1.0

        def steps(n: int) -> float:
            began = time.perf_counter()
            for _ in range(n):
                training.refresh()
                training.advance(Silent())
            return 1e3 * (time.perf_counter() - began) / n

        if plain:
            use_plain_torch()
            steps(4)
            return {"wall": sorted(steps(4) for _ in range(5))[2]}
        steps(20)
        wall = sorted(steps(n_steps // 5) for _ in range(5))[2]
        with profile(activities=[ProfilerActivity.CPU]) as profiled:
            steps(n_steps)
        with Work() as work:
            steps(16)  # a whole period of what is refreshed
        rows = {
            event.key: (
                event.self_cpu_time_total / n_steps / 1e3,
                event.count / n_steps,
                *(counter[event.key] / 16 for counter in (work.moved, work.gathers, work.flops)),
            )
            for event in profiled.key_averages()
        }
        level, at = torch.rand(1 << 17, dtype=torch.float64), torch.randint(1 << 17, (1 << 21,))  # entries of 8 bytes
        gather = min(_timed(lambda: level.index_select(0, at)) for _ in range(5))
        big = torch.rand(2, 1 << 21)  # as large as the hash grid
        copy = min(_timed(lambda: big[0].copy_(big[1])) for _ in range(20))
        square = torch.rand(1024, 1024)
        product = min(_timed(lambda: square @ square) for _ in range(5))
        rates = {
            "copy": 4 * big.numel() / copy / 1e9,
            "gathers": len(at) / gather / 1e9,
            "flops": 2 * 1024**3 / product / 1e9,
        }
        return {"wall": wall, "rays": training.n_rays, "rows": rows, **rates}


def work_at_a_point(operator: str, of: dict) -> tuple[int, int]:
    """The random reads and additions, and the flops, of an operator at a point, from its arguments; 0 of others than these."""
    if operator == "cached_occlusion":
        return 0, 60 * len(of["directions"])  # cosine, share and lobe of a direction, and fourteen sums
    if operator.startswith("light_lookup"):
        return 8, 0  # four texels of two maps
    if "n_active" not in of:
        return 0, 0
    corners, n_features = 8 * of["n_active"], of["table"].shape[1]
    (width, n_inputs), n_outputs = of["hidden"].shape, of["out"].shape[0]
    layer, last, encoding = 2 * width * n_inputs, 2 * width * n_outputs, 2 * corners * n_features
    return {
        "sdf_field": (corners, 2 * layer + last + 4 * encoding),  # also the derivatives by the position
        "sdf_field_backward": (2 * corners, 6 * layer + 3 * last + 8 * encoding),
    }.get(operator, (corners, layer + 2 * width + encoding))


def _timed(body) -> float:
    began = time.perf_counter()
    body()
    return time.perf_counter() - began


def asked(run: Path, data: Path, n_steps: int, isa: str, threads: int, plain: bool = False) -> dict | None:
    """What a process of its own measures; None where the processor has no such instruction set."""
    environment = os.environ | OTHERS[isa] | {"SPLITNERF_ISA": isa, "OMP_NUM_THREADS": str(threads)}
    words = [sys.executable, __file__, run, data, "--steps", str(n_steps), "--measure", *["--plain"] * plain]
    done = subprocess.run(words, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        print(f"{isa}, {threads} threads: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])


def page(cases: dict[tuple[str, int], dict], head: str) -> str:
    """The page of docs/benchmarks."""
    rays = next(iter(cases.values()))["rays"]
    lines = ["# A training step", "", head, "", f"{rays} rays a step, near the end of a run.", ""]
    lines += ["| | " + " | ".join(f"{isa}, {threads} thread{'s' * (threads > 1)}" for isa, threads in cases) + " |"]
    lines += ["|---|" + "---|" * len(cases)]
    rows = {
        "wall": "a step, ms",
        "plain": "the same step in plain torch, ms",
        "copy": "copying 8 MB, GB/s",
        "gathers": "random reads of 8 bytes from 1 MB, 10^9 a second",
        "flops": "a matrix product, GFLOP/s",
    }
    for key, name in rows.items():
        lines.append(f"| {name} | " + " | ".join(f"{case[key]:.3g}" for case in cases.values()) + " |")
    columns = "| operator | ms | calls | ms on 2 threads | divided | 8 cores, by count | MB | share of its limit |"
    for isa in sorted({isa for isa, _ in cases}):
        one, two = cases[isa, 1], cases[isa, 2]
        lines += ["", f"## {isa}", "", columns, "|---" * 8 + "|"]
        groups, eight = {group: [0.0, 0.0, 0.0] for group in GROUPS}, 0.0
        ordered = sorted(one["rows"].items(), key=lambda row: -row[1][0])
        for name, (ms, calls, moved, gathers, flops) in ordered:
            on_two = two["rows"].get(name, (ms,))[0]
            share = min(1.0, max(0.0, 2 * (1 - on_two / ms))) if ms > 0 else 0.0
            on_eight = ms * (1 - share + share / 8)
            eight += on_eight
            if ms < LEAST:
                group = next(start for start in GROUPS if name.startswith(start))
                groups[group] = [a + b for a, b in zip(groups[group], (ms, calls, on_two))]
                continue
            least = {
                "bandwidth": moved / one["copy"],
                "reads": gathers / one["gathers"],
                "FMA": flops / one["flops"],
            }  # ns
            of = max(least, key=least.get)
            limit = f"{least[of] / ms / 1e6:.0%}, {of}" if moved else "-"
            lines.append(
                f"| {name} | {ms:.2f} | {calls:.1f} | {on_two:.2f} | {share:.0%} | {on_eight:.2f} | {moved / 1e6:.2f} | {limit} |"
            )
        for group, (ms, calls, on_two) in groups.items():
            lines.append(f"| {GROUPS[group]}, each below {LEAST} ms | {ms:.2f} | {calls:.0f} | {on_two:.2f} | | | | |")
        total, on_two = (sum(row[0] for row in case["rows"].values()) for case in (one, two))
        lines.append(f"| sum | {total:.2f} | | {on_two:.2f} | | {eight:.2f} | | |")
    lines += [
        "",
        "Times are those of torch's profiler, about a microsecond too long for each call. MB: what an operator reads and writes as a whole. *Divided*:",
        "the share of the time that two threads halve; *8 cores* follows from it by Amdahl's law and was not measured. *Share of its limit*: the time that",
        "these bytes, the random reads or the flops alone would take at the rates above, whichever is longest.",
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--out", type=Path, default=Path("docs/benchmarks/step.md"))
    parser.add_argument("--measure", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--plain", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.measure:
        print(json.dumps(measured(args.run, args.data, args.steps, args.plain)))
        return
    from splitnerf_tools.bench.provenance import header, provenance

    inputs = args.run, args.data, args.steps
    cases = {case: found for case in CASES if (found := asked(*inputs, *case)) is not None}
    for case, found in cases.items():
        found["plain"] = asked(*inputs, *case, plain=True)["wall"]
    facts = provenance(SOURCES, f"python tests/bench/step.py {args.run.name} {args.data.name}")
    del facts["threads"], facts["kernels"]
    args.out.write_text(page(cases, header(facts)))
    print(args.out)


if __name__ == "__main__":
    main()
