"""Every schedule of a training by its closed form, alone and as a run follows it."""

import itertools
import math
from collections.abc import Callable

import pytest
import torch
from splitnerf.config import Config, preset
from splitnerf.data.dataset import load_dataset
from splitnerf.render.model import SceneModel
from splitnerf.training import loop as trainer
from splitnerf.training import losses, schedule
from splitnerf.training import step as step_module
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.schedule import cosine_anneal, light_moves, light_period, next_ray_count, set_learning_rate
from test_refreshes import calls
from tiny_runs import tiny, train_scene


def one_parameter(rate: float = 1.0) -> torch.optim.Optimizer:
    """An optimiser with one group at this rate."""
    return torch.optim.AdamW([{"params": [torch.zeros(1)], "rate": rate, "lr": rate}])


def factor(config: Config, step: int) -> float:
    """What the learning rate is multiplied by at a step of a run that only counts steps."""
    optimiser = one_parameter()
    set_learning_rate(optimiser, config, step, step / config.run.steps)
    return optimiser.param_groups[0]["lr"]


# ---- the learning rate ----


@pytest.mark.parametrize(
    ("warmup", "steps", "expected"),
    [
        (50, 1000, {0: 1 / 50, 24: 25 / 50, 49: 1.0, 50: 1.0}),  # in equal steps
        # then lr(p) = f^((p - w) / (1 - w)) after a warm-up of the share w: equal factors in equal times, f at the end
        (200, 1000, {200: 1.0, 400: 0.01**0.25, 401: 0.01 ** (201 / 800), 600: 0.1, 800: 0.01**0.75, 1000: 0.01}),
        (0, 100, {0: 1.0, 50: 0.1, 100: 0.01}),
        # The decay begins at half of the run at the latest.
        (80, 100, {0: 1 / 80, 49: 50 / 80, 75: 76 / 80 * 0.1, 100: 0.01}),
    ],
)
def test_the_rate_warms_up_and_decays(warmup, steps, expected):
    config = Config().replace({"steps": steps, "warmup_steps": warmup, "final_learning_rate": 0.01})
    for step, rate in expected.items():
        assert factor(config, step) == pytest.approx(rate, rel=1e-9), step


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("light", ["pyramid", "mlp"])
def test_each_part_has_its_rate_and_its_decay(light, sparse):
    """The sharpness and the light's texels have rates of their own and no decay, all else the common ones; none is left out."""
    settings = {"light.kind": light, "shading.method": "split", "sparse_steps": sparse}
    model = SceneModel(tiny(**settings))
    optimiser = schedule.make_optimiser(model, tiny(**settings))
    rates, decays, sparsely = {}, {}, {}
    for group in optimiser.param_groups:
        for parameter in group["params"]:
            assert id(parameter) not in rates
            rates[id(parameter)], decays[id(parameter)] = group["lr"], group["weight_decay"]
            sparsely[id(parameter)] = group["sparse"]
            assert group["betas"] == (0.9, 0.99) and group["eps"] == 1e-15
    for name, parameter in model.named_parameters():
        own = {"variance": (0.001, 0.0), "light.texels": (0.02, 0.0)}.get(name, (0.01, 0.01))
        assert (rates[id(parameter)], decays[id(parameter)]) == own, name
        assert sparsely[id(parameter)] == (sparse and name == "sdf_field.grid.table"), name


# ---- levels, annealing ----


@pytest.mark.parametrize(
    ("settings", "opened"),
    [
        (
            {"n_levels": 6, "start_levels": 2, "levels_open_by": 0.5},
            {0.0: 2, 0.124: 2, 0.126: 3, 0.376: 5, 0.499: 5, 0.5: 6, 1.0: 6},
        ),
        ({"n_levels": 6, "start_levels": 2, "levels_open_by": 0.0}, {0.0: 6, 1.0: 6}),
        ({"n_levels": 3, "start_levels": 4}, {0.0: 3, 1.0: 3}),
    ],
)
def test_levels_open_evenly(settings, opened):
    model = SceneModel(tiny(**settings))
    for progress, n in opened.items():
        model.open_levels(progress)
        assert model.sdf_field.grid.n_active == n, progress


def test_the_cosine_is_annealed_from_0_to_1():
    """t = min(1, step / 20,000), as published; elsewhere by the share of the run that is set."""
    for step in (0, 1, 5_000, 10_000, 20_000):
        assert cosine_anneal(preset("paper"), step / 20_000) == pytest.approx(step / 20_000)
    config = Config().replace({"cos_anneal_by": 0.4})
    found = [cosine_anneal(config, progress) for progress in (0.0, 0.1, 0.3, 0.4, 0.7, 1.0)]
    assert found == pytest.approx([0.0, 0.25, 0.75, 1.0, 1.0, 1.0])
    assert cosine_anneal(config.replace({"cos_anneal_by": 0.0}), 0.0) == 1.0


# ---- rays ----


def converged(n_rays: int, per_ray: float, config: Config) -> list[int]:
    """Numbers of rays step by step, where each has so many samples."""
    counts = [n_rays]
    while len(counts) < 100:
        counts.append(next_ray_count(counts[-1], counts[-1] * per_ray, config))
    return counts


