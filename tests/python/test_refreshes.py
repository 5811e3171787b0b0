"""What a run brings up to date and when, by which seed it draws, and what its log and its end hold."""

import math
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from splitnerf.config import preset
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import read_image
from splitnerf.errors import InputError
from splitnerf.fields import EvaluatedLight, Light
from splitnerf.pipeline import check_repeatable, load_run
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.training import loop, meshes, metrics
from splitnerf.training.finite import Diverged
from splitnerf.training.gpu_step import GpuStep
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.metrics import StepLog
from splitnerf.training.schedule import next_ray_count, progress_by
from splitnerf.training.step import Capacity, StepNumbers
from tiny_runs import lines_of, tiny, train_scene

PLAIN = {"occlusion.kind": "off", "shading.method": "split", "preview_every": 2.0}  # nothing is traced, nothing shown


def calls(monkeypatch, kind: type, name: str, note) -> list:
    """What `note` makes of the arguments of each call of a method."""
    notes, method = [], getattr(kind, name)

    def noted(self, *args, **kwargs):
        notes.append(note(self, *args, **kwargs))
        return method(self, *args, **kwargs)

    monkeypatch.setattr(kind, name, noted)
    return notes


def steps_of(monkeypatch) -> list[int]:
    """The step that a run is at, as its only number; -1 before the first."""
    at, refresh = [-1], loop.Training.refresh

    def noted(self):
        at[0] = self.step
        refresh(self)

    monkeypatch.setattr(loop.Training, "refresh", noted)
    return at


@pytest.fixture
def refreshed(data, tmp_path, monkeypatch):
    """Runs 20 steps; returns what was trained, and at which step what was brought up to date."""

    def run(**settings):
        at = steps_of(monkeypatch)
        seen = {
            "grid": calls(monkeypatch, OccupancyGrid, "update", lambda _, *args, **settings: (at[0], settings)),
            "backward": calls(monkeypatch, EvaluatedLight, "backward", lambda *_: at[0]),
        }
        config = tiny(steps=20, **PLAIN, **settings)
        return train_scene(load_dataset(data), config, tmp_path), seen

    return run


def test_cells_are_brought_up_to_date_every_few_steps(refreshed):
    """Every 6 steps, all cells at first and at the end."""
    _, seen = refreshed(grid_every=6)
    assert seen["grid"] == [*((step, {"first": step == 0, "step": step}) for step in range(0, 20, 6)), (19, {})]


def test_a_mesh_is_shaded_and_lit_anew_every_few_steps(data, tmp_path, monkeypatch):
    """A mesh from the middle: light every 16 steps, what it sends every 7; three bounces with each new mesh."""
    at = steps_of(monkeypatch)
    light = calls(monkeypatch, SceneModel, "weigh_occlusion", lambda *_: at[0])
    indirect = calls(monkeypatch, SceneModel, "refresh_indirect", lambda *_: at[0])
    config = tiny(steps=20, mesh_every=0.5, indirect_every=7, preview_every=2.0, open_below=0.0, levels_open_by=0.0)
    trained = train_scene(load_dataset(data), config, tmp_path)
    assert light == [10, 16, 19] and indirect == [10] * 3 + [14] + [19] * 3
    assert trained.model.has_mesh and trained.mesh.scene is not None and trained.finished


def test_the_light_that_weighs_the_rays_follows_the_light(data, tmp_path, monkeypatch):
    at = steps_of(monkeypatch)
    heights = calls(monkeypatch, Light, "panorama", lambda _, height: (at[0], height))
    config = tiny(
        steps=20,
        mesh_every=0.2,
        preview_every=2.0,
        **{"occlusion.kind": "mlp", "shading.method": "split", "constants.occlusion_environment_height": 12},
        occlusion_rays=4,
    )
    trained = train_scene(load_dataset(data), config, tmp_path)
    assert heights == [(4, 12), (16, 12)] and trained.mesh.environment.shape == (12, 24, 3)


