"""The trainer on another device than the CPU, by tensors that only say so."""

import itertools
import os

import pytest
import torch
from op_checks import on_threads
from pretend_gpu import GPU, GpuTensor, pretend_gpu
from splitnerf.data.dataset import load_dataset
from splitnerf.devices import in_background
from splitnerf.ops.rays import CELL_OCCUPIED
from splitnerf.pipeline import reconstruct
from splitnerf.render import model, occupancy, renderer
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import DENSITY_CUTOFF, LIPSCHITZ, OccupancyGrid
from splitnerf.training import loop as trainer
from splitnerf.training import losses
from splitnerf.training import step as steps
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.step import Capacity
from tiny_runs import lines_of, refused, tiny, train_scene


def test_two_devices_in_one_call_are_told(monkeypatch):
    """Else no test of this file would find any."""
    with pretend_gpu(monkeypatch):
        here, there, random = torch.ones(3), torch.ones(3, device="cuda"), torch.Generator("cuda")
        for wrong in (lambda: here + there, lambda: there[here.long()], lambda: torch.rand(3, generator=random)):
            with pytest.raises(RuntimeError, match="two devices"):
                wrong()


# In 200 steps with 10 lines of metrics.jsonl, 6 updates of the grid (paper: 13) and one mesh. Parameters are checked before the
# mesh is made. Preset paper finds all samples of its rays and shades each, so that its steps wait for two counts anyway; each update of
# its grid draws among the occupied cells. From the mesh on, in 115 steps, a panorama of its light is painted every 16 steps, and the
# CPU traces rays in each: it waits for the points that are chosen and for their numbers, and the factors go back.
WAITS = {
    "cpu": {"item": 1},
    "fast": {"item": 1},
    "paper": {
        "item": 1,
        "march_rays": 200,
        "spread_samples": 200,
        "nonzero": 128,
        "unique": 13,
        "__float__": 13,
        "to": 239,
        "cpu": 575,
    },
}


@pytest.mark.parametrize("name", ["cpu", "fast", "paper"])
def test_steps_stay_on_the_gpu_and_all_waits_for_it_are_known(data, tmp_path, monkeypatch, name):
    """Operators that must know how many samples there are wait within, unless they are told their capacity."""
    seen, advance, poll = {}, trainer.Training.advance, SurfaceMesh.poll

    def waiting(module, name, is_told):
        operator = getattr(module, name)

        def called(*args, **kwargs):
            gpu.waits[name] += not is_told(*args, **kwargs)
            return operator(*args, **kwargs)

        monkeypatch.setattr(module, name, called)

    waiting(renderer, "march_rays", lambda *_, **__: False)
    waiting(renderer, "sample_rays", lambda *_, capacity, **__: capacity > 0)
    waiting(renderer, "spread_samples", lambda *args: args[5] is not None)
    waiting(model, "wide_lobes", lambda *args: args[4] is not None)

    def watched(training, bar):
        seen[training.step] = gpu.waits.copy(), training.mesh.made_at
        advance(training, bar)

    for cached in (losses._stored_seed, steps._limits):
        cached.cache_clear()
    monkeypatch.setattr(occupancy, "ALL_CELLS_UNTIL", 20)
    monkeypatch.setattr(trainer.Training, "advance", watched)
    monkeypatch.setattr(SurfaceMesh, "poll", lambda mesh, wait=False: poll(mesh, wait=True))  # takes its mesh at once
    settings = {"min_step": 0.03} if name == "paper" else {"target_samples": 3072}  # so that samples fit
    settings |= {"mesh_every": 0.5, "mesh.background": True, "indirect_every": 50}
    config = tiny(name, steps=250, preview_every=1.0, checkpoint_minutes=1e3, **settings)
    with pretend_gpu(monkeypatch) as gpu:
        trained = train_scene(load_dataset(data), config, tmp_path, device="cuda")
        assert trained.finished and trained.model.device == GPU and trained.grid.cells.device == GPU
    assert all(isinstance(p, GpuTensor) for p in trained.model.parameters())
    (before, no_mesh), (after, made_at) = seen[40], seen[240]
    assert dict(after - before) == WAITS[name] and no_mesh == 0.0 and made_at == 0.5


def test_the_grid_of_a_gpu_waits_for_no_count(monkeypatch):
    """Each update evaluates all cells near the surface of the update before, also while the density gets wider, and a tenth of the
    others."""
    with pretend_gpu(monkeypatch) as gpu:
        grid, s = OccupancyGrid(24, 1.5, device="cuda"), 100.0
        radius = grid.centres().norm(dim=1)
        grid.update(lambda x: x.norm(dim=1) - 0.5, s)
        gpu.waits.clear()
        for i in range(1, 9):
            before, s = grid.values.clone(), 0.95 * s
            grid.update(lambda x, i=i: x.norm(dim=1) - 0.5 - 0.02 * i, s, first=False)
            assert not gpu.waits
            bound = LIPSCHITZ * grid.half_diagonal + DENSITY_CUTOFF / s
            near, new = before.abs() < 2.0 * bound, (grid.values - (radius - 0.5 - 0.02 * i)).abs() < 1e-5
            assert 500 < near.sum() < 4000 and new[near].all() and 0.05 < new[~near].float().mean() < 0.15
            gpu.waits.clear()
        assert torch.equal((grid.values.abs() <= bound).view_as(grid.cells), grid.cells == CELL_OCCUPIED)