@pytest.mark.parametrize("per_ray", [1.7, 30.0, 130.0])
def test_rays_are_as_many_as_fill_the_budget(per_ray):
    """In the end budget / samples a ray; on the way there by a factor of 1.25 up and 0.8 down at most."""
    config = Config().replace({"target_samples": 30_000, "max_rays": 100_000})
    for start in (64, 50_000):
        counts = converged(start, per_ray, config)
        assert counts[-1] == pytest.approx(30_000 / per_ray, abs=1)
        far = [(a, b) for a, b in itertools.pairwise(counts) if not 0.8 < 30_000 / per_ray / a < 1.25]
        assert far and all(b == int(1.25 * a if a < 30_000 / per_ray else 0.8 * a) for a, b in far)


def test_rays_have_bounds():
    config = Config().replace({"target_samples": 30_000, "max_rays": 900})
    assert converged(256, 1.0, config)[-1] == 900 and converged(256, 1e5, config)[-1] == 64
    assert next_ray_count(256, 0, config) == int(1.25 * 256)  # all rays missed
    assert next_ray_count(100, 1, config.replace({"target_samples": 1})) == 100


def test_recorded_steps_keep_their_number_of_rays_while_the_budget_is_nearly_met():
    config = Config().replace({"target_samples": 30_000, "max_rays": 100_000, "cuda_graphs": True})
    for share, kept in ((0.91, True), (1.04, True), (0.89, False), (1.06, False)):
        assert (next_ray_count(1000, 30_000 * share, config) == 1000) == kept, share
    taken = {next_ray_count(n, n * 30_000 / (1.2 * n), config) for n in range(64, 5000)}
    for size in (128, 1024, 2048):  # between a power of 2 and the next
        assert {n for n in taken if size <= n < 2 * size} == set(range(size, 2 * size, size // 16))


# ---- the light ----


def test_the_light_moves_once_in_its_period_and_with_the_last_step():
    config = Config().replace({"steps": 10, "light_step_every": 4})
    assert light_period(config) == 4
    assert [step for step in range(10) if light_moves(config, step)] == [3, 7, 9]
    mlp = config.replace({"light.kind": "mlp", "shading.method": "split"})
    assert light_period(mlp) == 1 and all(light_moves(mlp, step) for step in range(10))


# ---- what a run does ----


def recorded(monkeypatch, name: str, note: Callable, module=trainer) -> list:
    """What `note` makes of the arguments and the result of each call that the trainer makes of this function."""
    notes, function = [], getattr(module, name)

    def noted(*args, **kwargs):
        result = function(*args, **kwargs)
        notes.append(note(args, kwargs, result))
        return result

    monkeypatch.setattr(module, name, noted)
    return notes


def test_a_run_follows_its_schedules(data, tmp_path, monkeypatch):
    """Levels, anneal, rates, and the terms that begin late or stand for several steps, as a run of 41 steps has them."""
    n = 41
    begun_late = {"entropy_weight": 0.01, "priors_from": 0.5, "mesh_every": 0.25}
    of_light = {"neutral_weight": 0.03, "light_prior_weight": 0.002, "light_step_every": 4}
    levels = {"n_levels": 8, "start_levels": 2, "levels_open_by": 0.6, "cos_anneal_by": 0.5}
    config = tiny(steps=n, warmup_steps=8, final_learning_rate=0.1, **levels, **begun_late, **of_light)
    levels = recorded(monkeypatch, "find_samples", lambda args, _, __: args[0].sdf_field.grid.n_active, step_module)
    anneals = recorded(monkeypatch, "find_samples", lambda args, *_: args[5], step_module)
    by_group = lambda args, *_: [group["lr"] / group["rate"] for group in args[0].param_groups]
    rates = recorded(monkeypatch, "set_learning_rate", by_group)
    terms = recorded(monkeypatch, "loss_terms", lambda _, __, result: {k: t.weight for k, t in result.items()}, losses)
    requested = calls(monkeypatch, SurfaceMesh, "request", lambda _, progress: progress)
    train_scene(load_dataset(data), config, tmp_path)

    assert levels == [min(8, 2 + math.floor(6 * step / (0.6 * n))) for step in range(n)]
    assert anneals == pytest.approx([min(1.0, step / (0.5 * n)) for step in range(n)])
    w = 8 / n
    expected = [min(1.0, (step + 1) / 8) * 0.1 ** max(0.0, (step / n - w) / (1 - w)) for step in range(n)]
    assert all(group == pytest.approx([rate] * len(group)) for group, rate in zip(rates, expected, strict=True))
    assert ["entropy" in step for step in terms] == [step / n >= 0.5 for step in range(n)]
    for prior, weight in (("neutral", 0.03), ("light_prior", 0.002)):
        assert [step for step in range(n) if prior in terms[step]] == [*range(3, 40, 4), 40]
        assert sum(step.get(prior, 0.0) for step in terms) == pytest.approx(weight * n)
    apart = math.ceil(0.25 * n)
    assert requested == pytest.approx([apart / n, 2 * apart / n, 3 * apart / n, 1.0])