def test_all_that_a_run_draws_follows_its_seed(data, tmp_path):
    """Two seeds begin with other fields and other rays; a seed by itself, before and after a run of another, with the same."""
    dataset = load_dataset(data)
    begun = []
    for seed in (3, 4, 3):
        training = loop.Training(dataset, tiny(seed=seed), tmp_path, torch.device("cpu"))
        begun.append((training.model.sdf_field.hidden_direction.detach().clone(), training.source.draw(64)[2]))
    for a, b, c in zip(*begun):
        assert torch.equal(a, c) and not torch.equal(a, b)


def test_a_line_of_the_log_holds_the_weighted_terms(data, tmp_path):
    """They add up to the loss; psnr follows the mean squared error of colours by a twentieth a step."""
    config = tiny(steps=5, colour_weight=7.0, neutral_weight=0.0, **PLAIN)
    train_scene(load_dataset(data), config, tmp_path)
    lines = lines_of(tmp_path)
    assert [line["step"] for line in lines] == [1, 2, 3, 4, 5]
    for line in lines:
        terms = [value for name, value in line.items() if name.startswith("loss_")]
        assert line["loss"] == pytest.approx(sum(terms), rel=1e-5)
    psnr = [-10 * math.log10(line["loss_colour"] / (3 * 7.0)) for line in lines]
    mean = psnr[0]
    for line, found in zip(lines, psnr):
        mean += 0.05 * (found - mean)
        assert line["psnr"] == pytest.approx(mean, abs=1e-3)
    assert max(psnr) - min(psnr) > 0.1
    assert "loss_light" not in lines[0]  # texels are filtered exactly; an MLP is asked to be consistent


def test_previews_of_large_photos_are_smaller_pictures_of_the_view(data, tmp_path, monkeypatch):
    dataset = load_dataset(data)
    training = loop.Training(dataset, tiny(steps=1), tmp_path, torch.device("cpu"))
    pictures = []
    for step, edge in enumerate((dataset.width, dataset.width - 1)):
        monkeypatch.setattr(metrics, "PREVIEW_EDGE", edge)
        path = metrics.write_preview(tmp_path, training.model, training.grid, dataset, step)
        pictures.append(read_image(path)[..., :3])
    height, width = dataset.height // 2, dataset.width // 2
    large, small = pictures[0].reshape(height, 2, 4 * width, 2, 3).mean(axis=(1, 3)), pictures[1]
    assert small.shape == (height, 4 * width, 3)
    np.testing.assert_allclose(small[:, :width], large[:, :width], atol=0.01)  # the photo
    assert np.abs(small - large).mean() < 0.03


def test_previews_and_checkpoints_come_from_time_to_time(data, tmp_path, monkeypatch):
    """Previews with each quarter of the run; checkpoints after their minutes, but only when the light has moved."""
    previews, saved = [], calls(monkeypatch, loop.Training, "save", lambda training: training.step)
    monkeypatch.setattr(loop, "write_preview", lambda *args: previews.append(args[-1]))
    config = tiny(steps=20, checkpoint_minutes=1e-9, light_step_every=8, **PLAIN | {"preview_every": 0.25})
    train_scene(load_dataset(data), config, tmp_path)
    assert previews == [5, 10, 15, 20] and saved == [8, 16, 20]


def test_the_number_of_rays_follows_that_of_the_samples(data, tmp_path):
    """The samples composited, not those shaded or looked at."""
    config = tiny(steps=20, target_samples=3000, initial_rays=64, max_rays=400, **PLAIN)
    train_scene(load_dataset(data), config, tmp_path)
    lines = lines_of(tmp_path)
    rays = [line["rays"] for line in lines]
    samples = [line["kept"] * line["samples_per_ray"] * line["rays"] for line in lines]
    assert rays[0] == 64 and rays[-1] > 100
    assert rays[1:] == [next_ray_count(a, round(n), config) for a, n in zip(rays, samples[:-1])]


def test_counts_of_a_line_are_per_ray_and_per_point_looked_at(tmp_path):
    """Of 50 rays: 600 points looked at, 300 composited, 120 shaded; and the steps that were skipped."""
    log = StepLog(tmp_path)
    numbers = StepNumbers(7, 50, {"colour": 0.25}, {"colour": 2.0}, 1.0, Capacity(300, 120, 40), 20.0, 600)
    log.take(numbers, 3.0, 0.5, skipped=5)
    line = log.pending
    counts = {"rays": 50, "samples_per_ray": 12.0, "kept": 0.5, "shaded": 0.2, "skipped": 5, "step": 7, "s": 20.0}
    expected = counts | {"loss": 0.5, "loss_colour": 0.5}
    assert {name: line[name] for name in expected} == expected


