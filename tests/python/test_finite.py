"""Numbers that are not finite: each is planted once, is named, and costs no checkpoint."""

import itertools
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from splitnerf.cli import FAILED
from splitnerf.data.dataset import load_dataset
from splitnerf.training import loop as trainer
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.finite import Diverged, check_state, explain_loss
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.step import Capacity, Step, StepNumbers
from tiny_runs import lines_of, tiny, train, train_scene


def goes_on(data: Path, run: Path, before: bytes) -> None:
    """The checkpoint is the one from before, and the run goes on from it."""
    assert (run / "checkpoint.pt").read_bytes() == before
    train_scene(load_dataset(data), tiny(steps=12), run, resume=True)
    assert load_checkpoint(run / "checkpoint.pt")["step"] == 12


@pytest.fixture(params=[Step, GpuStep])
def kind(request, monkeypatch) -> type[Step]:
    """Runs take steps of this kind; those of a GPU are read late."""
    monkeypatch.setattr(trainer, "Step", request.param)
    return request.param


def test_a_nan_pixel_stops_the_run(data, begun, kind):
    """The image came another way than through the reader."""
    run, before = begun
    dataset = load_dataset(data)
    resumed = trainer.dataset_fingerprint
    images = np.array(dataset.images)
    images[2, 12, 12, 0] = np.nan
    dataset = replace(dataset, images=images)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trainer, "dataset_fingerprint", lambda _: resumed(load_dataset(data)))
        with pytest.raises(Diverged, match=r"loss is not finite \(colour"):
            train_scene(dataset, tiny(steps=4000, foreground_share=1.0), run, resume=True)
    goes_on(data, run, before)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_light_texel_that_is_not_finite_stops_the_run(data, begun, monkeypatch, value):
    """An infinite one is clamped where it is used and harms no loss, but it may not be saved."""
    run, before = begun
    original = trainer.set_learning_rate

    def planting(optimiser, config, step, progress):
        if step == 10:
            optimiser.param_groups[2]["params"][0].data[7, 1] = value
        original(optimiser, config, step, progress)

    with monkeypatch.context() as patch:
        patch.setattr(trainer, "set_learning_rate", planting)
        with pytest.raises(Diverged, match=r"not finite: parameter light.texels \(1 of"):
            train_scene(load_dataset(data), tiny(steps=20), run, resume=True)
    goes_on(data, run, before)


def test_a_learning_rate_of_a_thousand_loses_no_checkpoint(data, begun, capsys):
    run, before = begun
    capsys.readouterr()
    options = ["--set", "learning_rate=1e3", "--set", "warmup_steps=1"]
    assert train(data, run, "--resume", "--steps", "400", *options) == FAILED
    error = capsys.readouterr().err.splitlines()[-1]
    assert "not finite" in error and "learning_rate" in error
    goes_on(data, run, before)


def test_a_step_without_a_finite_gradient_is_skipped_and_counted(data, tmp_path, monkeypatch, capsys, kind):
    fetch, advance, steps, moved = kind.fetch, trainer.Training.advance, itertools.count(), []

    def planting(step, *arguments):
        now = next(steps)
        if now in (3, 5, 6):
            next(step.model.parameters()).grad.view(-1)[0] = {3: torch.nan, 5: 1e30, 6: 2e18}[now]
        return fetch(step, *arguments)

    def watched(training, bar):
        before = [p.detach().clone() for p in training.model.parameters()]
        advance(training, bar)
        moved.append(not all(torch.equal(a, b) for a, b in zip(training.model.parameters(), before)))

    monkeypatch.setattr(kind, "fetch", planting)
    monkeypatch.setattr(trainer.Training, "advance", watched)
    trained = train_scene(load_dataset(data), tiny(steps=8), tmp_path)
    assert [i for i, any_moved in enumerate(moved) if not any_moved] == [3, 5, 6]
    assert all(p.isfinite().all() for p in trained.model.parameters())
    assert [line["skipped"] for line in lines_of(tmp_path)] == [0, 0, 0, 1, 1, 2, 3, 3]
    assert capsys.readouterr().err.count("step is skipped") == 3
    moments = load_checkpoint(tmp_path / "checkpoint.pt")["optimiser"]["state"].values()
    assert max(int(of_one["step"]) for of_one in moments) == 5


def step_of(*gradients: list[float] | None) -> Step:
    """A step of a model whose parameters have these gradients."""
    parameters = [torch.zeros(3, requires_grad=True) for _ in gradients]
    for parameter, gradient in zip(parameters, gradients):
        parameter.grad = None if gradient is None else torch.tensor(gradient)
    return Step(SimpleNamespace(parameters=lambda: parameters), None, None, None)


def numbers_of(step: Step) -> StepNumbers:
    """The numbers of a step without terms and samples."""
    none = torch.zeros(0, dtype=torch.int64)
    found = SimpleNamespace(n_found=none.sum(), evaluated=none)
    ray = SimpleNamespace(found=found, sizes=torch.zeros(3, dtype=torch.int64), s=torch.ones(()))
    return step.fetch(1, SimpleNamespace(target=none), ray, {}).read()


