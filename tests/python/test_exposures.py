"""Exposures of photos that training learns: their estimate, the loss at a photo's own exposure, and the files of a run."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from blender_data import edit, make_blender
from splitnerf.cli import main
from splitnerf.data.dataset import EXPOSURES, load_dataset, with_exposures
from splitnerf.data.images import linear_to_srgb, srgb_to_linear
from splitnerf.data.pixels import per_channel
from splitnerf.errors import InputError
from splitnerf.evaluate.scoring import exposed_like
from splitnerf.ops.rays import EdgeRuns, read_pixels
from splitnerf.ops.training import pixel_losses
from splitnerf.training import exposure
from splitnerf.training.batches import draw_batch, edge_runs
from splitnerf.training.exposure import COLOUR_ERROR, ERROR, PhotoExposures
from tiny_runs import refused, tiny, train

CPU = torch.device("cpu")


def photos(exposures, photographed: bool = True):
    """Photos that state exposures, as far as learning them asks."""
    exposures = np.array(exposures, float)

    class Photos(SimpleNamespace):
        def __len__(self) -> int:
            return len(exposures)

    return Photos(exposures=exposures, photographed=photographed)


def settings(**changes):
    return tiny(**{"exposure.refine": "yes"} | changes)


def seen(n: int, factors: torch.Tensor, seed: int = 0, high: float = 0.4):
    """Pixels of photos with these factors [views, 3]: view, target, mean and opacity."""
    g = torch.Generator().manual_seed(seed)
    view = torch.randint(len(factors), (n,), generator=g)
    mean = 0.05 + (high - 0.05) * torch.rand(n, 3, generator=g)
    photo = (mean * factors[view]).clamp(max=1)
    target = torch.cat([torch.from_numpy(linear_to_srgb(photo.numpy())), torch.ones(n, 1)], dim=1)
    return view, target, mean, torch.ones(n)


class TestLearning:
    @pytest.mark.parametrize("white_balance", [False, True])
    def test_factors_come_back(self, white_balance):
        """Each as far as its pixels outweigh the start, moved to a geometric mean of 1."""
        true = torch.tensor([[0.6, 0.7, 0.8], [1.0, 1.0, 1.0], [1.6, 1.5, 1.2]])
        found = PhotoExposures(photos([1, 1, 1]), settings(**{"exposure.white_balance": white_balance}), CPU)
        for step in range(40):
            found.learn(*seen(20_000, true, step))
        logs = true.log() - true.log().mean(0)
        level = logs.mean(1, keepdim=True).expand(-1, 3)
        parts = [(level, ERROR)] + white_balance * [(logs - level, COLOUR_ERROR)]
        expected = sum(x * (1 - error**2 / x.square().mean()) for x, error in parts).exp()
        torch.testing.assert_close(found.factors, expected, rtol=2e-3, atol=0)
        torch.testing.assert_close(found.factors.log().mean(0), torch.zeros(3), atol=1e-5, rtol=0)

    def test_what_is_no_larger_than_the_error_changes_nothing(self):
        found = PhotoExposures(photos([1, 2, 1]), settings(), CPU)
        for step in range(20):
            found.learn(*seen(20_000, torch.tensor([[0.96], [2.1], [1.03]]).expand(-1, 3), step, high=0.3))
        torch.testing.assert_close(found.factors[:, 0], torch.tensor([1.0, 2, 1]))

    def test_what_is_clipped_dark_or_beside_the_object_says_nothing(self):
        found = PhotoExposures(photos([1, 1]), settings(), CPU)
        view, target, mean, opacity = seen(4000, torch.tensor([[1.0] * 3, [2.0] * 3]))
        clipped, dark = (torch.cat([x, target[:, 3:]], 1) for x in (torch.ones(4000, 3), 0.01 * target[:, :3]))
        beside = target * torch.tensor([1, 1, 1, 0.5])
        for bad in (dict(target=clipped), dict(target=dark), dict(target=beside), dict(opacity=0.5 * opacity)):
            found.learn(**dict(view=view, target=target, mean=mean, opacity=opacity) | bad)
        found.learn(view, target, mean, opacity, torch.tensor(False))  # nor does a step that is not allowed
        assert torch.equal(found.factors, torch.ones(2, 3)) and not found.sums.any()
        found.learn(view, target, mean, opacity, torch.tensor(True))
        assert found.sums.any()

    @pytest.mark.parametrize(
        "refine, photographed, compositing",
        [("auto", True, "linear"), ("yes", False, "linear")]  # learned; the others are not
        + [("auto", False, "linear"), ("no", True, "linear"), ("auto", True, "srgb")],
    )
    def test_when_they_are_learned(self, refine, photographed, compositing):
        learned = compositing == "linear" and (refine == "yes" or refine == "auto" and photographed)
        config = settings(**{"exposure.refine": refine, "shading.compositing": compositing, "shading.method": "split"})
        assert PhotoExposures(photos([1, 1], photographed), config, CPU).learned == learned

    def test_srgb_samples_and_exposures_exclude_each_other(self):
        with pytest.raises(InputError, match="exposure.refine = yes needs shading.compositing = linear"):
            settings(**{"shading.compositing": "srgb", "shading.method": "split"})

    def test_sums_of_other_photos_are_refused(self):
        found = PhotoExposures(photos([1, 1]), settings(), CPU)
        with pytest.raises(ValueError, match="exposures"):
            found.restore(torch.zeros(3, 4))


class TestLoss:
    def batch(self, exposure: float, edges=None, balance=(1.0, 1.0, 1.0), **changes):
        target = torch.tensor([[0.5, 0.6, 1.0, 1.0]])
        first = torch.zeros(1, dtype=torch.int64)
        runs = EdgeRuns.none(CPU) if edges is None else edges

        def draw(n, random, backgrounds, exposures):
            pixels, *beside = read_pixels(target, first, first, exposures, backgrounds, runs)
            return target[:, :3], target[:, :3], pixels, first, *beside

        source = SimpleNamespace(generator=torch.Generator().manual_seed(0), draw=draw)
        return draw_batch(source, 1, tiny(**changes), torch.full((1, 3), exposure) * torch.tensor(balance))

    def test_a_photo_is_compared_at_its_own_exposure(self):
        """A rendering at an exposure of 1 that is right has no error, and what is clipped asks only for as much light."""
        batch = self.batch(0.5)
        mean = torch.from_numpy(srgb_to_linear(batch.target[:, :3].numpy())) / 0.5
        mean[0, 2] = 7.0
        colour, _ = pixel_losses(mean * batch.exposure, torch.ones(1), target=batch.target, background=batch.background)
        assert float(colour) < 1e-10
        dim = mean.detach() * torch.tensor([1, 1, 0.2])
        photo = {"target": batch.target, "background": batch.background}
        assert float(pixel_losses(dim * batch.exposure, torch.ones(1), **photo)[0]) > 0.005

    def test_srgb_samples_are_compared_at_an_exposure_of_one(self):
        """And so is what lies behind the object at the masks' edges."""
        edges = edge_runs([((np.array([0]), np.array([1])), np.uint8([[51, 76, 102]]))], 1, CPU)
        balance = np.float32([0.8, 1.2, 1.1])
        batch = self.batch(0.5, edges, balance.tolist(), compositing="srgb", **{"shading.method": "split"})
        assert torch.equal(batch.exposure, torch.ones(1, 3)) and batch.whole.item()
        behind = srgb_to_linear(np.float32([51, 76, 102]) / 255)
        np.testing.assert_allclose(srgb_to_linear(batch.background[0].numpy()), 2 * behind / balance, rtol=1e-4)
        linear = srgb_to_linear(np.float32([0.5, 0.6]))
        np.testing.assert_allclose(srgb_to_linear(batch.target[0, :2].numpy()), 2 * linear / balance[:2], rtol=1e-4)


