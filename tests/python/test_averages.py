"""Averages of large photos: what they are, how wide their pixels are, and that small photos know nothing of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from splitnerf.config import Config
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import area_average, linear_to_srgb, srgb_to_linear
from splitnerf.data.pixels import Photos
from splitnerf.render.averages import averaging_factor, training_photos
from splitnerf.render.rays import PixelSource
from splitnerf.training import loop
from test_edges import scene
from test_known_pixels import ignoring_scene
from tiny_runs import tiny


def seeded() -> torch.Generator:
    return torch.Generator().manual_seed(3)


def averaging(dataset: Dataset, factor: float, **settings) -> Config:
    """Settings by which photos are averaged down by a factor, which is rounded down."""
    config = tiny(**settings)
    distance = np.linalg.norm(dataset.poses[0, :3, 3])
    cell = 2 * config.constants.box / config.finest_cells
    return config.replace({"pixel_cells": float(factor * 1.0001 * distance / dataset.intrinsics[0, 0] / cell)})


def far(dataset: Dataset) -> Dataset:
    """The cameras at a distance of 3 from the scene's middle."""
    dataset.poses[:, 2, 3] = 3.0
    return dataset


def source_of(dataset: Dataset, config: Config) -> PixelSource:
    photos = training_photos(dataset, config)
    return PixelSource(photos, config.constants.foreground_share, seeded(), config.losses.edge_pixels)


@pytest.mark.parametrize("scene", ["alpha", "ignoring"])
def test_averages_are_what_a_downscale_reads(scene, data, tmp_path):
    root = data if scene == "alpha" else ignoring_scene(tmp_path)
    small, averaged = load_dataset(root, downscale=3), load_dataset(root).averaged(3, 0.0)
    assert np.array_equal(small.images.codes, averaged.images.codes) and averaged.images.codes.dtype == np.uint16
    assert np.array_equal(small.intrinsics, averaged.intrinsics) and np.array_equal(small.poses, averaged.poses)
    assert (small.downscale, small.whole) == (averaged.downscale, averaged.whole) == (3, False)
    assert (small.known is None) == (scene == "alpha") == (averaged.known is None)
    assert small.known is None or np.array_equal(small.known, averaged.known)


def test_a_ray_of_an_average_meets_the_middle_of_its_block(data):
    """The origin and direction are those through the block's centre, and the colour is the block's mean."""
    dataset = load_dataset(data)
    source = source_of(dataset, averaging(dataset, 2))
    drawn = source.draw(200)
    local = torch.einsum("nij,ni->nj", source.poses[drawn.view, :3, :3], drawn.rays_d)
    lens = torch.from_numpy(dataset.intrinsics)[drawn.view]
    column = lens[:, 2] - lens[:, 0] * local[:, 0] / local[:, 2]
    row = lens[:, 3] + lens[:, 1] * local[:, 1] / local[:, 2]
    assert (column / 2 % 1 - 0.5).abs().max() < 1e-3 and (row / 2 % 1 - 0.5).abs().max() < 1e-3
    views, tops, lefts = drawn.view.numpy(), (row - 1).round().int().numpy(), (column - 1).round().int().numpy()
    blocks = np.stack([dataset.images[v, y : y + 2, x : x + 2] for v, y, x in zip(views, tops, lefts)])
    alpha = blocks[..., 3].mean((1, 2))
    assert np.abs(drawn.pixels[:, 3].numpy() - alpha).max() < 1e-4 and 0.2 < np.mean(alpha) < 0.98
    linear = (srgb_to_linear(blocks[..., :3]) * blocks[..., 3:]).mean((1, 2)) / np.maximum(alpha, 1e-6)[:, None]
    assert np.abs(drawn.pixels[:, :3].numpy() - linear_to_srgb(linear)).max() < 1e-4