def with_norm(norm: float, step: int = 1) -> StepNumbers:
    return StepNumbers(step, 1, {}, {}, norm, Capacity(0, 0, 0), 1.0, 0.0)


def test_the_norm_is_that_of_all_gradients():
    """Of either sign and of any parameter, 3^2 + 4^2 + 7^2 + 6^2 = 110; one without a gradient counts as none."""
    assert numbers_of(step_of([3.0, 0.0, 4.0], None, [-7.0, 6.0, 0.0])).gradient_norm == pytest.approx(110**0.5)


def test_a_gradient_may_be_taken_if_its_square_is_a_number(capsys):
    step = step_of()
    assert step.judge(with_norm(9e17)) and step.skipped == 0
    for bad in (2e19, torch.inf, torch.nan):  # in single precision the square of the first is infinite
        assert not step.judge(with_norm(bad, 8))
    assert step.skipped == 3 and capsys.readouterr().err.count("step 7: ") == 3


def test_nine_bad_gradients_in_a_row_are_borne_as_often_as_they_come():
    """Steps whose results exceed their capacity are counted, and neither bad nor good."""
    step = step_of()
    for _ in range(3):
        assert [step.judge(with_norm(torch.nan)) for _ in range(9)] == [False] * 9 and step.judge(with_norm(1.0))
    assert not step.judge(with_norm(1.0)._replace(complete=False)) and step.skipped == 28
    with pytest.raises(Diverged, match="step 5: .*10 steps in a row"):
        for i in range(10):
            step.judge(with_norm(torch.nan, 6))
            assert i < 9 and not step.judge(with_norm(1.0)._replace(complete=False))
    assert step.skipped == 28 + 9 + 10


@pytest.fixture
def stepped() -> tuple[torch.nn.Module, torch.optim.Optimizer]:
    """A layer after one step of its optimiser."""
    model = torch.nn.Linear(2, 3)
    optimiser = torch.optim.AdamW(model.parameters())
    model(torch.ones(1, 2)).sum().backward()
    optimiser.step()
    return model, optimiser


@pytest.mark.parametrize("value", [torch.nan, torch.inf, -torch.inf])
def test_a_parameter_or_a_moment_that_is_not_finite_is_named(stepped, value):
    model, optimiser = stepped
    check_state(4, model, optimiser)
    for name, tensor in (
        ("parameter weight", model.weight),
        ("parameter bias", model.bias),
        ("exp_avg of weight", optimiser.state[model.weight]["exp_avg"]),
        ("exp_avg_sq of bias", optimiser.state[model.bias]["exp_avg_sq"]),
    ):
        kept = tensor.detach().clone()
        tensor.data.view(-1)[1] = value
        with pytest.raises(Diverged, match=rf"step 4: not finite: {name} \(1 of {tensor.numel()} values\)"):
            check_state(4, model, optimiser)
        tensor.data.copy_(kept)
    check_state(4, model, optimiser)


def test_parameters_whose_sum_is_too_large_are_finite(stepped):
    model, optimiser = stepped
    model.weight.data.fill_(3e38)
    check_state(4, model, optimiser)


def test_the_first_bad_input_is_named_in_order_of_the_data_flow():
    """Whatever comes first, all that follows from it is bad as well."""
    names = [f"rays' {name}" for name in ("rays_o", "rays_d", "target", "background")] + ["parameter weight"]
    points = ("albedo", "radiance")
    names += [f"rendered {x}" for x in ("sdf", "gradients", "weights", *points, "mean", "opacity")]

    def explained(first_bad: int) -> str:
        def of(start: str) -> dict[str, torch.Tensor]:
            return {name.removeprefix(start): x for name, x in values.items() if name.startswith(start)}

        values = {name: torch.full((3,), torch.nan if i >= first_bad else 1.0) for i, name in enumerate(names)}
        model = torch.nn.Module()
        model.weight = torch.nn.Parameter(values["parameter weight"])
        shaded = {name: values[f"rendered {name}"] for name in points}
        ray = SimpleNamespace(**of("rendered "), points=SimpleNamespace(_asdict=lambda: shaded))
        terms = {"colour": 1.0, "mask": torch.inf, "metal": torch.nan}
        return str(explain_loss(8, terms, model, SimpleNamespace(**of("rays' ")), ray))

    for i, name in enumerate(names):
        message = f"step 8: the loss is not finite (mask, metal); first not finite: {name} (3 of 3 values); "
        assert explained(i).startswith(message)
    assert "first not finite: none of what it comes from; " in explained(len(names))


@pytest.mark.slow
def test_a_long_training_stays_finite(data, tmp_path):
    """Some times the steps of a run: no loss, parameter or skipped step tells of it. Preset paper would take hours."""
    config = tiny(steps=100_000, target_samples=128, n_levels=2, preview_every=1.0)
    training = train_scene(load_dataset(data), config, tmp_path)
    assert training.step == 100_000 and training.take_step.skipped == 0
    assert all(math.isfinite(value) for line in lines_of(tmp_path) for value in line.values())
    assert all(parameter.isfinite().all() for parameter in training.model.parameters())
