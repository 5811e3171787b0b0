"""Compares a training step on a GPU with the same step on the CPU: every term of the loss and gradient; then graph with
eager.

    python tests/bench/gpu_step.py DATA [--device cuda] [--preset fast] [--steps 30] [--out DIR] [--set KEY=VALUE ...]

The CPU trains some steps and makes a mesh. Its checkpoint is the model of all runs, its batch and samples are copied,
and its random draws are recorded and given to the others. So only roundings differ. Three runs are made: on the device
and on the CPU in float32, and on the CPU in float64, the truth. An error is the root mean square of a difference over
that of the truth; those of the table and of the light's texels are taken for each level. The error of the device may be
:data:`FACTOR` times that of float32 on the CPU, plus :data:`FLOOR`. On a GPU the step is also taken with the matrix
products that training takes (TF32, with limits of their own), and as a CUDA graph, which is compared with the eager
step of the same capacity: also a graph that is recorded after all graphs were dropped, after a step beyond its
capacity, and after another mesh. --device cpu is a rehearsal. Prints the worst errors and writes step.md; exit code 1:
an error is beyond its limit.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

import torch
from splitnerf.config import Config, preset
from splitnerf.config.presets import parse_setting
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.devices import tensor_cores
from splitnerf.fields import LightPyramid
from splitnerf.render.renderer import FoundSamples
from splitnerf.training.batches import Batch, draw_batch
from splitnerf.training.gpu_step import SAMPLE_SLACK, in_units
from splitnerf.training.loop import Training
from splitnerf.training.schedule import light_moves
from splitnerf_tools.bench.provenance import header, provenance
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_leaves, tree_map

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("cpp", "python/splitnerf")
FACTOR = 10.0  # a GPU adds in another order, has other elementary functions and fuses other products than the CPU
FLOOR = 1e-5  # of sums of 1e5 numbers in another order: 6e-8 times their root
TF32 = 2e-2  # more, where factors are rounded to 11 bits, 5e-4, layer after layer
OTHER_RAYS = 0.01  # share of the rays that may have another number of samples: roundings decide at a threshold
PROGRESS = 0.9  # of the training, at which all levels are open and all priors have begun
BATCHES = 4  # that are tried until roundings choose the same samples to be shaded
ALWAYS = {"open_below": 0.0}  # the caches are read also where the mesh hides nothing from itself
DRAWS = (torch.rand, torch.randn, torch.randint, torch.multinomial)


class SameDraws(TorchFunctionMode):
    """Records the random numbers of the first run that begins with :meth:`again`, and gives later runs copies of
    them."""

    def __init__(self) -> None:
        super().__init__()
        self.drawn: list[Tensor] = []
        self.next: Iterator[Tensor] | None = None

    def again(self) -> SameDraws:
        """Itself, from the first draw on."""
        self.next = iter(self.drawn) if self.drawn else None
        return self

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        if func not in DRAWS or kwargs.get("generator") is None:
            return func(*args, **kwargs)
        if self.next is not None:
            return next(self.next).to(kwargs["generator"].device)
        self.drawn.append(func(*args, **kwargs))
        return self.drawn[-1]


class Doubles(TorchFunctionMode):
    """Where a call is given float64 and float32, the float32 tensors become float64; but the split sum's table
    stays."""

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        if any(isinstance(x, Tensor) and x.dtype == torch.float64 for x in tree_leaves((args, kwargs))):
            args, kwargs = tree_map(doubled, (args, kwargs))
        return func(*args, **kwargs)


def doubled(x: object) -> object:
    """A float32 tensor in float64, and anything else as it is."""
    is_table = isinstance(x, Tensor) and x.shape == (32, 32, 4)
    return x.double() if isinstance(x, Tensor) and x.dtype == torch.float32 and not is_table else x


def on(device: torch.device, value: object) -> object:
    """The same with all its tensors on a device."""
    return tree_map(lambda x: x.to(device) if isinstance(x, Tensor) else x, value)


class Silence:
    """A progress bar that shows nothing."""

    def show(self, *_: object) -> None:
        pass


class Work(NamedTuple):
    """What all runs are given: the number of the step, its rays and samples on the CPU, and the light that weighs
    occlusion."""

    step: int
    batch: Batch
    found: FoundSamples
    environment: Tensor | None


class Answer(NamedTuple):
    """What a run gives, on the CPU: terms of the loss, gradients (None: none was taken), the shaded samples'
    numbers."""

    terms: dict[str, Tensor]
    gradients: dict[str, Tensor | None]
    shaded: Tensor


class Row(NamedTuple):
    """One comparison: its name, the errors on the device and of the CPU in float32, and the limit of the former."""

    name: str
    error: float
    on_cpu: float
    limit: float

    @property
    def share(self) -> float:
        """Of the limit that the error takes; infinite where it is nan."""
        return math.inf if math.isnan(self.error) else self.error / self.limit

    @property
    def holds(self) -> bool:
        return self.share <= 1.0


def begun(dataset: Dataset, config: Config, run: Path, steps: int) -> Training:
    """A training on the CPU after some steps and with a mesh, whose checkpoint is in the run's folder."""
    training = Training(dataset, config, run, torch.device("cpu"))
    for _ in range(steps):
        training.refresh()
        training.advance(Silence())
    while not training.may_stop:  # gradients of the light are pending
        training.refresh()
        training.advance(Silence())
    training.mesh.poll(wait=True)
    training.mesh.request(training.progress)
    training.mesh.poll(wait=True)
    training.save()
    return training


