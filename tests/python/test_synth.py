"""Rendered data sets: what each layout's files hold against the renderer's arrays, and built-in shapes."""

import json
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh
from splitnerf.cli import BAD_INPUT, DONE, build_parser, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb, read_image, write_image
from splitnerf.data.truth import load_scene_truth, load_view_truths, read_relit, relight_maps
from splitnerf.evaluate.scoring import FIRST_SEED, asset_mesh
from splitnerf.relight.cameras import bounding_sphere
from splitnerf.render.path_traced import MOST_VIEWS, AssetRenderer
from splitnerf_tools.commands import synth as synth_command
from splitnerf_tools.synth import rendering
from splitnerf_tools.synth.rendering import SynthSettings, normalised, orbit, render_views, spiral, synthesise
from splitnerf_tools.synth.shapes import MATERIALS, SHAPES, pattern, shape_asset
from splitnerf_tools.synth.writer import LAYOUTS, SceneWriter
from tiny_runs import command, refused

SIZE = 24
HALF_STEP = 0.5 / 255 + 1e-6


def piece(mesh: trimesh.Trimesh, colour: tuple, metallic: float, roughness: float, offset: tuple) -> trimesh.Trimesh:
    """A mesh with its material, moved, z up turned to glTF's y up."""
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[*colour, 1.0], metallicFactor=metallic, roughnessFactor=roughness, emissiveFactor=[0.2, 0, 0]
    )
    vertices = (mesh.vertices + offset)[:, [0, 2, 1]] * [1, 1, -1]
    normals = np.array(mesh.vertex_normals)[:, [0, 2, 1]] * [1, 1, -1]
    visual = trimesh.visual.TextureVisuals(material=material)
    return trimesh.Trimesh(vertices, mesh.faces, vertex_normals=normals, visual=visual, process=False)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """An asset with no symmetry, off the origin, that glows, and two maps: one side bright, and a blue one."""
    folder = tmp_path_factory.mktemp("files")
    ball = piece(trimesh.creation.icosphere(subdivisions=4), (0.8, 0.3, 0.1), 0.0, 0.6, (5.0, 2.0, 1.0))
    small = piece(trimesh.creation.icosphere(subdivisions=3, radius=0.5), (0.9, 0.9, 0.9), 1.0, 0.4, (6.5, 2.2, 1.6))
    scene = trimesh.Scene({"ball": ball, "small": small})
    (folder / "balls.glb").write_bytes(scene.export(file_type="glb", include_normals=True))
    sunny = np.full((16, 32, 3), 0.05, np.float32)
    sunny[6:10, 14:18] = 6  # the centre column looks along +x
    write_image(folder / "sunny.exr", sunny)
    write_image(folder / "blue.exr", np.full((16, 32, 3), (0.2, 0.4, 0.9), np.float32))
    return folder


def close_images(image, maps):
    alpha = maps["alpha"]
    seen = alpha > 0
    straight = maps["radiance"][seen] / alpha[seen][:, None]
    assert np.abs(image[..., 3] - alpha).max() <= HALF_STEP
    assert np.abs(image[seen][:, :3] - np.clip(linear_to_srgb(straight), 0, 1)).max() <= HALF_STEP


