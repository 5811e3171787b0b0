"""Photos in memory: as whole numbers within a budget, else in a file; averages of large ones."""

import math
import platform
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from blender_data import make_blender
from splitnerf.cli import main
from splitnerf.cli.common import BAD_INPUT
from splitnerf.config import Config
from splitnerf.data import pixels
from splitnerf.data.dataset import Dataset, dataset_fingerprint, load_dataset
from splitnerf.data.images import area_average, linear_to_srgb, read_image, srgb_to_linear, write_image
from splitnerf.data.pixels import Photos, decoded, encoded, file_of
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.ops.rays import draw_rays
from splitnerf.render.stereo import widened
from splitnerf.training import batches, loop
from splitnerf.training.batches import PixelSource, averaging_factor, training_photos
from test_known_pixels import ignoring_scene
from test_pixels import scene
from tiny_runs import tiny, train_scene


@pytest.fixture
def in_file(monkeypatch, tmp_path):
    """A budget that no data set of the tests fits into, and the folder of the files."""
    folder = tmp_path / "files"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr("splitnerf.data.photos.WORK", 1)
    return Reading(max_memory=5e-5), folder


@pytest.mark.parametrize(("dtype", "most"), [(np.uint8, 255), (np.uint16, 65535)])
def test_codes_stand_for_the_values_they_are_rounded_from(dtype, most):
    codes = np.arange(most + 1).astype(dtype)
    assert np.array_equal(encoded(decoded(codes), dtype), codes)
    values = np.random.default_rng(0).random(1000, np.float32)
    assert np.abs(decoded(encoded(values, dtype)) - values).max() < 0.5001 / most
    assert encoded(np.uint8([0, 1, 255]), np.uint16).tolist() == [0, 257, 65535]


def test_photos_in_a_file_train_as_those_in_memory(in_file, tmp_path):
    """Equal bits of the pixels, of the fingerprint, and of what some steps learn."""
    reading, folder = in_file
    root, found = make_blender(tmp_path / "data", aim=(0.2, 0.1, 0.1)), []  # no photo as another
    for how in (Reading(), reading):
        dataset = load_dataset(root, "train", 1, how)
        run = tmp_path / f"run{len(found)}"
        run.mkdir()
        state = train_scene(dataset, tiny(steps=5, deterministic=True), run).model.state_dict()
        found.append((dataset, state))
    (memory, first), (file, second) = found
    assert file_of(memory.images.codes) is None and file_of(file.images.codes) is not None
    assert memory.images.codes.dtype == np.uint8 and list(folder.iterdir()) == []  # the file has no name
    for path, photo in zip(memory.image_paths, memory.images):
        assert np.allclose(photo, read_image(path), atol=1e-6)
    assert np.array_equal(memory.images, file.images) and dataset_fingerprint(memory) == dataset_fingerprint(file)
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_the_budget_counts_what_is_there_already(monkeypatch):
    before = pixels.memory_for_photos(1.0)
    assert pixels.memory_for_photos(2.0) - before == 10**9
    array = pixels.new_array((10, 100, 100, 4), np.dtype(np.uint8), False)
    assert before - pixels.memory_for_photos(1.0) == array.nbytes == 400_000
    del array
    assert pixels.memory_for_photos(1.0) == before
    monkeypatch.setattr(pixels, "memory_bytes", lambda: (9000, 1000))
    assert pixels.memory_for_photos(0.0) == 500  # half of what is available


def test_one_photo_must_fit(tmp_path):
    told = "one photo of 48x48 takes 5.5e-05 GB while it is read, more than the 1e-06 GB .*--max-memory"  # 24 B a pixel
    with pytest.raises(InputError, match=told):
        load_dataset(make_blender(tmp_path / "data"), "train", 1, Reading(max_memory=1e-6))


def test_a_full_disk_is_named_before_a_photo_is_read(in_file, monkeypatch, tmp_path):
    reading, folder = in_file
    monkeypatch.setattr(pixels.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 10}))
    with pytest.raises(InputError, match=f"{folder}: has 0.0 GB free.*TMPDIR"):
        load_dataset(make_blender(tmp_path / "data"), "train", 1, reading)


def test_a_negative_budget_is_refused(tmp_path, capsys):
    root = make_blender(tmp_path / "data")
    assert main(["train", str(root), "--out", str(tmp_path / "run"), "--max-memory", "-1"]) == BAD_INPUT
    assert "max_memory" in capsys.readouterr().err and not (tmp_path / "run").exists()


