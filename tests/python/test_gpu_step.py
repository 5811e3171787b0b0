"""A training step on another device against the same step on the CPU in float64, and a replayed step against an eager one.

The CPU trains some steps and makes a mesh. Its checkpoint is the model of all sides, its batch and samples are copied, and its random
draws are recorded and given to the others: only roundings differ. An error is the root mean square of a difference over that of
the truth, level by level for the table and the light's texels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
import torch
from op_checks import DEVICES
from pretend_graphs import graphs_on_the_cpu
from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.devices import tensor_cores
from splitnerf.render.renderer import FoundSamples
from splitnerf.training.batches import Batch, draw_batch
from splitnerf.training.gpu_step import SAMPLE_SLACK, in_units
from splitnerf.training.loop import Training
from splitnerf.training.schedule import light_moves
from tiny_runs import tiny
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_leaves, tree_map

FACTOR = 10.0  # a GPU adds in another order, has other elementary functions and fuses other products than the CPU
FLOOR = 1e-5  # of sums of 1e5 numbers in another order: 6e-8 times their root
TF32 = 2e-2  # more, where factors are rounded to 11 bits, 5e-4, layer after layer
OTHER_RAYS = 0.01  # share of the rays that may have another number of samples: roundings decide at a threshold
PROGRESS = 0.9  # of the training, at which all levels are open and all priors have begun
BATCHES = 4  # that are tried until roundings choose the same samples to be shaded
# The caches are read also where the mesh hides nothing from itself.
CONFIG = tiny("fast", open_below=0.0, steps=100, table_dtype="float16", seed=2)
Numbers = dict[str, Tensor | None]


class SameDraws(TorchFunctionMode):
    """Records the random numbers of the first run that begins with :meth:`again`, and gives later runs copies of them."""

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
        draws = func in (torch.rand, torch.randn, torch.randint, torch.multinomial)
        if not draws or kwargs.get("generator") is None:
            return func(*args, **kwargs)
        if self.next is not None:
            return next(self.next).to(kwargs["generator"].device)
        self.drawn.append(func(*args, **kwargs))
        return self.drawn[-1]


class Doubles(TorchFunctionMode):
    """Where a call is given float64 and float32, the float32 tensors become float64; but the split sum's table stays."""

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        if any(isinstance(x, Tensor) and x.dtype == torch.float64 for x in tree_leaves((args, kwargs))):
            args, kwargs = tree_map(doubled, (args, kwargs))
        return func(*args, **kwargs)


def doubled(x: object) -> object:
    """A float32 tensor in float64, and anything else as it is."""
    is_table = isinstance(x, Tensor) and x.shape == (32, 32, 4)
    return x.double() if isinstance(x, Tensor) and x.dtype == torch.float32 and not is_table else x


class Work(NamedTuple):
    """What all sides are given: the number of the step, its rays and its samples, on the CPU."""

    step: int
    batch: Batch
    found: FoundSamples


class Answer(NamedTuple):
    """What a step gives, on the CPU in float64: terms of the loss and gradients by name, and the shaded samples' numbers."""

    numbers: Numbers
    shaded: Tensor


class Side(NamedTuple):
    """Where trainings are restored to."""

    dataset: Dataset
    config: Config
    run: Path

    def restored(self, device: str, config: Config | None = None) -> Training:
        """The training from its checkpoint on a device, all levels open."""
        training = Training(self.dataset, config or self.config, self.run, torch.device(device))
        training.restore()
        training.model.open_levels(PROGRESS)
        return training

    def in_float64(self) -> Training:
        """The same on the CPU with the numbers of its 16-bit table in float64."""
        stored = self.restored("cpu").model.sdf_field.grid.stored()
        training = self.restored("cpu", self.config.replace({"table_dtype": "float32"}))
        training.model.double()
        training.model.sdf_field.grid.table.data = stored.double()
        return training


def drawn_work(training: Training) -> Work:
    """A batch, its samples, and the first step from now on at which the light moves."""
    batch = draw_batch(training.source, training.n_rays, training.config, training.exposures.factors)
    step = next(i for i in range(training.step, training.step + 1000) if light_moves(training.config, i))
    return Work(step, batch, training.take_step.find(batch, PROGRESS))


