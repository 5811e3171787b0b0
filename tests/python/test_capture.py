"""From photographs to data: each part against closed forms, and the whole on a painted ball."""

import fcntl
import json
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
from blender_data import directions_of_map
from layout_scenes import seen_by_pixels
from PIL import Image
from splitnerf.cli import main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.frames import TEST_STRIDE
from splitnerf.data.images import linear_to_srgb, srgb_to_linear, write_image
from splitnerf.errors import InputError
from splitnerf.files import LOCK, PARTIAL, own_folder
from splitnerf_tools.capture import poses
from splitnerf_tools.capture import prepare as preparation
from splitnerf_tools.capture.masks import dots_of, given_masks, mask_files
from splitnerf_tools.capture.photographs import Photograph, find_photographs
from splitnerf_tools.capture.photometry import find_exposures
from splitnerf_tools.capture.poses import (
    LEAST_SEEN,
    Lens,
    Reconstruction,
    _adjusted,
    _alike,
    _are_possible,
    _counted,
    _focal_lengths,
    _is_doubtful,
    _is_sound,
    _taken_out,
)
from splitnerf_tools.capture.prepare import PrepareSettings, _upright_copies, _without_camera
from splitnerf_tools.capture.surroundings import FAINT, HEIGHT, Shot, surroundings
from splitnerf_tools.capture.undistorted import pinhole_of, undistort, without_vignetting
from splitnerf_tools.capture.world import CAMERA_DISTANCE, World, settle
from table_scene import BALL, CAMERA, RADIUS, TABLE_RADIUS, photograph, ring, surface_colours, write_photos
from tiny_runs import refused

PLAIN = Lens(320, 240, 320.0, 320.0, 160.0, 120.0, 0.0, 0.0, 0.0, 0.0)


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
    names, seen = [f"p_{i:02d}" for i in range(n)], (np.zeros(0, int), np.zeros(0, int), np.zeros((0, 2)))
    scene = Reconstruction(names, ring(n), [PLAIN] * n, points, *seen, error=0.3)
    return scene, np.arange(len(points)) < len(ball)


def moved(scene: Reconstruction, seed: int) -> Reconstruction:
    """The scene in another frame."""
    random = np.random.default_rng(seed)
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    scale, shift = 7.0, random.normal(size=3) * 5
    poses = scene.poses.copy()
    poses[:, :3, :3], poses[:, :3, 3] = rotation @ poses[:, :3, :3], scale * poses[:, :3, 3] @ rotation.T + shift
    return replace(scene, poses=poses, points=scale * scene.points @ rotation.T + shift)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_world_stands_on_its_table(seed):
    scene, of_ball = found_scene()
    world = settle(moved(scene, seed), 0)
    assert world.table_radius == pytest.approx(1.2, abs=0.15)  # of points in a square of 2 x 2
    heights = world.scene.points[:, 2]
    scale = CAMERA_DISTANCE / 3.0
    assert np.allclose(heights[of_ball], scale * scene.points[of_ball, 2], atol=0.01)
    assert abs(heights[~of_ball][:500]).max() < 0.01
    radii = [np.linalg.norm(points[of_ball, :2], axis=1) for points in (world.scene.points, scene.points)]
    assert np.allclose(radii[0], scale * radii[1], atol=0.01)
    assert (world.object_points == of_ball).mean() > 0.99
    before, after = (camera_points(found, 3) for found in (scene, world.scene))
    assert np.allclose(after, scale * before, atol=1e-6)


def test_without_a_table_up_is_the_cameras_mean():
    scene, of_ball = found_scene()
    alone = replace(scene, points=scene.points[of_ball])
    world = settle(moved(alone, 0), 0)
    assert not world.table
    assert np.allclose(world.scene.points[:, 2], CAMERA_DISTANCE / 3.0 * (alone.points[:, 2] - BALL[2]), atol=0.03)