@pytest.mark.parametrize("complete", [False, True])
def test_a_step_without_all_its_samples_leaves_nothing_behind(data, tmp_path, monkeypatch, complete):
    training = loop.Training(load_dataset(data), tiny(**PLAIN), tmp_path, torch.device("cpu"))
    parts = training.model, training.grid, training.mesh, training.generator, training.optimiser, training.exposures
    step, differentiate = GpuStep(*parts), GpuStep.differentiate
    training.take_step = step

    def bounded(self, *arguments):
        self.capacity = Capacity() if complete else Capacity(samples=0)
        return differentiate(self, *arguments)

    monkeypatch.setattr(GpuStep, "differentiate", bounded)
    before = {name: value.clone() for name, value in training.model.state_dict().items()}
    training.refresh()
    training.advance(SimpleNamespace(show=lambda *_: None))
    assert training.log.psnr is None and len(step._pending) == 1
    training.settle()
    moved = [name for name, value in training.model.state_dict().items() if not torch.equal(value, before[name])]
    assert training.step == 1 and bool(moved) == complete and (training.log.psnr is not None) == complete
    assert any(leaf.grad.any() for leaf in training.light.leaves if leaf.grad is not None) == complete
    assert {int(moments["step"]) for moments in training.optimiser.state.values()} == {int(complete)}


def test_time_is_counted_in_minutes_and_goes_on_with_the_run(data, tmp_path, monkeypatch):
    """Each step takes 10 seconds: checkpoints after more than a minute; a pause between two parts does not count."""
    at, pause = steps_of(monkeypatch), [0.0]
    saved = calls(monkeypatch, loop.Training, "save", lambda training: training.step)
    monkeypatch.setattr(loop.time, "monotonic", lambda: 10.0 * (at[0] + 1) + pause[0])
    config = tiny(steps=16, checkpoint_minutes=1.0, light_step_every=1, **PLAIN)
    train_scene(load_dataset(data), config, tmp_path)
    assert saved == [7, 14, 16]
    pause[0] = 5000.0
    trained = train_scene(load_dataset(data), config.replace({"steps": 20}), tmp_path, resume=True)
    lines = lines_of(tmp_path)
    assert [line["step"] for line in lines] == [*range(1, 21)] and trained.step == 20
    assert [line["seconds"] for line in lines] == [*range(10, 201, 10)] and trained.seconds == 200


@pytest.mark.parametrize(
    ("step", "seconds", "progress"),
    [(0, 0, 0.0), (30, 6, 0.3), (10, 60, 0.5), (100, 0, 1.0), (0, 120, 1.0), (200, 300, 1.0)],
)
def test_progress_is_the_larger_share_of_steps_or_minutes(data, tmp_path, step, seconds, progress):
    """Training leaves the refinement its share of the minutes."""
    training = loop.Training(load_dataset(data), tiny(steps=100, max_minutes=2.0), tmp_path, torch.device("cpu"))
    training.step, training.seconds = step, float(seconds)
    assert training.progress == pytest.approx(progress) and training.finished == (progress == 1.0)
    refined = tiny(steps=100, max_minutes=2.0, **{"refinement.enabled": True}, refinement_share=0.4)
    assert refined.training_minutes + refined.refinement_minutes == 2.0
    for config, share in ((refined, seconds / 72), (tiny(steps=100), 0.0)):
        assert progress_by(config)(step, float(seconds)) == pytest.approx(min(1.0, max(step / 100, share)))


def test_the_bar_shows_the_step_and_the_error(tmp_path):
    log, numbers = StepLog(tmp_path), StepNumbers(4, 50, {}, {}, 1.0, Capacity(300, 120, 40), 20.0, 162)
    assert log.text(numbers) == "training, step 4"
    log.psnr = 21.456
    assert log.text(numbers) == "training, step 4, photos 21.46 dB"


