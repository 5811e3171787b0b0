"""What a run brings up to date and when, by which seed it draws, and what its log and its end hold."""

from __future__ import annotations

import math

import pytest
import torch
from tiny_runs import lines_of, tiny

from splitnerf.data.dataset import load_dataset
from splitnerf.fields import VisibilityBits
from splitnerf.render.model import SceneModel
from splitnerf.render.occupancy import OccupancyGrid
from splitnerf.training import loop
from splitnerf.training.schedule import next_ray_count


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
    """Runs 40 steps; returns what was trained, and at which step what was brought up to date."""

    def run(**settings):
        at = steps_of(monkeypatch)
        seen = {
            "grid": calls(monkeypatch, OccupancyGrid, "update", lambda _, *args, use_hull=False, **__: (at[0], use_hull)),
            "backward": calls(monkeypatch, loop.EvaluatedLight, "backward", lambda *_: at[0]),
        }  # fmt: skip
        config = tiny(steps=40, mesh_every=2.0, preview_every=2.0, **settings)
        return loop.train(load_dataset(data), config, tmp_path), seen

    return run


def test_cells_are_brought_up_to_date_every_few_steps_and_the_hull_counts_at_first(refreshed):
    """Every 6 steps and at the end; the hull until .4 of the run, which is step 16."""
    trained, seen = refreshed(grid_every=6, hull_until=0.4)
    assert seen["grid"] == [(step, step < 16) for step in range(0, 40, 6)] + [(39, False)]
    assert 0 < trained.grid.hull.float().mean() < 0.6
    assert not refreshed(hull_until=0.0)[0].grid.hull


def test_light_gathers_and_moves_with_its_period(refreshed):
    _, seen = refreshed(light_step_every=4)
    assert seen["backward"] == [*range(3, 40, 4)]


def test_a_mesh_is_shaded_and_lit_anew_every_few_steps(data, tmp_path, monkeypatch):
    """A mesh from the start: light every 16 steps, what it sends every 7; three bounces with each new mesh."""
    at = steps_of(monkeypatch)
    light = calls(monkeypatch, VisibilityBits, "set_light", lambda *_: at[0])
    indirect = calls(monkeypatch, SceneModel, "refresh_indirect", lambda *_: at[0])
    config = tiny(steps=40, mesh_every=0.5, indirect_every=7, preview_every=2.0, open_below=0.0, levels_open_by=0.0)
    trained = loop.train(load_dataset(data), config, tmp_path)
    assert light == [20, 32, 39] and indirect == [20] * 3 + [21, 28, 35] + [39] * 3
    assert trained.model.occlusion.ready and trained.scene is not None and trained.finished


def test_the_light_that_weighs_the_rays_follows_the_light(data, tmp_path, monkeypatch):
    at, heights = steps_of(monkeypatch), []
    training = {}
    train_init = loop.Training.__init__

    def noted(self, *args):
        train_init(self, *args)
        training["it"] = self
        panorama = self.model.light.panorama
        self.model.light.panorama = lambda height: heights.append((at[0], height)) or panorama(height)

    monkeypatch.setattr(loop.Training, "__init__", noted)
    config = tiny(
        steps=40, mesh_every=0.2, preview_every=2.0, occlusion="mlp", shading="split", environment_height=12, occlusion_rays=4
    )
    loop.train(load_dataset(data), config, tmp_path)
    assert heights == [(8, 12), (16, 12), (32, 12)] and training["it"].environment.shape == (12, 24, 3)


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
    """They add up to the loss; psnr follows the colour's mean squared error without its weight."""
    config = tiny(steps=5, colour_weight=7.0, neutral_weight=0.0)
    loop.train(load_dataset(data), config, tmp_path)
    lines = lines_of(tmp_path)
    assert [line["step"] for line in lines] == [1, 2, 3, 4, 5]
    for line in lines:
        terms = [value for name, value in line.items() if name.startswith("loss_")]
        assert line["loss"] == pytest.approx(sum(terms), rel=1e-5)
    mse = lines[0]["loss_colour"] / (3 * 7.0)
    assert lines[0]["psnr"] == pytest.approx(-10 * math.log10(mse), abs=1e-3)


def test_previews_and_checkpoints_come_from_time_to_time(data, tmp_path, monkeypatch):
    """Previews with each quarter of the run; checkpoints after their minutes, but only when the light has moved."""
    previews, saved = [], []
    monkeypatch.setattr(loop, "write_preview", lambda *args: previews.append(args[-1]))
    save = loop.Training.save
    monkeypatch.setattr(loop.Training, "save", lambda self: saved.append(self.step) or save(self))
    config = tiny(steps=20, preview_every=0.25, checkpoint_minutes=1e-9, light_step_every=8, mesh_every=2.0)
    loop.train(load_dataset(data), config, tmp_path)
    assert previews == [5, 10, 15, 20] and saved == [8, 16, 20]


def test_the_number_of_rays_follows_that_of_the_samples(data, tmp_path):
    """The samples composited, not those shaded or looked at."""
    config = tiny(steps=20, target_samples=3000, initial_rays=64, max_rays=400)
    loop.train(load_dataset(data), config, tmp_path)
    lines = lines_of(tmp_path)
    rays = [line["rays"] for line in lines]
    samples = [line["kept"] * line["samples_per_ray"] * line["rays"] for line in lines]
    assert rays[0] == 64 and rays[-1] > 100
    assert rays[1:] == [next_ray_count(a, round(n), config) for a, n in zip(rays, samples[:-1])]
