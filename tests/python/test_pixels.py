"""The pixels that a step draws: their rays, backgrounds and jitter, and those along the masks' edges."""

import dataclasses
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from blender_data import SIZE, look_at
from layout_scenes import write_transforms
from op_checks import generator, precisions
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.images import read_image, write_image
from splitnerf.ops.rays import EdgeRuns, read_pixels
from splitnerf.render.rays import image_rays
from splitnerf.training.batches import PixelSource, band, draw_batch, edge_of, edge_runs, filled_in
from tiny_runs import tiny

HEIGHT, WIDTH = 20, 32
# fx, fy, cx, cy
LENSES = np.array([[40.0, 44.0, 15.0, 11.0], [30.0, 30.0, 16.0, 10.0], [55.0, 50.0, 17.5, 8.5]], np.float32)
POSES = np.float32([look_at(np.array(x), np.zeros(3)) for x in ((3, 1, 1), (-2, 2, 0.5), (0.3, -3, 2))])


@pytest.fixture
def dataset(tmp_path) -> Dataset:
    """Images whose pixels say where they are: column, row, view, each from 0 to 1; a mask in the middle."""
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    images = np.zeros((3, HEIGHT, WIDTH, 4), np.float32)
    images[..., 0], images[..., 1], images[..., 2] = column / WIDTH, row / HEIGHT, np.arange(3)[:, None, None] / 3
    images[:, 6:14, 10:20, 3] = 1.0
    names, paths = ["a", "b", "c"], [tmp_path / name for name in "abc"]
    return Dataset("marked", tmp_path, "train", 1, images, POSES, LENSES, names, paths, np.eye(4))


@pytest.mark.parametrize("share", [0.0, 0.7, 1.0])
def test_training_rays_go_through_the_middles_of_their_pixels(dataset, share):
    origins, directions, pixels, view, *_ = PixelSource(dataset, share, generator()).draw(600)
    view = view.numpy()
    assert np.array_equal(view, (pixels[:, 2] * 3).round().long().numpy())
    np.testing.assert_allclose(directions.norm(dim=1), 1.0, atol=1e-6)
    ahead = np.c_[(origins + 5.0 * directions).double().numpy(), np.ones(600)]
    for i in range(3):
        mine = view == i
        assert mine.sum() > 100
        np.testing.assert_allclose(origins[mine], np.broadcast_to(POSES[i, :3, 3], (mine.sum(), 3)))
        (fx, fy, cx, cy), (x, y, z) = LENSES[i], np.linalg.inv(POSES[i].astype(np.float64))[:3] @ ahead[mine].T
        at = np.stack([cx + fx * x / -z, cy - fy * y / -z], 1)  # by a pinhole camera
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
    assert len(counts) == 14 * 12 and counts.min() > 0.7 * counts.float().mean()
    assert counts.max() < 1.3 * counts.float().mean()
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


# ---- what is drawn beside them ----


def drawn(seed: int = 0, edges: EdgeRuns | None = None, **settings):
    """A batch whose origins are 1, directions 2 and pixels 3, which are the first ones of three photos, exposed by 1, 2 and 3."""
    config = tiny(box=1.3, eikonal_points=4000, smoothness_points=3000, smoothness_radius=0.05, **settings)
    runs = EdgeRuns.none(torch.device("cpu")) if edges is None else edges

    def draw(n: int, random: torch.Tensor, backgrounds: torch.Tensor, exposures: torch.Tensor) -> tuple:
        assert random.shape == (n,) and 0 <= random.min() < 0.01 and 0.99 < random.max() < 1
        view = torch.arange(n) % 3
        pixels, *beside = read_pixels(torch.full((n, 4), 3.0), torch.arange(n), view, exposures, backgrounds, runs)
        return torch.full((n, 3), 1.0), torch.full((n, 3), 2.0), pixels, view, *beside

    source = SimpleNamespace(generator=torch.Generator().manual_seed(seed), draw=draw)
    return draw_batch(source, 2000, config, torch.tensor([[1.0], [2.0], [3.0]]).repeat(1, 3))


