"""Training steps that are recorded and repeated, on a CPU that pretends to."""

from __future__ import annotations

from types import SimpleNamespace

import pretend_graphs
import pytest
import torch
from tiny_runs import lines_of, tiny

from splitnerf.ops import AdamW
from splitnerf.training import graphs, room
from splitnerf.training import loop as trainer
from splitnerf.training.batches import draw_batch
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.config import Config
from splitnerf.data.dataset import load_dataset
from splitnerf.errors import InputError
from splitnerf.training.graphs import GraphedStep
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.render.model import SceneModel
from splitnerf.render.rays import PixelSource
from splitnerf.training.step import Step


@pytest.fixture
def recording(monkeypatch):
    """Graphs on the CPU; counts how they were used."""
    return pretend_graphs.graphs_on_the_cpu(monkeypatch)


@pytest.mark.parametrize("settings", [
    {}, {"sparse_steps": True, "table_dtype": "bfloat16", "seed": 3},
    {"table_dtype": "float16", "sample_above": 0.0, "grid_every": 3, "target_samples": 16384},
])  # fmt: skip
def test_recorded_steps_have_the_bits_of_others(data, tmp_path, monkeypatch, recording, settings):
    """While the light moves, levels open, meshes come, priors begin and the anneal goes on. Both have the same capacity."""
    settings = {"target_samples": 4608, "open_below": 0.0, "indirect_every": 25, "start_levels": 1} | settings
    config = tiny("cpu", steps=120, cuda_graphs=True, **settings)
    for name in ("recorded", "called"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(trainer, "next_ray_count", lambda n_rays, *_: 96)
    trainer.train(load_dataset(data), config, tmp_path / "recorded")
    assert recording["replayed"] > 60 and recording["recorded"] < 60
    called = []

    def call(function, pool, generator):
        outputs = [None, None]
        called.append(lambda: outputs.__setitem__(slice(None), function()))
        return SimpleNamespace(replay=called[-1]), outputs

    monkeypatch.setattr(graphs, "record", call)
    trainer.train(load_dataset(data), config, tmp_path / "called")
    assert len(called) == recording["recorded"]
    for ours, theirs in zip(lines_of(tmp_path / "recorded"), lines_of(tmp_path / "called"), strict=True):
        assert ours | {"seconds": 0} == theirs | {"seconds": 0}


def test_a_capacity_changes_roundings_alone(data):
    """Losses and gradients of one step with room for more of everything, against those with none."""
    dataset = load_dataset(data)
    config = tiny(
        "cpu",
        open_below=0.0,
        n_levels=6,
        target_samples=3000,
        initial_variance=0.4,
        eikonal_weight=0.0,
        entropy_weight=0.0,
    )
    model = SceneModel(config)
    generator = torch.Generator().manual_seed(0)
    source = PixelSource(dataset, 0.85, generator)
    mesh = SurfaceMesh(model)
    mesh.request(0.5)
    grid = SimpleNamespace(cells=torch.ones(16, 16, 16, dtype=torch.uint8))
    take_step = Step(model, grid, mesh, generator)
    batch = draw_batch(source, 200, config, torch.ones(len(dataset), 3))
    found = take_step.find(batch, 0.9)
    n = len(found.directions)
    padded_found = take_step.find(batch, 0.9, n + 77)
    assert n > 500 and len(padded_found.directions) == n + 77 and model.sums_light

    def step(found, capacity):
        take_step.generator = torch.Generator().manual_seed(1)
        light = model.evaluate_light()
        ray, terms = take_step.differentiate(batch, found, light, None, 3, 0.9, capacity)
        light.backward()
        return {k: t.value.detach() for k, t in terms.items()}, [p.grad for p in model.parameters()], ray

    terms, grads, ray = step(found, None)
    padded_terms, padded_grads, padded = step(padded_found, (4096, 2048))
    assert padded.sizes.tolist() == ray.sizes.tolist() and len(padded.shaded) == 4096
    assert {"colour", "neutral", "smoothness", "mask", "dark_metal"} <= set(terms)
    for name, value in terms.items():
        if name != "eikonal":  # it looks at some points twice, and counts for nothing here
            torch.testing.assert_close(padded_terms[name], value, rtol=1e-5, atol=1e-7)
    for (name, _), a, b in zip(model.named_parameters(), padded_grads, grads, strict=True):
        assert (a - b).norm() <= 1e-4 * b.norm(), name


def test_a_step_that_exceeds_its_room_moves_nothing(data, tmp_path, monkeypatch, recording):
    """Nor does it count."""
    monkeypatch.setattr(room, "SHADING_SLACK", 0.2)
    monkeypatch.setattr(room, "UNIT", 1)
    complete, settle, moved, step = [], GraphedStep.settle, [], AdamW.step
    monkeypatch.setattr(GraphedStep, "settle", lambda self, *told: complete.append(settle(self, *told)) or complete[-1])

    def watched(self, allowed):
        params = [p for group in self.param_groups for p in group["params"]]
        before = [p.detach().clone() for p in params]
        step(self, allowed=allowed)
        moved.append(any(not torch.equal(p, b) for p, b in zip(params, before)))

    monkeypatch.setattr(AdamW, "step", watched)
    monkeypatch.setattr(trainer, "next_ray_count", lambda n_rays, *_: 96)
    config = tiny("cpu", steps=40, cuda_graphs=True, target_samples=4608)
    trained = trainer.train(load_dataset(data), config, tmp_path)
    assert complete.count(False) > 0 and moved == complete and trained.finished
    stored = load_checkpoint(tmp_path / "checkpoint.pt")["optimiser"]["state"]
    assert max(int(moments["step"]) for moments in stored.values()) == complete.count(True)


def test_what_cannot_be_recorded_is_refused():
    for settings in ({"light": "mlp"}, {"occlusion": "mlp"}, {"normals": "finite_difference"}):
        with pytest.raises(InputError, match="cuda_graphs"):
            Config().replace({"cuda_graphs": True, "shading": "split", **settings})


def test_waiting_while_recording_is_refused():
    generator = torch.Generator()
    for waits in (lambda x: x.sum().item(), lambda x: x.nonzero(), lambda x: x[x > 0]):
        with pytest.raises(RuntimeError, match="waits"):
            pretend_graphs.record(lambda: waits(torch.ones(3)), None, generator)
    x, total = torch.ones(3), torch.zeros(3)
    graph, drawn = pretend_graphs.record(
        lambda: total.add_(x * 2) + torch.rand(3, generator=generator), None, generator
    )
    assert not total.any()
    graph.replay()
    first = drawn.clone()
    x.fill_(2.0)
    graph.replay()
    assert total.tolist() == [6.0] * 3 and not torch.equal(drawn - 6, first - 2)
