"""Layouts are recognised by themselves, the same cameras come out of each, and a run holds out what it was asked to."""

import json
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from blender_data import SIZE, edit, make_blender, set_pose, sphere_alpha
from layout_scenes import CENTRE, COUNT, FOCAL, LENS, RADIUS, sphere_poses, write_colmap, write_neus, write_transforms
from splitnerf.cli import BAD_INPUT, DONE
from splitnerf.config import Config
from splitnerf.data.dataset import load_dataset
from splitnerf.data.frames import far_origin, has_test_split, read_frames
from splitnerf.data.images import write_image
from splitnerf.data.layouts import colmap, transforms
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from tiny_runs import command, train

LAYOUTS = {
    "transforms": lambda root: write_transforms(root),
    "transforms with masks": lambda root: write_transforms(root, masks=True, suffix=".jpg"),
    "NeuS": lambda root: write_neus(root),
    "NeuS with alpha": lambda root: write_neus(root, masks=False),
    "COLMAP, binary": lambda root: write_colmap(root, binary=True),
    "COLMAP, text": lambda root: write_colmap(root, binary=False, masks=True),
    "COLMAP of nerfstudio": lambda root: write_colmap(root, binary=True, place="colmap/sparse/0"),
    "COLMAP, undistorted": lambda root: write_colmap(root, binary=False, place="sparse"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_same_cameras_come_out_of_each_layout(tmp_path, name):
    data = load_dataset(LAYOUTS[name](tmp_path))
    poses = [pose for i, pose in enumerate(sphere_poses()) if i % 8]
    assert data.frame_names == [f"v{i:02d}" for i in range(COUNT) if i % 8]
    assert load_dataset(tmp_path, "test").frame_names == ["v00", "v08"] and has_test_split(tmp_path)
    np.testing.assert_allclose(data.world_poses, poses, atol=1e-6)
    np.testing.assert_allclose(data.intrinsics, np.broadcast_to(LENS, (len(data), 4)), rtol=1e-5)
    assert data.known is None and not data.origin.any() and data.photographed == (name == "transforms with masks")
    for pose, image in zip(poses, data.images):
        assert np.array_equal(image[..., 3] > 0.5, sphere_alpha(pose, CENTRE, RADIUS) > 0.5)


def test_a_transforms_file_counts_before_the_model_it_was_made_of(tmp_path):
    """Also with a byte order mark."""
    write_colmap(tmp_path, binary=True)
    path = write_transforms(tmp_path, fl_x=2 * FOCAL) / "transforms.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_dataset(tmp_path).intrinsics[0, 0] == pytest.approx(2 * FOCAL)


@pytest.mark.parametrize(("removed", "focal"), [((), 70), (("cameras.bin", "images.txt"), 60)])
def test_of_two_forms_of_a_model_the_binary_one_is_read(tmp_path, capsys, removed, focal):
    for binary, length in ((False, 60.0), (True, 70.0)):
        root = write_colmap(tmp_path, binary=binary, cameras={1: (0, "SIMPLE_PINHOLE", [SIZE] * 2, [length, 24, 24])})
    for name in removed:
        (root / "sparse/0" / name).unlink()
    assert load_dataset(tmp_path).intrinsics[0, 0] == focal
    assert ("files of both forms; cameras.bin and images.bin are read" in capsys.readouterr().err) == (not removed)


@pytest.mark.parametrize("folder", ["absolute", "../images", "cam"])
def test_masks_of_colmap_are_found_from_paths(tmp_path, capsys, folder):
    """With a byte order mark in the model, and names that have blanks."""
    root = write_colmap(tmp_path, binary=False, masks=True)
    (model,) = root.rglob("images.txt")
    listed = root.resolve() / "images" if folder == "absolute" else folder
    model.write_text("\ufeff" + model.read_text().replace(" v", f" {listed}/a v"))
    (root / "images/cam").mkdir()
    for i in range(COUNT):
        name = f"cam/a v{i:02d}.png" if folder == "cam" else f"a v{i:02d}.png"
        (root / f"images/v{i:02d}.png").rename(root / "images" / name)
        (root / f"masks/v{i:02d}.png.png").rename(root / f"masks/a v{i:02d}.png")
    masks = [frame.mask_path for frame in colmap.read(root)]
    said = "masks: no image has a mask there (cam/a v00.png.png would be one)" in capsys.readouterr().err
    if folder == "cam":
        assert masks == [None] * COUNT and said
    else:
        assert masks == [root / f"masks/a v{i:02d}.png" for i in range(COUNT)] and not said
    lines = model.read_text().splitlines()
    model.write_text("\n".join(lines[:1] + lines[1::2]).replace("a v", "an y v"))  # three words more
    with pytest.raises(InputError, match="images.txt: is damaged or no file of COLMAP .image '"):
        colmap.read(root)


def test_masks_of_colmap_are_found_by_other_forms_of_their_names(tmp_path):
    """Without the photo's suffix; a letter with an accent, composed in the model and decomposed in the file system."""
    root = write_colmap(tmp_path, binary=False, masks=True)
    (model,) = root.rglob("images.txt")
    model.write_text(model.read_text().replace("v00.png", "\u00e9.png"))
    (root / "images/v00.png").rename(root / "images/e\u0301.png")
    (root / "masks/v00.png.png").rename(root / "masks/e\u0301.png.png")
    for i in range(1, COUNT, 2):
        (root / f"masks/v{i:02d}.png.png").rename(root / f"masks/v{i:02d}.png")
    for frame in read_frames(root, "train", Reading("all"))[0]:
        assert frame.mask_path.is_file() and frame.mask_path.name.startswith(frame.image_path.stem)


@pytest.mark.parametrize("binary", [True, False])
def test_images_in_folders_have_their_masks_in_folders(tmp_path, binary):
    """Here through a lens that bends, whose parameters a model names."""
    cameras = {3: (3, "RADIAL", [SIZE, SIZE], [FOCAL, SIZE / 2, SIZE / 2, 0.05, 0.01])}
    root = write_colmap(tmp_path, binary=binary, masks=True, cameras=cameras)
    for folder, suffix in (("images", ".png"), ("masks", ".png.png")):
        (root / folder / "left").mkdir()
        (root / folder / f"v03{suffix}").rename(root / folder / f"left/v03{suffix}")
    for path in (root / "sparse/0").iterdir():
        path.write_bytes(path.read_bytes().replace(b"v03.png", b"left/v03.png"))
    frames, _ = read_frames(root, "train", Reading("all"))
    frame = next(frame for frame in frames if frame.name == "left/v03")
    assert frame.image_path == root / "images/left/v03.png" and frame.mask_path == root / "masks/left/v03.png.png"
    assert frame.distortion.radial == (0.05, 0.01, 0, 0) and not frame.distortion.fisheye


@pytest.mark.parametrize(
    ("number", "name", "parameters", "expected"),
    [
        (2, "SIMPLE_RADIAL", [9.0, 4, 3, 0.1], ((9, 9, 4, 3), (0.1, 0, 0, 0), (0, 0), False)),
        (4, "OPENCV", [9.0, 8, 4, 3, 0.1, 0.2, 0.3, 0.4], ((9, 8, 4, 3), (0.1, 0.2, 0, 0), (0.3, 0.4), False)),
        (5, "OPENCV_FISHEYE", [9.0, 8, 4, 3, 0.1, 0.2, 0.3, 0.4], ((9, 8, 4, 3), (0.1, 0.2, 0.3, 0.4), (0, 0), True)),
        (8, "SIMPLE_RADIAL_FISHEYE", [9.0, 4, 3, 0.1], ((9, 9, 4, 3), (0.1, 0, 0, 0), (0, 0), True)),
        (9, "RADIAL_FISHEYE", [9.0, 4, 3, 0.1, 0.2], ((9, 9, 4, 3), (0.1, 0.2, 0, 0), (0, 0), True)),
    ],
)
@pytest.mark.parametrize("binary", [True, False])
def test_each_camera_model_of_colmap(tmp_path, binary, number, name, parameters, expected):
    cameras = {1: (number, name, [SIZE, SIZE], parameters)}
    frames, _ = read_frames(write_colmap(tmp_path, binary=binary, cameras=cameras), "train")
    bent = frames[0].distortion
    assert tuple(lens_intrinsics(frames[0].lens, (SIZE, SIZE))) == pytest.approx(expected[0])
    assert (bent.radial, bent.tangential, bent.fisheye) == expected[1:]


# ---- what is held out ----


def names(root, mode: str) -> tuple[list[str], list[str]]:
    return tuple([frame.name for frame in read_frames(root, split, Reading(mode))[0]] for split in ("train", "test"))


def test_eval_modes_of_one_list(tmp_path):
    root, every = write_transforms(tmp_path), [f"v{i:02d}" for i in range(COUNT)]
    assert names(root, "all") == (every, every) and not has_test_split(root, Reading("all"))
    assert has_test_split(root / "images")  # which has no layout: so that loading says it
    held_out = ["v00", "v08"]
    assert names(root, "fraction") == names(root, "auto") == ([n for n in every if n not in held_out], held_out)
    with pytest.raises(InputError, match="v00.png: its path names neither train nor test"):
        names(root, "filename")


def test_eval_modes_of_data_that_make_splits(tmp_path):
    root = make_blender(tmp_path, train=6, test=3)
    train, test = [f"r_{i}" for i in range(6)], [f"r_{i}" for i in range(3)]
    assert names(root, "auto") == names(root, "filename") == (train, test)
    assert names(root, "all") == (train + test, train + test)
    assert names(root, "fraction") == ((train + test)[1:8], ["r_0", "r_2"])
    shared = json.loads((root / "transforms_train.json").read_text())["frames"][4]
    edit(root, lambda m: m["frames"].__setitem__(1, shared), "transforms_test.json")  # in both splits
    assert names(root, "all")[0] == [*train, "r_0", "r_2"]


WORDS = {
    "test": "images/test_001 test/latest train/eval_3 testing/7 test_train/test_0",
    "train": "images/train_001 Train/contest test/train/0",
    None: "latest/contest train_test/0",
}


@pytest.mark.parametrize(("path", "split"), [(f"{x}.png", split) for split, s in WORDS.items() for x in s.split()])
def test_words_in_paths(tmp_path, path, split):
    root = write_transforms(tmp_path / "train")  # the folder's own name does not count
    write_image(root / path, np.ones((SIZE, SIZE, 4)))
    edit(root, lambda m: m["frames"].__setitem__(slice(1, None), []), "transforms.json")
    edit(root, lambda m: m["frames"][0].update(file_path=path), "transforms.json")
    if split is None:
        with pytest.raises(InputError, match="its path names neither train nor test"):
            names(root, "filename")
        return
    assert len(read_frames(root, split, Reading("filename"))[0]) == 1
    other = "test" if split == "train" else "train"
    message = f"has no frames for the {other} split; no path of an image has the word {other}"
    with pytest.raises(InputError, match=message):
        read_frames(root, other, Reading("filename"))


def test_one_frame_is_held_out_and_none_is_left(tmp_path):
    root = write_transforms(tmp_path)
    edit(root, lambda m: m["frames"].__setitem__(slice(1, None), []), "transforms.json")
    with pytest.raises(InputError, match="no frames for the train split; add posed images, or give --eval-mode all"):
        load_dataset(root)
    with pytest.raises(InputError, match="one view does not show the object's shape"):
        load_dataset(root, reading=Reading("all"))


# ---- files of the data ----


def test_files_outside_of_the_folder_are_read_and_named_once(tmp_path, capsys):
    root = write_transforms(tmp_path / "data", masks=True)
    (root / "images").rename(tmp_path / "images")
    for i, folder in ((0, ".."), (1, str(tmp_path)), *((i, "../data/..") for i in range(2, COUNT))):
        edit(root, lambda m, i=i, f=folder: m["frames"][i].update(file_path=f"{f}/images/v{i:02d}"), "transforms.json")
    assert len(load_dataset(root)) == COUNT - 2
    notes = [line for line in capsys.readouterr().err.splitlines() if "outside of" in line]
    said = "names files outside of its folder; they are read ('../images/v00.png' is one)"
    assert notes == [f"splitnerf: note: {root}/transforms.json: {said}"]


@pytest.mark.parametrize("name", ["/dev/zero", "/etc/passwd", "../secret"])
def test_what_is_no_image_stays_unread(tmp_path, name):
    root = write_transforms(tmp_path / "data")
    (tmp_path / "secret").write_text("a word that nobody may see")
    edit(root, lambda m: m["frames"][1].update(file_path=name), "transforms.json")
    with pytest.raises(InputError) as caught:
        load_dataset(root)
    assert "word" not in str(caught.value) and "root" not in str(caught.value).replace(str(tmp_path), "")


def test_a_file_without_permission_is_not_called_damaged(tmp_path, monkeypatch):
    root = write_transforms(tmp_path)
    monkeypatch.setattr("pathlib.Path.read_text", Mock(side_effect=PermissionError(13, "Permission denied")))
    with pytest.raises(InputError, match=r"transforms.json: cannot be read \(Permission denied\)"):
        load_dataset(root)


WIDE = {"fl_x": 100, "fl_y": 80, "cx": 60, "cy": 30, "w": 120, "h": 60}
FRAMES = [  # the file, the frame, and fx, fy, cx, cy of a photo of the frame's own size; None where it is refused
    (WIDE, {}, (120, 60), (100, 80, 60, 30)),
    (WIDE, {"fl_x": 50}, (120, 60), (50, 40, 60, 30)),
    (WIDE, {"fl_y": 40}, (120, 60), (50, 40, 60, 30)),
    ({"fl_y": 80}, {"fl_x": 50}, (120, 60), (50, 80, 60, 30)),
    ({"fl_x": 80}, {"fl_x": 50}, (120, 60), (50, 50, 60, 30)),
    (WIDE, {"w": 240, "h": 120}, (240, 120), (200, 160, 120, 60)),
    (WIDE, {"w": 240, "h": 120, "fl_x": 150}, (240, 120), (150, 120, 120, 60)),
    (WIDE, {"w": 60, "h": 120}, (60, 120), None),
    (WIDE, {"w": 60, "h": 120, "cx": 30, "cy": 60}, (60, 120), (100, 80, 30, 60)),
    ({"camera_angle_x": 1.0, "w": 120, "h": 60}, {"w": 60, "h": 120}, (60, 120), None),
    ({"camera_angle_x": 1.0, "camera_angle_y": 0.5}, {}, (120, 60), (60 / np.tan(0.5), 30 / np.tan(0.25), 60, 30)),
    (WIDE, {"cx": -10}, (120, 60), (100, 80, -10, 30)),
]


@pytest.mark.parametrize(("file", "frame", "size", "expected"), FRAMES)
def test_the_numbers_of_a_file_are_brought_to_the_size_of_a_frame(tmp_path, file, frame, size, expected):
    write_image(tmp_path / "a.png", np.zeros(size[::-1], np.float32))
    frames = [{"file_path": "a.png", "transform_matrix": np.eye(4).tolist()} | frame]
    (tmp_path / "transforms.json").write_text(json.dumps(file | {"frames": frames}))
    if expected is None:
        with pytest.raises(InputError, match=r"frame 0 \(a.png\): is 60x120 and .* is of 120x60; give the frame its"):
            transforms.read(tmp_path, None)
    else:
        (read,) = transforms.read(tmp_path, None)
        assert lens_intrinsics(read.lens, size[::-1]) == pytest.approx(expected)


def test_masks_are_paired_by_names_and_numbers(tmp_path, capsys):
    neus, model = write_neus(tmp_path / "neus"), write_colmap(tmp_path / "model", binary=False)
    (neus / "image/._v00.png").write_bytes(b"a Mac's")
    first, second = sorted((neus / "mask").iterdir())[:2]
    first.rename(neus / "mask/zz.png")
    with pytest.raises(InputError, match="mask: has no mask that is of v00.png alone; give each image one of its name"):
        read_frames(neus, "train")
    (neus / "mask/zz.png").rename(neus / "mask/0.png")
    frames, _ = read_frames(neus, "train", Reading("all"))
    assert [frame.mask_path.name for frame in frames[:2]] == ["0.png", second.name] and not capsys.readouterr().err
    for i, path in enumerate(sorted((neus / "image").glob("v*"))):
        path.rename(neus / f"image/{i}.png")
    read_frames(neus, "train")
    assert "in the alphabet's order, which is not that of their numbers" in capsys.readouterr().err
    for folder, ending in (("image", ".png"), ("mask", ".jpg")):
        for i, path in enumerate(sorted((neus / folder).glob("[!.]*"))):
            path.rename(neus / folder / f"{('left', 'right')[i % 2]}_{i // 2}{ending}")
    frames, _ = read_frames(neus, "train", Reading("all"))
    assert all(frame.mask_path.stem == frame.name for frame in frames)
    (neus / "mask/right_3.jpg").rename(neus / "mask/3.png")
    with pytest.raises(InputError, match="mask: has no mask that is of left_0.png alone"):
        read_frames(neus, "train")
    lines = (model / "sparse/0/images.txt").read_text().splitlines()
    (model / "sparse/0/images.txt").write_text("\n".join(lines[:1] + lines[1::2]))
    with pytest.raises(InputError, match="images.txt: is damaged or no file of COLMAP .* has no line of points"):
        read_frames(model, "train")


# ---- what a run holds out ----


STEPS = ("--steps", "2")
EAST = np.eye(4, k=3)  # a pose's step along x


@pytest.mark.parametrize(("distance", "origin"), [(2990, 0), (3014, 3010)])
def test_the_origin_moves_where_cameras_are_a_thousand_times_as_far_away_as_apart(distance, origin):
    frames = [Frame("", None, np.eye(4) + (distance + side) * EAST, {}) for side in (-3, 3)]
    assert far_origin(frames).tolist() == [origin, 0, 0]


def n_views(path) -> int:
    return json.loads(path.read_text())["views"]


@pytest.fixture(scope="module")
def run_on_all(tmp_path_factory):
    root = tmp_path_factory.mktemp("all")
    write_colmap(root / "data", binary=True)
    assert train(root / "data", root / "run", *STEPS, "--eval-mode", "all") == DONE
    return root


def test_what_is_held_out_is_said(tmp_path, capsys):
    data = write_transforms(tmp_path / "data")
    assert train(data, tmp_path / "run", *STEPS) == DONE
    said = f"{data}: 14 views to train on, 2 are held out for testing (every 8th; --eval-mode all trains on all)"
    assert capsys.readouterr().err.count(said) == 1
    assert n_views(tmp_path / "run/evaluation.json") == 2
    words = "--data", data, "--eval-mode", "all", "--out", tmp_path / "s.json"
    assert command("evaluate", tmp_path / "run", *words) == DONE
    said = "16 views to train on, no view is held out for testing (all are trained on and evaluated)"
    assert said in capsys.readouterr().err
    assert n_views(tmp_path / "s.json") == COUNT


def test_later_commands_read_the_data_as_the_run_did(run_on_all, tmp_path, capsys):
    run, data = run_on_all / "run", run_on_all / "data"
    assert n_views(run / "evaluation.json") == COUNT and Config.read(run / "config.toml").reading == Reading("all")
    assert command("evaluate", run, "--data", data, "--out", tmp_path / "run.json") == DONE
    asset = "evaluate", run / "mesh.glb", "--data", data, "--spp", 1
    assert command(*asset, "--out", tmp_path / "asset.json") == DONE
    assert command(*asset, "--out", tmp_path / "other.json", "--eval-mode", "fraction") == DONE
    assert [n_views(tmp_path / f"{name}.json") for name in ("run", "asset", "other")] == [COUNT, COUNT, 2]
    relit = "relight", run, "--env", run / "environment.hdr", "--data", data, "--spp", 1, "--size", 8, "--out"
    assert command(*relit, tmp_path / "relit") == command(*relit, tmp_path / "fewer", "--eval-mode", "fraction") == DONE
    assert [len(list((tmp_path / name).glob("*.png"))) for name in ("relit", "fewer")] == [COUNT, 2]


def test_a_run_is_not_resumed_on_other_views(run_on_all, capsys):
    run, data = run_on_all / "run", run_on_all / "data"
    assert train(data, run, "--steps", "3", "--resume", "--eval-mode", "fraction") == BAD_INPUT
    assert "was trained on other images" in capsys.readouterr().err
    assert train(data, run, "--steps", "3", "--resume") == DONE
    assert n_views(run / "evaluation.json") == COUNT


def test_a_run_far_from_the_origin_says_where_it_is(tmp_path, capsys):
    """Its meshes keep their details, and cameras of the data still fit them."""
    data = write_transforms(tmp_path / "data")
    for i in range(COUNT):
        edit(data, set_pose(i, lambda pose: (pose + 5e6 * EAST).tolist()), "transforms.json")
    run = tmp_path / "run"
    assert train(data, run, *STEPS) == DONE
    assert "the cameras are far from the origin; results are relative to 5000000 0 0" in capsys.readouterr().err
    stored = json.loads((run / "origin.json").read_text())
    assert stored["origin"] == [5e6, 0, 0] and stored["meaning"]
    vertices = np.asarray(trimesh.load_mesh(run / "mesh.ply").vertices)
    assert np.abs(vertices).max() < 2 and len(np.unique(vertices[:, 0])) > 20
    assert command("export", run, "--out", tmp_path / "asset", "--formats", "ply") == DONE
    exported = json.loads((tmp_path / "asset/origin.json").read_text())
    assert exported["origin"] == stored["origin"] and exported["scale"] == 1
    for origin, scale in (("x", 1), ([1, 2], 1), (None, 1), (["x"] * 3, 1), ([float("nan")] * 3, 1), ([0, 0, 0], 0)):
        (run / "origin.json").write_text(json.dumps({"origin": origin, "scale": scale}))
        assert command("export", run, "--out", tmp_path / "other", "--formats", "ply") == BAD_INPUT
        assert not (tmp_path / "other").exists()
        assert "origin.json: does not hold three numbers as 'origin'" in capsys.readouterr().err
    (run / "origin.json").write_text(json.dumps(stored))
    scores = json.loads((run / "evaluation.json").read_text())["novel_view"]
    assert scores["psnr"] > 8
