"""Photos of several sizes in one data set: each is used as it is, and nothing is drawn beside it."""

import io
import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from blender_data import ANGLE, SIZE, edit, make_blender
from PIL import Image
from splitnerf.cli import DONE, main
from splitnerf.config import Config
from splitnerf.data.dataset import dataset_fingerprint, load_dataset
from splitnerf.data.images import read_image, write_image
from splitnerf.data.truth import load_view_truths
from splitnerf.errors import InputError
from splitnerf.relight.cameras import data_views
from splitnerf.render.rays import pixel_rays
from splitnerf.render.seen import Cameras
from splitnerf.training.batches import PixelSource, average_with_edges, training_photos
from splitnerf.training.loop import Training
from splitnerf_tools.view.assets import ViewedPhotos
from tiny_runs import tiny

FOCAL = 0.5 * SIZE / np.tan(0.5 * ANGLE)
# left, top, right, bottom of the parts of the photos that are kept, in turn
PARTS = ((0, 0, SIZE, SIZE), (6, 0, SIZE - 8, SIZE), (0, 10, SIZE, SIZE - 2), (7, 9, SIZE, SIZE - 6))


def cut(root: Path, data: Path) -> Path:
    """A copy of a square data set whose photos, with the maps beside them, are cut to PARTS; each states its own lens."""
    shutil.copytree(root, data)
    for split in ("train", "test"):
        path = data / f"transforms_{split}.json"
        content = json.loads(path.read_text())
        angle = content.pop("camera_angle_x")
        for i, frame in enumerate(content["frames"]):
            left, top, right, bottom = PARTS[i % len(PARTS)]
            for file in data.glob(f"{frame['file_path']}[._]*"):
                pixels = read_image(file)
                scale = len(pixels) / SIZE
                l, t, r, b = (round(scale * x) for x in (left, top, right, bottom))
                write_image(file, pixels[t:b, l:r])
            whole = len(pixels)
            frame |= {"fl_x": 0.5 * whole / np.tan(0.5 * angle), "cx": whole / 2 - l, "cy": whole / 2 - t}
            frame |= {"w": r - l, "h": b - t}
        path.write_text(json.dumps(content))
    return data


@pytest.fixture(scope="module")
def square(tmp_path_factory) -> Path:
    return make_blender(tmp_path_factory.mktemp("square"), train=8)


@pytest.fixture(scope="module")
def mixed(square, tmp_path_factory) -> Path:
    return cut(square, tmp_path_factory.mktemp("mixed") / "data")


def test_each_photo_keeps_its_pixels_its_lens_and_its_place(square, mixed):
    whole, parts = load_dataset(square), load_dataset(mixed)
    assert np.array_equal(parts.box_from_world, whole.box_from_world) and np.array_equal(parts.poses, whole.poses)
    for i in range(len(parts)):
        left, top, right, bottom = PARTS[i % len(PARTS)]
        assert parts.sizes[i].tolist() == [bottom - top, right - left]
        assert np.array_equal(parts.cropped(i, parts.images[i]), whole.images[i][top:bottom, left:right])
        assert parts.intrinsics[i] == pytest.approx([FOCAL, FOCAL, SIZE / 2 - left, SIZE / 2 - top], rel=1e-6)
        assert parts.known[i].sum() == parts.sizes[i].prod() and parts.cropped(i, parts.known[i]).all()
    assert (Cameras.of(parts).sizes.numpy() == parts.sizes).all()
    chosen = parts.select([3, 1])
    assert (chosen.sizes == parts.sizes[[3, 1]]).all()
    assert dataset_fingerprint(parts) != dataset_fingerprint(whole)


