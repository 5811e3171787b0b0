"""Photographs as files: what they tell, what is damaged, and the frames of a video."""

import io
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps
from splitnerf.data.images import write_image
from splitnerf.errors import InputError
from splitnerf_tools.capture.masks import mask_files
from splitnerf_tools.capture.photographs import Photograph, find_photographs, read_upright, sharpness, write_frames
from splitnerf_tools.capture.prepare import _upright_copies
from table_scene import photograph, ring
from tiny_runs import refused

TOLD = [{}, {0x8827: (200, 400)}, {0x829A: 0.0}, {0x829D: 0.0}, {0x8827: 0}, {0x920A: 35.0}, {0x829D: 2.0}, {}]
EXPOSURES = [1 / 16, 1 / 8, None, None, None, 1 / 16, 1 / 4, 1 / 16]
MP4, MATROSKA = b"colrncl%c\0%c\0%c", b"\x55\xb0\x8f\x55\xb1\x81%c\x55\xba\x81%c"
BRIGHT, USUAL = [MP4 % (b"x", 9, 18), MATROSKA % (9, 16), MATROSKA % (9, 18)], [MP4 % (b"c", 1, 1), MATROSKA % (1, 1)]
TWO = np.random.default_rng(0).integers(0, 255, (2, 40, 60, 3), np.uint8)
PLAIN_ONES = np.full((5, 150, 200, 3), 6, np.uint8) + np.arange(5, dtype=np.uint8)[:, None, None, None]
UNFIT = [(TWO, "holds 2 different photos, fewer than 3; take 30"), (PLAIN_ONES, "show too little detail; put")]


