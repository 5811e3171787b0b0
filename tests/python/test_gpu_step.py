"""The comparison of one training step on two devices: what it finds, on the CPU and on a GPU that is none."""

from __future__ import annotations

import pytest
import torch
from bench import gpu_step
from bench.gpu_step import Answer, Row, answer, compared, error_of
from pretend_gpu import pretend_gpu
from pretend_graphs import graphs_on_the_cpu
from splitnerf.data.dataset import load_dataset
from splitnerf.render import model as rendering
from splitnerf.training import losses
from tiny_runs import as_options, tiny

SETTINGS = gpu_step.ALWAYS | {"steps": 100, "table_dtype": "float16", "seed": 2}


@pytest.fixture(scope="module")
def prepared(data, tmp_path_factory):
    """Data, settings, folder, and all that the comparison begins with, on the CPU."""
    dataset, config, run = load_dataset(data), tiny("fast", **SETTINGS), tmp_path_factory.mktemp("step")
    gpu_step.begun(dataset, config, run, 6)
    ours, truth = gpu_step.restored(dataset, config, run, "cpu"), gpu_step.in_float64(dataset, config, run)
    there = gpu_step.restored(dataset, config, run, "cpu")
    return dataset, config, run, there, *gpu_step.same_choice(ours, truth, there)


@pytest.fixture
def there(prepared):
    """The scene on the device that is looked at, which tests may spoil."""
    return gpu_step.restored(*prepared[:3], "cpu")


def wrong(prepared, there) -> set[str]:
    """The rows of a step that are beyond their limits."""
    work, draws, (true, on_cpu, _) = prepared[4:]
    return {row.name for row in compared(there, true, on_cpu, answer(there, work, draws)) if not row.holds}


def test_a_step_agrees_with_float64(prepared, there):
    true, on_cpu, found = prepared[6]
    rows = compared(there, true, on_cpu, found)
    names = {row.name for row in rows}
    assert all(row.holds for row in rows) and all(row.limit < 5e-3 for row in rows)
    assert {"loss, colour", "loss, neutral", "loss, light_prior", "loss, entropy", "gradient, variance"} <= names
    assert {"gradient, light.texels, level 2", "gradient, sdf_field.grid.table, level 3"} <= names
    assert 0 < sum(row.on_cpu for row in rows) and true.terms["colour"] != on_cpu.terms["colour"]  # it was in float64
    assert there.model.sums_light and not there.model.occlusion.is_unoccluded  # all caches were read


def test_equal_runs_have_equal_bits(prepared, there):
    """Rays, samples, draws and the model are the same: nothing but the device is left to differ."""
    work, draws, (_, on_cpu, _) = prepared[4:]
    again = answer(there, work, draws)
    assert all(torch.equal(again.terms[name], value) for name, value in on_cpu.terms.items())
    assert all(torch.equal(again.gradients[name], value) for name, value in on_cpu.gradients.items())


@pytest.mark.parametrize("name", ["sdf_field.hidden_bias", "material.net.0.weight", "light.texels", "variance"])
def test_a_changed_weight_is_found(prepared, there, name):
    with torch.no_grad():
        parameter = dict(there.model.named_parameters())[name]
        parameter.view(-1)[0] += 0.01 * parameter.norm()
    assert len(wrong(prepared, there)) > 5


@pytest.mark.parametrize("level", [0, 3])
def test_a_level_without_gradient_is_found(prepared, there, level):
    spec = there.model.sdf_field.grid.spec
    _, first, n, _ = spec.levels()[level]

    def drop(grad):
        grad[first : first + n] = 0
        return grad

    there.model.sdf_field.grid.table.register_hook(drop)
    assert wrong(prepared, there) == {f"gradient, sdf_field.grid.table, level {level}"}