def on(device: torch.device, value: object) -> object:
    """The same with all its tensors on a device."""
    return tree_map(lambda x: x.to(device) if isinstance(x, Tensor) else x, value)


def answer(training: Training, work: Work, draws: SameDraws, tf32: bool = False) -> Answer:
    """One step with these rays, samples and draws, in the precision of the training's model."""
    model = training.model
    is_double = model.variance.dtype == torch.float64
    batch, found = on(model.device, work[1:])
    if is_double:
        batch, found = tree_map(doubled, (batch, found))
    with draws.again(), tensor_cores(tf32), Doubles() if is_double else nullcontext():
        light = model.evaluate_light()
        ray, terms = training.take_step.differentiate(batch, found, light, work.step, PROGRESS)
        light.backward()
    return collected(training, ray, terms)


def collected(training: Training, ray, terms) -> Answer:
    """What a step left in its results and at the parameters."""
    model = training.model
    found: Numbers = {name: term.value for name, term in terms.items()}
    found |= {f"gradient of {name}": p.grad for name, p in model.named_parameters()}
    spec = model.sdf_field.grid.spec
    levels = {"sdf_field.grid.table": [n for _, _, n, _ in spec.levels()], "light.texels": model.light.level_sizes}
    for name, sizes in levels.items():  # coarse levels have few of the numbers
        whole = found.pop(f"gradient of {name}")
        found |= {f"gradient of {name}, level {i}": part for i, part in enumerate(whole.split(sizes))}
    copied = {name: None if x is None else x.detach().cpu().double().clone() for name, x in found.items()}
    return Answer(copied, ray.shaded.cpu().clone())


def error_of(got: Tensor | None, true: Tensor | None) -> float:
    """The root mean square of the difference over that of the truth; infinite where only one of them is there."""
    if got is None or true is None or got.shape != true.shape:
        return 0.0 if got is true else math.inf
    scale, error = true.norm(), (got - true).norm()
    return 0.0 if scale == error == 0 else math.inf if error.isnan() else float(error / scale)


def beyond(truth: Answer, on_cpu: Answer, there: Answer, more: float = 0.0) -> set[str]:
    """The numbers that are farther from the truth than FACTOR times those of float32 on the CPU, and than FLOOR and `more`."""
    names = truth.numbers.keys() | there.numbers.keys()
    true, ours, theirs = ({name: side.numbers.get(name) for name in names} for side in (truth, on_cpu, there))
    limits = {name: FACTOR * error_of(ours[name], true[name]) + FLOOR + more for name in names}
    assert all(limit < 5e-3 + more or math.isinf(limit) for limit in limits.values())
    return {name for name, limit in limits.items() if not error_of(theirs[name], true[name]) <= limit}


@pytest.fixture(scope="module")
def side(data, tmp_path_factory) -> Side:
    """A training of six steps with a mesh, in a checkpoint."""
    made = Side(load_dataset(data), CONFIG, tmp_path_factory.mktemp("step"))
    training = Training(*made, torch.device("cpu"))
    while training.step < 6 or not training.may_stop:  # gradients of the light are pending
        training.refresh()
        training.advance(SimpleNamespace(show=lambda *_: None))
    for _ in range(2):
        training.mesh.poll(wait=True)
        training.mesh.request(training.progress)
    training.mesh.poll(wait=True)
    training.save()
    return made


@pytest.fixture(scope="module")
def truth(side) -> tuple[Work, SameDraws, Answer, Answer]:
    """Work for which float64 and float32 shade the same samples, and their answers on the CPU."""
    ours, exact = side.restored("cpu"), side.in_float64()
    for _ in range(BATCHES):
        work, draws = drawn_work(ours), SameDraws()
        on_cpu, true = answer(ours, work, draws), answer(exact, work, draws)
        if torch.equal(on_cpu.shaded, true.shaded):
            return work, draws, true, on_cpu
    raise RuntimeError(f"other samples are shaded in each of {BATCHES} batches")