@pytest.mark.parametrize("layout", LAYOUTS)
def test_files_hold_what_was_rendered(files, tmp_path, layout):
    asset = read_asset(files / "balls.glb")
    centre, radius = bounding_sphere(asset)
    renderer, given = AssetRenderer(normalised(asset, centre, 1 / radius)), []
    recorder, settings = Mock(), SynthSettings(SIZE, 3, 2, 4, layout)
    recorder.render = Mock(
        side_effect=lambda *args, **options: given.append(renderer.render(*args, **options)) or given[-1]
    )
    writer = SceneWriter(tmp_path, 0.6911112070083618, layout)
    light = np.full((8, 16, 3), 0.5, np.float32)
    relight = {"a": writer.light(light * 2, "a"), "b_1": writer.light(light, "b_1")}
    render_views(recorder, writer, writer.light(light), relight, settings)
    seeds = [call.kwargs["seed"] for call in recorder.render.call_args_list]
    assert len(set(seeds)) == len(seeds) == 3 + 2 * 3 and max(seeds) < FIRST_SEED
    with pytest.raises(Exception, match="has neither"):
        load_dataset(tmp_path)
    writer.close()
    (tmp_path / "val_000").mkdir()
    train, test = load_dataset(tmp_path), load_dataset(tmp_path, "test")
    assert (len(train), len(test)) == (3, 2)
    assert test.frame_names == (["r_000", "r_001"] if layout == "blender" else ["test_000", "test_001"])
    for image, maps in zip(np.concatenate([train.images, test.images]), given):
        close_images(image, maps)
    focal = 0.5 * SIZE / np.tan(0.5 * 0.6911112070083618)
    assert train.intrinsics[0] == pytest.approx([focal, focal, SIZE / 2, SIZE / 2])
    assert test.world_poses == pytest.approx(orbit(2, 3.0233467, 30, 20), abs=1e-4)
    assert train.world_poses == pytest.approx(spiral(3, 3.0233467, (-20, 78)), abs=1e-4)
    for name, truth, maps in zip(test.frame_names, load_view_truths(test), given[3:5]):
        solid = maps["alpha"] > 0.92
        assert np.array_equal(truth.normal_mask | ~solid, np.ones_like(solid))
        encoded = linear_to_srgb if layout == "blender" else np.asarray  # the other one keeps albedo linear
        assert np.abs(encoded(truth.albedo[solid]) - encoded(maps["albedo"][solid])).max() <= HALF_STEP
        unit = maps["smooth_normal"] / np.maximum(np.linalg.norm(maps["smooth_normal"], axis=-1, keepdims=True), 1e-8)
        assert np.linalg.norm(truth.normal[solid] - unit[solid], axis=-1).max() < np.radians(0.6)
        if layout == "blender":
            assert np.abs(truth.roughness[solid] - maps["roughness"][solid]).max() <= HALF_STEP
            assert np.abs(truth.metallic[solid] - maps["metallic"][solid]).max() <= HALF_STEP
            stored = read_image(tmp_path / f"test/{name}_normal.exr")
            assert stored[..., :3] == pytest.approx(maps["smooth_normal"] * maps["alpha"][..., None], abs=1e-3)
        else:
            assert truth.roughness is None and truth.metallic is None
    assert load_view_truths(train)[0].albedo is None
    assert list(relight_maps(test)) == ["a", "b_1"]
    for k, name in enumerate(relight_maps(test)):
        for i in range(2):
            close_images(read_relit(test, i, name), given[5 + 2 * k + i])


@pytest.fixture(scope="module")
def data(files):
    out = files / "data"
    maps = "--light", files / "sunny.exr", "--relight", files / "blue.exr", files / "sunny.exr"
    sizes = "--size 40 --train 6 --test 3 --spp 384".split()
    assert command("synth", files / "balls.glb", *maps, *sizes, "--out", out) == DONE
    return out


def test_mesh_poses_and_images_share_one_world(data):
    test, mesh = load_dataset(data, "test"), load_scene_truth(data).mesh
    assert np.linalg.norm(mesh.vertices, axis=1).max() == pytest.approx(1, abs=1e-5)
    for pose, (fx, fy, cx, cy), image in zip(test.world_poses, test.intrinsics, test.images):
        local = (mesh.vertices - pose[:3, 3]) @ pose[:3, :3]
        x, y = cx - fx * local[:, 0] / local[:, 2], cy + fy * local[:, 1] / local[:, 2]
        rows, columns = np.nonzero(image[..., 3] > 0.5)
        seen = [columns.min(), columns.max() + 1, rows.min(), rows.max() + 1]
        assert seen == pytest.approx([x.min(), x.max(), y.min(), y.max()], abs=0.8)


def test_an_asset_scores_as_perfect_on_its_own_data(data, tmp_path):
    out = tmp_path / "scores.json"
    words = data / "asset.glb", "--data", data, "--env", data / "light.hdr", "--spp", 384, "--out", out
    assert command("evaluate", *words) == DONE
    scores = json.loads(out.read_text())
    assert scores["relight"]["psnr"] > 40 and scores["novel_view"]["psnr"] > 40 and scores["albedo"]["psnr"] > 38
    assert scores["relight"]["lsq"]["scale"] == pytest.approx([1, 1, 1], abs=0.005)
    assert set(scores["relight"]["maps"]) == {"blue", "sunny"} and scores["normal_mae_deg"] < 1
    assert scores["roughness_mae"] < 0.01 and scores["metallic_balanced_accuracy"] > 0.97
    assert scores["light_psnr"] == 100 and scores["f_score"] == 1 and scores["chamfer"] < 0.01


