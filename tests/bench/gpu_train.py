"""Trains and scores without an export, or looks at a training's steady state.

    python tests/bench/gpu_train.py DATA --out RUN --preset fast --steps 20000 [--set KEY=VALUE] [--views 8]
    python tests/bench/gpu_train.py DATA --out RUN --preset fast --steps 20000 --until 1500 --page steady.md [--profiled
    20]

The first trains with the schedule of so many steps and scores some test views; its last line says steps, seconds,
memory and the main scores, and RUN/training.json holds all of them. The second ends at a step. It says how long a step
took over the last two thirds of the steps before it, and then profiles some steps: the kernels by their own time, and
how long the device was busy.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import torch
from splitnerf.config import parse_setting, preset
from splitnerf.data.dataset import load_dataset, spread
from splitnerf.devices import choose_device
from splitnerf.evaluate.scoring import Protocol, score_fields
from splitnerf.training.loop import TrainedScene, Training
from splitnerf.training.metrics import METRICS
from splitnerf_tools.bench.provenance import header, provenance
from torch.autograd import DeviceType
from torch.profiler import ProfilerActivity, profile

SOURCES = ("cpp", "python/splitnerf")
SHOWN = 60  # kernels


class Silence:
    """A progress bar that shows nothing."""

    def show(self, *_: object) -> None:
        """Nothing."""


class Enough(BaseException):
    """Ends a training that was only looked at."""


class Look:
    """Times the steps of a training, which has not begun, up to one; profiles some more, and ends it.

    Attributes:
        said: What it saw, a sentence.
        lines: The same and the kernels, for a page.
    """

    def __init__(self, training: Training, until: int, profiled: int):
        self.training, self.first, self.until, self.profiled = training, until // 3, until, profiled
        self.cuda = training.model.device.type == "cuda"
        self.ends: list[float] = []
        self.advance, training.advance = training.advance, self.watched

    def watched(self, bar: object) -> None:
        """A step of the training, which calls this in the place of its own."""
        self.advance(bar)
        step = self.training.step
        if step == self.first and self.training.model.occlusion.needs_mesh and self.training.mesh.scene is None:
            self.training.mesh.request(self.training.progress)  # without a mesh a step does less
            self.training.mesh.poll(wait=True)
        if step in (self.first, self.until, self.until + self.profiled) and self.cuda:
            torch.cuda.synchronize()
        if step >= self.first:
            self.ends.append(time.perf_counter())
        if step == self.until:
            self.profiler = profile(activities=[ProfilerActivity.CPU] + [ProfilerActivity.CUDA] * self.cuda)
            self.profiler.start()
        if step == self.until + self.profiled:
            self.profiler.stop()
            self.look()
            raise Enough

    def look(self) -> None:
        ends, last = self.ends[: self.until - self.first + 1], self.ends[-1]
        each = [1e3 * (b - a) for a, b in zip(ends, ends[1:])]
        self.said = (
            f"steps {self.first} to {self.until}: {sum(each) / len(each):.3f} ms a step, median {statistics.median(each):.3f}, "
            f"longest {max(each):.1f}"
        )
        if self.cuda:
            self.said += f"; {torch.cuda.max_memory_allocated() >> 20} MiB at most ({torch.cuda.max_memory_reserved() >> 20} reserved)"
        events = [
            event
            for event in self.profiler.key_averages()
            if (event.device_type == DeviceType.CUDA) == self.cuda and not getattr(event, "is_user_annotation", False)
        ]
        own = {x.key: (x.self_device_time_total if self.cuda else x.self_cpu_time_total) / 1e3 for x in events}
        counts, busy, n = {x.key: x.count for x in events}, sum(own.values()), self.profiled
        self.said += (
            f"; {1e3 * (last - ends[-1]) / n:.3f} ms a step under the profiler, of which {busy / n:.3f} ms in "
            f"{sum(counts.values()) / n:.0f} kernels and copies"
        )
        self.lines = [self.said + ".", "", "| ms a step | share | calls a step | us a call | name |", 5 * "|---" + "|"]
        for name in sorted(own, key=own.__getitem__, reverse=True)[:SHOWN]:
            a_call = 1e3 * own[name] / counts[name]
            self.lines.append(
                f"| {own[name] / n:.4f} | {own[name] / busy:.1%} | {counts[name] / n:.1f} | {a_call:.1f} | `{short(name)}` |"
            )


def short(name: str) -> str:
    """A kernel's name without what every one has, at most 110 letters."""
    for part in ("void ", "(anonymous namespace)::", "splitnerf::", "cuda::"):
        name = name.replace(part, "")
    return name.replace("|", "/").replace("`", "'")[:110]


def summary(run: Path, trained: TrainedScene, data: Path, views: int) -> str:
    """Writes training.json, and says in a sentence what a run took and scores."""
    steps = [json.loads(line) for line in (run / METRICS).read_text().splitlines()]
    half = next(x for x in steps if x["step"] >= trained.step / 2)
    rate = (trained.step - half["step"]) / max(trained.seconds - half["seconds"], 1e-9)
    result: dict[str, object] = {"steps": trained.step, "seconds": trained.seconds, "steps_a_second": rate}
    said = [
        f"{trained.step} steps in {trained.seconds:.0f} s, {rate:.1f} a second at the end, {steps[-1]['skipped']} skipped"
    ]
    if trained.model.device.type == "cuda":
        result["MiB"] = torch.cuda.max_memory_allocated() >> 20, torch.cuda.max_memory_reserved() >> 20
        said.append("{} MiB at most ({} reserved)".format(*result["MiB"]))
    test = load_dataset(data, "test")
    views = test.select(spread(range(len(test)), views))
    scores = score_fields(trained.model, trained.grid, views, None, None, {}, Protocol.spp, trained.seconds).scores
    shown = {
        "novel views {:.2f} dB": scores["novel_view"]["psnr"],
        "albedo {:.2f} dB": (scores["albedo"] or {}).get("psnr"),
        "light {:.2f} dB": scores["light_psnr"],
        "normals {:.2f} degrees": scores["normal_mae_deg"],
    }
    said += [text.format(score) for text, score in shown.items() if score is not None]
    (run / "training.json").write_text(json.dumps(result | {"scores": scores}, indent=1) + "\n")
    return ", ".join(said)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--out", type=Path, required=True, metavar="RUN")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--steps", type=int, required=True, help="of the schedule")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings")
    parser.add_argument("--views", type=int, default=8, help="test views that are scored (default: 8)")
    parser.add_argument("--until", type=int, metavar="STEP", help="look at the steps before this one, and end")
    parser.add_argument("--page", type=Path, help="where what is seen is written")
    parser.add_argument("--profiled", type=int, default=20, help="steps (default: 20)")
    args = parser.parse_args()
    config = preset(args.preset).replace(
        {"run.preview_every": 1.0} | dict(map(parse_setting, args.settings)) | {"run.steps": args.steps}
    )
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / METRICS).write_text("")
    training = Training(load_dataset(args.data), config, args.out, choose_device(args.device))
    if args.until is None:
        print(summary(args.out, training.complete(), args.data, args.views))
        return 0
    look = Look(training, args.until, args.profiled)
    try:
        training.complete()
    except Enough:
        args.page.write_text("\n".join([f"# {args.preset}", "", *look.lines, "", header(provenance(SOURCES))]) + "\n")
        print(look.said)
        return 0
    print(f"the training ended at step {training.step}, before it was looked at", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
