"""Pixels that are held out of a refinement, and what they decide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from painted_ball import heights, photos, sky, with_textures
from splitnerf.data.asset import Asset
from splitnerf.refinement.fit import MOST_ERROR, FitSettings, Refinement, is_worse
from splitnerf.refinement.level import level_of_light
from splitnerf.refinement.pixels import HELD_OUT, Pixels, held_out
from splitnerf.refinement.stage import PATIENCE, Stage
from splitnerf.refinement.texels import AssetTexels

SETTINGS = FitSettings(sweeps=3, pixels=128, directions=4, outline=False)


def pixels_of_views(n: int, size: int = 64) -> Pixels:
    row, column = (part.ravel() for part in np.indices((size, size)))
    centre = np.tile(np.stack([column, row], axis=1) + np.float32(0.5), (n, 1))
    return Pixels(np.repeat(np.arange(n), size * size), centre, *[np.zeros(0)] * 5)


def test_of_many_photos_whole_ones_are_held_out():
    pixels = pixels_of_views(32)
    held = held_out(pixels)
    assert np.unique(pixels.view[held]).tolist() == [4, 12, 20, 28]
    assert held.sum() == 4 * 64 * 64


def test_of_few_photos_an_eighth_of_the_blocks_is():
    """In each photo, and none of them the same in two photos that follow."""
    pixels = pixels_of_views(3)
    held = held_out(pixels).reshape(3, 64, 64)
    blocks = held.reshape(3, 8, 8, 8, 8).mean(axis=(2, 4))
    assert np.isin(blocks, (0, 1)).all() and blocks.sum(axis=(1, 2)).tolist() == [64 / HELD_OUT] * 3
    assert not (held[:-1] & held[1:]).any()


@pytest.mark.parametrize(("size", "n_held"), [(1, 0), (2, 0), (5, 3)])
def test_photos_of_a_few_pixels_are_divided_or_judge_themselves(size, n_held):
    """One block holds all of them; none may leave the fit or its judge without pixels."""
    held = held_out(pixels_of_views(1, size))
    assert held.sum() == n_held and not held.all()


def test_a_fit_of_a_few_pixels_has_a_judge(painted):
    asset, data = painted
    few = data.images[:1].copy()
    seen = np.argwhere(few[0, ..., 3] > 0.999)
    few[..., 3] = 0.0
    few[(0, *seen[len(seen) // 2], 3)] = 1.0
    fit = Refinement(replace(data.select([0]), images=few), asset, sky(), SETTINGS)
    assert len(fit.pixels) == 1 and np.isfinite(fit.held_errors()).all() and np.isfinite(fit.gather(fit.surface()))


def test_held_out_pixels_are_not_fitted_and_their_error_is_one_number(painted):
    """The same at each call, whatever the fit has drawn; none where all is true; a pixel that nothing explains decides nothing."""
    asset, data = painted
    fit = Refinement(data, asset, sky(), SETTINGS)
    assert not np.intersect1d(fit.fitted.numbers, fit.held.numbers).size
    assert len(fit.fitted.numbers) + len(fit.held.numbers) == len(fit.pixels)
    drawn = np.concatenate([fit.see(fit.fitted, fit.random)[0] for _ in range(8)])
    assert not held_out(fit.pixels)[drawn].any()
    error = fit.held_errors().mean()
    fit.gather(fit.surface())
    assert fit.held_errors().mean() == error and abs(error) < 1e-3
    fit.pixels.target[fit.held.numbers[len(fit.held.numbers) // 2]] = 1e3
    assert 0 < fit.held_errors().mean() - error < 3 * MOST_ERROR / len(fit.held.numbers)
    fit.unknowns = fit.unknowns + 0.1
    assert fit.held_errors().mean() > 10 * abs(error)


def test_few_photos_excuse_more(painted):
    """A photo shows a quarter of a sphere's surface, by area of its pixels; the factor is that of a mean of twice as many values."""
    asset, data = painted
    factors = []
    for n in (4, 12):
        stage = Stage(photos(asset, sky(), n=n, spp=1), asset, sky(), SETTINGS)
        assert stage.fit.sightings == pytest.approx(n / 4, rel=0.2)
        ratio = stage.last.held[0] / stage.fit.held_errors()[0]
        assert ratio == pytest.approx(stage.unseen, rel=1e-4)
        factors.append(ratio)
    assert factors[0] > 1.7 and 1.2 < factors[1] < 1.5