def restored(dataset: Dataset, config: Config, run: Path, device: str) -> Training:
    """The same training from its checkpoint on a device, all levels open."""
    training = Training(dataset, config, run, torch.device(device))
    training.restore()
    training.take_step.late = None  # each device traces the points of this step
    training.model.open_levels(PROGRESS)
    return training


def in_float64(dataset: Dataset, config: Config, run: Path) -> Training:
    """The same training on the CPU with the same numbers in float64: those of a table in 16 bits are what that
    holds."""
    stored = restored(dataset, config, run, "cpu").model.sdf_field.grid.stored()
    training = restored(dataset, config.replace({"table_dtype": "float32"}), run, "cpu")
    training.model.double()
    if stored is not None:
        training.model.sdf_field.grid.table.data = stored.double()
    return training


def drawn_work(training: Training) -> Work:
    """A batch, its samples, and the first step from now on at which the light moves."""
    batch = draw_batch(training.source, training.n_rays, training.config, training.exposures.factors)
    step = next(i for i in range(training.step, training.step + 1000) if light_moves(training.config, i))
    return Work(step, batch, training.take_step.find(batch, PROGRESS), training.environment)


def answer(training: Training, work: Work, draws: SameDraws, tf32: bool = False) -> Answer:
    """One step with these rays, samples and draws, in the precision of the training's model."""
    model = training.model
    is_double = model.variance.dtype == torch.float64
    batch, found, environment = on(model.device, work[1:])
    if is_double:
        batch, found = tree_map(doubled, (batch, found))
    with draws.again(), tensor_cores(tf32), Doubles() if is_double else nullcontext():
        light = model.evaluate_light()
        ray, terms = training.take_step.differentiate(batch, found, light, environment, work.step, PROGRESS)
        light.backward()
    return collected(training, ray, terms)


def collected(training: Training, ray, terms) -> Answer:
    """What a step left in its results and at the parameters, copied to the CPU in float64."""
    parameters = training.model.named_parameters()
    gradients = {name: None if p.grad is None else p.grad.detach().cpu().double().clone() for name, p in parameters}
    values = {name: term.value.detach().cpu().double().clone() for name, term in terms.items()}
    return Answer(values, gradients, ray.shaded.cpu().clone())


def parts_of(training: Training, gradients: dict[str, Tensor | None]) -> dict[str, Tensor | None]:
    """The gradients, those of the table and of the light's texels level by level: coarse levels have few of the
    numbers."""
    model, parts = training.model, dict(gradients)
    spec = model.sdf_field.grid.spec
    levels = {"sdf_field.grid.table": [n for _, _, n, _ in spec.levels()]}
    if isinstance(model.light, LightPyramid):
        levels["light.texels"] = model.light.level_sizes
    for name, sizes in levels.items():
        if (whole := parts.pop(name)) is not None:
            parts |= {f"{name}, level {i}": part for i, part in enumerate(whole.split(sizes))}
    return parts


