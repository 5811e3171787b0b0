"""Large photos from coarse to fine: what the averages are, when they end, and that small photos know nothing of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from layout_scenes import write_transforms
from test_known_pixels import OBJECT, ignoring_scene
from tiny_runs import tiny

from splitnerf.data import pixels
from splitnerf.data.dataset import load_dataset
from splitnerf.render.pyramid import PhotoPyramid
from splitnerf.render.rays import PixelSource
from splitnerf.training import loop

COARSE = {"coarse_until": 0.5, "coarse_edge": 12}  # of photos of 24 pixels: blocks of 2 x 2
PLAIN = {"occlusion": "off", "shading": "split", "preview_every": 2.0, "deterministic": True}


def seeded() -> torch.Generator:
    return torch.Generator().manual_seed(3)


def weights(trained: loop.TrainedScene) -> torch.Tensor:
    return torch.nn.utils.parameters_to_vector(trained.model.parameters())


@pytest.mark.parametrize("scene", ["alpha", "ignoring"])
def test_averages_are_what_a_downscale_reads(scene, data, tmp_path):
    root = data if scene == "alpha" else ignoring_scene(tmp_path)
    small, averaged = load_dataset(root, downscale=3), load_dataset(root).averaged(3, 0.0)
    assert np.array_equal(small.images.codes, averaged.images.codes) and averaged.images.codes.dtype == np.uint16
    assert np.array_equal(small.intrinsics, averaged.intrinsics) and np.array_equal(small.poses, averaged.poses)
    assert (small.downscale, small.whole) == (averaged.downscale, averaged.whole) == (3, False)
    assert (small.known is None) == (scene == "alpha") == (averaged.known is None)
    assert small.known is None or np.array_equal(small.known, averaged.known)


def test_averages_that_memory_has_no_room_for_go_to_a_file(data):
    dataset = load_dataset(data)
    in_file = dataset.averaged(2, 1e-6)
    assert pixels.file_of(in_file.images.codes) is not None
    assert np.array_equal(in_file.images.codes, dataset.averaged(2, 0.0).images.codes)


def test_exposures_stay_with_the_photos(data):
    dataset = load_dataset(data)
    exposed = dataset.exposed(np.linspace(0.5, 2, len(dataset))).averaged(2, 0.0)
    assert np.array_equal(exposed.images.exposures[:, 0], np.linspace(0.5, 2, len(dataset)).astype(np.float32))
    assert np.array_equal(exposed.images.codes, dataset.averaged(2, 0.0).images.codes)


def test_a_ray_of_an_average_meets_the_middle_of_its_block(data):
    """The origin and direction are those through the block's centre, and the colour is the block's mean."""
    dataset = load_dataset(data)
    source = PhotoPyramid(dataset, tiny(**COARSE), seeded()).source
    drawn = source.draw(200)
    local = torch.einsum("nij,ni->nj", source.poses[drawn.view, :3, :3], drawn.rays_d)
    lens = torch.from_numpy(dataset.intrinsics)[drawn.view]
    column = lens[:, 2] - lens[:, 0] * local[:, 0] / local[:, 2]
    row = lens[:, 3] + lens[:, 1] * local[:, 1] / local[:, 2]
    assert (column / 2 % 1 - 0.5).abs().max() < 1e-3 and (row / 2 % 1 - 0.5).abs().max() < 1e-3
    views, tops, lefts = drawn.view.numpy(), (row - 1).round().int().numpy(), (column - 1).round().int().numpy()
    alpha = [dataset.images[v, y : y + 2, x : x + 2, 3].mean() for v, y, x in zip(views, tops, lefts)]
    assert np.abs(drawn.pixels[:, 3].numpy() - alpha).max() < 1e-4 and 0.2 < np.mean(alpha) < 0.98


def test_photos_follow_their_averages_at_the_time_that_is_set(data):
    dataset = load_dataset(data)
    pyramid = PhotoPyramid(dataset, tiny(**COARSE), seeded())
    assert pyramid.factor == 2 and pyramid.at(0.0) is pyramid.at(0.49) and pyramid.source.height == 12
    fine = pyramid.at(0.5)
    assert fine is pyramid.at(1.0) is pyramid.source and (fine.height, fine.width) == (24, 24)


@pytest.mark.parametrize("settings", [COARSE | {"coarse_edge": 13}, COARSE | {"coarse_until": 0.0}])
def test_small_photos_and_the_setting_0_draw_as_without_averages(settings, data):
    dataset, config = load_dataset(data), tiny(**settings)
    pyramid = PhotoPyramid(dataset, config, seeded())
    plain = PixelSource(dataset, config.sampling.foreground_share, seeded(), config.losses.edge_pixels)
    assert pyramid.factor == 1 and pyramid.at(0.0) is pyramid.at(1.0)
    assert all(torch.equal(a, b) for a, b in zip(pyramid.source.draw(100), plain.draw(100)))


def test_edges_come_with_the_photos(tmp_path):
    """Colours at a mask's edge are compared whole in the photos, not in averages, whose colours are the object's alone."""
    dataset = load_dataset(write_transforms(tmp_path, masks=True), reading=OBJECT)
    pyramid = PhotoPyramid(dataset, tiny(coarse_until=0.5, coarse_edge=16), seeded())
    assert dataset.whole and pyramid.factor > 1 and pyramid.source.edges is None
    assert pyramid.at(1.0).edges is not None


@pytest.mark.parametrize("stop", [8, 16])
def test_a_resumed_run_draws_the_same_rays(stop, data, tmp_path):
    """From averages and from photos, stopped before and after the one follows the other, bit by bit."""
    dataset, config = load_dataset(data), tiny(steps=20, **PLAIN, **COARSE)
    runs = [tmp_path / name for name in ("whole", "stopped")]
    for run in runs:
        run.mkdir()
    whole = loop.train(dataset, config, runs[0])
    stopped = loop.Training(dataset, config, runs[1], torch.device("cpu"))
    heights = []
    with loop.same_bits(True):
        while stopped.step < stop:
            stopped.refresh()
            heights.append(stopped.source.height)
            stopped.advance(None)
        stopped.save()
    assert heights == [12] * min(10, stop) + [24] * max(0, stop - 10)
    resumed = loop.train(dataset, config, runs[1], resume=True)
    assert torch.equal(weights(whole), weights(resumed))
    off = loop.train(dataset, config.replace({"coarse_until": 0.0}), tmp_path)
    assert not torch.equal(weights(whole), weights(off))