def test_cameras_look_at_the_origin():
    for poses in (spiral(20, 3.0, (-20, 70), turn=15), orbit(7, 3.0, 30, swing=20)):
        assert np.linalg.norm(poses[:, :3, 3], axis=1) == pytest.approx(3)
        assert poses[:, :3, 2] * 3 == pytest.approx(poses[:, :3, 3])
        assert np.linalg.det(poses[:, :3, :3]) == pytest.approx(1)
        assert np.abs(poses[:, 2, 0]).max() < 1e-12 and (poses[:, 2, 1] > 0).all()
    backs = {"orbit": orbit(8, 3.0, 30, swing=20)[:, :3, 2], "spiral": spiral(3, 3.0, (-20, 70), turn=15)[:, :3, 2]}
    azimuths = {name: np.degrees(np.arctan2(back[:, 1], back[:, 0])) % 360 for name, back in backs.items()}
    assert azimuths["orbit"] == pytest.approx(22.5 + 45 * np.arange(8))
    assert azimuths["spiral"] == pytest.approx((15 + 222.4922 * np.arange(3)) % 360, abs=1e-3)  # of the golden ratio
    assert np.degrees(np.arcsin(backs["orbit"][:, 2])) == pytest.approx([30, 50, 30, 10] * 2)
    low, high = np.sin(np.radians([-20, 70]))
    assert backs["spiral"][:, 2] == pytest.approx([low, (low + high) / 2, high])


def test_equal_seeds_write_equal_files_and_others_differ(files, tmp_path):
    images = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        settings = SynthSettings(SIZE, 1, 1, 2, seed=seed)
        out = synthesise(files / "balls.glb", files / "blue.exr", [], tmp_path / name, settings)
        images.append((out / "train/r_000.png").read_bytes())
    assert images[0] == images[1] != images[2]
    sizes = [rendering.resized(np.ones((rows, 2 * rows, 3), np.float32)).shape for rows in (300, 16)]
    assert sizes == [(256, 512, 3), (16, 32, 3)]


def bad(files, tmp_path, **change):
    known = {"light": files / "blue.exr", "relight": [], "out": tmp_path / "out", "settings": SynthSettings(8, 1, 1, 1)}
    return synthesise(files / "balls.glb", **(known | change))


def test_bad_input_writes_nothing(files, tmp_path, capsys):
    (tmp_path / "full").mkdir()
    (tmp_path / "full/notes.txt").write_text("mine")
    with pytest.raises(Exception, match="full: exists and is not an empty folder"):
        bad(files, tmp_path, out=tmp_path / "full")
    for settings, message in (
        *(({name: 0}, f"--{name} must be at least 1 and") for name in ("size", "train", "test", "spp")),
        ({"train": MOST_VIEWS + 1}, "--train must be at least 1 and at most"),
        ({"seed": -1}, "--seed must not be negative"),
        ({"layout": "nerfactor", "turntable": True}, "--turntable: the layout nerfactor has no word"),
        ({"layout": "nerf"}, "--layout must be one of"),
    ):
        with pytest.raises(Exception, match=message):
            bad(files, tmp_path, settings=replace(SynthSettings(8, 1, 1, 1), **settings))
    SynthSettings(1, MOST_VIEWS, 1, 1).check()
    (tmp_path / "apart.gltf").write_text("{}")
    assert not rendering.write_placed_glb(tmp_path / "apart.gltf", tmp_path / "out", np.zeros(3), 1.0)
    (tmp_path / "more").mkdir()
    (tmp_path / "more/relight_blue.exr").write_bytes((files / "blue.exr").read_bytes())
    with pytest.raises(Exception, match="two maps are called blue"):
        bad(files, tmp_path, relight=[files / "blue.exr", tmp_path / "more/relight_blue.exr"])
    assert not (tmp_path / "out").exists()
    for words, said in (((files / "gone.glb",), "gone.glb"), (("a.glb", "--material", "metal"), "give --shape")):
        assert said in refused(capsys, "synth", *words, "--light", files / "blue.exr", "--out", tmp_path / "out")
        assert not (tmp_path / "out").exists()