def test_a_dropped_gradient_is_found(prepared, there, monkeypatch):
    """Of the visible light's sum to its colours, and of all of a parameter."""
    corrected = rendering.summed_correction
    monkeypatch.setattr(rendering, "summed_correction", lambda *x: corrected(*x[:9], x[9].detach(), *x[10:]))
    assert wrong(prepared, there) == {f"gradient, light.texels, level {i}" for i in range(3)}
    monkeypatch.undo()
    there.model.material.net[0].bias.requires_grad_(False)
    assert wrong(prepared, there) == {"gradient, material.net.0.bias"}


def test_a_term_too_many_and_one_too_few_are_found(prepared, there, monkeypatch):
    terms_of = losses.loss_terms

    def others(*arguments):
        terms = terms_of(*arguments)
        terms["more"] = terms.pop("mask")
        return terms

    monkeypatch.setattr(losses, "loss_terms", others)
    assert wrong(prepared, there) == {"loss, mask", "loss, more"}


def test_errors():
    ones, none = torch.ones(4), torch.zeros(4)
    assert error_of(ones * 1.5, ones) == 0.5 and error_of(none, none) == 0.0 and error_of(None, None) == 0.0
    assert (
        error_of(ones, none) == error_of(None, ones) == error_of(ones, None) == error_of(ones[:2], ones) == float("inf")
    )
    assert not Row("", error_of(ones * float("nan"), ones), 0.0, 1.0).holds


def test_on_a_gpu_that_is_none(prepared, monkeypatch):
    """Nothing of the comparison forgets a device; the draws are the CPU's."""
    dataset, config, run, _, work, draws, (true, on_cpu, _) = prepared
    with pretend_gpu(monkeypatch):
        there = gpu_step.restored(dataset, config, run, "cuda")
        assert there.model.device.type == "cuda"
        rows = [*compared(there, true, on_cpu, answer(there, work, draws)), gpu_step.other_rays(there, work)]
    assert all(row.holds for row in rows)


def test_a_graph_is_held_against_the_eager_step(prepared, monkeypatch):
    dataset, config, run, _, work, _, _ = prepared
    used = graphs_on_the_cpu(monkeypatch)
    there = gpu_step.restored(dataset, config.replace({"cuda_graphs": True}), run, "cpu")
    answers = list(gpu_step.Graphed(there, work).answers())
    assert used["recorded"] >= 3 and used["replayed"] >= 10 and there.take_step.skipped == 1
    for name, eager, replayed in answers:
        rows = [Row(x, 0.0, 0.0, 1e-5) for x in names_of(there, eager)]
        found = gpu_step.against_eager(there, eager, replayed, rows)
        assert len(found) > 25 and all(row.error == 0.0 and row.limit == 1e-5 for row in found), name
    replayed.terms["mask"].mul_(1.01)
    replayed.gradients["variance"].mul_(1.01)
    wrong = {row.name for row in gpu_step.against_eager(there, eager, replayed, rows) if not row.holds}
    assert wrong == {"loss, mask", "gradient, variance"}


def names_of(training, found: Answer) -> list[str]:
    return [row.name for row in compared(training, found, found, found)]


def test_the_program(data, tmp_path, monkeypatch, capsys):
    small = as_options(
        SETTINGS
        | {
            "n_levels": 4,
            "log2_table_size": 10,
            "target_samples": 512,
            "initial_rays": 64,
            "grid_resolution": 16,
            "light_resolution": 16,
            "mesh_resolution": 24,
        }
    )
    command = ["gpu_step.py", str(data), "--device", "cpu", "--steps", "2", "--out", str(tmp_path), *small]
    monkeypatch.setattr("sys.argv", command)
    assert gpu_step.main() == 0 and "agree, the worst at 0." in capsys.readouterr().out
    assert "| gradient, variance |" in (tmp_path / "step.md").read_text()
    monkeypatch.setattr(gpu_step, "FACTOR", 0.5)
    monkeypatch.setattr(gpu_step, "FLOOR", 1e-12)
    assert gpu_step.main() == 1 and "beyond its limit" in (tmp_path / "step.md").read_text()
