"""Trains and scores without an export, or looks at a training's steady state: where the time of host and device goes.

    python tests/bench/gpu_train.py DATA --out RUN --preset fast --steps 20000 [--set KEY=VALUE] [--views 8]
    python tests/bench/gpu_train.py DATA --out RUN --preset fast --steps 20000 --until 1500 --page steady.md [--profiled 20]

The first trains with the schedule of so many steps and scores some test views; its last line says steps, seconds, memory and the main
scores, and RUN/training.json holds all of them. The second ends at a step. Over the last two thirds of the steps before it says
how long a step took, and how long the host was in each part of one: drawing rays, finding samples, copying into a graph, replaying it,
and so on. Then it profiles some steps, and by itself each thing that steps share: an update of the occupied cells, the light on the
mesh, a mesh.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import torch
from torch.autograd import DeviceType
from torch.profiler import ProfilerActivity, profile

from splitnerf.config import parse_setting, preset
from splitnerf.data.dataset import load_dataset, spread
from splitnerf.devices import choose_device
from splitnerf.outputs import evaluate_scene
from splitnerf.training import graphs, loop
from splitnerf.training.loop import TrainedScene, Training
from splitnerf.training.metrics import METRICS
from splitnerf_tools.bench.provenance import header, provenance

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf")
SHOWN = 60  # kernels


class Enough(BaseException):
    """Ends a training that was only looked at."""


class Phases:
    """The host's time within functions, each without that of those it calls, and their calls; only while `on`."""

    def __init__(self) -> None:
        self.on, self.seconds, self.calls = False, Counter(), Counter()
        self._inner: list[float] = []  # of each function that runs, the time in those that it has called

    def watch(self, owner: object, name: str, phase: str) -> None:
        """Counts a function, an attribute of `owner`, from now on; one that is not there is left out."""
        function = getattr(owner, name, None)
        if function is not None:
            setattr(owner, name, self.timed(function, phase))

    def timed(self, function: Callable, phase: str) -> Callable:
        def within(*args: object, **kwargs: object) -> object:
            begin = time.perf_counter()
            self._inner.append(0.0)
            try:
                return function(*args, **kwargs)
            finally:
                took, inner = time.perf_counter() - begin, self._inner.pop()
                if self._inner:
                    self._inner[-1] += took
                if self.on:
                    self.seconds[phase] += took - inner
                    self.calls[phase] += 1

        return within

    def table(self, n_steps: int) -> list[str]:
        """Milliseconds and calls a step."""
        lines = [f"| {name} | {1e3 * t / n_steps:.3f} | {self.calls[name] / n_steps:.2f} |" for name, t in self.seconds.most_common()]
        return ["| part of a step | the host's ms a step | calls a step |", "|---|---|---|", *lines]


