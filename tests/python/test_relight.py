"""The relighter: cameras and composition by closed forms, the furnace through the whole command, clear errors."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from blender_data import directions_of_map
from gltf_builder import Gltf
from painted_ball import bare
from PIL import Image
from splitnerf.cli import DONE, INTERRUPTED, main
from splitnerf.data.environment import directions_of_texels
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb, read_image, straight_srgb, write_image
from splitnerf.errors import InputError
from splitnerf.relight import rendering
from splitnerf.relight.background import Background, compose, fill
from splitnerf.relight.cameras import View, bounding_sphere, look_at, path_views, turntable
from splitnerf.relight.output import display_frame, write_frame, write_gif
from splitnerf.relight.studio import STUDIO_LIGHTS, direction, light_named, soft_box, studio_light
from splitnerf.render.path_traced import AssetRenderer
from splitnerf_tools.view.assets import light_of
from tiny_runs import refused

CENTRE = np.array([1.0, -2.0, 0.8])  # of the ball, z up
HALF_FIELD, MARGIN = np.radians(19.8), 1.1  # of a 50 mm lens on a sensor of 36 mm; around the object


def write_ball(path, metallic=0.0):
    ball, gltf = trimesh.creation.icosphere(subdivisions=4), Gltf()
    material = gltf.material(name="ball", pbrMetallicRoughness={"metallicFactor": metallic})  # white and rough
    part = gltf.primitive(0.5 * ball.vertices, ball.faces, material=material, NORMAL=ball.vertices)
    gltf.node(mesh=gltf.mesh(part), translation=[CENTRE[0], CENTRE[2], -CENTRE[1]])  # y up in the file
    return gltf.write(path)


@pytest.fixture
def ball(tmp_path):
    return write_ball(tmp_path / "ball.glb")


@pytest.fixture
def grey(tmp_path):
    write_image(tmp_path / "grey.exr", np.full((16, 32, 3), 0.5, np.float32))
    return tmp_path / "grey.exr"


def run(*words):
    return main(["relight", *map(str, words)])


# ---- cameras ----


def test_turntable_starts_at_the_front_and_frames_the_sphere(ball):
    asset = read_asset(ball)
    centre, radius = bounding_sphere(asset)
    assert centre == pytest.approx(CENTRE, abs=1e-5) and radius == pytest.approx(0.5, abs=1e-5)
    corners = [[0, 0, 0], [4, 0, 0], [1, 2, 0], [9, 9, 9]]  # the last is of no face
    middle, farthest = bounding_sphere(bare(trimesh.Trimesh(corners, [[0, 1, 2]], process=False)))
    assert middle.tolist() == [2, 1, 0] and farthest == pytest.approx(5**0.5)
    views = turntable(asset, 4, elevation=30, size=(60, 40))
    assert [view.light_degrees for view in views] == [0] * 4
    for view, azimuth in zip(views, np.radians([-90, 0, 90, 180])):
        offset = view.pose[:3, 3] - CENTRE
        distance = MARGIN * 0.5 / np.sin(HALF_FIELD)
        expected = [np.cos(azimuth) * np.sqrt(0.75), np.sin(azimuth) * np.sqrt(0.75), 0.5]
        assert offset / distance == pytest.approx(expected, abs=1e-4)
        rotation = view.pose[:3, :3]
        assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12) and np.linalg.det(rotation) > 0
        assert rotation[2, 0] == pytest.approx(0, abs=1e-12) and rotation[2, 1] > 0  # upright
        # The silhouette's half angle is asin(r / d): it keeps inside the shorter side by the margin.
        points = (asset.vertices - view.pose[:3, 3]) @ rotation
        silhouette = 20 * np.tan(np.arcsin(np.sin(HALF_FIELD) / MARGIN)) / np.tan(HALF_FIELD)
        pixels = np.array(view.intrinsics[2:]) + view.intrinsics[0] * points[:, :2] * [1, -1] / -points[:, 2:]
        assert pixels.min(axis=0)[1] == pytest.approx(20 - silhouette, abs=0.05)
        assert pixels.max(axis=0)[0] == pytest.approx(30 + silhouette, abs=0.05)


def test_a_path_keeps_its_lens_at_any_size(tmp_path):
    pose = np.eye(4)
    pose[:3, 3] = [1, 2, 3]
    path = tmp_path / "path.json"
    lens = {"fl_x": 100, "fl_y": 110, "cx": 30, "cy": 25, "w": 80, "h": 40}
    path.write_text(json.dumps(lens | {"frames": [{"transform_matrix": pose.tolist()}]}))
    (view,) = path_views(path, None)
    assert np.array_equal(view.pose, pose)
    assert (view.intrinsics, view.width, view.height) == ((100, 110, 30, 25), 80, 40)
    (view,) = path_views(path, (160, None))
    assert (view.intrinsics, view.width, view.height) == ((200, 220, 60, 50), 160, 80)
    assert path_views(path, (160, 81))[0].height == 81  # a rounded size stretches by no more than a pixel
    with pytest.raises(InputError, match="path.json: is 80x40, --size 160x82 would stretch it"):
        path_views(path, (160, 82))
    path.write_text(json.dumps({"camera_angle_x": np.pi / 2, "frames": [{"transform_matrix": pose.tolist()}]}))
    (view,) = path_views(path, (40, 20))
    assert view.intrinsics == pytest.approx((20, 20, 20, 10))
    assert path_views(path, None)[0].intrinsics == pytest.approx((256, 256, 256, 256))


# ---- composition ----


def test_composition_is_linear_and_the_shadow_darkens_what_is_behind():
    pixel = {"radiance": [0.2, 0.4, 0.6], "alpha": 0.5, "shadow": 0.25}
    images = {name: np.array([[value]], np.float32) for name, value in pixel.items()}
    clear = compose(images, None, 2.0)
    assert clear[0, 0] == pytest.approx([0.4, 0.8, 1.2, 0.75])
    behind = np.array([[[1.0, 0.5, 0.0]]], np.float32)
    assert compose(images, behind, 2.0)[0, 0] == pytest.approx([0.65, 0.925, 1.2, 1.0])
    # Laying the transparent picture over the same background later gives the same.
    assert clear[0, 0, :3] + (1 - clear[0, 0, 3]) * behind[0, 0] == pytest.approx([0.65, 0.925, 1.2])
    straight = straight_srgb(clear[..., :3], clear[..., 3])[0, 0]
    assert straight == pytest.approx(linear_to_srgb(np.array([0.4 / 0.75, 1, 1])), abs=1e-6)
    assert display_frame(clear)[0, 0].tolist() == np.rint(255 * linear_to_srgb(np.array([0.65, 1.0, 1.0]))).tolist()
    del images["shadow"]
    assert compose(images, None, 1.0)[0, 0, 3] == 0.5


def test_plates_cover_the_picture_and_are_cropped_about_the_centre(tmp_path):
    columns = np.broadcast_to(np.arange(40.0)[None, :, None], (10, 40, 3))
    assert fill(columns, 20, 10) == pytest.approx(columns[:, 10:30])
    assert fill(columns, 20, 5)[2, :, 0] == pytest.approx(np.arange(0.5, 40, 2)[0:20], abs=0.5)
    assert fill(columns, 5, 30).shape == (30, 5, 3)
    behind = lambda text: Background(str(text)).behind(View(np.eye(4), (4, 4, 2, 2), 4, 4), np.zeros((2, 4, 3)), 8.0)
    # 128 / 255 decoded is 0.2159, whatever the exposure; a fifth of it over white is 0.9004, decoded 0.7883.
    plates = [("RGBA", (128, 0, 0, 255), [0.2159, 0, 0]), ("RGBA", (128, 0, 0, 0), [1, 1, 1])]
    plates += [("RGB", (255, 128, 0), [1, 0.2159, 0]), ("LA", (128, 51), [0.7883] * 3), ("L", 128, [0.2159] * 3)]
    for mode, pixel, expected in plates:
        Image.new(mode, (4, 4), pixel).save(tmp_path / "plate.png")
        assert behind(tmp_path / "plate.png")[0, 0] == pytest.approx(expected, abs=1e-3), mode
    write_image(tmp_path / "plate.exr", np.full((4, 4, 3), [2.0, -1.0, 0.5], np.float32))
    assert behind(tmp_path / "plate.exr")[0, 0].tolist() == [2, 0, 0.5]
    assert (behind("white") == 1).all() and behind("transparent") is None


def test_the_environment_stands_behind_in_its_directions():
    # Radiance 2 + d on a fine map; a camera at the origin that looks along -z of a turned frame.
    rotation = trimesh.transformations.random_rotation_matrix(np.array([0.2, 0.7, 0.4]))
    environment, view = (2 + directions_of_map(180)).astype(np.float32), View(rotation, (30, 30, 8, 6), 16, 12)
    seen = Background("environment").behind(view, environment, 2.0) / 2
    x, y = np.meshgrid((np.arange(16) + 0.5 - 8) / 30, (np.arange(12) + 0.5 - 6) / 30)
    rays = np.stack([x, -y, -np.ones_like(x)], axis=-1)
    rays = rays @ rotation[:3, :3].T / np.linalg.norm(rays, axis=-1, keepdims=True)
    assert seen == pytest.approx(2 + rays, abs=2e-3)
    # Of an edge at 0.4 of a pixel of wide angle one half of the rays sees the light: the mean over each pixel is smooth.
    half = np.zeros((500, 1000, 3), np.float32)
    half[:, :500] = 1.0
    view = View(look_at(np.zeros(3), 0.0, 0.0, 1.0), (3, 30, 8.4, 6), 16, 12)
    assert Background("environment").behind(view, half, 1.0)[:, 7:10, 0] == pytest.approx(np.tile([0, 0.5, 1], (12, 1)))


# ---- light ----


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_white_furnace_through_the_command(tmp_path, grey, metallic):
    path = write_ball(tmp_path / "white.glb", metallic)
    words = ("--env", grey, "--size", "24", "--spp", "256", "--exposure", "-1", "--out", tmp_path / "out")
    assert run(path, *words) == DONE
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000.exr", "000.png"]
    linear, srgb = read_image(tmp_path / "out/000.exr"), read_image(tmp_path / "out/000.png")
    alpha = linear[..., 3]
    inside = alpha > 0.999
    assert inside.sum() > 200 and not linear[:3, :3].any()
    # A white ball under light 0.5 from everywhere, a stop darker, is as bright as the light, and vanishes against it.
    assert linear[inside, :3].mean() == pytest.approx(0.25, rel=0.01)
    assert linear[..., :3] == pytest.approx(0.25 * np.repeat(alpha[..., None], 3, axis=2), abs=0.03)
    assert srgb[inside, :3].mean() == pytest.approx(0.5370987, abs=0.01)
    assert srgb[..., 3] == pytest.approx(alpha, abs=3e-3)


def test_shadow_lies_beside_the_object_and_nowhere_else(tmp_path, ball):
    # A small light straight above: the shadow is the ball's disc on the ground, seen from 40 degrees.
    light = np.full((128, 256, 3), 1e-5, np.float32)
    light[0] = 1000.0
    write_image(tmp_path / "top.exr", light)
    pose = look_at(CENTRE, np.radians(-60), np.radians(40), 4.0)
    camera = {"camera_angle_x": 0.5, "frames": [{"transform_matrix": pose.tolist()}]}
    (tmp_path / "path.json").write_text(json.dumps(camera))
    words = ("--env", tmp_path / "top.exr", "--size", "48", "--spp", "64", "--path", tmp_path / "path.json")
    assert run(ball, *words, "--shadow-catcher", "--out", tmp_path / "out") == DONE
    pixels = read_image(tmp_path / "out/000.exr")
    (view,) = path_views(tmp_path / "path.json", (48, 48))
    images = AssetRenderer(read_asset(ball)).render(light, view.pose, view.intrinsics, 48, 48, spp=64)
    # Where each pixel's ray meets the ground, measured from the point below the ball.
    x, y = np.meshgrid((np.arange(48) + 0.5 - 24) / view.intrinsics[0], (np.arange(48) + 0.5 - 24) / view.intrinsics[1])
    rays = np.stack([x, -y, -np.ones_like(x)], axis=-1) @ view.pose[:3, :3].T
    reach = (CENTRE[2] - 0.5 - view.pose[2, 3]) / rays[..., 2]
    radius = np.linalg.norm((view.pose[:3, 3] + reach[..., None] * rays - CENTRE)[..., :2], axis=-1)
    beside = (images["alpha"] == 0) & (reach > 0)
    shadow = pixels[..., 3]
    assert (beside & (radius < 0.44)).sum() > 20 and (shadow[beside & (radius < 0.44)] > 0.95).all()
    assert (shadow[beside & (radius > 0.56)] < 0.05).all()
    assert not pixels[beside][:, :3].any()  # black
    assert shadow[images["alpha"] > 0.999] == pytest.approx(1.0, abs=1e-3)


# ---- files ----


def test_several_maps_animations_and_overwriting(tmp_path, ball, grey, capsys):
    write_image(tmp_path / "red.hdr", np.full((8, 16, 3), [1.0, 0.1, 0.1], np.float32))
    out = tmp_path / "out"
    small = "--size 17 --spp 2 --background white".split()
    words = (ball, "--env", grey, "--env", tmp_path / "red.hdr", *small, "--out", out)
    assert run(*words, "--turntable", "3", "--gif", "--fps", "10") == DONE
    assert capsys.readouterr().out.split() == [str(out / "grey"), str(out / "red")]
    for name in ("grey", "red"):
        frames = sorted(p.name for p in (out / name).iterdir())
        assert frames == ["000.exr", "000.png", "001.exr", "001.png", "002.exr", "002.png", "animation.gif"]
        with Image.open(out / name / "animation.gif") as gif:
            assert (gif.n_frames, gif.size, gif.info["duration"], gif.info["loop"]) == (3, (17, 17), 100, 0)
    assert read_image(out / "red/000.exr").shape == read_image(out / "red/000.png").shape == (17, 17, 3)
    assert read_image(out / "red/000.exr")[8, 8, 0] > 5 * read_image(out / "red/000.exr")[8, 8, 1]
    assert "grey: holds frames already; replace them with --overwrite" in refused(capsys, "relight", *words)
    (out / "grey/notes.txt").write_text("mine")
    assert run(*words, "--overwrite") == DONE
    assert sorted(p.name for p in (out / "grey").iterdir()) == ["000.exr", "000.png", "notes.txt"]


def test_what_files_cannot_hold_is_bounded(tmp_path):
    """The largest half in EXR, and 50 pictures a second in GIF, which counts hundredths."""
    write_frame(tmp_path, 7, np.full((2, 2, 4), 1e6, np.float32), with_alpha=False)
    assert (read_image(tmp_path / "007.exr") == 65504).all()
    for fps, milliseconds in ((12, 80), (30, 30), (100, 20)):
        write_gif(tmp_path / "a.gif", [np.full((2, 2, 3), 90 * i, np.uint8) for i in range(2)], fps)
        with Image.open(tmp_path / "a.gif") as gif:
            assert gif.info["duration"] == milliseconds


def test_each_frame_is_rendered_as_it_is_set(tmp_path, ball, monkeypatch):
    """With a seed and a turn of the light of its own, from one place, and the ground a millionth of the size below the ball."""
    asked, poses, light = [], set(), np.zeros((16, 32, 3), np.float32)
    light[5, 12] = 1.0

    def render(environment, pose, lens, width, height, **options):
        asked.append((environment.sum(axis=2).argmax() % 32, options))
        poses.add(pose.tobytes())
        return {name: np.zeros((height, width, 3)[:n], np.float32) for name, n in (("radiance", 3), ("alpha", 2))}

    monkeypatch.setattr(rendering, "AssetRenderer", lambda asset: SimpleNamespace(render=render))
    write_image(tmp_path / "lamp.exr", light)
    words = "--rotate-env 90 --turntable 4 --rotate light --spp 3 --bounces 2 --seed 7 --shadow-catcher".split()
    assert run(ball, "--env", tmp_path / "lamp.exr", *words, "--out", tmp_path / "out") == DONE
    # Counter-clockwise from above is to the left, by a quarter of 32 columns and then by one more from frame to frame.
    frame = {"spp": 3, "bounces": 2, "catcher_height": pytest.approx(0.3 - 1e-6 * 0.5, abs=2e-7)}
    assert asked == [(x, frame | {"seed": 7 + i}) for i, x in enumerate((4, 28, 20, 12))] and len(poses) == 1


def test_mp4_or_the_package_that_is_missing(tmp_path, ball, grey, monkeypatch, capsys):
    words = (ball, "--env", grey, "--size", "33x18", "--spp", "1", "--turntable", "2", "--mp4")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert "--mp4 needs the package imageio-ffmpeg" in refused(capsys, "relight", *words, "--out", tmp_path / "none")
    assert not (tmp_path / "none").exists()
    monkeypatch.undo()
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg (extra video) is not installed")
    assert run(*words, "--out", tmp_path / "out") == DONE
    reader = imageio_ffmpeg.read_frames(str(tmp_path / "out/animation.mp4"))
    assert next(reader)["size"] == (32, 18) and len(list(reader)) == 2


def test_the_cameras_of_a_data_set_at_its_size(tmp_path, ball, grey):
    data = tmp_path / "data"
    (view,) = turntable(read_asset(ball), 1, size=(24, 20))
    frames = [{"file_path": "./test/r_0", "transform_matrix": view.pose.tolist()}] * 2
    data.mkdir()
    (data / "transforms_test.json").write_text(json.dumps({"fl_x": view.intrinsics[0], "frames": frames}))
    write_image(data / "test/r_0.png", np.ones((20, 24, 4)))
    assert run(ball, "--env", grey, "--spp", "4", "--data", data, "--out", tmp_path / "a") == DONE
    assert run(ball, "--env", grey, "--spp", "4", "--size", "24x20", "--out", tmp_path / "b") == DONE
    assert sorted(p.name for p in (tmp_path / "a").glob("*.exr")) == ["000.exr", "001.exr"]
    assert np.array_equal(read_image(tmp_path / "a/000.exr"), read_image(tmp_path / "b/000.exr"))


def test_an_interrupted_call_leaves_whole_frames_only(tmp_path, ball, grey, monkeypatch, capsys):
    def interrupt(folder, index, linear, *, with_alpha, write=rendering.write_frame):
        if index == 1:
            raise KeyboardInterrupt
        write(folder, index, linear, with_alpha=with_alpha)

    monkeypatch.setattr(rendering, "write_frame", interrupt)
    words = ("--env", grey, "--size", "8", "--spp", "1", "--turntable", "3", "--gif", "--out", tmp_path / "out")
    assert run(ball, *words) == INTERRUPTED
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000.exr", "000.png"]
    assert "interrupted" in capsys.readouterr().err


def test_animations_need_frames_of_one_size(tmp_path, ball, grey, capsys):
    pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg (extra video) is not installed")
    frames = [{"transform_matrix": np.eye(4).tolist(), "w": size, "h": size} for size in (8, 9)]
    (tmp_path / "path.json").write_text(json.dumps({"camera_angle_x": 1.0, "frames": frames}))
    words = (ball, "--env", grey, "--spp", "1", "--path", tmp_path / "path.json", "--out", tmp_path / "out")
    assert "the frames differ in size; give --size" in refused(capsys, "relight", *words, "--gif")
    assert "--mp4 needs frames of at least 2x2 pixels" in refused(capsys, "relight", *words, "--size", "1", "--mp4")
    assert not (tmp_path / "out").exists()
    assert run(*words) == DONE
    # Seen from the origin, looking down, the ball is out of sight: clear pictures, alpha included.
    assert read_image(tmp_path / "out/001.png").shape == (9, 9, 4) and not read_image(tmp_path / "out/001.exr").any()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("{ball} --env {tmp}/none.exr", "none.exr: no such environment map"),
        ("{tmp}/none.glb --env {grey}", "none.glb: no such file"),
        ("{tmp} --env {grey}", "has no mesh.glb; finish its training"),
        ("{ball} --env {grey} --env {grey}", "two maps have the same name"),
        ("{ball} --env {grey} --turntable 0", "--turntable must be at least 1"),
        ("{ball} --env {grey} --elevation 90", "--elevation must lie between -90 and 90"),
        ("{ball} --env {grey} --elevation nan", "--elevation must lie between -90 and 90"),
        ("{ball} --env {grey} --spp 0", "--spp must lie between 1 and"),
        ("{ball} --env {grey} --exposure nan", "--exposure must lie between -20 and 20"),
        ("{ball} --env {grey} --background sky", "sky: no such image"),
        ("{ball} --env {grey} --data {tmp}/none", "none: no such folder"),
        ("{ball} --env {grey} --path {tmp}/none.json", "none.json: no such file"),
        ("{ball} --env {grey} --out {ball}", "ball.glb: is a file; give --out a folder"),
    ]
    + [(f"{{ball}} --env {{grey}} --size {size}", "--size must be W or") for size in "big 0 64x 6x4x3 16385".split()],
)
def test_bad_input_ends_with_2_one_line_and_no_folder(tmp_path, ball, grey, capsys, words, message):
    words = [word.format(tmp=tmp_path, ball=ball, grey=grey) for word in words.split()]
    assert message in refused(capsys, "relight", "--out", tmp_path / "out", *words)
    assert not (tmp_path / "out").exists()


# ---- the lights that the program makes ----


@pytest.mark.parametrize("name", STUDIO_LIGHTS)
def test_a_white_matte_surface_that_faces_the_light_is_white(name):
    """The radiance of a white Lambertian surface is irradiance / pi; the largest over all normals is 1."""
    light = studio_light(name)
    assert light.shape == (128, 256, 3) and light.dtype == np.float32 and light.min() >= 0
    directions, areas = directions_of_texels(128)
    flux = (light.mean(axis=2) * areas).ravel()
    normals = directions_of_texels(12)[0].reshape(-1, 3)
    radiance = [np.clip(directions.reshape(-1, 3) @ normal, 0, None) @ flux / np.pi for normal in normals]
    assert max(radiance) == pytest.approx(1, abs=0.02)


def test_lights_stand_where_they_are_set():
    """The sun at the left behind the camera, zenith above horizon above ground, and boxes of their width and height."""
    brightest = np.unravel_index(studio_light("sunny").mean(axis=2).argmax(), (128, 256))
    sun = directions_of_texels(128)[0][brightest]
    assert np.degrees([np.arctan2(sun[1], sun[0]), np.arcsin(sun[2])]) == pytest.approx([-140, 42], abs=1.5)
    sky, ground = studio_light("overcast")[[0, 58, -1]].mean(axis=(1, 2)), studio_light("overcast")[70:]
    assert sky[0] > 1.5 * sky[1] > 2 * sky[2] and ground.std(axis=(0, 1)).max() < 1e-4
    rays = [[1, 0.4, 0], [1, 0.5, 0], [1, 0.6, 0], [1, 0, 0.2], [1, 0, 0.3], [-1, 0, 0]]
    assert soft_box(np.array(rays), direction(0, 0), 0.5, 0.25)[:, 0] == pytest.approx([1, 0.5, 0, 1, 0, 0])


def test_relight_takes_their_names(ball, tmp_path, capsys):
    words = ["relight", str(ball), "--size", "24", "--spp", "16"]
    lights = [word for name in STUDIO_LIGHTS for word in ("--env", name)]
    assert main([*words, *lights, "--out", str(tmp_path / "lit")]) == DONE
    pictures = [read_image(tmp_path / "lit" / name / "000.exr")[..., :3] for name in STUDIO_LIGHTS]
    assert min(np.abs(a - b).mean() for i, a in enumerate(pictures) for b in pictures[:i]) > 0.01
    assert f"or {', '.join(STUDIO_LIGHTS)}" in refused(capsys, *words, "--env", "studoi", "--out", tmp_path / "no")
    assert not (tmp_path / "no").exists()
    with pytest.raises(SystemExit):
        main(["relight", "--help"])
    assert ", ".join(STUDIO_LIGHTS) in " ".join(capsys.readouterr().out.split())


def test_a_file_of_that_name_goes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "studio").write_text("a file")
    with pytest.raises(Exception, match="use an .exr or .hdr file"):
        light_named("studio")
    assert np.array_equal(light_of("sunset", "x").radiance, studio_light("sunset"))