def write_video(path: Path, frames: Iterable[np.ndarray], code: str = "MJPG") -> None:
    """Frames of 320 x 240 pixels."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (320, 240))
    for frame in frames:
        writer.write(frame)
    writer.release()


@pytest.mark.parametrize("orientation, told, exposure", [*zip(range(1, 9), TOLD, EXPOSURES)])
def test_files_tell_of_turns_exposures_and_lenses(tmp_path, orientation, told, exposure):
    """Photos are turned as Pillow turns them, and COLMAP reads the turned ones. Another focal length is another lens."""
    exif, pixels = Image.Exif(), np.random.default_rng(0).integers(0, 256, (2, 20, 30, 3), np.uint8)
    exif[0x0112] = orientation
    for name, photo, other in zip("ab", pixels, ({}, told)):
        exif.get_ifd(0x8769).update({0x829A: 0.01, 0x829D: 4.0, 0x8827: 100, 0x920A: 50.0} | other)
        Image.fromarray(photo).save(tmp_path / f"{name}.png", exif=exif)
    (tmp_path / "c.png").write_bytes((tmp_path / "a.png").read_bytes())  # the same photo
    first, second = find_photographs(tmp_path)
    assert second.exposure == (exposure and pytest.approx(exposure))
    assert (first.lens == second.lens) == (0x920A not in told)
    expected = np.asarray(ImageOps.exif_transpose(Image.open(tmp_path / "a.png")))
    assert (first.height, first.width) == expected.shape[:2] and np.array_equal(read_upright(first.path), expected)
    copy = _upright_copies([first], tmp_path / "work") / "lens_1/a.png"
    assert copy.is_symlink() == (orientation == 1) and np.array_equal(np.asarray(Image.open(copy)), expected)


def test_damaged_exif_costs_no_photo(tmp_path):
    """Whatever one, two or five of its bytes say."""
    exif, data, random = Image.Exif(), io.BytesIO(), np.random.default_rng(0)
    exif[0x0112], exif[0x010F] = 6, "Maker"
    exif.get_ifd(0x8769).update({0x829A: 0.01, 0x829D: 2.0, 0x8827: 100, 0xA405: 26})
    Image.fromarray(random.integers(0, 255, (8, 12, 3), np.uint8)).save(data, "jpeg", exif=exif)
    good, path = data.getvalue(), tmp_path / "a.jpg"
    first, length = good.index(b"Exif") + 6, len(exif.tobytes()) - 6
    for _ in range(400):
        changed = bytearray(good)
        for at in random.integers(first, first + length, random.choice((1, 2, 5))):
            changed[at] = random.choice((0, 255, random.integers(256)))
        path.write_bytes(changed)
        (photo,) = find_photographs(tmp_path)
        assert read_upright(path).shape == (photo.height, photo.width, 3)


def test_pictures_that_are_no_photos_are_told_of(tmp_path, capsys, monkeypatch):
    """And that a photo is HEIC whatever its name says."""
    (tmp_path / "d.jpg").mkdir()
    with pytest.raises(InputError, match="holds no photos"):
        find_photographs(tmp_path)
    for name in ("a.AVIF", "b.PNG"):
        Image.new("RGB", (4, 4)).save(tmp_path / name)
    assert [photo.name for photo in find_photographs(tmp_path)] == ["b"]
    assert "1 pictures of kinds that are not read are left out (a.AVIF)" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    for content, told in ((b"\0\0\0\x18ftypheic", "c.jpg: HEIC photos need"), (b"", "no photo that can be read")):
        (tmp_path / "c.jpg").write_bytes(content)
        with pytest.raises(InputError, match=told):
            find_photographs(tmp_path)


def test_a_false_raw_photo_is_named(tmp_path, monkeypatch):
    """Whether rawpy is there or not."""
    error = type("LibRawError", (Exception,), {})
    (tmp_path / "a.dng").write_bytes(b"no raw photo")
    rawpy = SimpleNamespace(LibRawError=error, imread=Mock(side_effect=error(b"Unsupported")))
    for module, told in ((rawpy, "a.dng: is no raw photo that can be read"), (None, "a.dng: raw photos need")):
        monkeypatch.setitem(sys.modules, "rawpy", module)
        with pytest.raises(InputError, match=told):
            find_photographs(tmp_path)


@pytest.mark.parametrize("size", [(1, 3000), (3000, 1), (1, 1)])
def test_a_photo_may_be_a_line(tmp_path, size):
    Image.new("RGB", size, "red").save(tmp_path / "a.png")
    (photo,) = find_photographs(tmp_path)
    assert (photo.width, photo.height) == size and sharpness(read_upright(photo.path)) < 1e-6


@pytest.mark.parametrize(("name", "told"), [("v.mp4", "is no video"), ("photos", "holds 1 different photos")])
def test_libraries_say_nothing_beside_the_program(tmp_path, name, told):
    """Of a video that is none, and of EXIF data that are cut short."""
    (tmp_path / "v.mp4").write_text("no video")
    (tmp_path / "photos").mkdir()
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x05\x01\x12\0\x03\0\0\0\x10\xff\xff\xff\0"
    Image.new("RGB", (40, 30)).save(tmp_path / "photos/a.jpg", exif=exif)
    command = [sys.executable, "-m", "splitnerf", "prepare", name, "--out", "out"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True).stderr
    assert told in said and all(line.startswith("splitnerf: ") for line in said.splitlines()), said


def test_the_sharpest_frames_of_a_video(tmp_path):
    """The last of the first window, the first of the second, and the last of the third, in their colours."""
    sharp, shares = photograph(ring(3)[0], 320.0, 320, 240)[0], []
    blurred = cv2.GaussianBlur(sharp, (15, 15), 4)
    write_video(tmp_path / "v.avi", (sharp if number in (3, 4, 11) else blurred for number in range(12)))
    (tmp_path / "frames").mkdir()
    write_frames(tmp_path / "v.avi", tmp_path / "frames", 3, shares.append)
    frames = sorted((tmp_path / "frames").iterdir())
    assert [frame.name for frame in frames] == [f"frame_0000{i}.png" for i in (1, 2, 3)] and shares[-1] == 1
    assert all(abs(cv2.imread(str(frame)) - 1.0 * sharp).mean() < 8 for frame in frames)
    columns = np.tile(np.uint8([50, 150]), (8, 320))[..., None].repeat(3, 2)  # their Laplacian is 200 and -200 in turn
    for photo in (columns, columns.swapaxes(0, 1), np.uint16(columns) * 257, columns.repeat(2, 0).repeat(2, 1)):
        assert sharpness(photo) == pytest.approx(40000, rel=1e-3)


@pytest.mark.parametrize(("box", "is_told"), [*((box, 1) for box in BRIGHT), *((box, 0) for box in USUAL)])
def test_a_video_of_high_range_is_told_of(tmp_path, capsys, box, is_told):
    """As phones film by default, in hybrid log-gamma."""
    write_video(tmp_path / "v.mp4", [np.full((240, 320, 3), 20, np.uint8)], "mp4v")
    (tmp_path / "v.mp4").write_bytes((tmp_path / "v.mp4").read_bytes() + b"\0\0\0\x13" + box + b"\0\x09\0")
    write_frames(tmp_path / "v.mp4", tmp_path, 1, lambda share: None)
    assert ("v.mp4: is a video of high dynamic range" in capsys.readouterr().err) == is_told


def test_a_video_that_is_cut_short_is_told_of(tmp_path, capsys):
    write_video(tmp_path / "v.avi", (np.full((240, 320, 3), 20 * number, np.uint8) for number in range(12)))
    data = bytearray((tmp_path / "v.avi").read_bytes())
    start = [i for i in range(len(data)) if data[i : i + 4] == b"00dc"][7]
    data[start : data.index(b"idx1")] = bytes(data.index(b"idx1") - start)
    (tmp_path / "v.avi").write_bytes(data)
    (tmp_path / "frames").mkdir()
    write_frames(tmp_path / "v.avi", tmp_path / "frames", 6, lambda share: None)
    assert "v.avi: cannot be read beyond frame 6 of 12" in capsys.readouterr().err
    assert len(list((tmp_path / "frames").iterdir())) == 3


def no_masks(photos: list[Photograph], folder: Path, said: str) -> None:
    """They are refused."""
    with pytest.raises(InputError, match=said):
        mask_files(photos, folder)


def test_a_mask_that_may_be_anothers_is_refused(tmp_path):
    """Two photos that differ in their suffixes; two masks that do."""
    photos = [Photograph(tmp_path / f"a{suffix}", f"a{suffix}", 8, 6, None, "") for suffix in (".jpg", ".png")]
    no_masks(photos, tmp_path, "has no mask a.png; add it or leave --masks out")
    Image.new("L", (6, 8)).save(tmp_path / "a.png")
    no_masks(photos, tmp_path, "a.png: is 6x8, its photo 8x6; make them equal")
    Image.new("L", (8, 6)).save(tmp_path / "a.png")
    no_masks(photos, tmp_path, r"a.png: may be the mask of a.jpg or of a.png; call it a.png.png")
    no_masks(photos[1:], tmp_path, "every mask is black; give masks that are white on the object")
    Image.new("RGB", (8, 6), "red").save(tmp_path / "a.png.png")
    no_masks(photos, tmp_path, "a.png.png: is coloured")  # before COLMAP has run for minutes
    soft, words = np.linspace(0, 128, 48, dtype=np.uint8).reshape(6, 8), np.arange(48, dtype=np.uint16).reshape(6, 8)
    for mask, share in ((soft - (soft > 127), "49.8"), (5 * words, "0.4")):  # also bytes in 16 bits
        Image.fromarray(mask).save(tmp_path / "a.png.png")
        no_masks(photos, tmp_path, f"a.png.png: at most {share}% of white, is black; make it white on the object")
    Image.fromarray(soft).save(tmp_path / "a.png.png")
    (tmp_path / "notes.txt").touch(), (tmp_path / "notes.md").touch()  # of no photo
    assert [path.name for path in mask_files(photos, tmp_path).values()] == ["a.png", "a.png.png"]
    for name in ("a.png", "a"):
        Image.new("L", (8, 6)).save(tmp_path / f"{name}.bmp")
        no_masks(photos, tmp_path, f"/{name}.png: may be a mask of the same photo as {name}.bmp; delete one of them")
    Image.new("L", (8, 6), 255).save(tmp_path / "u\u0308.png")  # of a system that keeps letters with accents otherwise
    (found,) = mask_files([Photograph(tmp_path / "\u00fc.jpg", "u", 8, 6, None, "")], tmp_path).values()
    assert found.name == "u\u0308.png"


@pytest.mark.parametrize("photos, said", [*UNFIT, (PLAIN_ONES - 6, "all photos are too dark; expose them longer")])
def test_photos_that_show_too_little_are_refused(tmp_path, capsys, photos, said):
    for i, pixels in enumerate(photos):
        write_image(tmp_path / f"photos/{i}.png", pixels / np.float32(255))
    words = "prepare", tmp_path / "photos", "--out", tmp_path / "data"
    (tmp_path / "masks").mkdir()
    assert "masks: has no mask 0.png" in refused(capsys, *words, "--masks", tmp_path / "masks")  # before the cameras
    assert not (tmp_path / "data/work").exists() and said in refused(capsys, *words)
