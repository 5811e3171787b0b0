"""Trains and says what it took, or profiles some steps of a training.

    python tests/bench/gpu_train.py DATA --out RUN --preset fast --device cuda [--steps N] [--max-minutes M] [--set KEY=VALUE]
    python tests/bench/gpu_train.py DATA --out RUN --preset fast --device cuda --steps 600 --profile profile.md

The first is `splitnerf train` with the same options; its last line says steps, seconds, steps a second of the second half of
the run, the largest memory that torch's allocator gave out, and the main scores, and RUN/training.json holds all of them. The second
profiles 20 steps from two thirds of the steps on, ends there, and writes which kernels took the time, and how much of it
the device stood still.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from pathlib import Path

import torch
from torch.autograd import DeviceType
from torch.optim.optimizer import register_optimizer_step_post_hook
from torch.profiler import ProfilerActivity, profile

from splitnerf.bench.provenance import header, provenance
from splitnerf.cli import main as splitnerf

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf")
PROFILED = 20  # steps
SHOWN = 60  # kernels


class Enough(BaseException):
    """Ends a training that was only to be profiled; no error, so that the command line lets it pass."""


class StepProfiler:
    """Profiles `PROFILED` optimiser steps after the first so many.

    Args:
        device: "cuda" or "cpu".
        first: Steps before.
    """

    def __init__(self, device: str, first: int):
        activities = [ProfilerActivity.CPU] + [ProfilerActivity.CUDA] * (device == "cuda")
        self.device, self.first, self.steps = device, first, 0
        self.profile, self.started, self.seconds = profile(activities=activities), 0.0, 0.0

    def __call__(self, *_: object) -> None:
        self.steps += 1
        if self.steps not in (self.first, self.first + PROFILED):
            return
        if self.device == "cuda":
            torch.cuda.synchronize()
        if self.steps == self.first:
            self.profile.start()
            self.started = time.perf_counter()
        else:
            self.seconds = time.perf_counter() - self.started
            self.profile.stop()
            raise Enough

    def markdown(self) -> str:
        """Kernels (on the CPU: operators) by their own time, in milliseconds a step."""
        on_device = self.device == "cuda"
        events = [
            x for x in self.profile.key_averages()
            if (x.device_type == DeviceType.CUDA) == on_device and not getattr(x, "is_user_annotation", False)
        ]  # fmt: skip
        times = {x.key: (x.self_device_time_total if on_device else x.self_cpu_time_total) for x in events}
        counts, busy = {x.key: x.count for x in events}, sum(times.values()) / 1e3 / PROFILED
        wall = 1e3 * self.seconds / PROFILED
        lines = [
            f"{PROFILED} steps after {self.first}: {wall:.3f} ms a step under the profiler, of which {busy:.3f} ms in "
            f"{sum(counts.values()) / PROFILED:.0f} {'kernels and copies' if on_device else 'operators'} a step.", "",
            "| ms a step | share | calls a step | us a call | name |", "|---|---|---|---|---|",
        ]  # fmt: skip
        for name in sorted(times, key=times.__getitem__, reverse=True)[:SHOWN]:
            own, calls = times[name] / 1e3 / PROFILED, counts[name] / PROFILED
            share = own / busy if busy else 0.0
            lines.append(f"| {own:.4f} | {share:.1%} | {calls:.1f} | {1e3 * own / calls:.1f} | `{short(name)}` |")
        return "\n".join([*lines, "", header(provenance(SOURCES, root=ROOT))]) + "\n"


def short(name: str) -> str:
    """A kernel's name without what every one has, at most 110 letters."""
    for part in ("void ", "(anonymous namespace)::", "splitnerf::", "cuda::"):
        name = name.replace(part, "")
    return name.replace("|", "/").replace("`", "'")[:110]


def rate_of(run: Path) -> dict[str, float]:
    """Steps, seconds, and steps a second over the second half of the steps."""
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    last = lines[-1]
    half = next((x for x in lines if x["step"] >= last["step"] / 2), last)
    seconds = last["seconds"] - half["seconds"]
    rate = (last["step"] - half["step"]) / seconds if seconds > 0 else last["step"] / max(last["seconds"], 1e-9)
    return {"steps": last["step"], "train_seconds": last["seconds"], "steps_a_second": round(rate, 2)}


def leaves(scores: dict, prefix: str = "") -> dict[str, float]:
    """The numbers of evaluation.json, by their path."""
    found: dict[str, float] = {}
    for name, value in scores.items():
        if isinstance(value, dict):
            found |= leaves(value, f"{prefix}{name}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            found[prefix + name] = value
    return found


def sentence(result: dict) -> str:
    """What a table says of a run."""
    parts = ["{steps} steps in {train_seconds:.0f} s, {steps_a_second} a second at the end".format(**result)]
    if "peak_allocated_MiB" in result:
        parts.append("{peak_allocated_MiB} MiB at most ({peak_reserved_MiB} reserved)".format(**result))
    scores = result.get("scores", {})
    shown = {"novel_view.psnr": "novel views", "albedo.psnr": "albedo", "relight.psnr": "relit", "light_psnr": "light"}
    parts += [f"{name} {scores[key]:.2f} dB" for key, name in shown.items() if key in scores]
    return ", ".join(parts)


def tell(run: Path, device: str, seconds: float) -> None:
    """Writes training.json and prints its sentence, as far as the run came."""
    if not (run / "metrics.jsonl").is_file() or not (run / "metrics.jsonl").stat().st_size:
        return
    result: dict[str, object] = {**rate_of(run), "whole_seconds": seconds}
    if device == "cuda":
        result["peak_allocated_MiB"] = torch.cuda.max_memory_allocated() >> 20
        result["peak_reserved_MiB"] = torch.cuda.max_memory_reserved() >> 20
    if (run / "evaluation.json").is_file():
        result["scores"] = leaves(json.loads((run / "evaluation.json").read_text()))
    (run / "training.json").write_text(json.dumps(result, indent=1) + "\n")
    print(sentence(result), flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--steps", type=int)
    parser.add_argument("--profile", type=Path, metavar="FILE", help="a page; needs --steps")
    args, rest = parser.parse_known_args()
    command = ["train", str(args.data), "--out", str(args.out), "--overwrite", "--device", args.device, *rest]
    if args.steps is not None:
        command += ["--steps", str(args.steps)]
    if args.profile is not None:
        if args.steps is None or args.steps < 2 * PROFILED:
            parser.error(f"--profile needs --steps, at least {2 * PROFILED}")
        profiler = StepProfiler(args.device, min(2 * args.steps // 3, args.steps - PROFILED - 1))
        register_optimizer_step_post_hook(profiler)
        try:
            code = splitnerf(command)
        except Enough:
            args.profile.write_text(profiler.markdown())
            print(args.profile.read_text().splitlines()[0])
            return 0
        print(
            f"the training ended with {code} after {profiler.steps} optimiser steps, before the profile did",
            file=sys.stderr,
        )
        return code or 1
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # what is known of the run by then is told all the same
    started = time.monotonic()
    try:
        return splitnerf(command)
    finally:
        tell(args.out, args.device, round(time.monotonic() - started, 1))


if __name__ == "__main__":
    sys.exit(main())