@pytest.mark.parametrize("downscale", [1, 2, 3])
def test_averages_have_whole_blocks_of_each_photo_alone(mixed, downscale):
    parts = load_dataset(mixed)
    small = load_dataset(mixed, downscale=downscale) if downscale > 1 else parts
    assert (small.sizes == parts.sizes // downscale).all()
    averaged, with_edges = [small], partial(average_with_edges, width=2)
    if downscale > 1:
        averaged += [parts.averaged(downscale, 0.0), parts.averaged(downscale, 0.0, with_edges)]
    for split in averaged:
        assert (split.sizes == small.sizes).all()
        for i in range(len(split)):
            expected = np.zeros(split.known.shape[1:], bool)
            split.cropped(i, expected)[:] = True
            assert np.array_equal(split.known[i], expected)


def test_rays_are_drawn_within_the_photos_through_their_own_lenses(mixed):
    photos = load_dataset(mixed)
    source = PixelSource(photos, 0.5, torch.Generator().manual_seed(0))
    rays_o, rays_d, shown, view, *_ = source.draw(4000)
    pose, lens = source.poses[view], source.intrinsics[view]
    local = (pose[:, :3, :3].transpose(1, 2) @ rays_d[..., None])[..., 0]
    x, y = lens[:, 2] - lens[:, 0] * local[:, 0] / local[:, 2], lens[:, 3] + lens[:, 1] * local[:, 1] / local[:, 2]
    sizes = torch.from_numpy(photos.sizes)[view]
    assert (x > 0).all() and (y > 0).all() and (x < sizes[:, 1]).all() and (y < sizes[:, 0]).all()
    pixels = torch.from_numpy(np.stack(list(photos.images)))[view, y.long(), x.long()]
    assert torch.equal(pixels, shown)
    again, directions = pixel_rays(pose, lens, x, y)
    assert torch.allclose(directions, rays_d, atol=1e-5) and torch.equal(again, rays_o)
    corners = {(int(v), int(row), int(column)) for v, row, column in zip(view, y, x)}
    assert any(row >= 30 and photos.sizes[view][0] == SIZE for view, row, _ in corners)


def test_the_hull_is_that_of_the_whole_photos(square, mixed, tmp_path):
    """What lies beside a photo says nothing: only by the box's corners less is carved."""
    cpu = torch.device("cpu")
    grids = [Training(load_dataset(root), tiny(), tmp_path, cpu).source.hull(tiny()) for root in (square, mixed)]
    assert (grids[0] & ~grids[1]).sum() == 0  # nothing more is carved
    axis = torch.linspace(-1, 1, 2 * len(grids[0]) + 1)[1::2] * tiny().constants.box
    near = axis[:, None, None] ** 2 + axis[None, :, None] ** 2 + axis**2 < 1.3**2
    assert (grids[1] & ~grids[0] & near).sum() < 0.03 * (grids[0] & near).sum()


def test_training_photos_are_averaged_by_the_smallest(mixed):
    photos = training_photos(load_dataset(mixed), Config().replace({"sampling.pixel_cells": 1024.0}))
    assert photos.sizes.min() >= 8


def test_photos_of_two_sizes_become_an_asset(data, tmp_path, capsys):
    """Every part of a run; truth, relit views and pages have the photos' sizes too."""
    mixed, run = cut(data, tmp_path / "data"), tmp_path / "run"
    assert main(["train", str(mixed), "--out", str(run), "--steps", "30", "--set", "refinement.sweeps=1"]) == DONE
    assert "refinement, on the photos: colours" in capsys.readouterr().out
    scores = json.loads((run / "evaluation.json").read_text())
    assert scores["novel_view"]["psnr"] > 10 and (run / "mesh.glb").is_file() and (run / "report.html").is_file()
    assert main(["evaluate", str(run), "--data", str(mixed), "--spp", "1"]) == DONE
    assert main(["inspect", str(mixed), "--out", str(tmp_path / "page.html")]) == DONE
    sizes = {f"{view.width}x{view.height}" for view in data_views(mixed, "train", None)}
    assert len(sizes) == 4
    viewed, views = ViewedPhotos(mixed), data_views(mixed, "train", None)
    for camera, png, expected in zip(viewed.cameras(), map(viewed.png, range(len(viewed))), views):
        size = camera["width"], camera["height"]
        assert size == Image.open(io.BytesIO(png)).size == (expected.width, expected.height)
        assert camera["intrinsics"] == pytest.approx(expected.intrinsics)
    test = load_dataset(mixed, "test")
    for truth, image in zip(load_view_truths(test), test.images):
        assert truth.albedo is None or truth.albedo.shape[:2] == image.shape[:2]


def test_a_photo_that_is_no_scaled_copy_of_the_one_of_its_lens_is_refused(square, tmp_path):
    """A turned one, whose file the data state upright."""
    turned = cut(square, tmp_path / "turned")
    path = turned / "train/r_1.png"
    write_image(path, read_image(path).transpose(1, 0, 2))
    with pytest.raises(InputError, match=f"r_1.png: is {SIZE}x34, but its lens is stated for 34x{SIZE}; turn the i"):
        load_dataset(turned)
    with pytest.raises(InputError, match="r_1.png: is 48x34, but its lens is stated"):
        data_views(turned, "train", None)


def test_a_lens_is_scaled_with_its_photo(square, tmp_path):
    """Photos at a half of the size that the data state, wholly and within rounding."""
    halved = shutil.copytree(square, tmp_path / "halved")
    lens = {"fl_x": 2.1 * FOCAL, "cx": 1.05 * SIZE, "cy": 1.05 * SIZE, "w": 2.1 * SIZE, "h": 2.1 * SIZE}
    edit(halved, lambda meta: meta.update(lens))
    expected = load_dataset(square).intrinsics
    assert load_dataset(halved).intrinsics == pytest.approx(expected)
    views = data_views(halved, "train", None)
    assert np.array([view.intrinsics for view in views]) == pytest.approx(expected) and views[0].width == SIZE


def test_small_and_large_photos_agree_where_the_object_is(tmp_path):
    """Large photos are looked at in averages: each by its own factor."""
    data = make_blender(tmp_path, centre=(3, 1, -2), train=8)
    expected = load_dataset(data)
    for i in (1, 4, 6):
        path = data / f"train/r_{i}.png"
        write_image(path, read_image(path).repeat(5, 0).repeat(5, 1))
    found = load_dataset(data)
    assert found.sizes[:3].tolist() == [[SIZE] * 2, [5 * SIZE] * 2, [SIZE] * 2]
    assert found.intrinsics[1] == pytest.approx(5 * expected.intrinsics[1])
    assert found.box_from_world == pytest.approx(expected.box_from_world, rel=0.03)
