"""Data sets: layouts, the shared frame, truth maps, and lenses that bend."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from blender_data import SIZE, edit, make_blender, make_folders, poses_around, sphere_alpha, sphere_seen
from layout_scenes import CENTRE, LENS, RADIUS, opencv_points, seen_by_pixels, write_transforms
from splitnerf.data.dataset import dataset_fingerprint, load_dataset
from splitnerf.data.frames import has_test_split, read_frames
from splitnerf.data.images import linear_to_srgb, read_image, srgb_to_linear, write_image
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import Distortion, pixel_width, read_lens, sample_cubic, undistort
from splitnerf.data.normalisation import transform_plane, transform_points
from splitnerf.data.photos import load_photo
from splitnerf.data.truth import decode_clipped_normals, load_scene_truth, load_view_truths
from splitnerf.errors import InputError
from splitnerf.refinement.pixels import covered_pixels

REAL = Path(os.environ.get("SPLITNERF_DATA", "../shared/data"))


@pytest.fixture
def scene(tmp_path):
    return make_blender(tmp_path / "ball")


def test_blender_layout(scene):
    data = load_dataset(scene, "train")
    assert (data.name, len(data), data.images.shape) == ("ball", 12, (12, SIZE, SIZE, 4))
    assert data.images[0].dtype == data.poses.dtype == data.intrinsics.dtype == np.float32
    assert data.frame_names[:2] == ["r_0", "r_1"]
    assert data.intrinsics[0] == pytest.approx(LENS)
    assert np.array_equal(data.box_from_world, np.eye(4))
    small = load_dataset(scene, "train", downscale=5)
    assert small.images.shape[1:3] == (SIZE // 5, SIZE // 5)
    assert small.intrinsics[0] * 5 == pytest.approx(data.intrinsics[0])


def test_view_folders(tmp_path):
    root = make_folders(tmp_path)
    train, test = load_dataset(root, "train"), load_dataset(root, "test", downscale=2)
    assert (len(train), test.frame_names) == (12, ["test_9", "test_11"])
    assert train.intrinsics[0] == pytest.approx(LENS)
    poses = poses_around(np.zeros(3), 1.0, 14)
    assert test.world_poses == pytest.approx(np.array(poses[12:]), abs=1e-6)
    assert has_test_split(root)
    normals = np.full((SIZE, SIZE, 3), 0.5 * np.array([0, -0.6, 0.8]) + 0.5)
    write_image(root / "test_9/normal.png", normals)
    write_image(root / "test_9/albedo.png", np.tile([[0.5, 0.25, 1, 1], [0, 1, 0, 0]], (SIZE, SIZE // 2, 1)))
    truth, empty = load_view_truths(test)
    assert empty.normal is None
    centre = SIZE // 4
    assert truth.normal[centre, centre] == pytest.approx([0, -0.6, 0.8], abs=0.006)
    assert truth.normal_mask[centre, centre] and not truth.normal_mask[0, 0] and not truth.normal[0, 0].any()
    assert truth.albedo[centre, centre] == pytest.approx([128 / 255, 64 / 255, 1], abs=1e-4)  # linear


def test_normals_of_shiny_blender_are_whole(scene, capsys):
    """Those of NeRF-Blender, without `r_0_alpha.png`, have lost what is negative."""
    normal = np.array([-0.48, -0.6, 0.64])
    write_image(scene / "train/r_0_normal.png", np.full((SIZE, SIZE, 3), 0.5 * normal + 0.5))
    load_view_truths(load_dataset(scene, "train"))
    told = "have not the length 1; save them as normal.exr instead (r_0_normal.png)"
    assert told in capsys.readouterr().err
    write_image(scene / "train/r_0_alpha.png", np.ones((SIZE, SIZE)))
    truth = load_view_truths(load_dataset(scene, "train"))[0]
    centre = SIZE // 2
    assert truth.normal[centre, centre] == pytest.approx(normal, abs=0.006)
    assert truth.normal_mask[centre, centre] and not truth.normal_mask[0, 0] and told not in capsys.readouterr().err


@pytest.mark.parametrize(("masks", "downscale"), [(True, 1), (True, 5), (False, 5)])
def test_normals_are_scored_on_masks_or_where_half_of_a_pixel_is_opaque(tmp_path, capsys, masks, downscale):
    root = write_transforms(tmp_path, masks=masks)
    write_image(root / "images/v08_normal.png", np.tile(linear_to_srgb(np.float32([0.6, 0.48, 0.64])), (SIZE, SIZE, 1)))
    data = load_dataset(root, "test", downscale)
    assert np.array_equal(load_view_truths(data)[1].normal_mask, data.images[1, ..., 3] > (0.9 if masks else 0.5))
    assert "the length 1" not in capsys.readouterr().err


def test_radiance_a_little_below_0_is_noise(tmp_path):
    pixels = np.random.default_rng(11).uniform(0.1, 0.5, (16, 16, 3)).astype(np.float32)
    pixels[3, 4] = -0.01
    frame = Frame("a", tmp_path / "a.exr", np.eye(4), {"camera_angle_x": 0.5})
    write_image(tmp_path / "a.exr", pixels)
    rgba = load_photo(frame, 1, "object").rgba
    assert not rgba[3, 4, :3].any() and rgba[..., :3].any(axis=-1).sum() == 255
    for part, value in ((np.s_[3, 4], -0.06), (np.s_[3, 4:14], -0.04)):  # a tenth of the brightest, a thousandth of all
        pixels[part] = value
        write_image(tmp_path / "a.exr", pixels)
        with pytest.raises(InputError, match="a.exr: has NaN, infinite or negative pixels"):
            load_photo(frame, 1, "object")


@pytest.mark.parametrize("edge", [100, 16])
def test_far_small_object_is_brought_into_the_box(tmp_path, monkeypatch, edge):
    """By silhouettes that may be smaller than the photos."""
    monkeypatch.setattr("splitnerf.data.photos.SILHOUETTE_SIZE", edge)
    centre, radius = np.array([5.0, -3.0, 2.0]), 0.05
    root = make_blender(tmp_path / "far", centre, radius)
    data = load_dataset(root, "train")
    inside = data.box_from_world[:3, :3] @ centre + data.box_from_world[:3, 3]
    assert np.linalg.norm(inside) < 0.15
    assert 0.8 < data.box_from_world[0, 0] * radius <= 1.05
    assert transform_points(data.world_from_box, inside[None]) == pytest.approx(centre[None])
    world = np.array(json.loads((root / "transforms_train.json").read_text())["frames"][3]["transform_matrix"])
    assert data.poses[3, :3, :3] == pytest.approx(world[:3, :3], abs=1e-6)
    assert transform_points(data.world_from_box, data.poses[3, :3, 3]) == pytest.approx(world[:3, 3], abs=1e-4)


def test_another_internal_frame_changes_no_place_in_the_world(tmp_path):
    data = load_dataset(make_blender(tmp_path / "far", (5.0, -3.0, 2.0), 0.05))
    assert data.in_box(data.box_from_world.copy()) is data
    matrix = np.diag([2.0, 2, 2, 1]) + 0.5 * np.eye(4, k=3)
    other = data.in_box(matrix)
    assert other.world_poses == pytest.approx(data.world_poses, abs=1e-5)
    assert other.poses[:, 0, 3] == pytest.approx(2 * data.world_poses[:, 0, 3] + 0.5, abs=1e-5)
    assert transform_plane(matrix, np.array([0.6, 0, 0.8, 3])) == pytest.approx([0.6, 0, 0.8, 2 * 3 + 0.6 * 0.5])


def test_fingerprint_tells_scenes_apart_and_not_folders(scene, tmp_path):
    fingerprint = dataset_fingerprint(load_dataset(scene))
    assert fingerprint == dataset_fingerprint(load_dataset(make_blender(tmp_path / "moved")))
    assert fingerprint != dataset_fingerprint(load_dataset(make_blender(tmp_path / "moved", radius=0.9)))
    assert fingerprint != dataset_fingerprint(load_dataset(make_blender(tmp_path / "painted", grey=0.4)))


def test_truth_maps(scene):
    shape = (SIZE, SIZE)
    data = load_dataset(scene, "test", downscale=2)
    write_image(scene / "test/r_0_albedo.png", np.full((*shape, 4), [0.5, 0.25, 1, 1]))
    write_image(scene / "test/r_0_orm.png", np.tile([[1, 0.2, 0.8, 1], [1, 0.9, 0.1, 0]], (SIZE, SIZE // 2, 1)))
    coverage = np.ones((*shape, 1))
    coverage[0], coverage[2] = 0.78, 0.82  # of means below and above 0.9
    write_image(scene / "test/r_0_normal.exr", np.dstack([coverage * [0, 0.6, 0.8], coverage]))
    write_image(scene / "light.hdr", np.ones((4, 8, 3)))
    trimesh.creation.box().export(scene / "mesh.ply")
    truth, empty = load_view_truths(data)[:2]
    assert truth.albedo[5, 5] == pytest.approx([0.2158605, 0.0512695, 1], abs=1e-4)  # of the levels 128, 64, 255
    assert (truth.roughness[5, 5], truth.metallic[5, 5]) == pytest.approx((0.2, 0.8))
    assert truth.normal[5, 5] == pytest.approx([0, 0.6, 0.8])
    assert truth.normal_mask[1:].all() and not truth.normal_mask[0].any()
    assert truth.albedo.shape == (SIZE // 2, SIZE // 2, 3)
    assert empty.albedo is empty.roughness is empty.metallic is empty.normal is empty.normal_mask is None
    scene_truth = load_scene_truth(scene)
    assert scene_truth.light.shape == (4, 8, 3) and len(scene_truth.mesh.faces) == 12
    write_image(scene / "light.exr", np.ones((8, 16, 3)))
    assert load_scene_truth(scene).light.shape == (8, 16, 3)
    moved = load_scene_truth(scene, np.array([100.0, -20, 3])).mesh
    assert moved.vertices == pytest.approx(scene_truth.mesh.vertices - [100, -20, 3])
    assert load_scene_truth(scene / "test").light is None and load_scene_truth(scene / "test").mesh is None


def test_clipped_normals_are_restored_where_one_component_is_unknown():
    normals = np.array([[0.6, -0.48, 0.64], [0.6, 0.48, 0.64], [-0.6, -0.48, 0.64]])
    restored, known = decode_clipped_normals(linear_to_srgb(np.maximum(normals, 0)).astype(np.float32))
    assert known.tolist() == [True, True, False]
    assert restored[:2] == pytest.approx(normals[:2], abs=1e-5)
    assert not restored[2].any()


@pytest.mark.parametrize(
    ("split", "factor", "message"),
    [("train", 0, "at least 1"), ("train", -2, "at least 1"), ("train", 1.5, "whole number")]
    + [("train", SIZE + 1, "too small for downscale"), ("val", 1, "no split 'val'")],
)
def test_bad_choices(scene, split, factor, message):
    with pytest.raises(InputError, match=message):
        load_dataset(scene, split, factor)


@pytest.mark.parametrize("name", ["nerf_synthetic_400/chair", "scenes/boombox", "real/moldGoldCape"])
def test_real_scenes_fit_the_box_as_they_are(name):
    if not (REAL / name).is_dir():
        pytest.skip(f"{REAL / name} is absent; set SPLITNERF_DATA to the folder of real inputs")
    data = load_dataset(REAL / name, "test", downscale=4)
    assert np.array_equal(data.box_from_world, np.eye(4))
    for view, truth, pose in zip(data.images, load_view_truths(data), data.poses):
        if truth.normal is not None:
            seen = truth.normal_mask & (view[..., 3] > 0.99)
            assert (truth.normal[seen] @ pose[:3, 2] > -0.1).mean() > 0.98


def test_photos_are_brought_to_one_exposure(tmp_path):
    root = make_blender(tmp_path, grey=0.5)
    edit(root, lambda meta: [frame.update(exposure=[0.5, 1.0, 2.0][i % 3]) for i, frame in enumerate(meta["frames"])])
    found = load_dataset(root)
    linear = srgb_to_linear(np.float32(128 / 255))
    for i, exposure in enumerate(found.exposures):
        assert exposure == [0.5, 1.0, 2.0][i % 3]
        inside = found.images[i][found.images[i, ..., 3] > 0.99][:, :3]
        np.testing.assert_allclose(srgb_to_linear(inside), linear / exposure, rtol=0.01)
    chosen = found.select([2, 4])
    assert chosen.exposures.tolist() == chosen.stated.tolist() == [2.0, 1.0] and found.photographed
    for name in ("images", "poses", "intrinsics"):
        assert np.array_equal(getattr(chosen, name), getattr(found, name)[[2, 4]])


def test_clipped_pixels_of_a_short_exposure_are_known(tmp_path):
    root = make_blender(tmp_path, grey=1.0)
    edit(root, lambda meta: [frame.update(exposure=[0.8, 1.25][i % 2]) for i, frame in enumerate(meta["frames"])])
    assert covered_pixels(load_dataset(root)).saturated.all()
    edit(root, lambda meta: [frame.update(exposure=1.0) for frame in meta["frames"]])
    assert not covered_pixels(load_dataset(make_blender(tmp_path / "grey", grey=0.97))).saturated.any()


@pytest.mark.parametrize("peak", [0.5, 40.0])
def test_linear_photos_of_floats(tmp_path, peak):
    """EXR files with associated alpha: their radiance comes back at an exposure of 1, also far above 1; none is clipped."""
    root, linear = make_blender(tmp_path), []
    for i in range(12):
        rgba = read_image(root / f"train/r_{i}.png")
        rgba[..., :3] = np.random.default_rng(i).uniform(0.01, peak, rgba.shape[:2] + (3,))
        rgba[SIZE // 2, SIZE // 2, 3] = 0.5
        linear.append(rgba.copy())
        write_image(root / f"train/r_{i}.exr", np.dstack([rgba[..., :3] * rgba[..., 3:], rgba[..., 3]]))
        (root / f"train/r_{i}.png").unlink()
    edit(root, lambda meta: [frame.update(file_path=f"./train/r_{i}.exr") for i, frame in enumerate(meta["frames"])])
    found = load_dataset(root)
    assert not found.photographed and found.images.codes.dtype == np.uint16
    white = linear_to_srgb((1 / found.exposures).astype(np.float32))
    for i, truth in enumerate(linear):
        inside = truth[..., 3] > 0.4
        shown = found.images[i][inside][:, :3]
        np.testing.assert_allclose(srgb_to_linear(shown), truth[inside][:, :3], rtol=5e-3, atol=1e-4 * peak)
        assert (shown < 0.99 * white[i]).all()


def test_photos_with_the_curve_of_their_camera(tmp_path):
    root = make_blender(tmp_path, grey=0.5)
    edit(root, lambda meta: meta.update(gamma=2.2))
    edit(root, lambda meta: meta["frames"][1].update(gamma=0))
    found = load_dataset(root)
    for i, linear in ((0, (128 / 255) ** 2.2), (1, float(srgb_to_linear(np.float32(128 / 255))))):
        inside = found.images[i][found.images[i, ..., 3] > 0.99][:, :3]
        np.testing.assert_allclose(srgb_to_linear(inside), linear, rtol=1e-3)


# ---- lenses that bend ----


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
def test_a_bent_photo_is_as_a_pinhole_takes_it(name, monkeypatch):
    """In strips of seven rows."""
    monkeypatch.setattr("splitnerf.data.lens.STRIP", 7 * WIDTH)
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
    # where all samples of the cubic lie in the photo
    middle = inside & (u > 4) & (u < WIDTH - 4) & (v > 4) & (v < HEIGHT - 4)
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
    for i, power in enumerate((3, 5, 7, 9)):  # x - x^power / power has its top at 1
        assert Distortion(tuple(-np.eye(4)[i] / power)).reach == pytest.approx(1)
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
        alpha = sphere_seen(np.array(frame["transform_matrix"]), x, y, CENTRE, RADIUS)
        write_image(root / f"images/v{i:02d}.png", np.full((SIZE, SIZE, 3), 0.25) + 0.5 * alpha[..., None])
        write_image(root / f"masks/v{i:02d}.png.png", alpha)
    return root


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
    assert by_name["v03"].lens["fl_y"] == 2 * LENS[0]  # the file's pixels are square, at another focal length
    assert by_name["v05"].lens["camera_angle_x"] == 0.7 and "fl_x" not in by_name["v05"].lens
    for value in (True, False, 1, 0):
        assert read_lens({"fl_x": 9, "k1": 0.1, "is_fisheye": value}, "x")[1].fisheye == value


def test_the_width_of_a_pixel_is_a_median():
    poses, lenses = np.tile(np.eye(4), (3, 1, 1)), np.float32([[10, 99, 5, 5]] * 3)
    poses[:, 2, 3] = 1, 2, 9
    for nearest, width in ((0.0, 2 / 10), (3.0, 3 / 10)):
        assert pixel_width(poses, lenses, np.zeros(3), nearest=nearest) == pytest.approx(width)


def test_zeros_bend_nothing(tmp_path):
    zeros = dict.fromkeys(("k1", "k2", "k3", "k4", "p1", "p2"), 0.0)
    plain = load_dataset(write_transforms(tmp_path / "a", masks=True))
    unused = {"rolling_shutter": [0, 0, 0], "latlong": False, "aabb_scale": 4, "is_fisheye": False}
    for model in ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        data = load_dataset(write_transforms(tmp_path / model, masks=True, **zeros, **unused, camera_model=model))
        assert data.known is None and np.array_equal(data.images, plain.images)
        assert all(frame.distortion is None for frame in read_frames(tmp_path / model, "train")[0])


def test_colours_beside_a_mask_do_not_bleed_into_the_object(tmp_path):
    """With straight alpha the colours of empty pixels mean nothing: here they are white, the sphere's are black."""
    write_transforms(tmp_path, **STRONG)
    x, y = seen_by_pixels(STRONG, LENS, SIZE, SIZE)
    for i, frame in enumerate(json.loads((tmp_path / "transforms.json").read_text())["frames"]):
        alpha = sphere_seen(np.array(frame["transform_matrix"]), x, y, CENTRE, RADIUS)
        write_image(tmp_path / f"images/v{i:02d}.png", np.dstack([1 - alpha] * 3 + [alpha]))
    data = load_dataset(tmp_path)
    assert data.images[data.images[..., 3] > 0.1][:, :3].max() < 0.05
