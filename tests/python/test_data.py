"""Datasets: layouts, the shared frame, and the truth maps."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from blender_data import ANGLE, SIZE, edit, make_blender, make_folders, poses_around
from splitnerf.data.dataset import dataset_fingerprint, load_dataset
from splitnerf.data.frames import has_test_split
from splitnerf.data.images import linear_to_srgb, read_image, srgb_to_linear, write_image
from splitnerf.data.normalisation import transform_points
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
    focal = 0.5 * SIZE / np.tan(0.5 * ANGLE)
    assert data.intrinsics[0] == pytest.approx([focal, focal, SIZE / 2, SIZE / 2])
    assert np.array_equal(data.box_from_world, np.eye(4))


def test_view_folders(tmp_path):
    root = make_folders(tmp_path)
    train, test = load_dataset(root, "train"), load_dataset(root, "test", downscale=2)
    assert (len(train), test.frame_names) == (12, ["test_009", "test_011"])
    focal = 0.5 * SIZE / np.tan(0.5 * ANGLE)
    assert train.intrinsics[0] == pytest.approx([focal, focal, SIZE / 2, SIZE / 2])
    poses = poses_around(np.zeros(3), 1.0, 14)
    assert test.world_poses == pytest.approx(np.array(poses[12:]), abs=1e-6)
    assert has_test_split(root)
    normals = np.full((SIZE, SIZE, 3), 0.5 * np.array([0, -0.6, 0.8]) + 0.5)
    write_image(root / "test_009/normal.png", normals)
    write_image(root / "test_009/albedo.png", np.full((SIZE, SIZE, 4), [0.5, 0.25, 1, 1]))
    truth, empty = load_view_truths(test)
    assert (truth.name, empty.normal) == ("test_009", None)
    centre = SIZE // 4
    assert truth.normal[centre, centre] == pytest.approx([0, -0.6, 0.8], abs=0.006)
    assert truth.normal_mask[centre, centre] and not truth.normal_mask[0, 0] and not truth.normal[0, 0].any()
    assert truth.albedo[centre, centre] == pytest.approx([128 / 255, 64 / 255, 1], abs=1e-4)  # linear


def test_downscale_divides_size_and_intrinsics(scene):
    data = load_dataset(scene, "train", downscale=5)
    assert data.images.shape[1:3] == (SIZE // 5, SIZE // 5)
    assert data.intrinsics[0] * 5 == pytest.approx(load_dataset(scene, "train").intrinsics[0])


def test_far_small_object_is_brought_into_the_box(tmp_path):
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
    other = data.in_box(np.diag([2.0, 2, 2, 1]) + 0.5 * np.eye(4, k=3))
    assert other.world_poses == pytest.approx(data.world_poses, abs=1e-5)
    assert other.poses[:, 0, 3] == pytest.approx(2 * data.world_poses[:, 0, 3] + 0.5, abs=1e-5)


def test_fingerprint_tells_scenes_apart_and_not_folders(scene, tmp_path):
    fingerprint = dataset_fingerprint(load_dataset(scene))
    assert fingerprint == dataset_fingerprint(load_dataset(make_blender(tmp_path / "moved")))
    assert fingerprint != dataset_fingerprint(load_dataset(make_blender(tmp_path / "moved", radius=0.9)))
    assert fingerprint != dataset_fingerprint(load_dataset(make_blender(tmp_path / "painted", grey=0.4)))


def test_truth_maps(scene):
    shape = (SIZE, SIZE)
    data = load_dataset(scene, "test", downscale=2)
    write_image(scene / "test/r_0_albedo.png", np.full((*shape, 4), [0.5, 0.25, 1, 1]))
    write_image(scene / "test/r_0_orm.png", np.full((*shape, 4), [1, 0.2, 0.8, 1]))
    coverage = np.ones((*shape, 1))
    coverage[0] = 0
    normals = np.concatenate([np.full((*shape, 3), [0, 0.6, 0.8]), coverage], axis=-1)
    write_image(scene / "test/r_0_normal.exr", normals * coverage)
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
    ("factor", "message"),
    [(0, "at least 1"), (-2, "at least 1"), (1.5, "whole number"), (SIZE + 1, "too small for downscale")],
)
def test_bad_downscale(scene, factor, message):
    with pytest.raises(InputError, match=message):
        load_dataset(scene, downscale=factor)


def test_unknown_split(scene):
    with pytest.raises(InputError, match="no split 'val'"):
        load_dataset(scene, "val")


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
    assert found.select([2, 4]).exposures.tolist() == [2.0, 1.0]


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
        np.testing.assert_allclose(
            srgb_to_linear(found.images[i][inside][:, :3]), truth[inside][:, :3], rtol=5e-3, atol=1e-4 * peak
        )
        assert (found.images[i][inside][:, :3] < 0.99 * white[i]).all()


def test_photos_with_the_curve_of_their_camera(tmp_path):
    root = make_blender(tmp_path, grey=0.5)
    edit(root, lambda meta: meta.update(gamma=2.2))
    edit(root, lambda meta: meta["frames"][1].update(gamma=0))
    found = load_dataset(root)
    for i, linear in ((0, (128 / 255) ** 2.2), (1, float(srgb_to_linear(np.float32(128 / 255))))):
        inside = found.images[i][found.images[i, ..., 3] > 0.99][:, :3]
        np.testing.assert_allclose(srgb_to_linear(inside), linear, rtol=1e-3)