def test_what_is_drawn_fills_its_range_beside_what_the_source_gives():
    batch = drawn()
    for found, columns, value in ((batch.rays_o, 3, 1.0), (batch.rays_d, 3, 2.0), (batch.target, 4, 3.0)):
        assert torch.equal(found, torch.full((2000, columns), value))
    assert torch.equal(batch.exposure, (batch.view + 1.0)[:, None].expand(2000, 3))
    assert batch.background.shape == (2000, 3) and batch.jitter.shape == (2000,)
    assert (batch.background[:, 0] != batch.background[:, 1]).all()
    for x in (batch.background, batch.jitter, batch.phase, batch.probes.chosen):
        assert 0 <= x.min() < 0.01 and 0.99 < x.max() < 1
    chosen, shifts = batch.probes.chosen[:2000], batch.probes.shifts[:2000]
    apart = torch.stack([batch.jitter, batch.phase, *batch.background.T, chosen, *shifts.T])
    assert (torch.corrcoef(apart) - torch.eye(9)).abs().max() < 0.1
    anywhere, shifts = batch.probes.anywhere, batch.probes.shifts
    assert anywhere.shape == (4000, 3) and -1.3 <= anywhere.min() < -1.29 and 1.29 < anywhere.max() <= 1.3
    assert batch.probes.chosen.shape == (3000,) and shifts.shape == (3000, 3)
    assert shifts.mean(0).abs().max() < 0.005
    torch.testing.assert_close(shifts.T.cov(), 0.05**2 * torch.eye(3), rtol=0, atol=0.1 * 0.05**2)
    probes = drawn(**{"losses.smoothness_weight": 0.0}).probes  # without smoothness no neighbours are drawn
    assert len(probes.anywhere) == 4000 and len(probes.chosen) == len(probes.shifts) == 0


def test_whole_pixels_are_seen_before_what_lies_behind_them():
    """And all others before random colours, which do not change by that."""
    numbers, behind = torch.tensor([0, 7, 8, 1999]), np.arange(12, dtype=np.uint8).reshape(4, 3)
    runs = np.array([0, 7, 1999]), np.array([1, 9, 2000])
    batch, plain = drawn(edges=edge_runs([(runs, behind)], 2000, torch.device("cpu"))), drawn()
    assert torch.equal(batch.whole.nonzero()[:, 0], numbers) and not plain.whole.any()
    torch.testing.assert_close(batch.background[numbers], torch.from_numpy(behind) / 255)
    assert torch.equal(batch.background[~batch.whole], plain.background[~batch.whole])


def test_the_same_generator_draws_the_same():
    first, again, other = drawn(), drawn(), drawn(1)
    drawn_parts = [(batch.background, batch.jitter, *batch.probes) for batch in (first, again, other)]
    for a, b, c in zip(*drawn_parts):
        assert torch.equal(a, b) and not torch.equal(a, c)


# ---- edges ----


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
    alpha = np.zeros((20, 30), np.float32)  # a wire that covers pixels by less than half
    alpha[:, 15] = 0.4
    near, outside = band(alpha, 2)
    assert np.array_equal(near.any(0).nonzero()[0], [15])
    assert np.array_equal((~outside).any(0).nonzero()[0], range(11, 20))


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
    _, _, behind, whole = source.read(index, view, torch.ones(4, 3), random)
    assert np.array_equal(whole.numpy(), expected.ravel()[index.numpy()])
    assert len(source.edges.behind) == expected.sum() > 0
    torch.testing.assert_close(behind[whole], (torch.tensor(grey)[view] / 255)[whole, None].expand(-1, 3))
    assert torch.equal(behind[~whole], random[~whole])


def test_a_source_has_edges_where_photos_are_whole_and_masks_have_edges(tmp_path):
    images = photo(square(), 0.9, np.full((40, 60), 0.25))[None]
    assert len(PixelSource(scene(tmp_path, images), 0.5, generator(), 2).edges.behind) > 0
    assert len(PixelSource(scene(tmp_path, images), 0.5, generator()).edges.behind) == 0
    full = np.ones_like(images)
    assert len(PixelSource(scene(tmp_path, full), 0.5, generator(), 2).edges.behind) == 0
    cut_out = scene(tmp_path, images)
    cut_out.whole = False
    assert len(PixelSource(cut_out, 0.5, generator(), 2).edges.behind) == 0


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