def error_of(got: Tensor | None, true: Tensor | None) -> float:
    """The root mean square of the difference over that of the truth; infinite where only one of them is there."""
    if got is None or true is None:
        return 0.0 if got is true else math.inf
    if got.shape != true.shape:
        return math.inf
    scale = true.norm()
    return float((got - true).norm() / scale) if scale > 0 else (0.0 if got.norm() == 0 else math.inf)


def compared(training: Training, truth: Answer, on_cpu: Answer, there: Answer, more: float = 0.0) -> list[Row]:
    """A row for each term and each gradient: how far `there` and the CPU's float32 are from the truth."""
    sides = []
    for found in (truth, on_cpu, there):
        terms = {f"loss, {name}": value for name, value in found.terms.items()}
        sides.append(terms | {f"gradient, {name}": x for name, x in parts_of(training, found.gradients).items()})
    rows = []
    for name in {**sides[0], **sides[2]}:  # a term that only one of them has is an infinite error
        true, ours, theirs = (side.get(name) for side in sides)
        own = error_of(ours, true)
        rows.append(Row(name, error_of(theirs, true), own, FACTOR * own + FLOOR + more))
    return rows


def other_rays(there: Training, work: Work) -> Row:
    """The share of the rays for which the device finds another number of samples than the CPU."""
    batch = on(there.model.device, work.batch)
    found = there.take_step.find(batch, PROGRESS).packed.offsets.diff().cpu()
    share = (found != work.found.packed.offsets.diff()[: len(found)]).double().mean()
    return Row("samples, rays with another number", float(share), 0.0, OTHER_RAYS)


def same_choice(ours: Training, truth: Training, there: Training) -> tuple[Work, SameDraws, list[Answer]]:
    """Work for which all three shade the same samples, and their answers: truth, the CPU in float32, the device.

    Raises:
        RuntimeError: No batch is such.
    """
    for _ in range(BATCHES):
        work, draws = drawn_work(ours), SameDraws()
        on_cpu = answer(ours, work, draws)
        answers = [answer(truth, work, draws), on_cpu, answer(there, work, draws)]
        if all(torch.equal(x.shaded, on_cpu.shaded) for x in answers):
            return work, draws, answers
    raise RuntimeError(f"other samples are shaded in each of {BATCHES} batches")


class Graphed:
    """Takes one step again and again as a training on a GPU does, with the same seed.

    Args:
        training: On its device.
        work: The rays; the step finds their samples itself.
    """

    def __init__(self, training: Training, work: Work):
        self.training, self.work, self.step = training, work, training.take_step
        self.batch = on(training.model.device, work.batch)
        self.step.sample_capacity = in_units(SAMPLE_SLACK * len(work.found.directions))

    def taken(self, batch: Batch | None = None, fits: bool = True) -> Answer:
        """One step. Raises RuntimeError where its results fit and should not, or the other way round."""
        training, step = self.training, self.step
        training.generator.manual_seed(1)
        training.optimiser.zero_grad(set_to_none=True)
        light = training.model.evaluate_light()
        ray, terms = step.gradients(batch or self.batch, light, None, self.work.step, PROGRESS)
        light.backward()
        pending = step.fetch(1, batch or self.batch, ray, terms)
        step.last, allowed = pending.read(), bool(pending.allowed)
        step.s = training.model.s_value
        if not allowed == fits == step.judge(step.last):
            raise RuntimeError(
                f"{step.last.counts} and {step.capacity}: the device says {allowed}, and it should be {fits}"
            )
        return collected(training, ray, terms)

    def replayed(self, n: int) -> Answer:
        """The last of `n` steps, which was the replay of a graph."""
        *_, last = (self.taken() for _ in range(n))
        if not self.step._graphs:
            raise RuntimeError("no graph was recorded")
        return last

    def crowded(self) -> Batch:
        """As many rays, all of them the one with the most samples."""
        most, n = int(self.work.found.packed.offsets.diff()[: len(self.batch.target)].argmax()), len(self.batch.target)
        of_rays = {name: x for name, x in self.batch._asdict().items() if isinstance(x, Tensor) and len(x) == n}
        return self.batch._replace(**{name: x[most].expand_as(x).contiguous() for name, x in of_rays.items()})

    def swapped(self) -> None:
        """Makes a mesh in the place of the present one."""
        self.training.mesh.request(PROGRESS)
        self.training.mesh.poll(wait=True)

    def answers(self) -> Iterator[tuple[str, Answer, Answer]]:
        """What graphs may do wrong: its name, the step without a graph, and the replay."""
        with self.step.running():
            self.taken()  # without room
            eager = self.taken()
            yield "graph against eager", eager, self.replayed(3)
            self.step._graphs.clear()
            yield "recorded again after all graphs were dropped", eager, self.replayed(2)
            self.taken(self.crowded(), fits=False)
            yield "after a step without room", eager, self.replayed(4)  # the first of which has no limits
            self.swapped()
            yield "after a mesh was swapped", self.taken(), self.replayed(3)