def test_views_get_the_exposure_at_which_they_are_nearest(tmp_path):
    views = load_dataset(make_blender(tmp_path))
    maps = []
    for i in range(len(views)):
        linear = srgb_to_linear(views.images[i, ..., :3]) / (1.5, 0.7)[i % 2]
        maps.append({"rgb": linear_to_srgb(linear), "alpha": views.images[i, ..., 3]})
    found = exposed_like(views, maps)
    expected = [(1.5, 0.7)[i % 2] for i in range(len(views))]
    np.testing.assert_allclose(found.exposures, per_channel(np.array(expected)), rtol=1e-3)
    blank = [{"rgb": m["rgb"], "alpha": 0 * m["alpha"]} for m in maps]
    np.testing.assert_array_equal(exposed_like(views, blank).exposures, 1)


class TestRun:
    def test_exposures_that_are_right_leave_no_file(self, tmp_path):
        """Photos of one exposure: what is learned is within its error, so the scores are those of the stated exposures."""
        data, run = make_blender(tmp_path / "data"), tmp_path / "run"
        assert train(data, run, "--steps", "30", "--set", "exposure.refine=yes") == 0
        assert not (run / EXPOSURES).exists() and "exposures" not in json.loads((run / "evaluation.json").read_text())

    def test_a_run_keeps_what_it_learned(self, tmp_path, capsys, monkeypatch):
        monkeypatch.setattr(exposure, "ERROR", 1e-4)
        data, run = make_blender(tmp_path / "data"), tmp_path / "run"
        edit(data, lambda meta: [frame.update(exposure=1 + i % 3) for i, frame in enumerate(meta["frames"])])
        arguments = "--steps", "60", "--set", "exposure.refine=yes"
        assert train(data, run, *arguments) == 0
        assert json.loads((run / "evaluation.json").read_text())["exposures"] == "fitted"
        stored = json.loads((run / EXPOSURES).read_text())["exposures"]
        views = load_dataset(data)
        assert list(stored) == [f"train/{name}.png" for name in views.frame_names]
        exposed = with_exposures(views, run)
        np.testing.assert_allclose(exposed.exposures, list(stored.values()))
        np.testing.assert_allclose(np.log(exposed.exposures).mean(0), math.log(6) / 3, atol=1e-5)
        assert main(["evaluate", str(run), "--data", str(data), "--spp", "1"]) == 0
        for bad in ({"other": [1, 1, 1]}, dict.fromkeys(stored, [1, 0, 1])):
            (run / EXPOSURES).write_text(json.dumps({"exposures": bad}))
            with pytest.raises(InputError, match="is not of these photos"):
                with_exposures(views, run)
        capsys.readouterr()
        error = refused(capsys, "refine", run, "--data", data, "--out", tmp_path / "again", "--sweeps", "1")
        assert "is not of these photos" in error
        arguments = "--steps", "30", "--set", "exposure.refine=no", "--overwrite"
        assert train(data, run, *arguments) == 0 and not (run / EXPOSURES).exists()
        assert with_exposures(views, run) is views
