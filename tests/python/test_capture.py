"""From photographs to data: each part against closed forms, and the whole on a painted ball."""

import fcntl
import json
import re
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing
from dataclasses import astuple, replace
from types import SimpleNamespace
from unittest.mock import Mock

import cv2
import numpy as np
import pycolmap
import pytest
from blender_data import directions_of_map, look_at
from layout_scenes import seen_by_pixels
from PIL import Image
from scipy.spatial.transform import Rotation
from splitnerf.cli import BAD_INPUT, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.frames import TEST_STRIDE
from splitnerf.data.images import linear_to_srgb, read_image, srgb_to_linear, write_image
from splitnerf.errors import InputError
from splitnerf.files import LOCK, PARTIAL, own_folder
from splitnerf_tools.capture import masks, poses
from splitnerf_tools.capture import prepare as preparation
from splitnerf_tools.capture.photographs import find_photographs
from splitnerf_tools.capture.photometry import find_exposures
from splitnerf_tools.capture.poses import LEAST_SEEN, Lens, Reconstruction
from splitnerf_tools.capture.surroundings import FAINT, HEIGHT, Shot, surroundings
from splitnerf_tools.capture.undistorted import pinhole_of, undistort, without_vignetting
from splitnerf_tools.capture.world import World, meeting_point, object_points, settle
from splitnerf_tools.report.drawings import SIDE
from table_scene import BALL, CAMERA, RADIUS, TABLE_RADIUS, photograph, ring, surface_colours, write_photos
from test_separation import TrueField, write_ball_on_floor
from tiny_runs import refused

PLAIN = Lens(320, 240, 320.0, 320.0, 160.0, 120.0, 0.0, 0.0, 0.0, 0.0)
LENS = Lens(320, 240, 320.0, 160.0, 240.0, 120.0, 0.0, 0.0, 0.0, 0.0)
DOUBTS = [(20, 19, 0.35, False), (20, 18, 0.0, True), (20, 20, 0.45, True), (11, 11, 0.35, False), (10, 10, 0.35, True)]
POSSIBLE = [(0.98, 300, True), (1.0, 1700, True), (0.96, 300, False), (1.0, 80, False), (1.0, 1900, False)]
LOST = "its camera was not found: too little in common with the others"
KINDS = ["around", "turntable", "three sizes", "zoomed", "squeezed"]


def camera_points(scene: Reconstruction, photo: int) -> np.ndarray:
    """[m, 3] the points in OpenCV's axes of a photo's camera."""
    camera = np.linalg.inv(scene.poses[photo] @ np.diag([1.0, -1, -1, 1]))
    return scene.points @ camera[:3, :3].T + camera[:3, 3]