def ruined_after(monkeypatch, n: int) -> None:
    """Sweeps that halve what the albedo lacks of the truth, and after n of them make it worse."""
    sweep = Refinement.sweep

    def changed(self, *arguments):
        before = self.unknowns
        error, _ = sweep(self, *arguments)
        away = 0.5 * self.wrong if self.n_sweeps <= n else -1.5 * self.wrong
        self.unknowns = before - away
        self.wrong = self.wrong - away
        return error, self.held_errors()

    monkeypatch.setattr(Refinement, "sweep", changed)


def begun(painted, sweeps: int) -> Stage:
    """A stage that begins with a wrong albedo."""
    asset, data = painted
    stage = Stage(data, asset, sky(), replace(SETTINGS, sweeps=sweeps, light_step=0.0, albedo_size=0))
    stage.fit.wrong = torch.zeros_like(stage.fit.unknowns)
    stage.fit.wrong[:, :3] = 0.1
    stage.fit.unknowns = stage.fit.unknowns + stage.fit.wrong
    start = stage.fit.held_errors()
    stage.held_start, stage.best = float(start.mean()), stage._candidate(0, start)
    return stage


def test_what_is_worse_by_chance_is_not_worse():
    """A paired test: noise that two candidates share does not count, a few batches of their own do not decide."""
    one = np.random.default_rng(0).normal(5.0, 2.0, 16)
    assert is_worse(one + 0.1 + 0.05 * np.arange(16) % 0.1, one)
    assert not is_worse(one + np.where(np.arange(16) == 3, 1.6, 0.0), one)
    assert not is_worse(one - 1.0, one) and not is_worse(one, one)


@pytest.mark.parametrize("good", [0, 2])
def test_what_is_best_on_held_out_pixels_is_delivered(painted, monkeypatch, good):
    """Not what the last sweep left; the start where no sweep helped. And the fit ends where nothing gains."""
    ruined_after(monkeypatch, good)
    stage = begun(painted, sweeps=100)
    wanted = [stage.fit.unknowns]
    while not stage.finished:
        stage.advance()
        wanted.append(stage.fit.unknowns)
    refined = stage.result()
    assert len(stage.sweeps) == good + PATIENCE and refined.delivered == good
    assert torch.equal(stage.best.unknowns, wanted[good]) and not torch.equal(stage.fit.unknowns, wanted[good])
    albedo = stage.fit.texels.maps(torch.as_tensor(stage.fit.texels.start))[0]  # of the truth
    error = np.abs(refined.asset.materials[0].albedo_texture - albedo.numpy()).max()
    assert error < (0.1 if good else 0.3) and refined.held[1] <= refined.held[0]
    assert (refined.held[1] < 0.3 * refined.held[0]) == bool(good)


@pytest.mark.parametrize(("rise", "delivered"), [(1.3, 2), (1.5, 1)])
def test_what_training_knew_of_held_out_photos_may_be_unlearnt(painted, rise, delivered):
    asset, data = painted
    stage = Stage(data, asset, sky(), SETTINGS)
    held = 1.0 + stage.fit.held_errors()
    stage.best, stage.last = stage._candidate(1, held), stage._candidate(2, rise * held)
    assert stage.result().delivered == delivered


@pytest.mark.parametrize("true", [False, True])
def test_normals_that_explain_nothing_are_left_out(painted, true):
    """A relief that the photos show is kept; noise that they do not show is left out."""
    asset, data = painted
    noise = np.random.default_rng(0).normal(0, 0.01 if true else 0.2, asset.materials[0].normal_texture.shape)
    tilted = noise + [0.3 * true, 0, 1]
    tilted = np.float32(tilted / np.linalg.norm(tilted, axis=2, keepdims=True))
    tilted = with_textures(asset, normal_texture=tilted)
    settings = replace(SETTINGS, light_step=0.0)  # the light is right
    stage = Stage(photos(tilted, sky(), spp=32) if true else data, tilted, sky(), settings)
    stage.best = stage.last = stage._candidate(1, stage.fit.held_errors())
    assert (stage.result().asset.materials[0].normal_texture is not None) == true


