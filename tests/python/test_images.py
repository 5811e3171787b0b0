"""Image files and environment maps: what is read is what was written, averages and turns are in linear light."""

import os
import subprocess
import sys

import numpy as np
import pytest
from blender_data import directions_of_map, write_exr
from PIL import Image
from scipy.spatial.transform import Rotation
from splitnerf.data import environment, images
from splitnerf.data.environment import read_environment, rotate_environment, sample_environment
from splitnerf.data.images import write_image
from splitnerf.data.pixels import averaged_codes


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_levels_survive_a_png_exactly(tmp_path, channels):
    """Straight alpha of 0 and 1 as well."""
    levels = np.random.default_rng(0).integers(0, 256, (7, 9, channels))
    levels[:2, :, 3:] = [[[0]], [[1]]]
    images.write_image(tmp_path / "a.png", levels / 255)
    assert np.array_equal(images.to_uint8(images.read_image(tmp_path / "a.png")), levels)
    assert images.to_uint8(np.array([-0.1, 1.2])).tolist() == [0, 255]
    # Columns of a JPEG keep their own colours.
    stripes = np.tile([[1.0, 0, 0], [0, 0, 1]], (16, 8, 1))
    images.write_image(tmp_path / "a.jpg", stripes)
    assert np.abs(images.read_image(tmp_path / "a.jpg") - stripes).max() < 0.1


def test_exr_is_exact_and_hdr_within_its_mantissa(tmp_path):
    radiance = np.exp(np.random.default_rng(1).normal(0, 2, (8, 16, 3))).astype(np.float32)
    images.write_image(tmp_path / "a.exr", radiance)
    assert np.array_equal(images.read_radiance(tmp_path / "a.exr"), radiance)
    images.write_image(tmp_path / "half.exr", np.full((2, 2, 3), 2049.0), half=True)
    assert (images.read_image(tmp_path / "half.exr") == 2048).all()  # of 11 bits
    images.write_image(tmp_path / "a.hdr", radiance)
    error = np.abs(images.read_radiance(tmp_path / "a.hdr") - radiance)
    assert (error <= radiance.max(axis=-1, keepdims=True) / 128).all()