TUNNELS = {"mug": 1, "rings": 1, "mask": 2}  # through the body; the others have none
WALLS = {"bowl": 0.08, "mug": 0.08, "box": 0.08, "vase": 0.07, "shell": 0.06, "mask": 0.07}
FLOORS = {"bowl": -0.87, "mug": -0.52, "box": -0.37, "vase": -0.73}  # where a ray down the axis ends
# The largest x and -y, and the lowest and highest z.
BOUNDS = {"bowl": (0.95, 0.95, -0.95, 0), "box": (0.7, 0.5, -0.45, 0.4), "vase": (0.6, 0.6, -0.8, 0.9)}
BOUNDS |= {"mug": (0.55 + 0.27 + 0.045, 0.55, -0.6, 0.6), "mask": (0.7, 0.42 + 0.23, -0.95, 0.95)}
BOUNDS |= {"rings": (0.9, 0.9, -0.6, 0.28), "plinth": (0.6, 0.6, -0.69, 0.6)}


@pytest.fixture(scope="module")
def assets():
    """All shapes, meshed coarsely."""
    return {name: shape_asset(name, "matte", resolution=96) for name in SHAPES}


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_one_closed_body_with_as_many_tunnels_as_it_says(assets, name):
    mesh = asset_mesh(assets[name])
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert mesh.euler_number == 2 - 2 * TUNNELS.get(name, 0) and np.abs(mesh.vertices).max() < 1 and mesh.volume > 0
    (_, y, low), (x, _, high) = mesh.bounds
    assert (x, -y, low, high) == pytest.approx(BOUNDS.get(name, (x, -y, low, high)), abs=0.004)
    assert (assets[name].materials[0].roughness, assets[name].materials[0].metallic) == (0.8, 0)


def edges(length: float, radius: float) -> float:
    """The volume that rounding takes from right-angled edges."""
    return (1 - np.pi / 4) * radius**2 * length


VOLUMES = {
    # A shell of radii 0.87 and 0.95 below z = -0.04, and half a ring of radius 0.04 on it.
    "bowl": np.pi * (2 / 3 * (0.95**3 - 0.87**3) - 0.04 * (0.95**2 - 0.87**2)) + np.pi * 1.82 * np.pi * 0.04**2 / 2,
    # 1.4 x 1 x 0.85 with edges of 0.06, less a cavity with walls of 0.08, less the rim's two rounded edges of 0.04.
    "box": 1.4 * 0.85 - edges(8.2, 0.06) - 1.24 * 0.84 * 0.77 - edges(2 * 2 * (1.32 + 0.92), 0.04),
    # A ball of radius 0.45 that sinks 0.01 into a block of 1.2 x 1.2 x 0.4 with edges of 0.04.
    "plinth": np.pi * (4 / 3 * 0.45**3 - 0.01**2 * (0.45 - 0.01 / 3)) + 1.2 * 1.2 * 0.4 - edges(4 * 2.8, 0.04),
}


@pytest.mark.parametrize("name", VOLUMES)
def test_volumes_are_those_of_the_formulas(assets, name):
    assert asset_mesh(assets[name]).volume == pytest.approx(VOLUMES[name], rel=0.004)


@pytest.mark.parametrize("name", WALLS)
def test_walls_are_as_thick_as_they_should_be(assets, name):
    """Inward rays from the faces; those near edges, holes and the handle meet something farther off."""
    mesh = asset_mesh(assets[name])
    start = mesh.triangles_center - 1e-4 * mesh.face_normals
    where, rays, _ = mesh.ray.intersects_location(start, -mesh.face_normals, multiple_hits=False)
    assert len(rays) > 0.99 * len(start)
    assert np.median(np.linalg.norm(where - start[rays], axis=1)) == pytest.approx(WALLS[name], rel=0.05)
    radius = np.linalg.norm(mesh.vertices - mesh.bounds.mean(axis=0), axis=1).max()
    assert 0.05 <= WALLS[name] / radius <= 0.1