def test_a_stage_goes_on_with_its_best(painted):
    asset, data = painted
    stage = Stage(data, asset, sky(), SETTINGS)
    while not stage.finished:
        stage.advance()
    again = Stage(data, asset, sky(), SETTINGS, stage.state())
    assert again.best[:2] == stage.best[:2] and again.last[:2] == stage.last[:2]
    assert again.held_start == stage.held_start
    assert torch.equal(again.best.unknowns, stage.best.unknowns)
    materials = (vars(of.result().asset.materials[0]) for of in (again, stage))
    for ours, theirs in zip(*(values.values() for values in materials)):
        assert np.array_equal(ours, theirs)
    with pytest.raises(KeyError, match="last"):
        Stage(data, asset, sky(), SETTINGS, {key: value for key, value in stage.state().items() if key != "last"})
    broken = stage.state()
    broken["best"][2] = broken["best"][2][:5]
    with pytest.raises(ValueError, match="unknowns"):
        Stage(data, asset, sky(), SETTINGS, broken)


# Albedo, roughness and metallic of the upper and the lower half of a ball, and the light's brightness: what it is, and how training
# may explain it.
DIELECTRICS = (
    (((0.3, 0.2, 0.0), (0.15, 0.6, 0.0)), 2.0),
    (((0.6 / 0.9335, 0.2, 0.0665), (0.3 / 0.869, 0.6, 0.131)), 1.0),
)
FAINT_METAL = (((0.25, 0.2, 0.5), (0.03, 0.6, 0.0)), 1.0)


def ball_of(ball: Asset, *halves: tuple) -> Asset:
    """A ball with an albedo, a roughness and a metallic on its upper and its lower half."""
    texels = AssetTexels(ball)
    values = texels.start.clone()
    upper, lower = (torch.tensor([*np.broadcast_to(half[0], 3), *half[1:]], dtype=torch.float32) for half in halves)
    values[:, :5] = torch.where(heights(texels) > 0, upper, lower)
    return texels.asset_with(texels.maps(values))


@pytest.mark.parametrize("truth, trained, level", [(*DIELECTRICS, 2.0), (FAINT_METAL, FAINT_METAL, 1.0)])
def test_photos_judge_whether_the_light_is_too_dark(ball, truth, trained, level):
    """Black clay beside a glossy metal with the F0 of a dielectric under too dark a light: its own F0 says that the light is right."""

    data = photos(ball_of(ball, *truth[0]), truth[1] * sky())
    fit = Refinement(data, ball_of(ball, *trained[0]), trained[1] * sky(), SETTINGS)
    start, found = fit.unknowns, level_of_light(fit.texels.start)
    held = fit.find_level(fit.held_errors())
    assert found > 1.9 and fit.level == pytest.approx(level, rel=0.05)
    np.testing.assert_array_equal(held, fit.held_errors())
    assert torch.equal(fit.unknowns, start) == (level == 1)
    light = fit.light.radiance().mean() / torch.from_numpy(trained[1] * sky()).mean()
    assert float(light) == pytest.approx(fit.level, rel=1e-3)


@pytest.mark.parametrize("worse, level", [(1.4, 2.0), (1.6, 1.0)])
def test_a_brighter_light_may_cost_photos_held_out_half_as_much_again(ball, worse, level, monkeypatch):
    """Training has fitted them under its own light; beside white porcelain a wrong light had 2.2 times their error."""
    (truth, _), (trained, _) = DIELECTRICS
    fit = Refinement(photos(ball_of(ball, *truth), 2.0 * sky()), ball_of(ball, *trained), sky(), SETTINGS)
    start = fit.held_errors() + 1e-3
    monkeypatch.setattr(fit, "held_errors", lambda: worse * start)
    fit.find_level(start)
    assert fit.level == pytest.approx(level, rel=0.05)


@pytest.mark.parametrize("seen", [False, True])
def test_grey_metal_gives_its_tint_to_the_light_unless_photos_show_the_light(ball, seen):
    tint = np.float32([1.25, 1.0, 0.8])
    asset = ball_of(ball, (0.55 * tint, 0.3, 1.0), ((0.3, 0.1, 0.1), 0.5, 0.0))
    data = photos(asset, sky())
    around = np.concatenate([sky(), np.ones_like(sky()[..., :1])], axis=2)
    data = replace(data, surroundings=around) if seen else data
    fit = Refinement(data, asset, sky(), SETTINGS)
    radiance, albedo = fit.light.radiance().numpy(), fit.texels.start[:, :3].numpy()
    assert fit.tint.tolist() == pytest.approx([1, 1, 1] if seen else tint.tolist(), rel=0.01)
    np.testing.assert_allclose(radiance.mean((0, 1)), sky().mean((0, 1)) * fit.tint.numpy(), rtol=1e-3)
    np.testing.assert_allclose(albedo * fit.tint.numpy(), AssetTexels(asset).start[:, :3].numpy(), rtol=1e-5)