def test_exposures_and_vignetting_come_back():
    random = np.random.default_rng(1)
    n, m = 12, 800
    gains = np.exp(random.normal(scale=0.3, size=n))
    gains /= np.exp(np.log(gains).mean())
    radiance = random.uniform(0.05, 0.5, m)
    photo, point = np.divmod(random.choice(n * m, 5000, replace=False), m)
    radii = random.uniform(0, 1, 5000)
    values = gains[photo] * (1 - 0.25 * radii**2 - 0.1 * radii**4) * radiance[point]
    values *= np.exp(random.normal(scale=0.02, size=5000))
    shiny = random.random(5000) < 0.05
    values[shiny] *= 2
    found = find_exposures(photo, point, values, radii, np.full(n, np.nan))
    assert abs(np.log(found.gains / gains)).max() < 0.015
    assert np.isclose(np.log(found.gains).mean(), 0, atol=1e-9)
    for r in (0.5, 1.0):
        factor = 1 + found.vignetting[0] * r**2 + found.vignetting[1] * r**4
        assert abs(factor - (1 - 0.25 * r**2 - 0.1 * r**4)) < 0.02


def test_exposures_without_observations_are_the_files():
    by_file = np.array([1.0, 2.0, 4.0])
    none = np.zeros(0, int)
    found = find_exposures(none, none, np.zeros(0), np.zeros(0), by_file)
    assert np.allclose(found.gains, [0.5, 1, 2], rtol=1e-4) and found.vignetting == (0.0, 0.0)