def test_a_finished_run_that_is_resumed_or_loaded_stays_as_it_is(data, tmp_path):
    """Half of its levels are open, as they were: the mesh is that of the same field."""
    config = tiny(steps=8, start_levels=1, levels_open_by=2.0, learning_rate=0.05, warmup_steps=1, mesh_every=2.0)
    first = train_scene(load_dataset(data), config, tmp_path).model
    again = train_scene(load_dataset(data), config, tmp_path, resume=True)
    assert again.step == 8 and again.finished
    x = torch.rand(100, 3) - 0.5
    for model in (again.model, load_run(tmp_path)[0]):
        assert model.sdf_field.grid.n_active == 2 and torch.equal(model.sdf_field.sdf(x), first.sdf_field.sdf(x))
        for name in ("vertices", "bits"):
            assert torch.equal(getattr(model.bits.cache, name), getattr(first.bits.cache, name))


@pytest.mark.parametrize("deterministic", [False, True])
def test_a_thread_makes_the_meshes_where_that_is_set(data, tmp_path, monkeypatch, deterministic):
    """A run whose bits repeat waits for each, another goes on without it."""
    make, makers, at = meshes.make_mesh, [], steps_of(monkeypatch)
    used = calls(monkeypatch, SceneModel, "use_mesh", lambda *_: at[0])

    def slowly(*args):
        makers.append(threading.current_thread())
        while not deterministic and at[0] < 8:
            time.sleep(0.001)
        return make(*args)

    monkeypatch.setattr(meshes, "make_mesh", slowly)
    config = tiny(steps=12, mesh_every=0.5, preview_every=2.0, **{"mesh.background": True}, deterministic=deterministic)
    train_scene(load_dataset(data), config, tmp_path)
    assert threading.main_thread() not in makers and len(makers) == 2
    assert (used[0] == 6) == deterministic and used[-1] == 11


@pytest.mark.parametrize(
    "settings", [{"preview_every": 2.0}, PLAIN, PLAIN | {"occlusion.kind": "mlp", "occlusion_weight": 0.0}]
)
def test_occlusion_is_traced_only_where_an_mlp_learns_it(data, tmp_path, settings):
    train_scene(load_dataset(data), tiny(steps=6, mesh_every=0.3, **settings), tmp_path)
    assert not any("loss_occlusion" in line for line in lines_of(tmp_path))


@pytest.mark.parametrize(("kind", "asked"), [("bits", [0.5, 1.0]), ("mlp", [0.5]), ("off", [])])
def test_meshes_are_asked_for_where_they_are_used(data, tmp_path, monkeypatch, kind, asked):
    """The last one is for the bits: they are stored with it."""
    requests = calls(monkeypatch, meshes.SurfaceMesh, "request", lambda _, progress: progress)
    config = tiny(steps=6, mesh_every=0.5, preview_every=2.0, **{"occlusion.kind": kind, "shading.method": "split"})
    train_scene(load_dataset(data), config, tmp_path)
    assert requests == asked


def test_parameters_are_checked_before_a_mesh_and_before_they_are_saved(data, tmp_path, monkeypatch):
    """Between two lines of the log."""
    training = loop.Training(load_dataset(data), tiny(mesh_every=0.5), tmp_path, torch.device("cpu"))
    training.step = 5000
    training.model.sdf_field.out_bias.data[0] = torch.nan
    for act in (training.refresh, training.save, training.finish):
        with pytest.raises(Diverged, match="step 5000: not finite: parameter sdf_field.out_bias"):
            act()
    assert not (tmp_path / "checkpoint.pt").exists()


def test_bits_repeat_on_the_cpu_alone(data, tmp_path):
    """Others are refused before anything is made."""
    check_repeatable(tiny(deterministic=True), "cpu")
    check_repeatable(tiny(), "cuda")
    with pytest.raises(InputError, match="deterministic run needs the CPU"):
        check_repeatable(tiny(deterministic=True), "cuda")


def test_rays_are_drawn_near_the_masks_as_often_as_is_set(data, tmp_path):
    """All of them, or as many as the masks fill."""
    dataset, inside = load_dataset(data), []
    for share in (0.0, 1.0):
        training = loop.Training(dataset, tiny(foreground_share=share), tmp_path, torch.device("cpu"))
        inside.append((training.source.draw(2000)[2][:, 3] > 0).float().mean().item())
    masks = (dataset.images[..., 3] > 0).mean()
    assert inside[0] == pytest.approx(masks, abs=0.04) and inside[1] > inside[0] + 0.1