def page(sections: dict[str, list[Row]]) -> str:
    """All rows, the worst of each section first."""
    lines = [
        "# One training step on two devices",
        "",
        header(provenance(SOURCES, root=ROOT)),
        "",
        "Errors: root mean square of the difference from the CPU's float64, over that of the float64.",
    ]
    for name, rows in sections.items():
        lines += ["", f"## {name}", "", "| | error | of the CPU in float32 | limit | |", "|---|---|---|---|---|"]
        for row in sorted(rows, key=lambda r: r.share, reverse=True):
            verdict = "" if row.holds else "beyond its limit"
            lines.append(f"| {row.name} | {row.error:.1e} | {row.on_cpu:.1e} | {row.limit:.1e} | {verdict} |")
    return "\n".join(lines) + "\n"


def sections_of(
    dataset: Dataset, config: Config, run: Path, device: str, steps: int
) -> Iterator[tuple[str, list[Row]]]:
    """The comparisons, one after the other, so that a failure does not hide what came before."""
    begun(dataset, config, run, steps)
    ours, truth, there = (
        restored(dataset, config, run, "cpu"),
        in_float64(dataset, config, run),
        restored(dataset, config, run, device),
    )
    work, draws, (true, on_cpu, found) = same_choice(ours, truth, there)
    yield f"{device} against the CPU", [*compared(there, true, on_cpu, found), other_rays(there, work)]
    if device == "cuda":
        yield "cuda in TF32 against the CPU", compared(there, true, on_cpu, answer(there, work, draws, True), TF32)
        if config.run.cuda_graphs:
            rows = compared(there, true, on_cpu, found)
            for name, eager, replayed in Graphed(there, work).answers():
                yield name, against_eager(there, eager, replayed, rows)


def against_eager(training: Training, eager: Answer, replayed: Answer, rows: list[Row]) -> list[Row]:
    """A graph's answer beside the eager one; they may differ as far as the device may from the truth."""
    limits = {row.name: row.limit for row in rows}
    return [row._replace(limit=limits[row.name]) for row in compared(training, eager, eager, replayed)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--device", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--preset", default="fast")
    parser.add_argument("--steps", type=int, default=30, help="of training on the CPU before (default: 30)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where step.md is written")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    args = parser.parse_args()
    config = preset(args.preset).replace(ALWAYS | dict(map(parse_setting, args.set)))
    sections: dict[str, list[Row]] = {}
    with tempfile.TemporaryDirectory() as run:
        try:
            for name, rows in sections_of(load_dataset(args.data), config, Path(run), args.device, args.steps):
                sections[name] = rows
                worst = max(rows, key=lambda r: r.share)
                n_wrong = sum(not row.holds for row in rows)
                print(
                    f"{name}: {len(rows) - n_wrong} of {len(rows)} agree, the worst at {worst.share:.2g} of its "
                    f"limit ({worst.name})",
                    flush=True,
                )
        finally:
            if args.out is not None:
                args.out.mkdir(parents=True, exist_ok=True)
                (args.out / "step.md").write_text(page(sections))
    return 0 if all(row.holds for rows in sections.values() for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
