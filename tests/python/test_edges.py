"""Pixels along the masks' edges: which they are, and what they would show without the object."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import torch
from blender_data import SIZE
from layout_scenes import write_transforms
from op_checks import generator
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import read_image, write_image
from splitnerf.render.edges import band, edge_of, filled_in
from splitnerf.render.rays import PixelSource


def square(height: int = 40, width: int = 60) -> np.ndarray:
    """A mask [h, w] of the columns 20 to 39 of the rows 10 to 29, whose left column is half covered."""
    alpha = np.zeros((height, width), np.float32)
    alpha[10:30, 20:40] = 1.0
    alpha[10:30, 20] = 0.4
    return alpha


def scene(tmp_path, images: np.ndarray, **changes) -> Dataset:
    n = len(images)
    names = [f"v{i}" for i in range(n)]
    pose, lens = np.tile(np.eye(4, dtype=np.float32), (n, 1, 1)), np.tile(np.float32([50, 50, 30, 20]), (n, 1))
    paths = [tmp_path / name for name in names]
    return Dataset("scene", tmp_path, "train", 1, images, pose, lens, names, paths, np.eye(4), whole=True, **changes)


def photo(alpha: np.ndarray, object_colour: float, behind: np.ndarray) -> np.ndarray:
    """[h, w, 4] an image of an object before a background, with a mask that is a pixel too far to the right."""
    shade = alpha * object_colour + (1 - alpha) * behind
    return np.dstack([shade, shade, shade, np.roll(alpha, 1, axis=1)]).astype(np.float32)


def test_a_band_reaches_its_width_to_both_sides_of_an_edge():
    alpha = square()
    alpha[20, 30] = 0.9  # an edge of a mask that is finer than a pixel
    near, outside = band(alpha, 2)
    assert near[20, 19:23].all() and near[20, 38:42].all()  # the edge is between columns 20 and 21, and 39 and 40
    assert not near[20, [18, 23, 37, 42]].any() and not outside[20, 16:44].any() and outside[20, [15, 44]].all()
    assert near[20, 30] and near[20, 24:37].sum() == 1
    assert not (near & outside).any()
    assert np.array_equal(near[20, 15:25], near[15, 15:25]) and near[8:12, 30].all() and not near[[7, 12], 30].any()


def test_what_lies_behind_is_beside_the_finest_parts_too():
    """A wire that covers pixels by less than half."""
    alpha = np.zeros((20, 30), np.float32)
    alpha[:, 15] = 0.4
    near, outside = band(alpha, 2)
    assert np.array_equal(near.any(0).nonzero()[0], [15]) and np.array_equal(
        (~outside).any(0).nonzero()[0], range(11, 20)
    )


def test_before_what_is_too_bright_for_the_photo_the_mask_decides():
    """In one channel is enough. The upper half of the photo shows such a place."""
    behind = np.full((40, 60, 3), 0.9, np.float32)
    behind[:20, :, 1] = 1.0
    (starts, _), colours = edge_of(behind, square(), None, 2)
    assert starts.min() // 60 >= 20 and len(starts) > 0 and (colours < 250).all()


@pytest.mark.parametrize("width", [2, 3])
def test_what_lies_behind_is_filled_in_from_outside(width):
    """A ramp to the right: everywhere by a mean of pixels outside the band, at which the object's colour has no part."""
    alpha = square()
    ramp = np.linspace(0.1, 0.4, 60, dtype=np.float32)[None, :].repeat(40, 0)
    image = photo(alpha, 0.9, ramp)
    near, outside = band(image[..., 3], width)
    place, colour = filled_in(image[..., :3], near, outside, width)
    assert np.array_equal(place, np.flatnonzero(near))
    assert colour.min() > 0.1 and colour.max() < 0.41
    np.testing.assert_allclose(colour[:, 0], ramp.ravel()[place], atol=0.005 * 4 * (width + 2))


def test_pixels_of_which_nothing_is_known_outside_are_no_edges():
    image = photo(square(), 0.9, np.full((40, 60), 0.25))
    known = np.ones((40, 60), bool)
    known[:, 40:] = False  # right of the object, where its mask ends at column 40
    (starts, ends), behind = edge_of(image[..., :3], image[..., 3], known, 2)
    near = np.zeros((40, 60), bool)
    for start, end in zip(starts, ends):
        near.reshape(-1)[start:end] = True
    assert not near[:, 40:].any() and near[:, 39].any() and near[20].sum() == 4
    assert behind.shape == (near.sum(), 3) and (behind == 64).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_pixels_are_found_by_their_numbers(tmp_path, dtype):
    """In photos of each kind of number, each with a background of its own, one without an object."""
    grey = (51, 102, 153, 204)
    images = np.stack([photo(square(), 0.9, np.full((40, 60), g / 255)) for g in grey])
    images[1, ..., 3] = 0
    codes = images if dtype == np.float32 else np.rint(images * np.iinfo(dtype).max).astype(dtype)
    source = PixelSource(scene(tmp_path, codes), 0.5, generator(), 2)
    expected = np.stack([band(image[..., 3], 2)[0] for image in images])
    index = torch.randperm(4 * 40 * 60, generator=generator())
    view, random = index // (40 * 60), torch.rand(len(index), 3)
    _, _, behind, whole = source.pixels.read(index, view, torch.ones(4, 3), random, source.edges.runs)
    assert np.array_equal(whole.numpy(), expected.ravel()[index.numpy()]) and len(source.edges) == expected.sum() > 0
    torch.testing.assert_close(behind[whole], (torch.tensor(grey)[view] / 255)[whole, None].expand(-1, 3))
    assert torch.equal(behind[~whole], random[~whole])


def test_a_source_has_edges_where_photos_are_whole_and_masks_have_edges(tmp_path):
    images = photo(square(), 0.9, np.full((40, 60), 0.25))[None]
    assert len(PixelSource(scene(tmp_path, images), 0.5, generator(), 2).edges) > 0
    assert PixelSource(scene(tmp_path, images), 0.5, generator()).edges is None
    full = np.ones_like(images)
    assert PixelSource(scene(tmp_path, full), 0.5, generator(), 2).edges is None
    cut_out = scene(tmp_path, images)
    cut_out.whole = False
    assert PixelSource(cut_out, 0.5, generator(), 2).edges is None


def test_photos_with_masks_of_their_own_are_whole(tmp_path):
    """Those with alpha are not, with masks beside it or without, nor those that were averaged down: their colours are the object's
    alone."""
    masked, cut_out, both = (tmp_path / name for name in ("masked", "cut_out", "both"))
    for folder in (masked, cut_out):
        folder.mkdir()
    write_transforms(masked, masks=True)
    write_transforms(cut_out)
    shutil.copytree(masked, both)
    for path in both.glob("images/*.png"):
        write_image(path, np.dstack([read_image(path)[..., :3], np.ones((SIZE, SIZE))]).astype(np.float32))
    data = load_dataset(masked)
    assert data.whole
    for other in (load_dataset(cut_out), load_dataset(both), load_dataset(masked, downscale=2)):
        assert not other.whole
    assert data.images[0, 0, 0, :3] == pytest.approx(0.5, abs=0.01) and data.images[0, 0, 0, 3] == 0
    assert data.select([0, 1]).whole and SIZE == data.width
