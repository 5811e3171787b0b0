"""Lenses: photos that a lens bent come out as a pinhole takes them, and models that nobody knows are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from blender_data import SIZE, edit, sphere_alpha
from layout_scenes import CENTRE, COUNT, LENS, RADIUS, opencv_points, seen_by_pixels, write_transforms
from splitnerf.data.dataset import load_dataset
from splitnerf.data.frames import read_frames
from splitnerf.data.images import write_image
from splitnerf.data.lens import Distortion, read_lens, sample_cubic, undistort

HEIGHT, WIDTH, CAMERA = 90, 130, (120.0, 118.0, 63.0, 47.0)
FOX = {"k1": 0.0578, "k2": -0.0805, "p1": -0.00098, "p2": 0.00016}  # about those of instant-ngp's photos of a fox
LENSES = {
    "barrel": {"k1": -0.25, "k2": 0.06},
    "pincushion": {"k1": 0.2},
    "fox": FOX,
    "tangential": {"p1": 0.02, "p2": -0.015},
    "three terms": {"k1": -0.1, "k2": 0.05, "k3": -0.02},
    "fisheye": {"k1": 0.05, "k2": -0.02, "k3": 0.2, "k4": -0.1, "fisheye": True},
    "plain fisheye": {"fisheye": True},
}


def distortion(k: dict) -> Distortion:
    model = "OPENCV_FISHEYE" if k.get("fisheye") else "OPENCV"
    numbers = {name: value for name, value in k.items() if name != "fisheye"}
    return read_lens({"fl_x": 1.0, "camera_model": model} | numbers, "here")[1]


def pattern(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """[..., 2] a smooth chequered plane at distance 1, in [0, 1]."""
    return np.stack([0.5 + 0.4 * np.sin(23 * x) * np.sin(19 * y), 0.5 + 0.5 * np.cos(9 * x - 14 * y)], axis=-1)


@pytest.mark.parametrize("name", LENSES)
def test_a_bent_photo_is_as_a_pinhole_takes_it(name):
    k = LENSES[name]
    photo = pattern(*seen_by_pixels(k, CAMERA, HEIGHT, WIDTH)).astype(np.float32)
    straight, known = undistort(photo, distortion(k), np.array(CAMERA))
    fx, fy, cx, cy = CAMERA
    row, column = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    x, y = (column - cx) / fx, (row - cy) / fy
    u, v = opencv_points(x, y, k)
    u, v = u * fx + cx, v * fy + cy
    inside = (u > 0.5) & (u < WIDTH - 0.5) & (v > 0.5) & (v < HEIGHT - 0.5)
    assert (known == inside).mean() > 0.999 and known.mean() > 0.7
    middle = (
        inside & (u > 4) & (u < WIDTH - 4) & (v > 4) & (v < HEIGHT - 4)
    )  # where all samples of the cubic lie in the photo
    error = np.abs(straight - pattern(x, y))
    assert error[middle].max() < 0.004 and error[inside].max() < 0.03
    assert np.abs(photo - pattern(x, y))[middle].max() > 0.03  # it was bent


def test_quadratic_functions_are_met_exactly_between_pixels():
    """Of cubic convolutions only that with a = -1/2 does it."""

    def quadratic(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 3e-3 * x * x - 2e-3 * x * y + 1e-3 * y * y + 0.02 * x - 0.01 * y + 0.1

    y, x = np.mgrid[:20, :24].astype(np.float64)
    places = np.random.default_rng(0).uniform(1, 18, size=(7, 9, 2))
    found = sample_cubic(torch.from_numpy(quadratic(x, y)[None, None].astype(np.float32)), torch.from_numpy(places))
    np.testing.assert_allclose(found[..., 0], quadratic(*np.moveaxis(places, -1, 0)), atol=2e-5)


def test_a_polynomial_that_folds_back_shows_no_second_image():
    """1 - 1.5 r^2 grows up to r = 0.4714, and is back in the photo's middle at r = 0.8."""
    lens = Distortion((-1.5, 0.0, 0.0, 0.0))
    assert lens.reach == pytest.approx(np.sqrt(1 / 4.5))
    _, known = undistort(np.ones((HEIGHT, WIDTH, 1), np.float32), lens, np.array([100.0, 100, 65, 45]))
    row, column = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    r = np.hypot(column - 65, row - 45) / 100
    assert known[r < 0.46].all() and not known[r > 0.48].any()
    assert Distortion((0.1, 0.1, 0.1, 0.1)).reach == np.inf
    assert Distortion((-1.0, 0.5, 0, 0)).reach == np.inf  # its slope 1 - 3 r^2 + 2.5 r^4 stays above 0


def bent_scene(root, k: dict, **keys):
    """The sphere's photos with masks through a lens."""
    write_transforms(root, masks=True, **keys)
    x, y = seen_by_pixels(k, LENS, SIZE, SIZE)
    for i, frame in enumerate(json.loads((root / "transforms.json").read_text())["frames"]):
        alpha = sphere_seen(np.array(frame["transform_matrix"]), x, y)
        write_image(root / f"images/v{i:02d}.png", np.full((SIZE, SIZE, 3), 0.25) + 0.5 * alpha[..., None])
        write_image(root / f"masks/v{i:02d}.png.png", alpha)
    return root