def test_a_gpu_shades_a_million_emitters_at_a_time(monkeypatch):
    """Where each part costs the host its launches; the CPU takes parts that stay in its caches, see test_visibility.py."""
    parts, shade = [], model.split_sum_shade
    monkeypatch.setattr(model, "SHADED_CHUNK", model.SHADED_CHUNK | {"cpu": 50})
    noting = lambda *args, **named: parts.append(len(args[0])) or shade(*args, **named)
    monkeypatch.setattr(model, "split_sum_shade", noting)
    torch.manual_seed(0)
    with pretend_gpu(monkeypatch):
        scene = SceneModel(tiny(open_below=0.0)).to("cuda")
        scene.sdf_field.grid.table.data.normal_(0.0, 0.3)
        scene.sdf_field.hidden_direction.data[:, 3:].normal_(0.0, 0.05)  # dents, that rays from the surface hit
        SurfaceMesh(scene).request(0.1)
        n = len(scene.bits.emitters.vertices)
        parts.clear()
        scene.refresh_indirect(scene.evaluate_light())
    assert n > 100 and parts == [n]


@pytest.mark.parametrize(("name", "pads"), [("fast", True), ("paper", False)])
def test_padding_is_computed_only_where_it_saves_a_wait(data, tmp_path, monkeypatch, name, pads):
    asked, differentiate = [], GpuStep.differentiate

    def watched(taken, batch, found, light, step, progress, capacity):
        asked.append((len(found.directions) > found.n_found.item(), capacity is not None, taken.capacity == Capacity()))
        return differentiate(taken, batch, found, light, step, progress, capacity)

    monkeypatch.setattr(GpuStep, "differentiate", watched)
    config = tiny(name, steps=12, target_samples=4608, min_step=0.03)
    with pretend_gpu(monkeypatch):
        train_scene(load_dataset(data), config, tmp_path, device="cuda")
    assert asked[0] == (False, False, True) and set(asked[4:]) == {(pads, pads, not pads)}


@pytest.mark.parametrize("own", [None, "PYTORCH_ALLOC_CONF", "PYTORCH_CUDA_ALLOC_CONF"])
@pytest.mark.parametrize(("name", "device"), [("paper", "cuda"), ("paper", "cpu"), ("fast", "cuda")])
def test_segments_grow_where_sizes_never_repeat(data, tmp_path, monkeypatch, name, device, own):
    """Unless the user has a value of his own."""
    asked = []
    monkeypatch.setattr(torch._C, "_accelerator_setAllocatorSettings", asked.append)
    for variable in ("PYTORCH_ALLOC_CONF", "PYTORCH_CUDA_ALLOC_CONF"):
        monkeypatch.delenv(variable, raising=False)
    if own:
        monkeypatch.setenv(own, "max_split_size_mb:512")
    with pretend_gpu(monkeypatch):
        trainer.Training(load_dataset(data), tiny(name), tmp_path, torch.device(device))
    assert asked == ["expandable_segments:True"] * (name == "paper" and device == "cuda" and own is None)


@pytest.mark.parametrize("device, cores, threads", [("cuda", 6, 4), ("cuda", 16, 8), ("cuda", 1, 1), ("cpu", 6, 8)])
def test_two_processors_are_left_to_the_thread_that_feeds_a_gpu(data, tmp_path, monkeypatch, device, cores, threads):
    """By all threads that work beside it, and until the last step is made."""
    seen, advance = set(), trainer.Training.advance

    def watched(training, bar):
        seen.update((torch.get_num_threads(), in_background(torch.get_num_threads).result()))
        advance(training, bar)

    monkeypatch.setattr(trainer.Training, "advance", watched)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(cores))

    def left() -> int:
        """The threads after a training."""
        train_scene(load_dataset(data), tiny(steps=2), tmp_path, device=device)
        return torch.get_num_threads()

    with pretend_gpu(monkeypatch):
        assert on_threads(8, left) == 8 and seen == {threads}


@pytest.mark.parametrize("settings", [{}, {"sparse_steps": True, "table_dtype": "float16"}])
def test_runs_go_on_on_the_other_device_and_back(data, tmp_path, monkeypatch, settings):
    dataset = load_dataset(data)
    config = tiny("cpu", occlusion_directions=256, open_below=0.0, **settings)
    train_scene(dataset, config.replace({"steps": 12}), tmp_path)
    with pretend_gpu(monkeypatch):
        there = train_scene(dataset, config.replace({"steps": 24}), tmp_path, device="cuda", resume=True)
        assert there.model.bits.cache.bits.device == GPU and there.step == 24
    content = load_checkpoint(tmp_path / "checkpoint.pt")
    assert content["device"] == "cuda" and not any(isinstance(x, GpuTensor) for x in content["model"].values())
    back = train_scene(dataset, config.replace({"steps": 36}), tmp_path, resume=True)
    assert back.finished and back.step == 36
    pairs = itertools.pairwise(lines_of(tmp_path))
    assert all(a["step"] < b["step"] and abs(a["psnr"] - b["psnr"]) < 1.0 for a, b in pairs)


def test_all_files_are_written_from_there(data, tmp_path, monkeypatch):
    with pretend_gpu(monkeypatch):
        _, evaluation = reconstruct(data, tmp_path / "run", tiny("cpu", steps=24), device="cuda")
    assert evaluation["novel_view"]["psnr"] > 5
    for name in ("mesh.ply", "mesh.glb", "environment.exr", "report.html"):
        assert (tmp_path / "run" / name).stat().st_size > 0, name


def test_without_a_gpu_the_device_is_refused(data, tmp_path, capsys):
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    assert "--device cuda" in refused(capsys, "train", data, "--out", tmp_path / "run", "--device", "cuda")
    assert not (tmp_path / "run").exists()
