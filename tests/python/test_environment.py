"""Environment maps: orientation, turning and what is refused."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
import pytest
from splitnerf.data.environment import read_environment, rotate_environment, sample_environment
from splitnerf.data.images import write_image


def write_raw(path, pixels):
    """Writes floats as they are, NaN and negative ones too."""
    sink = oiio.ImageOutput.create(str(path))
    sink.open(str(path), oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.FLOAT))
    sink.write_image(np.ascontiguousarray(pixels, np.float32))
    sink.close()
    return path


def directions(height, width):
    """Unit vectors through the texels' centres: u = 0.5 - azimuth / (2 pi), v = polar angle / pi."""
    azimuth = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None]
    polar = np.pi * ((np.arange(height) + 0.5) / height)[:, None]
    parts = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def test_texels_are_met_at_their_directions_and_blend_between(tmp_path):
    radiance = np.random.default_rng(0).random((8, 16, 3), np.float32)
    write_image(tmp_path / "a.exr", radiance)
    assert np.array_equal(read_environment(tmp_path / "a.exr"), radiance)
    towards = directions(8, 16)
    assert sample_environment(radiance, 7 * towards) == pytest.approx(radiance, abs=1e-5)
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
    assert np.array_equal(rotate_environment(radiance, 90), np.roll(radiance, -2, axis=1))
    assert np.array_equal(rotate_environment(radiance, -90), np.roll(radiance, 2, axis=1))
    assert np.array_equal(rotate_environment(radiance, 360), radiance)
    # What came from d comes from d turned counter-clockwise.
    towards = directions(4, 8)
    turned = sample_environment(rotate_environment(radiance, 90), rotate_z(towards, np.pi / 2))
    assert turned == pytest.approx(radiance, abs=1e-5)


def test_a_turn_between_columns_keeps_each_row_and_moves_smoothly():
    radiance = np.random.default_rng(2).random((4, 8, 3), np.float32)
    turned = rotate_environment(radiance, 10.0)
    assert turned.dtype == np.float32
    assert turned.mean(axis=1) == pytest.approx(radiance.mean(axis=1), abs=1e-6)
    share = 10 / 45
    assert turned == pytest.approx((1 - share) * radiance + share * np.roll(radiance, -1, axis=1), abs=1e-6)


def test_slightly_negative_pixels_are_set_to_zero_and_said(tmp_path, capsys):
    radiance = np.ones((4, 8, 3))
    radiance[1, 2] = -1e-3
    read = read_environment(write_raw(tmp_path / "a.exr", radiance))
    assert np.array_equal(read, np.maximum(radiance, 0))
    assert "a.exr: 1 pixels were slightly negative; set to 0" in capsys.readouterr().err