class Look:
    """Stops a training, which has not begun, behind a step, and says what the steps before and `profiled` more took."""

    def __init__(self, training: Training, until: int, profiled: int):
        self.training, self.first, self.until, self.profiled = training, until // 3, until, profiled
        self.on_device = training.model.device.type == "cuda"
        self.phases, self.ends = Phases(), []
        self.pages: list[str] = []
        step = training.take_step
        for owner, name, phase in (
            (training, "refresh", "refresh: levels, cells, meshes, light"), (loop, "draw_batch", "draws"), (step, "find", "find samples"),
            (step, "_replayed", "copies to and from a graph"), (torch.cuda.CUDAGraph, "replay", "replay"), (graphs, "record", "recording"),
            (step, "differentiate", "render and differentiate, eager or recorded"), (loop.PastStep, "of", "numbers"),
            (training.optimiser, "step", "optimiser"), (training, "settle", "read the numbers of the step before"),
        ):  # fmt: skip
            self.phases.watch(owner, name, phase)
        self.advance, training.advance = self.phases.timed(training.advance, "the rest"), self.watched

    def watched(self, bar: object) -> None:
        """A step of the training, which calls this in the place of its own."""
        self.advance(bar)
        if self.training.step == self.first:
            if self.training.model.occlusion.needs_mesh and self.training.mesh.scene is None:
                self.mesh()  # without which a step does less
            self.wait()
            self.phases.on = True
        if self.phases.on:
            self.ends.append(time.perf_counter())
        if self.training.step == self.until:
            self.wait()
            self.phases.on = False
            self.of_steps()
            self.profiler = self.started()
        if self.training.step == self.until + self.profiled:
            self.of_profile(*self.stopped(*self.profiler))
            self.each_by_itself()
            raise Enough

    def wait(self) -> None:
        if self.on_device:
            torch.cuda.synchronize()

    def of_steps(self) -> None:
        """Steps without the profiler."""
        n, step = self.until - self.first, self.training.take_step
        seconds = time.perf_counter() - self.ends[0]
        each = sorted(1e3 * (b - a) for a, b in zip(self.ends, self.ends[1:]))
        eager = self.phases.calls["render and differentiate, eager or recorded"] - self.phases.calls["recording"]
        self.sentence = (
            f"steps {self.first} to {self.until}: {1e3 * seconds / n:.3f} ms a step, median {statistics.median(each):.3f}, "
            f"longest {each[-1]:.1f}; {self.phases.calls['replay']} replays, {self.phases.calls['recording']} recordings, {eager} eager "
            f"steps, {step.n_discarded} without room"
        )
        if self.on_device:
            self.sentence += f"; {torch.cuda.max_memory_allocated() >> 20} MiB at most ({torch.cuda.max_memory_reserved() >> 20} reserved)"
        self.pages += [self.sentence + ".", "", *self.phases.table(n), ""]

    def started(self) -> tuple[profile, float]:
        self.wait()
        profiler = profile(activities=[ProfilerActivity.CPU] + [ProfilerActivity.CUDA] * self.on_device)
        profiler.start()
        return profiler, time.perf_counter()

    def stopped(self, profiler: profile, begin: float) -> tuple[float, dict[str, tuple[float, int]]]:
        """Milliseconds, and of each kernel (on the CPU: operator) its own milliseconds and its calls."""
        self.wait()
        ms = 1e3 * (time.perf_counter() - begin)
        profiler.stop()
        events = [
            x for x in profiler.key_averages()
            if (x.device_type == DeviceType.CUDA) == self.on_device and not getattr(x, "is_user_annotation", False)
        ]  # fmt: skip
        own = {x.key: x.self_device_time_total if self.on_device else x.self_cpu_time_total for x in events}
        return ms, {x.key: (own[x.key] / 1e3, x.count) for x in events}

    def of_profile(self, ms: float, kernels: dict[str, tuple[float, int]]) -> None:
        """Kernels by their own time, in milliseconds a step."""
        busy, count = (sum(x) / self.profiled for x in zip(*kernels.values()))
        said = f"{ms / self.profiled:.3f} ms a step under the profiler, of which {busy:.3f} ms in {count:.0f} kernels and copies"
        self.sentence += f"; {said}"
        self.pages += [f"{self.profiled} steps: {said}.", "", "| ms a step | share | calls a step | us a call | name |", 5 * "|---" + "|"]
        for name in sorted(kernels, key=kernels.__getitem__, reverse=True)[:SHOWN]:
            own, calls = (x / self.profiled for x in kernels[name])
            self.pages.append(f"| {own:.4f} | {own / busy:.1%} | {calls:.1f} | {1e3 * own / calls:.1f} | `{short(name)}` |")
        self.pages.append("")

    def each_by_itself(self) -> None:
        """What steps share, once each."""
        training, model = self.training, self.training.model
        parts: dict[str, Callable[[], object]] = {"occupied cells": lambda: training.update_grid(first=False, step=training.step)}
        if model.occlusion.needs_mesh:
            parts["a mesh, and its caches filled"] = self.mesh
        if training.config.occlusion.indirect and training.mesh.scene is not None:
            parts["light on the mesh"] = lambda: model.refresh_indirect(model.evaluate_light())
        self.pages += ["| by itself | ms | of which the device works | kernels and copies |", "|---|---|---|---|"]
        for name, part in parts.items():
            profiler = self.started()
            part()
            ms, kernels = self.stopped(*profiler)
            busy, count = (sum(x) for x in zip(*kernels.values()))
            self.pages.append(f"| {name} | {ms:.1f} | {busy:.1f} | {count} |")

    def mesh(self) -> None:
        self.training.mesh.poll(wait=True)
        self.training.mesh.request(self.training.progress)
        self.training.mesh.poll(wait=True)


def short(name: str) -> str:
    """A kernel's name without what every one has, at most 110 letters."""
    for part in ("void ", "(anonymous namespace)::", "splitnerf::", "cuda::"):
        name = name.replace(part, "")
    return name.replace("|", "/").replace("`", "'")[:110]


def told(run: Path, trained: TrainedScene, data: Path, views: int) -> str:
    """Writes training.json, and says in a sentence what a run took and scores."""
    steps = [json.loads(line) for line in (run / METRICS).read_text().splitlines()]
    half = next(x for x in steps if x["step"] >= trained.step / 2)
    rate = (trained.step - half["step"]) / max(trained.seconds - half["seconds"], 1e-9)
    result: dict[str, object] = {"steps": trained.step, "seconds": trained.seconds, "steps_a_second": rate}
    said = [f"{trained.step} steps in {trained.seconds:.0f} s, {rate:.1f} a second at the end, {steps[-1]['skipped']} skipped"]
    if trained.model.device.type == "cuda":
        result["MiB"] = torch.cuda.max_memory_allocated() >> 20, torch.cuda.max_memory_reserved() >> 20
        said.append("{} MiB at most ({} reserved)".format(*result["MiB"]))
    test = load_dataset(data, "test")
    test = test.select(spread(range(len(test)), views))
    scores = evaluate_scene(trained.model, trained.grid, test, None, trained.seconds)[0]
    shown = {"novel views {:.2f} dB": scores["novel_view"]["psnr"], "albedo {:.2f} dB": (scores["albedo"] or {}).get("psnr"),
             "light {:.2f} dB": scores["light_psnr"], "normals {:.2f} degrees": scores["normal_mae_deg"]}  # fmt: skip
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
    config = preset(args.preset).replace({"run.preview_every": 1.0} | dict(map(parse_setting, args.settings)) | {"run.steps": args.steps})
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / METRICS).write_text("")
    training = Training(load_dataset(args.data), config, args.out, choose_device(args.device))
    if args.until is None:
        print(told(args.out, training.complete(), args.data, args.views))
        return 0
    look = Look(training, args.until, args.profiled)
    try:
        training.complete()
    except Enough:
        args.page.write_text("\n".join([f"# {args.preset}", "", *look.pages, "", header(provenance(SOURCES, root=ROOT))]) + "\n")
        print(look.sentence)
        return 0
    print(f"the training ended at step {training.step}, before it was looked at", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