# ---- the surface as a mesh, made at once or beside the training ----

SMALL = {"n_levels": 2, "start_levels": 2, "log2_table_size": 8, "mesh_resolution": 24, "light_resolution": 16}


@pytest.fixture
def model() -> SceneModel:
    torch.manual_seed(0)
    return SceneModel(preset("cpu").replace(SMALL))


def test_a_mesh_is_the_surface_in_the_whole_box_at_its_resolution():
    """A ball that reaches beyond 1, closed, faces outward; triangles as large as cells of 24 nodes along an edge."""
    torch.manual_seed(0)
    model = SceneModel(preset("cpu").replace(SMALL | {"sphere_radius": 1.2, "box": 1.6}))
    mesh = SurfaceMesh(model)
    mesh.request(0.1)
    shape = trimesh.Trimesh(mesh.current.vertices.numpy(), mesh.current.faces.numpy(), process=False)
    assert shape.is_watertight and model.sdf_field.sdf(mesh.current.vertices).abs().max() < 0.02
    assert 5.0 < shape.volume < 10.0 and 1.2 < mesh.current.vertices.abs().max() < 1.6
    cell = 2 * 1.6 / 23
    assert np.sqrt(2) * cell < shape.edges_unique_length.max() < np.sqrt(3) * cell
    assert mesh.scene is mesh.current.scene and len(model.bits.cache.vertices) == len(shape.vertices)


@pytest.mark.parametrize("background", [False, True])
def test_a_mesh_is_traced_where_the_light_is_when_it_is_asked_for(model, background):
    mesh = SurfaceMesh(model, background=background)
    before = model.cells.centres
    for progress in (0.1, 0.2):
        with torch.no_grad():
            model.light.texels.normal_()
        mesh.request(progress)
        mesh.poll(wait=True)
        found = model.bits.cache.directions
        assert torch.equal(found, model.aims()) and not torch.equal(found, before)
        before = found


def test_a_mesh_made_beside_is_that_of_the_moment_it_was_asked_for(model, monkeypatch):
    at_once = SurfaceMesh(model)
    at_once.request(0.1)
    begun, make = threading.Event(), meshes.make_mesh
    monkeypatch.setattr(meshes, "make_mesh", lambda *args: (begun.wait(10), make(*args))[1])
    beside = SurfaceMesh(model, background=True)
    beside.request(0.2)
    with torch.no_grad():
        model.sdf_field.out_bias[0] += 0.3  # the surface moves on
        model.sdf_field.grid.table += 0.1
    beside.request(0.3)  # one is being made
    beside.poll()
    assert beside.current is None and beside.asked_at == 0.2
    before = {name: beside.state()[name] for name in ("mesh_vertices", "mesh_faces", "meshed_at")}
    assert before == {"mesh_vertices": None, "mesh_faces": None, "meshed_at": 0.0}
    begun.set()
    beside.poll(wait=True)
    assert beside.made_at == 0.2
    for ours, theirs in zip(beside.current[1:3], at_once.current[1:3]):
        assert torch.equal(ours, theirs)
    assert torch.equal(beside.current.bits.cache.bits, at_once.current.bits.cache.bits)
    assert model.has_mesh and torch.equal(model.bits.cache.vertices, beside.current.vertices)


@pytest.mark.parametrize("background", [False, True])
def test_without_a_surface_the_old_mesh_stays(model, background):
    mesh = SurfaceMesh(model, background=background)
    mesh.request(0.1)
    mesh.poll(wait=True)
    before = mesh.current
    with torch.no_grad():
        model.sdf_field.out_bias[0] = 10.0
    mesh.request(0.2)
    mesh.poll(wait=True)
    assert mesh.made_at == 0.2 and before is not None and mesh.current is before


def test_what_goes_wrong_beside_is_told(model):
    with torch.no_grad():
        model.sdf_field.out_bias[0] = torch.nan
    mesh = SurfaceMesh(model, background=True)
    mesh.request(0.1)
    with pytest.raises(RuntimeError, match="not finite"):
        mesh.poll(wait=True)
    assert mesh.current is None
