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
from PIL import Image
from splitnerf.errors import InputError
from splitnerf_tools.capture.photographs import find_photographs, read_upright, sharpness, write_frames
from table_scene import photograph, ring


def write_video(path: Path, frames: Iterable[np.ndarray], code: str = "MJPG") -> None:
    """Frames of 320 x 240 pixels."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (320, 240))
    for frame in frames:
        writer.write(frame)
    writer.release()


def test_files_tell_of_turns_and_exposures(tmp_path):
    pixels = np.zeros((20, 30, 3), np.uint8)
    pixels[:, :15] = 200
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was turned: rows run to the left
    exif.get_ifd(0x8769).update({0x829A: 0.01, 0x829D: 2.0, 0x8827: 100, 0xA405: 26})
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=exif, quality=95)
    (tmp_path / "b.jpg").write_bytes((tmp_path / "a.jpg").read_bytes())
    Image.fromarray(pixels).save(tmp_path / "a.png")
    first, second = find_photographs(tmp_path)
    assert [first.name, second.name] == ["a_jpg", "a_png"]  # b.jpg is the same photo as a.jpg
    assert (first.width, first.height) == (20, 30) and read_upright(first.path).shape == (30, 20, 3)
    assert read_upright(first.path)[5].mean() > 150 > 50 > read_upright(first.path)[25].mean()
    assert first.exposure == pytest.approx(0.25) and second.exposure is None


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
    for name in ("a.avif", "b.png"):
        Image.new("RGB", (4, 4)).save(tmp_path / name)
    assert [photo.name for photo in find_photographs(tmp_path)] == ["b"]
    assert "1 pictures of kinds that are not read are left out (a.avif)" in capsys.readouterr().err
    (tmp_path / "c.jpg").write_bytes(b"\0\0\0\x18ftypheic")
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with pytest.raises(InputError, match="c.jpg: HEIC photos need"):
        find_photographs(tmp_path)


@pytest.mark.parametrize("content, told", [(b"", "no photo that can be read"), (None, "holds no photos")])
def test_bad_photos_are_named(tmp_path, content, told):
    if content is not None:
        (tmp_path / "a.jpg").write_bytes(content)
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
    sharp = photograph(ring(3)[0], 320.0, 320, 240)[0]
    blurred = cv2.GaussianBlur(sharp, (15, 15), 4)
    write_video(tmp_path / "v.avi", (sharp if number in (2, 5, 9) else blurred for number in range(12)))
    (tmp_path / "frames").mkdir()
    write_frames(tmp_path / "v.avi", tmp_path / "frames", 3, lambda share: None)
    frames = sorted((tmp_path / "frames").iterdir())
    assert len(frames) == 3
    assert min(sharpness(cv2.imread(str(frame))) for frame in frames) > 0.5 * sharpness(sharp)


MP4, MATROSKA = b"colrncl%c\0%c\0%c", b"\x55\xb0\x8f\x55\xb1\x81%c\x55\xba\x81%c"
BRIGHT, USUAL = [MP4 % (b"x", 9, 18), MATROSKA % (9, 16), MATROSKA % (9, 18)], [MP4 % (b"c", 1, 1), MATROSKA % (1, 1)]


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