def test_runs_list_the_pixels_of_a_mask():
    masks = torch.rand(4, 9, 13, generator=torch.Generator().manual_seed(0)) > 0.6
    masks[1], masks[2] = False, True
    listed = batches.pixel_list([batches.runs_of(mask) for mask in masks], 9 * 13, torch.device("cpu"))
    numbers = masks.reshape(-1).nonzero().squeeze(1)
    n = listed.count
    cameras = torch.eye(3).expand(4, 3, 3), torch.zeros(4, 3)
    drawn = draw_rays(torch.full((n,), 0.5), n, listed, listed, *cameras, 9, 13)
    assert n == len(numbers) and torch.equal(drawn[3], numbers)


@pytest.mark.parametrize("radius", [0, 1, 2, 3, 7, 40])
def test_widened_masks_are_those_of_a_largest_value_around(radius):
    mask = torch.rand(23, 31, generator=torch.Generator().manual_seed(1)) > 0.98
    around = torch.nn.functional.max_pool2d(mask.float()[None], 2 * radius + 1, stride=1, padding=radius)[0] > 0
    assert torch.equal(widened(mask, radius), around)


def test_reduced_masks_lose_no_pixel():
    mask = torch.zeros(10, 11, dtype=torch.bool)
    mask[3, 7] = mask[9, 0] = True
    assert batches.reduced(mask, 2).nonzero().tolist() == [[1, 3], [4, 0]]


def test_a_photo_is_asked_for_in_parts_that_the_system_takes_whole():
    requests = []
    file = SimpleNamespace(madvise=lambda advice, start, size: requests.append((start, size)))
    pixels.ask_for(file, start=5000, size=500_000)
    ends = [start + size for start, size in requests]
    assert all(size <= 128 * 1024 and start % 4096 == 0 for start, size in requests)
    assert [start for start, _ in requests] == [4096, *ends[:-1]]
    assert ends[-1] == 505_000


GAPS = """
import re
from pathlib import Path
import numpy as np
from splitnerf.memory import give_back

def resident():
    return 1024 * int(re.search(r"RssAnon:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])

np.ones(10**6)  # once it is freed, glibc takes arrays of this size from its heap
arrays = [(np.ones(5 * 10**5), np.ones(10**4)) for _ in range(50)]
small, before = [few for _, few in arrays], resident()
del arrays
give_back()
print(before - resident(), sum(few.sum() for few in small))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc is asked")
def test_freed_memory_between_arrays_that_stay_is_given_back():
    """In a process of its own, whose memory has no gaps yet."""
    said = subprocess.run([sys.executable, "-c", GAPS], capture_output=True, text=True, check=True).stdout.split()
    assert int(said[0]) > 0.9 * 50 * 4e6 and float(said[1]) == 50 * 1e4


# ---- averages ----


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
    return PixelSource(
        photos, config.constants.foreground_share, torch.Generator().manual_seed(3), config.losses.edge_pixels
    )


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
    _, rays_d, pixels, view, *_ = source.draw(200)
    local = torch.einsum("nij,ni->nj", source.poses[view, :3, :3], rays_d)
    lens = torch.from_numpy(dataset.intrinsics)[view]
    column = lens[:, 2] - lens[:, 0] * local[:, 0] / local[:, 2]
    row = lens[:, 3] + lens[:, 1] * local[:, 1] / local[:, 2]
    assert (column / 2 % 1 - 0.5).abs().max() < 1e-3 and (row / 2 % 1 - 0.5).abs().max() < 1e-3
    views, tops, lefts = view.numpy(), (row - 1).round().int().numpy(), (column - 1).round().int().numpy()
    blocks = np.stack([dataset.images[v, y : y + 2, x : x + 2] for v, y, x in zip(views, tops, lefts)])
    alpha = blocks[..., 3].mean((1, 2))
    assert np.abs(pixels[:, 3].numpy() - alpha).max() < 1e-4 and 0.2 < np.mean(alpha) < 0.98
    linear = (srgb_to_linear(blocks[..., :3]) * blocks[..., 3:]).mean((1, 2)) / np.maximum(alpha, 1e-6)[:, None]
    assert np.abs(pixels[:, :3].numpy() - linear_to_srgb(linear)).max() < 1e-4


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


@pytest.mark.parametrize("least, n_levels", [(0.0, 9), (1.2, 6), (1e3, 4)])
def test_levels_finer_than_the_photos_are_left_out(least, n_levels, data):
    """Cells are 1, 1/2, 1/4, 1/8 of the sixth level's, which is 1.25 pixels; four levels are open from the start."""
    dataset = load_dataset(data)
    config = Config().replace({"growth": 2.0, "least_cell": least})
    distance, box = np.linalg.norm(dataset.poses[0, :3, 3]), config.constants.box
    dataset.intrinsics[:, 0] = 1.25 * distance / (2 * box / (config.constants.base_resolution * 2**5))
    assert batches.without_fine_levels(dataset, config) == config.replace({"n_levels": n_levels})


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
    starts, ends = (x.numpy() for x in (source_of(plain, averaging(plain, 3)).edges[:2]))
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
    pixels, _, behind, whole = source.read(everywhere, 0 * everywhere, torch.ones(2, 3), torch.rand(2400, 3))
    pixels, behind, whole = (x.unflatten(0, (40, 60)) for x in (pixels, behind, whole))
    blocks = area_average(srgb_to_linear(photo[..., :3] / np.float32(255)), 3)
    expected = linear_to_srgb(blocks)
    cut = (pixels[..., 3] > 0.01) & (pixels[..., 3] < 0.99)
    assert cut.sum() > 40 and whole[cut].all() and whole.sum() > 3 * cut.sum()
    torch.testing.assert_close(pixels[..., :3], torch.from_numpy(expected), rtol=0, atol=1e-4)
    torch.testing.assert_close(behind[whole], torch.full((int(whole.sum()), 3), 51 / 255))