def test_the_srgb_curve_keeps_shape_and_dtype():
    for dtype in (np.float32, np.float64):
        values = np.linspace(0, 1, 6, dtype=dtype).reshape(2, 3)[:, ::-1]
        coded = images.linear_to_srgb(values)
        assert coded.dtype == dtype and coded.shape == (2, 3)
        assert images.srgb_to_linear(coded) == pytest.approx(values, abs=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("factor", [2, 3])
def test_photos_are_averaged_to_a_step_of_16_bits(dtype, factor):
    """With colours that weigh by alpha; and with all alike, what the photo shows there."""
    values = np.random.default_rng(4).random((13, 11, 4))
    values[:6, :6, 3], values[6:9, :, 3] = 0, 1
    codes = values.astype(dtype) if dtype == np.float32 else np.rint(values * np.iinfo(dtype).max).astype(dtype)
    floats = codes / (1 if dtype == np.float32 else np.iinfo(dtype).max)
    weighed, alike = (averaged_codes(codes, factor, object_alone=alone) for alone in (True, False))
    linear, alpha = images.srgb_to_linear(floats[..., :3]), floats[..., 3:]
    coverage = images.area_average(alpha, factor)
    of_object = images.area_average(linear * alpha, factor) / np.maximum(coverage, 1e-8)
    np.testing.assert_allclose(weighed[..., :3] / 65535, images.linear_to_srgb(of_object), atol=1.6e-5)
    np.testing.assert_allclose(weighed[..., 3:] / 65535, coverage, atol=1.6e-5)
    of_all = images.linear_to_srgb(images.area_average(linear, factor))
    np.testing.assert_allclose(alike[..., :3] / 65535, of_all, atol=1.6e-5)
    assert np.array_equal(weighed[..., 3], alike[..., 3]) and weighed[0, 0].tolist() == [0] * 4
    assert averaged_codes(codes, 1) is codes


def test_write_rejects_what_it_cannot_store(tmp_path):
    nan, wide = np.full((2, 2, 3), np.nan), np.ones((2, 2, 5))
    for name, pixels, told in (
        ("a.bmp", nan + 1, "unknown image f"),
        ("a.png", nan, "finite"),
        ("a.png", wide, "H, W"),
    ):
        with pytest.raises(ValueError, match=told):
            images.write_image(tmp_path / name, pixels)
    assert not list(tmp_path.iterdir())


def test_a_black_mask_of_one_bit_a_pixel_is_as_small_as_that(tmp_path):
    Image.new("1", (2000, 2000)).save(tmp_path / "mask.png", optimize=True)
    assert (tmp_path / "mask.png").stat().st_size < 2000**2 / 4096
    assert images.read_image(tmp_path / "mask.png").shape == (2000, 2000, 1)


def test_texels_are_met_at_their_directions_and_blend_between(tmp_path):
    radiance = np.random.default_rng(0).random((8, 16, 3), np.float32)
    write_image(tmp_path / "a.exr", radiance)
    assert np.array_equal(read_environment(tmp_path / "a.exr"), radiance)
    towards = directions_of_map(8)
    assert sample_environment(radiance, 7 * towards) == pytest.approx(radiance, abs=1e-5)
    assert np.array_equal(environment.texels_of_directions(7 * towards.reshape(-1, 3), 8), np.arange(8 * 16))
    # Half a texel on: the mean of neighbours, across the seam too (the last column's neighbour is the first).
    half = rotate_z(towards, -np.pi / 16)
    expected = 0.5 * (radiance + np.roll(radiance, -1, axis=1))
    assert sample_environment(radiance, half) == pytest.approx(expected, abs=1e-5)
    poles = sample_environment(radiance, np.array([[0.0, 0, 1], [0, 0, -1]]))
    assert np.isfinite(poles).all()


def rotate_z(vectors, angle):
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def test_a_quarter_turn_of_light_is_a_quarter_turn_of_columns():
    radiance = np.random.default_rng(1).random((4, 8, 3), np.float32)
    for degrees, columns in ((90, -2), (-90, 2), (360, 0)):
        assert np.array_equal(rotate_environment(radiance, degrees), np.roll(radiance, columns, axis=1))
    # What came from d comes from d turned counter-clockwise.
    towards = directions_of_map(4)
    turned = sample_environment(rotate_environment(radiance, 90), rotate_z(towards, np.pi / 2))
    assert turned == pytest.approx(radiance, abs=1e-5)


def test_light_is_turned_into_another_world():
    """Of a map that shows 2 plus the direction: what a texel shows is the direction in the map's world."""
    towards, turn = directions_of_map(32), Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
    turned = environment.turn_environment((2 + towards).astype(np.float32), turn)
    assert turned == pytest.approx(2 + towards @ turn.T, abs=0.01)


def test_what_is_not_known_of_the_surroundings_has_no_part():
    """The horizon lies between a row of them and one that is known."""
    surroundings = np.full((16, 32, 4), [9, 9, 9, 0], np.float32)
    surroundings[8:] = [0.2, 0.4, 0.8, 1.0]
    radiance, known = environment.seen_at(surroundings, np.array([[0, 0, -1.0], [0, 0, 1], [0.8, 0.6, 0]]))
    assert known == pytest.approx([1, 0, 0.5]) and not radiance[1].any()
    assert radiance[[0, 2]] == pytest.approx(np.tile([0.2, 0.4, 0.8], (2, 1)))


def test_a_turn_between_columns_keeps_each_row_and_moves_smoothly():
    radiance = np.random.default_rng(2).random((4, 8, 3), np.float32)
    turned = rotate_environment(radiance, 10.0)
    assert turned.dtype == np.float32
    assert turned.mean(axis=1) == pytest.approx(radiance.mean(axis=1), abs=1e-6)
    share = 10 / 45
    assert turned == pytest.approx((1 - share) * radiance + share * np.roll(radiance, -1, axis=1), abs=1e-6)


def test_slightly_negative_pixels_are_set_to_zero_and_said(tmp_path, capsys):
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[1, 2] = -1e-3
    read = read_environment(write_exr(tmp_path / "a.exr", radiance))
    assert np.array_equal(read, np.maximum(radiance, 0))
    assert "a.exr: 1 pixels were slightly negative; set to 0" in capsys.readouterr().err


FORKS = """
import os, signal, sys
from pathlib import Path
import numpy as np
from splitnerf.data.images import read_image, write_image
pixels = np.ones((256, 256, 3), np.float32)
for name in ("parent.exr", "child.exr"):
    if name == "child.exr" and os.fork():
        sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
    signal.alarm(30)  # ends a child that waits
    write_image(Path(name), pixels)
os._exit(int(read_image(Path("child.exr")).sum() != pixels.sum()))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_program_reads_and_writes_exr(tmp_path):
    """After its parent has: threads of the parent's are not there."""
    assert subprocess.run([sys.executable, "-c", FORKS], cwd=tmp_path).returncode == 0