@pytest.mark.parametrize("name", FLOORS)
def test_a_ray_down_the_axis_reaches_the_floor(assets, name):
    ray = [[0.01, 0.02, 2.0]], [[0, 0, -1.0]]
    first = asset_mesh(assets[name]).ray.intersects_location(*ray, multiple_hits=False)[0]
    assert first[0, 2] == pytest.approx(FLOORS[name], abs=0.002)


def test_the_shell_and_the_mask_are_open(assets):
    """Rays along the openings' axes meet the inside of the far wall; rays through the eyes meet nothing."""
    opening = np.array([0.8, 0, 0.6])
    inside = asset_mesh(assets["shell"]).ray.intersects_location([2 * opening], [-opening], multiple_hits=False)[0]
    assert inside[0] @ opening == pytest.approx(-0.54, abs=0.04)
    mask = asset_mesh(assets["mask"])
    where, rays, _ = mask.ray.intersects_location(
        [[0.0, 2, 0.5], [0.29, 2, 0.2], [-0.29, 2, 0.2]], [[0, -1.0, 0]] * 3, multiple_hits=False
    )
    assert rays.tolist() == [0] and -0.5 < where[0, 1] < -0.3


@pytest.mark.parametrize("name", SHAPES)
def test_shading_normals_are_unit_and_follow_the_faces(assets, name):
    asset = assets[name]
    assert np.linalg.norm(asset.normals, axis=1) == pytest.approx(1, abs=1e-5)
    along = (asset_mesh(asset).face_normals[:, None] * asset.normals[asset.triangles]).sum(axis=2)
    assert np.mean(along > 0.95) > 0.9 and np.mean(along < 0.5) < 0.01


def test_the_pattern_has_contrast_at_every_scale_and_no_jumps():
    p = np.random.default_rng(0).uniform(-1, 1, (4000, 3))
    colours = pattern(p)
    assert 0.1 <= colours.min() < 0.12 and 0.7 < colours.max() <= 0.8
    differences = {d: np.abs(pattern(p + (d, 0, 0)) - colours).mean() for d in (0.002, 0.08, 0.3)}
    assert differences[0.002] < 0.005 and 0.04 < differences[0.08] < differences[0.3]
    assert np.abs(pattern(p + (0.002, 0, 0)) - colours).max() < 0.05


def test_the_command_renders_a_shape_with_its_truth(files, tmp_path):
    words = f"synth --shape mug --material glossy --light {files / 'blue.exr'} --out {tmp_path / 'data'}"
    assert main([*words.split(), *"--size 24 --train 2 --test 1 --spp 16".split()]) == DONE
    truth = load_view_truths(load_dataset(tmp_path / "data", "test"))[0]
    solid = truth.normal_mask
    assert truth.roughness[solid] == pytest.approx(0.25, abs=0.003) and (truth.metallic[solid] == 0).all()
    assert truth.albedo[solid].min() > 0.09 and truth.albedo[solid].max() < 0.81 and truth.albedo[solid].std() > 0.05
    mesh, asset = load_scene_truth(tmp_path / "data").mesh, read_asset(tmp_path / "data/asset.glb")
    assert mesh.euler_number == 0 and np.linalg.norm(mesh.vertices, axis=1).max() == pytest.approx(1, abs=1e-5)
    assert asset.vertices == pytest.approx(np.asarray(mesh.vertices), abs=1e-5)
    original = shape_asset("mug", "glossy")
    assert asset.colors == pytest.approx(original.colors, abs=1e-6)
    assert asset.materials[0].roughness == 0.25 and asset.materials[0].metallic == 0


WRONG = {"--shape cup": SHAPES, "--shape mug --material wood": MATERIALS}
WRONG |= dict.fromkeys(("", "a.glb --shape mug"), ("ASSET.glb", "--shape"))


@pytest.mark.parametrize("words, listed", WRONG.items())
def test_wrong_names_are_refused_in_a_line_that_lists_the_right_ones(words, listed, capsys):
    with pytest.raises(SystemExit) as ended:
        build_parser().parse_args(f"synth {words} --light l.hdr --out o".split())
    assert ended.value.code == BAD_INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    assert all(name in line for name in listed)
    assert synth_command.SHAPES == tuple(SHAPES) and synth_command.MATERIALS == tuple(MATERIALS)