def test_what_the_data_tell_of_the_background_is_compared(tmp_path):
    """A file of half the photo's size, which knows the left half, but where one channel is clipped."""
    photo, told = wall(0.2), np.zeros((60, 90, 4), np.float32)
    told[:, :45], told[:, 45:, :3] = np.float32([0, 200, 100, 255]) / 255, 0.3
    told[:6, :, 2] = 251 / 255
    write_image(tmp_path / "told.png", told)
    dataset = far(scene(tmp_path, np.stack([photo, photo])))
    dataset = replace(dataset, behind_paths=[tmp_path / "told.png", None])
    assert (dataset.select([1, 0]).behind(1)[..., 3] == 1).sum() == 109 * 89  # the pixel between both is half known
    source = source_of(dataset, averaging(dataset, 3))
    everywhere = torch.arange(2 * 40 * 60)
    view = everywhere // (40 * 60)
    _, _, behind, whole = source.read(everywhere, view, torch.ones(2, 3), torch.rand(4800, 3))
    behind, whole = behind.unflatten(0, (2, 40, 60)), whole.unflatten(0, (2, 40, 60))
    assert whole[0].equal(whole[1]) and whole[0, :, :29].sum() > 50 and whole[0, :, 30:].sum() > 50
    green, grey = torch.tensor([0, 200, 100]) / 255, torch.full((3,), 51 / 255)
    for part, colour in ((np.s_[0, :, :29], green), (np.s_[0, :, 31:], grey), (np.s_[1], grey)):
        torch.testing.assert_close(behind[part][whole[part]], colour.expand(int(whole[part].sum()), 3))


@pytest.mark.parametrize("brightness, edge_pixels", [(1.0, 2), (0.2, 0)])
def test_where_a_mask_has_to_say_the_edge_averages_are_of_the_object_alone(tmp_path, brightness, edge_pixels):
    """Before a wall that is too bright for the photo, or where edges are not compared."""
    codes = wall(brightness, object_colour=0.4)
    dataset = far(scene(tmp_path, np.stack([codes, codes])))
    source = source_of(dataset, averaging(dataset, 3, edge_pixels=edge_pixels))
    average = source.codes.view(2, 40, 60, 4)[0].int() & 0xFFFF
    partly = (average[..., 3] > 0) & (average[..., 3] < 65535)
    assert len(source.edges.behind) == 0 and partly.sum() > 40
    assert (average[partly][:, :3] - round(0.4 * 255) * 257).abs().max() <= 1


def test_a_run_draws_its_rays_from_averages(data, tmp_path):
    dataset = load_dataset(data)
    training = loop.Training(dataset, averaging(dataset, 2), tmp_path, torch.device("cpu"))
    assert (training.source.height, training.source.width) == (12, 12)
