"""Photos are kept as whole numbers within a budget of memory, else in a file: the values are the same."""

from __future__ import annotations

import platform
import subprocess
import sys

import numpy as np
import pytest
import torch
from blender_data import make_blender
from splitnerf.cli import main
from splitnerf.cli.common import BAD_INPUT
from splitnerf.data import pixels
from splitnerf.data.dataset import dataset_fingerprint, load_dataset
from splitnerf.data.images import read_image
from splitnerf.data.pixels import decoded, encoded, file_of
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.ops import draw_rays
from splitnerf.render.masks import pixel_list, reduced, runs_of, widened
from splitnerf.training import loop
from tiny_runs import tiny

CPU = torch.device("cpu")


@pytest.fixture
def in_file(monkeypatch, tmp_path):
    """A budget that no data set of the tests fits into, and the folder of the files."""
    folder = tmp_path / "files"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr("splitnerf.data.photos.WORK", 1)
    return Reading(max_memory=5e-5), folder


@pytest.fixture
def random_codes():
    return np.random.default_rng(0).integers(0, 256, (3, 5, 7, 4), np.uint8)


@pytest.mark.parametrize(("dtype", "most"), [(np.uint8, 255), (np.uint16, 65535)])
def test_codes_stand_for_the_values_they_are_rounded_from(dtype, most):
    codes = np.arange(most + 1).astype(dtype)
    assert np.array_equal(encoded(decoded(codes), dtype), codes)
    values = np.random.default_rng(0).random(1000, np.float32)
    assert np.abs(decoded(encoded(values, dtype)) - values).max() < 0.5001 / most


def test_photos_in_a_file_train_as_those_in_memory(in_file, tmp_path):
    """Equal bits of the pixels, of the fingerprint, and of what some steps learn."""
    reading, folder = in_file
    root, found = make_blender(tmp_path / "data", aim=(0.2, 0.1, 0.1)), []  # no photo as another
    for how in (Reading(), reading):
        dataset = load_dataset(root, "train", 1, how)
        run = tmp_path / f"run{len(found)}"
        run.mkdir()
        state = loop.train(dataset, tiny(steps=5, deterministic=True), run).model.state_dict()
        found.append((dataset, state))
    (memory, first), (file, second) = found
    assert file_of(memory.images.codes) is None and file_of(file.images.codes) is not None
    assert memory.images.codes.dtype == np.uint8 and list(folder.iterdir()) == []  # the file has no name
    for path, photo in zip(memory.image_paths, memory.images):
        assert np.allclose(photo, read_image(path), atol=1e-6)
    assert np.array_equal(memory.images, file.images) and dataset_fingerprint(memory) == dataset_fingerprint(file)
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_the_budget_counts_what_is_there_already(random_codes):
    before = pixels.room_for_photos(1.0)
    array = pixels.new_array((10, 100, 100, 4), np.dtype(np.uint8), False)
    assert before - pixels.room_for_photos(1.0) == array.nbytes == 400_000
    del array
    assert pixels.room_for_photos(1.0) == before


def test_one_photo_must_fit(tmp_path):
    with pytest.raises(InputError, match="one photo of .* takes .* GB while it is read.*--max-memory"):
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
    listed = pixel_list([runs_of(mask) for mask in masks], 9 * 13, CPU)
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
    assert reduced(mask, 2).nonzero().tolist() == [[1, 3], [4, 0]]


class Requests(list):
    """Stands in for a file: the bytes that the system was asked to read."""

    def madvise(self, advice, start, size):
        self.append((start, size))


def test_a_photo_is_asked_for_in_parts_that_the_system_takes_whole():
    requests = Requests()
    pixels._ask_for(requests, start=5000, size=500_000)
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