@pytest.mark.parametrize("device", DEVICES)
def test_a_step_agrees_with_float64(side, truth, device):
    work, draws, true, on_cpu = truth
    there = side.restored(device)
    found = answer(there, work, draws)
    assert not beyond(true, on_cpu, found) and torch.equal(found.shaded, on_cpu.shaded)
    offsets = there.take_step.find(on(there.model.device, work.batch), PROGRESS).packed.offsets.diff().cpu()
    others = offsets != work.found.packed.offsets.diff()[: len(offsets)]
    assert others.double().mean() <= OTHER_RAYS
    if device == "cuda":
        assert not beyond(true, on_cpu, answer(there, work, draws, tf32=True), TF32)
    assert there.model.sums_light and there.model.bits and not there.model.is_unoccluded  # all caches were read
    terms = {"colour", "neutral", "light_prior", "entropy", "gradient of variance", "gradient of light.texels, level 2"}
    assert terms < true.numbers.keys() and true.numbers["colour"] != on_cpu.numbers["colour"]  # it was in float64


class Graphed:
    """Takes one step again and again as a training on a GPU does, with the same seed; the step finds its samples itself."""

    def __init__(self, training: Training, work: Work):
        self.training, self.work, self.step = training, work, training.take_step
        self.batch = on(training.model.device, work.batch)
        self.step.sample_capacity = in_units(SAMPLE_SLACK * len(work.found.directions))

    def taken(self, batch: Batch | None = None, fits: bool = True) -> Answer:
        """One step, whose results fit or not as the device and the host say."""
        training, step = self.training, self.step
        training.generator.manual_seed(1)
        training.optimiser.zero_grad(set_to_none=True)
        light = training.model.evaluate_light()
        ray, terms = step.gradients(batch or self.batch, light, self.work.step, PROGRESS)
        light.backward()
        pending = step.fetch(1, batch or self.batch, ray, terms)
        step.last, allowed = pending.read(), bool(pending.allowed)
        step.s = training.model.s_value
        assert allowed == fits == step.judge(step.last), f"{step.last.counts} of {step.capacity}: {allowed}"
        return collected(training, ray, terms)

    def replayed(self, n: int) -> Answer:
        """The last of `n` steps, which was the replay of a graph."""
        *_, last = (self.taken() for _ in range(n))
        assert self.step._graphs
        return last

    def crowded(self) -> Batch:
        """As many rays, all of them the one with the most samples."""
        most, n = int(self.work.found.packed.offsets.diff()[: len(self.batch.target)].argmax()), len(self.batch.target)
        of_rays = {name: x for name, x in self.batch._asdict().items() if isinstance(x, Tensor) and len(x) == n}
        return self.batch._replace(**{name: x[most].expand_as(x).contiguous() for name, x in of_rays.items()})

    def answers(self) -> Iterator[tuple[Answer, Answer]]:
        """The eager step and its replay: at first, after all graphs were dropped, after a step without capacity, after a mesh."""
        with self.step.running():
            self.taken()  # its capacity is not limited
            eager = self.taken()
            yield eager, self.replayed(3)
            self.step._graphs.clear()
            yield eager, self.replayed(2)
            self.taken(self.crowded(), fits=False)
            yield eager, self.replayed(4)  # the first of which has no limits
            self.training.mesh.request(PROGRESS)
            self.training.mesh.poll(wait=True)
            yield self.taken(), self.replayed(3)


@pytest.mark.parametrize("device", DEVICES)
def test_a_replayed_step_is_the_eager_one(side, truth, monkeypatch, device):
    work, _, true, on_cpu = truth
    used = graphs_on_the_cpu(monkeypatch) if device == "cpu" else None
    there = side.restored(device, CONFIG.replace({"cuda_graphs": True}))
    for eager, replayed in Graphed(there, work).answers():
        assert len(eager.numbers) > 25
        if device == "cpu":
            assert all(error_of(x, eager.numbers[name]) == 0.0 for name, x in replayed.numbers.items())
        else:
            limits = {name: FACTOR * error_of(x, true.numbers[name]) + FLOOR for name, x in on_cpu.numbers.items()}
            for name, x in replayed.numbers.items():
                assert error_of(x, eager.numbers[name]) <= limits[name], name
    assert there.take_step.skipped == 1
    assert used is None or (used["recorded"] >= 3 and used["replayed"] >= 10)
