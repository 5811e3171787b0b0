"""Rays of pixels: each goes through the middle of its own, whoever asks for them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from blender_data import look_at
from op_checks import generator
from precision import precisions
from splitnerf.data.dataset import Dataset
from splitnerf.render.rays import PixelSource, image_rays

HEIGHT, WIDTH = 20, 32
LENSES = np.array(
    [[40.0, 44.0, 15.0, 11.0], [30.0, 30.0, 16.0, 10.0], [55.0, 50.0, 17.5, 8.5]], np.float32
)  # fx, fy, cx, cy
POSES = np.stack([look_at(np.array(x), np.zeros(3)) for x in ((3, 1, 1), (-2, 2, 0.5), (0.3, -3, 2))]).astype(
    np.float32
)


def project(points: np.ndarray, pose: np.ndarray, lens: np.ndarray) -> np.ndarray:
    """[n, 2] pixels (x to the right, y down, the corner of the first at 0) of points [n, 3], by a pinhole camera."""
    x, y, z = np.linalg.inv(pose.astype(np.float64))[:3] @ np.c_[points, np.ones(len(points))].T
    fx, fy, cx, cy = lens
    return np.stack([cx + fx * x / -z, cy - fy * y / -z], 1)


def far_along(origins: torch.Tensor, directions: torch.Tensor) -> np.ndarray:
    np.testing.assert_allclose(directions.norm(dim=1), 1.0, atol=1e-6)
    return (origins + 5.0 * directions).double().numpy()


@pytest.fixture
def dataset(tmp_path) -> Dataset:
    """Images whose pixels say where they are: column, row, view, each from 0 to 1; a mask in the middle."""
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    images = np.zeros((3, HEIGHT, WIDTH, 4), np.float32)
    images[..., 0], images[..., 1], images[..., 2] = column / WIDTH, row / HEIGHT, np.arange(3)[:, None, None] / 3
    images[:, 6:14, 10:20, 3] = 1.0
    names = ["a", "b", "c"]
    return Dataset(
        "marked", tmp_path, "train", 1, images, POSES, LENSES, names, [tmp_path / n for n in names], np.eye(4)
    )


@pytest.mark.parametrize("share", [0.0, 0.7, 1.0])
def test_training_rays_go_through_the_middles_of_their_pixels(dataset, share):
    origins, directions, pixels, view, *_ = PixelSource(dataset, share, generator()).draw(600)
    view = view.numpy()
    assert np.array_equal(view, (pixels[:, 2] * 3).round().long().numpy())
    ahead = far_along(origins, directions)
    for i in range(3):
        mine = view == i
        assert mine.sum() > 100
        np.testing.assert_allclose(origins[mine], np.broadcast_to(POSES[i, :3, 3], (mine.sum(), 3)))
        at = project(ahead[mine], POSES[i], LENSES[i])
        marked = pixels[mine, :2].numpy() * [WIDTH, HEIGHT]
        np.testing.assert_allclose(at, marked + 0.5, atol=1e-3)


def test_most_of_the_rays_are_near_the_masks_and_the_others_anywhere(dataset):
    """A share of them within two pixels of a mask, each such pixel as often as another; the others over all the image."""
    source = PixelSource(dataset, 0.75, generator())
    pixels = source.draw(40_000)[2]
    column, row = pixels[:, 0] * WIDTH, pixels[:, 1] * HEIGHT
    near = (column > 7.5) & (column < 21.5) & (row > 3.5) & (row < 15.5)
    share = 14 * 12 / (WIDTH * HEIGHT)
    assert near.float().mean().item() == pytest.approx(0.75 + 0.25 * share, abs=0.01)
    counts = torch.bincount(row[near].round().long() * WIDTH + column[near].round().long())
    counts = counts[counts > 0]
    assert (
        len(counts) == 14 * 12
        and counts.min() > 0.7 * counts.float().mean()
        and counts.max() < 1.3 * counts.float().mean()
    )
    assert column[~near].min() == 0 and column[~near].max().round() == WIDTH - 1


# ---- what is drawn ----


def with_images(dataset: Dataset, images: np.ndarray) -> Dataset:
    return dataclasses.replace(dataset, images=images.astype(np.float32))


@pytest.mark.parametrize(("share", "n_near"), [(0.0, 0), (0.75, 7), (1.0, 10)])
def test_as_many_rays_are_drawn_as_asked(dataset, share, n_near):
    """Ten, three quarters of which are seven: these are all from the only view that has a mask."""
    images = np.array(dataset.images)
    images[1:, ..., 3] = 0.0
    source = PixelSource(with_images(dataset, images), share, generator())
    origins, directions, pixels, view, *_ = source.draw(10)
    assert len(origins) == len(directions) == len(pixels) == len(view) == 10
    assert (pixels[:n_near, 2] == 0).all()


def test_without_masks_rays_come_from_anywhere(dataset):
    """From each of the 1,920 pixels, about as often from each view."""
    images = np.array(dataset.images)
    images[..., 3] = 0.0
    pixels = PixelSource(with_images(dataset, images), 0.9, generator()).draw(40_000)[2]
    assert len(pixels.unique(dim=0)) == 3 * HEIGHT * WIDTH
    assert (pixels[:, 2] * 3).round().long().bincount().min() > 0.9 * 40_000 / 3


def test_masks_reach_a_fiftieth_of_the_width_and_are_there_where_they_are_thin(dataset):
    """One pixel of a hundredth of an alpha, in images of 150 pixels: 7 x 7 pixels about it, two in small ones."""
    for width, margin in ((32, 2), (150, 3), (249, 4)):
        images = np.zeros((3, 20, width, 4))
        images[..., 0], images[..., 1] = np.arange(width) / width, np.arange(20)[:, None] / 20
        images[1, 9, 17, 3] = 0.01
        pixels = PixelSource(with_images(dataset, images), 1.0, generator()).draw(2000)[2]
        column, row = (pixels[:, 0] * width).round(), (pixels[:, 1] * 20).round()
        assert (column.min(), column.max(), row.min(), row.max()) == (17 - margin, 17 + margin, 9 - margin, 9 + margin)


def test_directions_are_not_rounded_to_tensor_cores(dataset):
    asked = precisions(lambda: image_rays(torch.from_numpy(POSES[0]), torch.from_numpy(LENSES[0]), HEIGHT, WIDTH))
    assert asked["__matmul__"] | asked["matmul"] == {"ieee"}