@pytest.mark.parametrize("wanted, factor", [(0.9, 1), (1.1, 1), (1.9, 1), (2.1, 2), (3.1, 3), (9.0, 3)])
def test_a_pixel_is_at_most_as_wide_as_the_setting_says(wanted, factor, data):
    """By the cells of the finest level, and so that 8 pixels are left along the shorter edge of 24."""
    dataset = load_dataset(data)
    config = averaging(dataset, wanted)
    photos = training_photos(dataset, config)
    assert averaging_factor(dataset, config) == factor and photos.height == 24 // factor
    s, box = config.surface, config.constants.box
    cells = math.floor(config.finest_cells)
    distance = np.linalg.norm(dataset.poses[0, :3, 3])
    width = distance / photos.intrinsics[0, 0] / (2 * box / cells)
    assert factor == 1 or width <= config.sampling.pixel_cells
    finer = config.replace({"growth": s.growth * 2 ** (1 / (s.n_levels - 1))})
    assert averaging_factor(dataset, finer) == max(1, factor // 2) or wanted == 9.0


@pytest.mark.parametrize("shown, factor", [(0.6, 2), (0.0, 1)])
def test_cameras_at_the_middle_see_pixels_as_those_at_the_edge_of_the_box(data, shown, factor):
    """At a distance of 0 a pixel has no width."""
    dataset = load_dataset(data)
    config = tiny(pixel_cells=shown)
    box = config.constants.box
    dataset.intrinsics[:, 0] = box / (shown / factor * 2 * box / config.finest_cells) if shown else 1.0
    for distance in (box, 0.1, 0.0):
        dataset.poses[:, :3, 3] = [0, 0, distance * 1.0001]
        assert averaging_factor(dataset, config) == (factor if distance < box else max(1, factor - 1))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_averages_keep_edges_of_known_pixels_at_each_exposure(tmp_path, kind):
    """The band is the same in photos of all kinds; what is not known has no edge, and exposures change no code."""
    values = wall(0.2) / np.float32(255)
    codes = values if kind == np.float32 else np.rint(values * np.iinfo(kind).max).astype(kind)
    known = np.ones((2, 120, 180), bool)
    known[1, :, 90:] = False
    plain = far(scene(tmp_path, np.stack([codes, codes]), known=known))
    exposed = replace(plain, images=Photos(plain.images.codes, np.array([0.5, 2.0])))
    averages = [training_photos(dataset, averaging(dataset, 3)) for dataset in (plain, exposed)]
    assert np.array_equal(*(photos.images.codes for photos in averages)) and averages[0].whole
    assert (averages[0].images.codes[1, :, 30:] == 0).all() and not averages[0].known[1, :, 30:].any()
    starts, ends = (x.numpy() for x in (source_of(plain, averaging(plain, 3)).edges.runs[:2]))
    marked = np.zeros((2, 40, 60), bool)
    for start, end in zip(starts, ends):
        marked.reshape(-1)[start:end] = True
    assert marked[0].sum() > 200 and not marked[1, :, 30:].any()
    assert np.array_equal(marked[1, :, :24], marked[0, :, :24])


def wall(brightness: float, object_colour: float = 0.9) -> np.ndarray:
    """[120, 180, 4] a photo of a square of 61 pixels before a wall, and its mask; blocks of 3 x 3 have edges of thirds."""
    alpha = np.zeros((120, 180), np.float32)
    alpha[31:91, 61:122] = 1.0
    shade = np.where(alpha > 0, object_colour, brightness).astype(np.float32)
    return np.rint(255 * np.dstack([shade, shade, shade, alpha])).astype(np.uint8)


def test_edges_of_averages_are_compared_whole(tmp_path):
    """A pixel at the edge has the mean of the object and of the wall, which is found behind it; one within has the object's."""
    photo = wall(0.2)
    dataset = far(scene(tmp_path, np.stack([photo, photo])))
    source = source_of(dataset, averaging(dataset, 3))
    assert (source.height, source.width) == (40, 60)
    everywhere = torch.arange(40 * 60)
    pixels, _, behind, whole = source.pixels.read(
        everywhere, 0 * everywhere, torch.ones(2, 3), torch.rand(2400, 3), source.edges.runs
    )
    pixels, behind, whole = (x.unflatten(0, (40, 60)) for x in (pixels, behind, whole))
    blocks = area_average(srgb_to_linear(photo[..., :3] / np.float32(255)), 3)
    expected = linear_to_srgb(blocks)
    cut = (pixels[..., 3] > 0.01) & (pixels[..., 3] < 0.99)
    assert cut.sum() > 40 and whole[cut].all() and whole.sum() > 3 * cut.sum()
    torch.testing.assert_close(pixels[..., :3], torch.from_numpy(expected), rtol=0, atol=1e-4)
    torch.testing.assert_close(behind[whole], torch.full((int(whole.sum()), 3), 51 / 255))


@pytest.mark.parametrize("brightness, edge_pixels", [(1.0, 2), (0.2, 0)])
def test_where_a_mask_has_to_say_the_edge_averages_are_of_the_object_alone(tmp_path, brightness, edge_pixels):
    """Before a wall that is too bright for the photo, or where edges are not compared."""
    codes = wall(brightness, object_colour=0.4)
    dataset = far(scene(tmp_path, np.stack([codes, codes])))
    source = source_of(dataset, averaging(dataset, 3, edge_pixels=edge_pixels))
    average = source.pixels.codes.view(2, 40, 60, 4)[0].int() & 0xFFFF
    partly = (average[..., 3] > 0) & (average[..., 3] < 65535)
    assert source.edges is None and partly.sum() > 40
    assert (average[partly][:, :3] - round(0.4 * 255) * 257).abs().max() <= 1


def test_a_run_draws_its_rays_from_averages(data, tmp_path):
    dataset = load_dataset(data)
    training = loop.Training(dataset, averaging(dataset, 2), tmp_path, torch.device("cpu"))
    assert (training.source.height, training.source.width) == (12, 12)
