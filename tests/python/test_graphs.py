"""Training steps that are recorded and repeated, on a CPU that pretends to."""

from types import SimpleNamespace
from typing import NamedTuple

import pretend_graphs
import pytest
import torch
from pretend_gpu import pretend_gpu
from splitnerf.data.dataset import load_dataset
from splitnerf.render.model import SceneModel
from splitnerf.training import gpu_step
from splitnerf.training import loop as trainer
from splitnerf.training.batches import PixelSource, draw_batch
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.step import Step
from tiny_runs import lines_of, tiny, train_scene


@pytest.fixture
def recording(monkeypatch):
    """Graphs on the CPU; counts how they were used."""
    return pretend_graphs.graphs_on_the_cpu(monkeypatch)


def called(function, pool, generator):
    """In place of `record`: the replay calls the function."""
    outputs = [None, None]
    return SimpleNamespace(replay=lambda: outputs.__setitem__(slice(None), function())), outputs


def same_lines(folder) -> None:
    """The runs `recorded` and `called` have the same numbers but for their seconds."""
    for ours, theirs in zip(lines_of(folder / "recorded"), lines_of(folder / "called"), strict=True):
        assert ours | {"seconds": 0} == theirs | {"seconds": 0}


class Taken(NamedTuple):
    """How a step was taken, its rays, and what there was after it: kinds of steps, steps without capacity, and the progress at the
    mesh in use."""

    how: str
    n_rays: int
    n_kinds: int
    skipped: int
    made_at: float


def schedule_of_a_gpu(data, run, monkeypatch, used, **settings) -> tuple[trainer.Training, list[Taken]]:
    """The schedule of preset fast in 160 steps on a pretended GPU. Before step 57 the surface becomes so blurred that rays find a half
    more samples. Memory that a mesh leaves when the next comes is overwritten."""
    advance, poll, use = trainer.Training.advance, SurfaceMesh.poll, SceneModel.use_mesh
    steps = []

    def watched(training, bar):
        if training.step == 57:
            training.model.variance.data.sub_(0.1)
        before, taken = used.copy(), training.take_step
        advance(training, bar)
        how = next(way for way in ("recorded", "called", "replayed") if used[way] > before[way])
        n_rays = len(taken.newest[0].target)
        steps.append(Taken(how, n_rays, len(taken._with_kernels), taken.skipped, training.mesh.made_at))

    def leaving(model, bits):
        old = model.bits
        use(model, bits)
        for x in () if old is None or model.bits is old else (old.cache.vertices, old.cache.normals):
            x.fill_(torch.nan)

    with monkeypatch.context() as patch:
        patch.setattr(trainer.Training, "advance", watched)
        # which step takes it is no chance
        patch.setattr(SurfaceMesh, "poll", lambda mesh, wait=False: poll(mesh, wait=True))
        patch.setattr(SceneModel, "use_mesh", leaving)
        surface = {"target_samples": 4608, "open_below": 0.0, "start_levels": 1, "indirect_every": 25}
        seldom = {"preview_every": 1.0, "checkpoint_minutes": 1e3}
        config = tiny("fast", steps=160, cuda_graphs=True, **surface, **seldom, **settings)
        run.mkdir()
        with pretend_gpu(patch):
            return train_scene(load_dataset(data), config, run, device="cuda"), steps


def test_a_whole_schedule_runs_through_graphs_to_its_end(data, tmp_path, monkeypatch, recording):
    """Numbers are read late; levels open, meshes are swapped, priors begin, the light moves. When the surface blurs, a step and
    the one on its way find more samples than their capacity: they move nothing, and the next has no limit. Called in place of
    recorded it gives the same bits."""
    trained, steps = schedule_of_a_gpu(data, tmp_path / "recorded", monkeypatch, recording)
    assert trained.finished and all(p.isfinite().all() for p in trained.model.parameters())
    # the first step that read of one that was not complete
    at = next(i for i, step in enumerate(steps) if step.skipped)
    assert 57 < at <= 57 + gpu_step.READ_EVERY and [step.how for step in steps[at : at + 2]] == ["recorded", "called"]
    assert [steps[i].skipped for i in (at - 1, at, at + 1, 159)] == [0, 1, 2, 2]
    assert len({step.made_at for step in steps}) == 10 and len(steps) == 160
    rays = [step.n_rays for step in steps]
    # none goes to and fro
    assert not any(a == c != b for a, b, c in zip(rays, rays[1:], rays[2:])) and len(set(rays[80:])) <= 3
    # A kind of steps is called, then recorded, and recorded anew where the graph has too little capacity.
    assert recording["recorded"] <= steps[-1].n_kinds and recording["called"] <= steps[-1].n_kinds + 15
    assert [step.how for step in steps].count("replayed") > 70

    monkeypatch.setattr(gpu_step, "record", called)
    other, _ = schedule_of_a_gpu(data, tmp_path / "called", monkeypatch, recording)
    for a, b in zip(trained.model.parameters(), other.model.parameters(), strict=True):
        assert torch.equal(a, b)
    same_lines(tmp_path)


def test_a_capacity_changes_roundings_alone(data):
    """Losses and gradients of one step with capacity for more of everything, against those with none."""
    dataset = load_dataset(data)
    weights = {"eikonal_weight": 0.0, "entropy_weight": 0.0, "shape_priors_until": 1.0}
    config = tiny("cpu", open_below=0.0, n_levels=6, target_samples=3000, initial_variance=0.4, **weights)
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
        ray, terms = take_step.differentiate(batch, found, light, 3, 0.9, capacity)
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


def test_waiting_while_recording_is_refused():
    """Else no test of this file would find any."""
    for waits in (lambda x: x.sum().item(), lambda x: x.nonzero(), lambda x: x[x > 0]):
        with pytest.raises(RuntimeError, match="waits"):
            pretend_graphs.record(lambda: waits(torch.ones(3)), None, torch.Generator())