def found_scene(n: int = 12) -> tuple[Reconstruction, np.ndarray]:
    """What structure from motion would find of the painted ball, and which of its points lie on it."""
    random = np.random.default_rng(0)
    ball = random.normal(size=(400, 3))
    ball = BALL + RADIUS * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    ball = ball[ball[:, 2] > 0.15]
    table = np.c_[random.uniform(-1, 1, (1500, 2)), np.zeros(1500)]
    table = table[np.linalg.norm(table[:, :2], axis=1) > 0.5]
    far = random.normal(size=(200, 3)) * 10 + 20
    points = np.concatenate([ball, table, far])
    names, seen = [f"p_{i:02d}.MP" for i in range(n)], (np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    return Reconstruction(names, ring(n), [PLAIN] * n, points, *seen, error=0.3), np.arange(len(points)) < len(ball)


def moved(scene: Reconstruction, seed: int) -> Reconstruction:
    """The scene in another frame."""
    rotation, scale, shift = Rotation.random(random_state=seed).as_matrix(), 7.0, np.array([3.0, -5, 2])
    poses = scene.poses.copy()
    poses[:, :3, :3], poses[:, :3, 3] = rotation @ poses[:, :3, :3], scale * poses[:, :3, 3] @ rotation.T + shift
    return replace(scene, poses=poses, points=scale * scene.points @ rotation.T + shift)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_world_stands_on_its_table(seed):
    scene, of_ball = found_scene()
    world = settle(moved(scene, seed), 0)
    assert world.table_radius == pytest.approx(1.22, abs=0.03)  # 95 % of a square of 2 x 2 without its middle
    assert np.allclose(world.scene.points[:-200], scene.points[:-200], atol=0.01)  # the others are far away
    assert np.allclose(world.scene.poses, scene.poses, atol=0.01)  # 3 from the ball, the first one over the x axis
    assert (world.object_points == of_ball).mean() > 0.99
    before, after = (camera_points(found, 3) for found in (scene, world.scene))
    assert np.allclose(after, before, atol=1e-6)


def test_without_a_table_up_is_the_cameras_mean():
    """And a camera that looks elsewhere does not move the centre."""
    scene, of_ball = found_scene()
    alone = replace(scene, points=scene.points[of_ball])
    world = settle(moved(alone, 0), 0)
    assert not world.table and np.allclose(world.scene.points[:, 2], alone.points[:, 2] - BALL[2], atol=0.03)
    astray = look_at(np.array([3.0, 0, 1]), np.array([0, 2.0, 1]))
    assert np.allclose(meeting_point(np.array([*scene.poses, astray])), BALL, atol=0.01)


def test_the_object_is_what_hangs_together_and_what_is_over_it():
    """As a lid; not a smaller thing beside it, another far over it, the table or a few lonely points."""
    random = np.random.default_rng(0)
    parts = [(600, 0, 0.4, 0.3), (40, 0, 1.0, 0.1), (200, 0.6, 0.3, 0.1), (200, 0, 2.4, 0.1), (5, 0, 1.4, 0.02)]
    points = [random.uniform(-edge, edge, (n, 3)) + [x, 0, z] for n, x, z, edge in parts]
    table = random.uniform([-0.5, -0.5, 0.01], [0.5, 0.5, 0.02], (200, 3))
    found = object_points(np.concatenate([*points, table]), BALL, True)
    assert found[:640].all() and not found[640:].any()


def test_exposures_and_vignetting_come_back():
    """Without observations they are the files'; a point's 1 % is shared by variances: 0.02 of values, 0.02 of files, 0.18."""
    random = np.random.default_rng(1)
    n, m = 12, 800
    gains = np.exp(random.permutation(np.linspace(-0.5, 0.5, n)))
    radiance = random.uniform(0.05, 0.9, m)
    photo, point = np.divmod(random.choice(n * m, 5000, replace=False), m)
    radii = random.uniform(0, 1, 5000)
    values = gains[photo] * (1 + 0.3 * radii**2 - 0.6 * radii**4) * radiance[point]
    values *= np.exp(random.normal(scale=0.02, size=5000))
    values[random.random(5000) < 0.05] *= 2  # shiny
    values[:40] = 0
    found = find_exposures(photo, point, values.clip(0, 1), radii, np.full(n, np.nan))
    assert abs(np.log(found.gains / gains)).max() < 0.015
    assert abs(np.array([[0.25, 0.0625], [1, 1]]) @ (np.array(found.vignetting) - [0.3, -0.6])).max() < 0.02
    found = find_exposures(*np.zeros((2, 0), int), *np.zeros((2, 0)), np.array([1.0, np.nan, 4.0]))
    assert np.allclose(found.gains, [0.5, 1, 2], rtol=1e-4) and found.vignetting == (0.0, 0.0)
    found = find_exposures(np.arange(2), np.zeros(2, int), np.array([0.4, 0.404]), np.array([0.0, 1.0]), np.ones(2))
    shares = [*found.vignetting, np.log(found.gains[1] / found.gains[0])] / np.log(1.01)
    assert shares == pytest.approx(np.array([0.09, 0.09, 0.02]) / 0.22, rel=0.02)


def test_undistorted_photos_are_pinhole_images():
    lens = Lens(320, 240, 300.0, 302.0, 165.0, 117.0, -0.08, 0.02, 0.001, -0.0008)
    bends = {name: getattr(lens, name) for name in ("k1", "k2", "p1", "p2")}
    slopes = np.stack(seen_by_pixels(bends, (lens.fx, lens.fy, lens.cx, lens.cy), 240, 320), axis=-1)

    def pattern(s: np.ndarray) -> np.ndarray:
        return (127 + 60 * np.sin(25 * s[..., :1] + 3) * np.cos(22 * s[..., 1:]) + 30 * s[..., :1]).repeat(3, -1)

    photo = np.round(pattern(slopes)).astype(np.uint8)
    for max_size in (0, 160, 640):
        pinhole = pinhole_of(lens, max_size)
        assert max(pinhole.width, pinhole.height) == min(max_size or 320, 320)
        image = undistort(photo, lens, pinhole)
        y, x = np.mgrid[: pinhole.height, : pinhole.width] + 0.5
        expected = pattern(np.stack([(x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy], axis=-1))
        assert abs(image - expected).max() < 2.5
    assert astuple(PLAIN.resized(160, 60))[:6] == (160, 60, 160, 80, 80, 30)


def test_vignetting_is_taken_out():
    """White stays white, what gets brighter than it becomes white, and nothing gets more than five times as bright."""
    lens, photo = replace(PLAIN, cx=140.0, cy=130.0), np.full((240, 320, 3), 100, np.uint8)
    photo[125:135, 205:215], photo[-10:, :10] = 255, 250
    y, x = np.mgrid[:240, :320] + 0.5
    squared = ((x - 140) ** 2 + (y - 130) ** 2)[..., None] / (160**2 + 120**2)
    light = srgb_to_linear(photo / np.float32(255)) / np.maximum(1 + 0.2 * squared - 0.8 * squared**2, 0.2)
    expected = np.where(photo == 255, 255, 255 * linear_to_srgb(light.clip(0, 1).astype(np.float32)))
    assert abs(without_vignetting(photo, lens, (0.2, -0.8)) - expected).max() < 0.51


def seen_world() -> tuple[World, list[np.ndarray], list[np.ndarray]]:
    """A world whose photos by LENS show its points, where the ball does not hide them; the photos, and the ball's true masks."""
    scene, _ = found_scene()
    world, seen = settle(replace(scene, lenses=[LENS] * len(scene.names)), 0), []
    pairs = [photograph(pose, 320.0, 480, 480, frequency=0.6) for pose in scene.poses]
    photos, truth = ([image[::2, :320] for image in images] for images in zip(*pairs))
    for i, ball in enumerate(truth):
        local = camera_points(world.scene, i) @ LENS.matrix.T
        at = local[:, :2] / local[:, 2:]
        x, y = np.floor(at).astype(int).T
        shown = np.flatnonzero((local[:, 2] > 0) & (x >= 0) & (x < 320) & (y >= 0) & (y < 240))
        shown = shown[ball[y[shown], x[shown]] == world.object_points[shown]]
        seen.append((np.full(len(shown), i), shown, at[shown]))
    seen = dict(zip(("photo_of", "point_of", "observed"), map(np.concatenate, zip(*seen))))
    return replace(world, scene=replace(world.scene, **seen)), photos, truth


def test_the_table_of_the_cameras_world_is_that_of_the_masks(tmp_path, monkeypatch):
    write_ball_on_floor(tmp_path)
    monkeypatch.setattr(masks, "train_field", lambda dataset, **_: TrueField(dataset.world_from_box))
    next(masks.find_masks(tmp_path, SimpleNamespace(table=True), 0, True, lambda share: None))
    table = json.loads((tmp_path / "ground.json").read_text())
    assert [*table["normal"], table["offset"]] == pytest.approx([0, 0, 1, 0], abs=1e-5)


def one_camera_of_900_pixels(n: int) -> pycolmap.SyntheticDatasetOptions:
    """Of n photos."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = 1, 1, n
    options.camera_model_id, options.camera_params = pycolmap.CameraModelId.RADIAL, [900, 512, 384, 0.05, 0.01]
    return options


def test_a_camera_that_nearly_no_points_hold_is_none():
    """The others keep theirs, with the lens in OpenCV's model. Points farther than two pixels from where photos see them are
    none, and of more than ten photos, those that two of them show."""
    model = pycolmap.synthesize_dataset(one_camera_of_900_pixels(12))
    far, near, rare = sorted(model.points3D, key=lambda key: -model.points3D[key].track.length())[:3]
    weak = model.images[model.reg_image_ids()[3]]
    for index in weak.get_observation_point2D_idxs()[LEAST_SEEN - 1 :]:
        model.delete_observation(weak.image_id, int(index))
    for key, distance in ((far, 2.5), (near, 1.5)):
        track = model.points3D[key].track
        seen = track.elements[0]
        model.images[seen.image_id].points2D[seen.point2D_idx].xy += [distance * track.length(), 0]
    for pair in [(seen.image_id, seen.point2D_idx) for seen in model.points3D[rare].track.elements][2:]:
        model.delete_observation(*pair)
    adjusted = poses._adjusted(model)
    assert near in adjusted.points3D and not {far, rare} & set(adjusted.points3D)
    found, off = poses._taken_out(adjusted), 0
    assert len(found.names) == 11 and weak.name not in found.names and found.photo_of.max() == 10
    lens = [1024, 768, 900, 900, 512, 384, 0.05, 0.01, 0, 0]
    assert np.allclose([astuple(lens) for lens in found.lenses], lens, atol=1e-3)
    for i, lens in enumerate(found.lenses):
        local, of = camera_points(found, i), found.photo_of == i
        seen, _ = cv2.projectPoints(local[found.point_of[of]], np.zeros(3), np.zeros(3), lens.matrix, lens.distortion)
        off += (abs(seen[:, 0] - found.observed[of]) > 0.02).any(axis=1).sum()
    assert off == 1


def test_cameras_that_hold_each_other_go_together():
    """A first photo shares 14 points with each of two others, which show no more: without them it shows none."""
    model = pycolmap.synthesize_dataset(one_camera_of_900_pixels(3))
    first, *others = sorted(model.reg_image_ids())
    for i, point in enumerate(sorted(model.points3D)):
        kept = {first, others[i % 2]} if i < 2 * (LEAST_SEEN - 1) else set()
        for element in list(model.points3D[point].track.elements):
            if element.image_id not in kept and point in model.points3D:
                model.delete_observation(element.image_id, element.point2D_idx)
    assert [model.images[key].num_points3D for key in (first, *others)] == [28, 14, 14]
    assert poses._adjusted(model).num_reg_images() == 0


def test_photos_are_paired():
    """Each with each other; of more than 250, those near in the order of names, and some farther on."""
    assert sorted(poses.photo_pairs(250)) == [(i, j) for i in range(250) for j in range(i + 1, 250)]
    steps = [*range(1, 16), 16, 32, 64, 128, 256]
    assert sorted(poses.photo_pairs(257)) == [(i, i + step) for i in range(257) for step in steps if i + step < 257]


@pytest.mark.parametrize("n, placed, error, doubtful", DOUBTS)
def test_cameras_are_doubted(n, placed, error, doubtful):
    """Where one photo in ten has none, or by the reprojection error, of ten photos a smaller one."""
    model = Mock(**{"num_reg_images.return_value": placed, "compute_mean_reprojection_error.return_value": error})
    assert poses._is_doubtful(model, n) == doubtful


@pytest.mark.parametrize("aspect, focal, possible", POSSIBLE)
def test_cameras_are_possible_or_not(aspect, focal, possible):
    model = pycolmap.synthesize_dataset(pycolmap.SyntheticDatasetOptions())
    for camera in model.cameras.values():
        size = camera.width / 300
        camera.model, camera.params = pycolmap.CameraModelId.OPENCV, [aspect * focal * size, focal * size, *[0.0] * 6]
    assert poses._are_possible(model) == possible


def test_a_photo_shows_its_focal_length_through_another_lens():
    model = pycolmap.synthesize_dataset(one_camera_of_900_pixels(8))
    model.cameras[1].focal_length = 1260
    found = poses._focal_lengths(model)
    assert len(found) == 8 and np.allclose([*found.values()], 900, rtol=1e-4)
    assert model.cameras[1].focal_length == 1260  # the lens that was given stays


def test_focal_lengths_of_one_lens():
    assert poses._alike({1: 400.0, 2: 560.0, 3: 415.0, 4: 555.0, 5: 404.0}) == {1: 1, 5: 1, 3: 1, 4: 2, 2: 2}
    unsure = {6: 375.0, 7: 600.0, 8: 620.0}  # by 7 % from the first lens, by 8 % from the second, and by more
    lenses = poses._alike({1: 400.0, 2: 404.0, 3: 408.0, 4: 555.0, 5: 560.0, 9: 550.0} | unsure)
    assert lenses == {1: 1, 2: 1, 3: 1, 6: 1, 4: 4, 5: 4, 9: 4, 7: 4, 8: 8}


@pytest.mark.parametrize("damage", [b"", b"no database", b"SQLite format 3\0" + bytes(range(200)) * 30])
def test_a_damaged_database_of_features_is_known(tmp_path, damage):
    path = tmp_path / "features.db"
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE TABLE keypoints (a)")
        base.commit()
    assert poses._is_sound(path)
    path.write_bytes(damage)
    assert poses._is_sound(path) == (damage == b"")  # an empty file is an empty database


def test_sigterm_ends_it_without_a_stack_trace(tmp_path):
    """pycolmap catches the signal when it is imported, and would print one."""
    raised = "import signal, sys, splitnerf.progress as p; from splitnerf.cli import main\n"
    raised += "p.Progress.__enter__ = lambda bar: signal.raise_signal(signal.SIGTERM)\nsys.exit(main(sys.argv[1:]))"
    words = ["prepare", str(tmp_path), "--out", str(tmp_path / "data")]
    done = subprocess.run([sys.executable, "-c", raised, *words], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (130, "splitnerf: interrupted\n")


def test_a_folder_is_prepared_by_one_program(tmp_path, capsys):
    """A second one is refused, and what a killed one left half-written among the photos is no photo."""
    write_photos(tmp_path / "photos", 3)
    out = tmp_path / "data"
    own_folder(out / "work", "photos")
    (out / LOCK).write_text("pid 1 on elsewhere")
    with open(out / LOCK) as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "in use by pid 1 on elsewhere" in refused(capsys, "prepare", tmp_path / "photos", "--out", out)
    deep = out / "work/photos/lens_1" / f"{PARTIAL}p.png"
    deep.parent.mkdir(parents=True)
    deep.touch()
    preparation._upright_copies(find_photographs(tmp_path / "photos"), out / "work")
    assert len(list(deep.parent.iterdir())) == 3 and not deep.exists()


def held(kind: str, image: np.ndarray, i: int) -> np.ndarray:
    """A picture as photo i of a kind has it."""
    (h, w), whole = image.shape[:2], image.astype(np.uint8)
    if kind == "three sizes":  # as it is, by a camera that was turned, and without its sides, in turn
        return (image, np.rot90(image), image[:, w // 16 : w - w // 16])[i % 3]
    if kind == "zoomed" and i % 2:  # from nearer, in the same size
        near = whole[h // 7 : h - h // 7, w // 7 : w - w // 7]
        return cv2.resize(near, (w, h), interpolation=cv2.INTER_CUBIC).astype(image.dtype)
    if kind == "squeezed":  # to a square
        return cv2.resize(whole, (300, 300), interpolation=cv2.INTER_AREA).astype(image.dtype)
    return image


@pytest.mark.parametrize("kind", [*KINDS, pytest.param("masks to find", marks=pytest.mark.slow)])
def test_photos_to_data(tmp_path, capsys, monkeypatch, kind):
    """Photos through the command: cameras, masks and a page; the data load. To find masks it needs more of them."""
    turntable, is_cut, given, n = kind == "turntable", kind == "three sizes", kind in KINDS, 12 if kind in KINDS else 20
    truth = write_photos(tmp_path / "photos", n, turntable)
    (tmp_path / "masks").mkdir()
    balls = [held(kind, photograph(pose, *CAMERA)[1], i) for i, pose in enumerate(truth)]
    for i, (path, ball) in enumerate(zip(sorted((tmp_path / "photos").iterdir()), balls)):
        name = f"1 %20 {path.name}" if is_cut else path.name
        Image.fromarray(255 * ball.astype(np.uint8)).save(tmp_path / "masks" / name)
        Image.fromarray(held(kind, np.asarray(Image.open(path)), i)).save(path)
        path.rename(path.with_name(name))
    if is_cut:  # as many photos are matched
        monkeypatch.setattr(poses, "EXHAUSTIVE", 4), monkeypatch.setattr(poses, "OVERLAP", 2)
    options = (["--masks", str(tmp_path / "masks")] if given else []) + (["--turntable"] if turntable else [])
    assert main(["prepare", str(tmp_path / "photos"), *options, "--out", str(tmp_path / "data")]) == 0
    assert f"{n} of {n} photos" in capsys.readouterr().out
    frames = json.loads((tmp_path / "data" / "transforms.json").read_text())["frames"]
    found = np.array([frame["transform_matrix"] for frame in frames])
    # Centres relative to the ball's, in the cameras' distances, are what no similarity changes but a turn about z.
    angles = [np.unwrap(np.arctan2(p[:, 1, 3], p[:, 0, 3])) for p in (found, truth)]
    assert np.ptp(np.subtract(*angles)) < 0.01
    assert np.allclose(found[:, 2, 3], truth[:, 2, 3], atol=0.03)
    shown = [np.asarray(Image.open(tmp_path / "data" / frame["mask_path"])) > 127 for frame in frames]
    assert np.mean([(mask & ball).sum() / (mask | ball).sum() for mask, ball in zip(shown, balls)]) > 0.95
    dataset = load_dataset(tmp_path / "data")
    assert len(dataset) == n - len(range(0, n, TEST_STRIDE)) and dataset.images[..., 3].mean() > 0.01


def test_surroundings_are_what_the_object_sees():
    shots, gains = [], np.exp(np.linspace(-0.3, 0.3, 12))
    for pose, gain in zip(ring(12), gains):
        photo, ball = photograph(pose, 200.0, 320, 240, frequency=0.6)
        linear = np.minimum(gain * srgb_to_linear(photo / np.float32(255)), 1)
        photo = np.round(255 * linear_to_srgb(linear.astype(np.float32))).astype(np.uint8)
        shots.append(Shot(photo, ball, pose, Lens(320, 240, 200.0, 200.0, 160.0, 120.0, 0, 0, 0, 0), gain))
    found = surroundings(shots, BALL, TABLE_RADIUS)
    rays = directions_of_map(HEIGHT)
    at_table = BALL - BALL[2] / np.minimum(rays[..., 2:], -1e-9) * rays
    radius = np.linalg.norm(at_table[..., :2], axis=-1)
    on_table = (rays[..., 2] < 0) & (radius < TABLE_RADIUS)
    expected = srgb_to_linear(surface_colours(at_table, rays, on_table, 0.6).astype(np.float32))
    seen = found[..., 3] > 0.9
    far = seen & (rays[..., 2] > -0.05)
    assert far.sum() > 50 and abs(np.log(found[far][:, :3] / expected[far])).max() < 0.1
    near = seen & (radius > 0.8) & (radius < 1.4)
    error = [abs(found[..., :3] - np.roll(expected, shift, axis=1))[near].mean() for shift in (-2, 0, 2)]
    assert near.sum() > 200 and error[1] < 0.03 and error[1] < 0.5 * min(error[0], error[2])
    assert not seen[: HEIGHT // 4].any()  # no camera looks up
    lower = found[HEIGHT // 2 :].reshape(-1, 4)
    hidden = lower[:, 3] == np.float32(FAINT)  # under the ball
    assert hidden.sum() > 100 and (lower[:, 3] > 0).all() and found[-1, 0, 3] == np.float32(FAINT)
    assert np.allclose(lower[hidden, :3], np.median(lower[~hidden, :3], axis=0))


@pytest.mark.parametrize("clipped, share", [(0, 0.75), (4, 5 / 12), (5, 0.0)])
def test_a_direction_is_known_by_its_pixels(clipped, share):
    """Nine of twelve that make it fully known: each third, beside three at the object's edge. White ones tell of more light."""
    image, mask = np.full((3, 300, 3), 128, np.uint8), np.arange(300) < 269
    image[:, 273 : 273 + 3 * clipped] = 255
    lens, pose = Lens(300, 3, 1e7, 1e7, 150, 1.5, 0, 0, 0, 0), look_at(np.array([3.0, 1, -1]), np.zeros(3))
    found = surroundings([Shot(image, np.tile(mask, (3, 1)), pose, lens, 0.5)], np.zeros(3), 0.0).reshape(-1, 4)
    expected = [pytest.approx([*[2 * srgb_to_linear(np.float32([128 / 255]))[0]] * 3, share])] if share else []
    assert found[found[:, 3] > 0].tolist() == expected


@pytest.mark.parametrize("turntable", [False, True])
def test_photos_become_data_by_their_cameras(tmp_path, monkeypatch, capsys, turntable):
    """Cameras and points are given. Exposures and dark corners are found; masks may be soft, and black on the object."""
    (world, photos, balls), seeds = seen_world(), []
    gains, (y, x) = np.exp(np.linspace(-0.3, 0.3, 12)), np.mgrid[:240, :320] + 0.5
    corners = 1 - 0.3 * ((x - 240) ** 2 + (y - 120) ** 2)[..., None] / (160**2 + 120**2)
    balls[3] = balls[3] & (y < 120)
    on = [np.mean([balls[4][int(2 * y), int(2 * x)] for x, y in dots]) for dots in masks.dots_of(world, 4, 160)]
    assert on[0] > 0.95 and on[1] < 0.05
    lights = [0.6 * srgb_to_linear(photo / np.float32(255)) for photo in photos]
    pictures = {f"p_{i:02d}.MP": linear_to_srgb(np.float32(gains[i] * corners * lights[i])) for i in range(12)}
    pictures |= {"black": np.full((240, 320, 3), 0.015), "soft": 0.3 * pictures["p_06.MP"]}
    pictures |= {f"lost_{i}": (0.4 + 0.01 * i) * pictures["p_06.MP"] for i in range(3 + turntable)}
    for name, picture, ball in zip(pictures, pictures.values(), [*balls, *balls]):
        write_image(tmp_path / f"photos/{name}.png", picture)
        write_image(tmp_path / f"masks/{name}.png", cv2.GaussianBlur(np.float32(ball ^ turntable), (0, 0), 3))
    (tmp_path / "masks/._p_00.MP.png").write_bytes(b"a Mac's")
    monkeypatch.setattr(preparation, "reconstruct", lambda *given: seeds.append(given[3]) or world.scene)
    monkeypatch.setattr(preparation, "settle", lambda found, seed: seeds.append(seed) or settle(found, seed))
    words, out = ["prepare", str(tmp_path / "photos"), *["--turntable"] * turntable, "--out"], tmp_path / "data"
    options = [str(out), "--masks", str(tmp_path / "masks"), "--max-size", "160", "--seed", "7"]
    assert main([*words, *options]) == 0 and seeds == [7, 7]
    assert ("masks are black on the object; they are turned around" in (said := capsys.readouterr().err)) == turntable
    assert re.findall(r"(\d+ of \d+) photos do not fit", said) == ["4 of 16"] * turntable
    frames = json.loads((out / "transforms.json").read_text())["frames"]
    assert [frame["exposure"] for frame in frames] == pytest.approx(gains, rel=0.02)
    assert np.allclose([frame["transform_matrix"] for frame in frames], world.scene.poses, atol=0.01)
    covered = []
    for frame, light, ball, pose in zip(frames, lights, balls, world.scene.poses):
        lens = [frame[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")]
        assert lens == pytest.approx([160, 120, 160, 80, 120, 60], abs=0.5)
        image, mask = (read_image(out / frame[key]) for key in ("file_path", "mask_path"))
        even = frame["exposure"] * cv2.resize(light, (160, 120), interpolation=cv2.INTER_AREA)
        assert abs(srgb_to_linear(image) - even)[:, 40:].mean() < 0.005  # no point tells of the rest
        assert ((mask[..., 0] > 0.5) == ball[1::2, 1::2]).mean() > 0.995 and mask.max() == 1
        covered.append(100 * mask.mean())
        turned = np.array(frame.get("light_rotation", np.zeros((3, 3)))) @ pose[:3, 3]
        assert turned == pytest.approx([np.hypot(*pose[:2, 3]), 0, pose[2, 3]] if turntable else np.zeros(3), abs=0.05)
    assert (around := out / "surroundings.exr").exists() != turntable
    red, green, blue, _ = (5, 5, 3, 1) if turntable else read_image(around).mean((0, 1))
    assert red > 1.2 * blue and green > 0.8 * red  # as of the table
    page = (out / "prepare.html").read_text()
    n, k, share = len(world.scene.points), world.object_points.sum(), f"{min(covered):.1f} to {max(covered):.1f} %"
    tiles = f"12 of {17 + turntable}|0.30 pixels|{n}, {k} on the object|found|{share}|0.74 to 1.34"
    assert "|".join(re.findall("<dd>(.*?)</dd>", page)) == tiles
    why = sum(([f"lost_{i}", LOST] for i in range(3 + turntable)), ["black", "too dark"])
    why += ["soft", f"blurred: {9 + turntable} % of the others&#39; sharpness"]  # 0.3 squared, more beside four of 0.4
    assert re.findall("<td>(.*?)</td>", page) == why
    drawn = np.array(re.findall(r'"camera" cx="([\d.]+)" cy="([\d.]+)"', page), float).reshape(2, 12, 2)
    at = world.scene.poses[:, :3, 3]
    at = (at - (at.min(0) + at.max(0)) / [2, 2, 4]) / 3.75 * [1, -1, -1] + 1
    assert np.allclose(drawn, SIDE / 2 * np.stack([at[:, :2], at[:, ::2]]), atol=1)

    def not_found(*_):
        assert "mask_path" not in (tmp_path / "again/transforms.json").read_text()
        raise InputError("nothing stands out")

    monkeypatch.setattr(preparation, "find_masks", not_found)
    assert main([*words, str(tmp_path / "again")]) == BAD_INPUT and not (tmp_path / "again/transforms.json").exists()


def test_rows_are_counted_while_colmap_writes_them(tmp_path):
    """COLMAP keeps the database open, in this process."""
    file, told, seen = tmp_path / "features.db", {}, threading.Event()

    def report(share):
        told[share] = True
        if share == wanted:
            seen.set()

    database, wanted = pycolmap.Database.open(file), 0.0
    with poses._counted(file, "cameras", 4, report):
        for n in range(1, 6):
            database.write_camera(pycolmap.Camera(model="SIMPLE_PINHOLE", width=8, height=6, params=[9.0, 4, 3]))
            wanted = min(1.0, n / 4)
            seen.clear()
            assert seen.wait(30), (wanted, list(told))
    database.close()