def sphere_seen(pose: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Coverage of the sphere in the directions (x, y, 1) of a camera, y down."""
    rays = np.stack([x, -y, -np.ones_like(x)], axis=-1) @ pose[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    offset = pose[:3, 3] - CENTRE
    return ((rays @ offset) ** 2 > offset @ offset - RADIUS**2).astype(np.float32)


STRONG = {"k1": 0.9, "p1": 0.01}


@pytest.mark.parametrize(
    ("k", "keys"),
    [
        (STRONG, STRONG | {"camera_model": "OPENCV"}),
        (STRONG, STRONG),
        ({"k1": 0.9}, {"k1": 0.9, "k2": 0, "camera_model": "RADIAL"}),
        ({"k1": 0.4, "fisheye": True}, {"k1": 0.4, "camera_model": "OPENCV_FISHEYE"}),
        ({"k1": 0.4, "fisheye": True}, {"k1": 0.4, "is_fisheye": True}),
    ],
)
def test_photos_and_masks_of_a_transforms_file_are_undistorted(tmp_path, k, keys):
    data = load_dataset(bent_scene(tmp_path, k, **keys))
    assert data.intrinsics[0] == pytest.approx(LENS)
    assert data.known is not None and 0.6 < data.known.mean() < 0.99 and data.known[:, 10:-10, 10:-10].all()
    assert not data.images[~data.known].any()
    for image, known, pose in zip(data.images, data.known, data.world_poses):
        expected = sphere_alpha(pose, CENTRE, RADIUS)
        wrong = (np.abs(image[..., 3] - expected) > 0.5) & known
        assert wrong.sum() <= 12  # of an edge of 40 pixels about; 100 and more without undistortion
        colour, alpha = image[known][:, 0], image[known][:, 3]
        partly = (alpha > 0.01) & (alpha < 0.99)  # where a hard edge, sampled, leaves [0, 1], alpha is clipped
        np.testing.assert_allclose(colour[partly], 0.25 + 0.5 * alpha[partly], atol=0.01)
        np.testing.assert_allclose(colour, 0.25 + 0.5 * alpha, atol=0.1)


def test_a_frame_may_have_a_lens_of_its_own(tmp_path):
    bent_scene(tmp_path, {"k1": 0.9}, k1=0.9)
    edit(tmp_path, lambda m: m["frames"][3].update(k1=0.0, fl_x=2 * LENS[0], camera_model="PINHOLE"), "transforms.json")
    edit(tmp_path, lambda m: m["frames"][5].update(k1=None, camera_angle_x=0.7), "transforms.json")
    frames, _ = read_frames(tmp_path, "train")
    by_name = {frame.name: frame for frame in frames}
    assert by_name["v03"].distortion is None and by_name["v03"].lens["fl_x"] == 2 * LENS[0]
    assert by_name["v04"].distortion == Distortion((0.9, 0, 0, 0)) == by_name["v05"].distortion
    assert "fl_y" not in by_name["v03"].lens  # that of the file belongs to another focal length
    assert by_name["v05"].lens["camera_angle_x"] == 0.7 and "fl_x" not in by_name["v05"].lens


def test_zeros_bend_nothing(tmp_path):
    zeros = dict.fromkeys(("k1", "k2", "k3", "k4", "p1", "p2"), 0.0)
    plain = load_dataset(write_transforms(tmp_path / "a", masks=True))
    for model in ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        data = load_dataset(write_transforms(tmp_path / model, masks=True, **zeros, camera_model=model))
        assert data.known is None and np.array_equal(data.images, plain.images)
        assert all(frame.distortion is None for frame in read_frames(tmp_path / model, "train")[0])


def test_colours_beside_a_mask_do_not_bleed_into_the_object(tmp_path):
    """With straight alpha the colours of empty pixels mean nothing: here they are white, the sphere's are black."""
    write_transforms(tmp_path, **STRONG)
    x, y = seen_by_pixels(STRONG, LENS, SIZE, SIZE)
    for i, frame in enumerate(json.loads((tmp_path / "transforms.json").read_text())["frames"]):
        alpha = sphere_seen(np.array(frame["transform_matrix"]), x, y)
        write_image(tmp_path / f"images/v{i:02d}.png", np.dstack([1 - alpha] * 3 + [alpha]))
    data = load_dataset(tmp_path)
    assert data.images[data.images[..., 3] > 0.1][:, :3].max() < 0.05


def test_keys_that_mean_nothing_are_left_alone(tmp_path):
    data = load_dataset(
        write_transforms(tmp_path, rolling_shutter=[0, 0, 0], latlong=False, aabb_scale=4, is_fisheye=False)
    )
    assert data.known is None and len(data) == COUNT - 2