def test_undistorted_photos_are_pinhole_images():
    lens = Lens(320, 240, 300.0, 302.0, 165.0, 117.0, -0.08, 0.02, 0.001, -0.0008)
    bends = {name: getattr(lens, name) for name in ("k1", "k2", "p1", "p2")}
    slopes = np.stack(seen_by_pixels(bends, (lens.fx, lens.fy, lens.cx, lens.cy), 240, 320), axis=-1)

    def pattern(s: np.ndarray) -> np.ndarray:
        return (127 + 60 * np.sin(25 * s[..., :1] + 3) * np.cos(22 * s[..., 1:]) + 30 * s[..., :1]).repeat(3, -1)

    photo = np.round(pattern(slopes)).astype(np.uint8)
    for max_size in (0, 160):
        pinhole = pinhole_of(lens, max_size)
        assert max(pinhole.width, pinhole.height) == (max_size or 320)
        image = undistort(photo, lens, pinhole)
        y, x = np.mgrid[: pinhole.height, : pinhole.width] + 0.5
        expected = pattern(np.stack([(x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy], axis=-1))
        assert abs(image - expected).max() < 2.5


def test_vignetting_is_taken_out():
    y, x = np.mgrid[:240, :320] + 0.5
    squared = ((x - 160) ** 2 + (y - 120) ** 2) / (160**2 + 120**2)
    linear = np.repeat((0.4 * (1 - 0.3 * squared))[..., None], 3, -1).astype(np.float32)
    photo = (255 * linear_to_srgb(linear) + 0.5).astype(np.uint8)
    photo[:10, :10] = 255
    even = without_vignetting(photo, PLAIN, (-0.3, 0.0)).astype(int)
    assert np.ptp(even[10:]) <= 2
    assert (even[:10, :10] == 255).all()


def seen_world() -> tuple[World, list[np.ndarray]]:
    """A world whose photos show its points, those beside the ball where it does not hide them, and the ball's true masks."""
    scene, _ = found_scene()
    world, photo_of, point_of = settle(scene, 0), [], []
    truth = [photograph(pose, 320.0, 320, 240)[1] for pose in scene.poses]
    for i, ball in enumerate(truth):
        local = camera_points(world.scene, i) @ PLAIN.matrix.T
        x, y = np.floor(local[:, :2] / local[:, 2:]).astype(int).T
        shown = np.flatnonzero((local[:, 2] > 0) & (x >= 0) & (x < 320) & (y >= 0) & (y < 240))
        shown = shown[ball[y[shown], x[shown]] == world.object_points[shown]]
        photo_of.append(np.full(len(shown), i)), point_of.append(shown)
    seen = replace(world.scene, photo_of=np.concatenate(photo_of), point_of=np.concatenate(point_of))
    return replace(world, scene=seen), truth


def test_dots_of_the_points_that_a_photo_shows():
    world, truth = seen_world()
    on = [np.mean([truth[3][int(y), int(x)] for x, y in dots]) for dots in dots_of(world, 3, 0)]
    assert len(dots_of(world, 3, 0)[0]) > 20 and on[0] > 0.95 and on[1] < 0.05


@pytest.mark.parametrize("inverted", [False, True])
def test_given_masks_may_be_black_on_the_object(tmp_path, capsys, inverted):
    world, truth = seen_world()
    for name, ball in zip(world.scene.names, truth):
        Image.fromarray(np.where(ball ^ inverted, 255, 0).astype(np.uint8)).save(tmp_path / f"{name}.MP.png")
    (tmp_path / "._p_00.MP.png").write_bytes(b"a Mac's")
    photos = [Photograph(tmp_path / f"{name}.MP.jpg", name, 320, 240, None, "") for name in world.scene.names]
    masks = given_masks(world, mask_files(photos, tmp_path), tmp_path, 0)
    assert all((mask == ball).mean() > 0.999 for mask, ball in zip(masks, truth))
    assert ("turned around" in capsys.readouterr().err) == inverted
    Image.new("L", (240, 320)).save(tmp_path / "p_03.MP.png")
    with pytest.raises(InputError, match="p_03.MP.png: is 240x320, its photo 320x240; make them equal"):
        mask_files(photos, tmp_path)
    (tmp_path / "p_03.MP.png").unlink()
    with pytest.raises(InputError, match="has no mask p_03.MP.png"):
        mask_files(photos, tmp_path)


def test_a_mask_that_may_be_anothers_is_refused(tmp_path):
    """Two photos that differ in their suffixes; two masks that do."""
    photos = [Photograph(tmp_path / f"a{suffix}", f"a{suffix}", 8, 6, None, "") for suffix in (".jpg", ".png")]
    Image.new("L", (8, 6)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"a.png: may be the mask of a.jpg or of a.png; call it a.png.png"):
        mask_files(photos, tmp_path)
    with pytest.raises(InputError, match="every mask is black; give masks that are white on the object"):
        mask_files(photos[1:], tmp_path)
    Image.new("RGB", (8, 6), "red").save(tmp_path / "a.png.png")
    with pytest.raises(InputError, match="a.png.png: is coloured"):  # before COLMAP has run for minutes
        mask_files(photos, tmp_path)
    Image.fromarray(np.arange(48, dtype=np.uint16).reshape(6, 8) * 5).save(tmp_path / "a.png.png")  # bytes in 16 bits
    with pytest.raises(InputError, match="a.png.png: at most 0.4% of white, is black; make it white on the object"):
        mask_files(photos, tmp_path)
    Image.new("L", (8, 6), 255).save(tmp_path / "a.png.png")
    assert [path.name for path in mask_files(photos, tmp_path).values()] == ["a.png", "a.png.png"]
    Image.new("L", (8, 6)).save(tmp_path / "a.bmp")
    with pytest.raises(InputError, match="a.png: may be a mask of the same photo as a.bmp; delete one of them"):
        mask_files(photos[:1], tmp_path)
    Image.new("L", (8, 6), 255).save(tmp_path / "u\u0308.png")  # of a system that keeps letters with accents otherwise
    (found,) = mask_files([Photograph(tmp_path / "\u00fc.jpg", "u", 8, 6, None, "")], tmp_path).values()
    assert found.name == "u\u0308.png"


TWO = np.random.default_rng(0).integers(0, 255, (2, 40, 60, 3), np.uint8)
PLAIN_ONES = np.full((5, 150, 200, 3), 120, np.uint8) + np.arange(5, dtype=np.uint8)[:, None, None, None]


@pytest.mark.parametrize(
    "photos, said",
    [
        (TWO, "holds 2 different photos, fewer than 3; take 30"),
        (PLAIN_ONES, "show too little detail; put"),
        (PLAIN_ONES - 120, "all photos are too dark; expose them longer"),
    ],
)
def test_photos_that_show_too_little_are_refused(tmp_path, capsys, photos, said):
    for i, pixels in enumerate(photos):
        write_image(tmp_path / f"photos/{i}.png", pixels / np.float32(255))
    words = "prepare", tmp_path / "photos", "--out", tmp_path / "data"
    (tmp_path / "masks").mkdir()
    assert "masks: has no mask 0.png" in refused(
        capsys, *words, "--masks", tmp_path / "masks"
    )  # before cameras are found
    assert not (tmp_path / "data/work").exists() and said in refused(capsys, *words)


def one_camera_of_900_pixels() -> pycolmap.SyntheticDatasetOptions:
    """Of 8 photos."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig, options.num_frames_per_rig = 1, 1, 8
    options.camera_model_id, options.camera_params = pycolmap.CameraModelId.RADIAL, [900, 512, 384, 0.05, 0.01]
    return options


def test_a_camera_that_nearly_no_points_hold_is_none():
    """The others keep theirs, with the lens in OpenCV's model."""
    model = pycolmap.synthesize_dataset(one_camera_of_900_pixels())
    weak = model.images[model.reg_image_ids()[3]]
    for index in weak.get_observation_point2D_idxs()[LEAST_SEEN - 1 :]:
        model.delete_observation(weak.image_id, int(index))
    found = _taken_out(_adjusted(model))
    assert len(found.names) == 7 and weak.name not in found.names and found.photo_of.max() == 6
    assert np.allclose([astuple(lens) for lens in found.lenses], [1024, 768, 900, 900, 512, 384, 0.05, 0.01, 0, 0])


def test_cameras_that_hold_each_other_go_together():
    """A first photo shares 14 points with each of two others, which show no more: without them it shows none."""
    options = one_camera_of_900_pixels()
    options.num_frames_per_rig = 3
    model = pycolmap.synthesize_dataset(options)
    first, *others = sorted(model.reg_image_ids())
    for i, point in enumerate(sorted(model.points3D)):
        kept = {first, others[i % 2]} if i < 2 * (LEAST_SEEN - 1) else set()
        for element in list(model.points3D[point].track.elements):
            if element.image_id not in kept and point in model.points3D:
                model.delete_observation(element.image_id, element.point2D_idx)
    assert [model.images[key].num_points3D for key in (first, *others)] == [28, 14, 14]
    assert _adjusted(model).num_reg_images() == 0


@pytest.mark.parametrize("aspect, focal, possible", [(1.0, 300, True), (0.75, 300, False), (1.0, 60, False)])
def test_cameras_are_possible_or_not(aspect, focal, possible):
    model = pycolmap.synthesize_dataset(pycolmap.SyntheticDatasetOptions())
    assert not _is_doubtful(model, model.num_reg_images()) and _is_doubtful(model, model.num_reg_images() + 1)
    for camera in model.cameras.values():
        size = camera.width / 300
        camera.model, camera.params = pycolmap.CameraModelId.OPENCV, [aspect * focal * size, focal * size, *[0.0] * 6]
    assert _are_possible(model) == possible


def test_a_photo_shows_its_focal_length_through_another_lens():
    model = pycolmap.synthesize_dataset(one_camera_of_900_pixels())
    model.cameras[1].focal_length = 1260
    found = _focal_lengths(model)
    assert len(found) == 8 and np.allclose([*found.values()], 900, rtol=1e-4)
    assert model.cameras[1].focal_length == 1260  # the lens that was given stays


def test_focal_lengths_of_one_lens():
    assert _alike({1: 400.0, 2: 560.0, 3: 410.0, 4: 555.0, 5: 404.0}) == {1: 1, 5: 1, 3: 1, 4: 2, 2: 2}
    unsure = {6: 375.0, 7: 600.0, 8: 700.0}  # by 7 % from the first lens, by 8 % from the second, and one of its own
    lenses = _alike({1: 400.0, 2: 404.0, 3: 408.0, 4: 555.0, 5: 560.0, 9: 550.0} | unsure)
    assert lenses == {1: 1, 2: 1, 3: 1, 6: 1, 4: 4, 5: 4, 9: 4, 7: 4, 8: 8}


@pytest.mark.parametrize("damage", [b"", b"no database", b"SQLite format 3\0" + bytes(range(200)) * 30])
def test_a_damaged_database_of_features_is_known(tmp_path, damage):
    path = tmp_path / "features.db"
    with closing(sqlite3.connect(path)) as base:
        base.execute("CREATE TABLE keypoints (a)")
        base.commit()
    assert _is_sound(path)
    path.write_bytes(damage)
    assert _is_sound(path) == (damage == b"")  # an empty file is an empty database


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
    _upright_copies(find_photographs(tmp_path / "photos"), out / "work")
    assert len(list(deep.parent.iterdir())) == 3 and not deep.exists()


def test_the_seed_reaches_all_that_draws(tmp_path, monkeypatch, capsys):
    seeds, parts = [], {"_photographs": [], "_sorted_out": ([], {}), "_upright_copies": [], "_without_camera": {}}
    for name, result in parts.items():
        monkeypatch.setattr(preparation, name, lambda *_, result=result: result)
    monkeypatch.setattr(preparation, "reconstruct", lambda *given: seeds.append(given[3]) or Mock())
    monkeypatch.setattr(preparation, "settle", lambda found, seed: seeds.append(seed) or 1 / 0)
    main(["prepare", str(tmp_path), "--out", str(tmp_path / "out"), "--seed", "7"])
    assert seeds == [7, 7]
    assert "--seed must be at least 0" in refused(capsys, "prepare", tmp_path, "--out", tmp_path, "--seed", 1 << 31)


def as_whole(image: np.ndarray, i: int) -> np.ndarray:
    return image


def as_held(image: np.ndarray, i: int) -> np.ndarray:
    """A picture as it is, by a camera that was turned, and without its sides, in turn."""
    side = image.shape[1] // 16
    return (image, np.rot90(image), image[:, side : image.shape[1] - side])[i % 3]


def as_zoomed(image: np.ndarray, i: int) -> np.ndarray:
    """Each other picture from nearer, in the same size."""
    h, w = image.shape[:2]
    near = image[h // 7 : h - h // 7, w // 7 : w - w // 7].astype(np.uint8)
    return cv2.resize(near, (w, h), interpolation=cv2.INTER_CUBIC).astype(image.dtype) if i % 2 else image


def as_squeezed(image: np.ndarray, i: int) -> np.ndarray:
    """A picture brought to a square."""
    return cv2.resize(image.astype(np.uint8), (300, 300), interpolation=cv2.INTER_AREA).astype(image.dtype)


@pytest.mark.parametrize(
    ("given", "turntable", "held"),
    [
        (True, False, as_whole),
        (True, True, as_whole),
        (True, False, as_held),
        (True, False, as_zoomed),
        (True, False, as_squeezed),
        pytest.param(False, False, as_whole, marks=pytest.mark.slow),
    ],
    ids=["around", "turntable", "three sizes", "zoomed", "squeezed", "masks to find"],
)
def test_photos_to_data(tmp_path, capsys, monkeypatch, given, turntable, held):
    """Photos through the command: cameras, masks and a page; the data load. To find masks it needs more of them."""
    n = 12 if given else 20
    truth = write_photos(tmp_path / "photos", n, turntable)
    (tmp_path / "masks").mkdir()
    balls = [held(photograph(pose, *CAMERA)[1], i) for i, pose in enumerate(truth)]
    for i, (path, ball) in enumerate(zip(sorted((tmp_path / "photos").iterdir()), balls)):
        name = f"1 %20 {path.name}" if held is as_held else path.name
        Image.fromarray(255 * ball.astype(np.uint8)).save(tmp_path / "masks" / name)
        Image.fromarray(held(np.asarray(Image.open(path)), i)).save(path)
        path.rename(path.with_name(name))
    if held is as_held:  # as many photos are matched
        monkeypatch.setattr(poses, "EXHAUSTIVE", 4), monkeypatch.setattr(poses, "OVERLAP", 2)
    options = (["--masks", str(tmp_path / "masks")] if given else []) + (["--turntable"] if turntable else [])
    assert main(["prepare", str(tmp_path / "photos"), *options, "--out", str(tmp_path / "data")]) == 0
    assert f"{n} of {n} photos" in capsys.readouterr().out
    frames = json.loads((tmp_path / "data" / "transforms.json").read_text())["frames"]
    found = np.array([frame["transform_matrix"] for frame in frames])
    # Centres relative to the ball's, in the cameras' distances, are what no similarity changes but a turn about z.
    angles = [np.unwrap(np.arctan2(p[:, 1, 3], p[:, 0, 3])) for p in (found, truth)]
    assert np.ptp(np.subtract(*angles)) < 0.01
    assert np.allclose(found[:, 2, 3], truth[:, 2, 3] * CAMERA_DISTANCE / 3.0, atol=0.03)
    assert all(("light_rotation" in frame) == turntable for frame in frames)
    overlap = []
    for frame, ball in zip(frames, balls):
        mask = np.asarray(Image.open(tmp_path / "data" / frame["mask_path"])) > 127
        overlap.append((mask & ball).sum() / (mask | ball).sum())
    assert np.mean(overlap) > 0.95
    dataset = load_dataset(tmp_path / "data")
    assert len(dataset) == n - len(range(0, n, TEST_STRIDE)) and dataset.images[..., 3].mean() > 0.01
    assert f"{n} of {n}" in (tmp_path / "data" / "prepare.html").read_text()


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


def test_data_whose_masks_are_not_found_are_not_left(tmp_path, monkeypatch):
    world, _ = seen_world()
    monkeypatch.setattr(preparation, "read_upright", lambda path: np.zeros((240, 320, 3), np.uint8))

    def refused(*_):
        assert "mask_path" not in (tmp_path / "transforms.json").read_text()
        raise InputError("nothing stands out")

    monkeypatch.setattr(preparation, "find_masks", refused)
    exposures = find_exposures(*[np.zeros(0, int)] * 2, *[np.zeros(0)] * 2, np.ones(len(world.scene.names)))
    photos = {name: SimpleNamespace(path=tmp_path) for name in world.scene.names}
    with pytest.raises(InputError, match="nothing stands out"):
        preparation.write_data(world, exposures, photos, None, tmp_path, PrepareSettings(), lambda step, share: None)
    assert not (tmp_path / "transforms.json").exists()


@pytest.mark.parametrize("placed, told", [("abcdefghi", False), ("abcdefg", True)])
def test_many_photos_without_a_camera_are_told_of(tmp_path, capsys, placed, told):
    photos = [SimpleNamespace(name=name) for name in "abcdefghij"]
    assert list(_without_camera(photos, list(placed), tmp_path)) == sorted(set("abcdefghij") - set(placed))
    said = capsys.readouterr().err
    assert ("3 of 10 photos do not fit together" in said) == told and len(said.splitlines()) == told


def test_rows_are_counted_while_colmap_writes_them(tmp_path):
    """COLMAP keeps the database open, in this process."""
    file, told, seen = tmp_path / "features.db", {}, threading.Event()

    def report(share):
        told[share] = True
        if share == wanted:
            seen.set()

    database, wanted = pycolmap.Database.open(file), 0.0
    with _counted(file, "cameras", 4, report):
        for n in range(1, 6):
            database.write_camera(pycolmap.Camera(model="SIMPLE_PINHOLE", width=8, height=6, params=[9.0, 4, 3]))
            wanted = min(1.0, n / 4)
            seen.clear()
            assert seen.wait(30), (wanted, list(told))
    database.close()
