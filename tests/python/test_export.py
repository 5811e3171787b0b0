"""Exports: axes, winding, textures, nothing written for a degenerate mesh, and the command."""

import dataclasses
import io
import json
import re
import shutil
import struct
import zipfile

import numpy as np
import OpenImageIO as oiio
import pytest
import torch
import trimesh
from PIL import Image
from splitnerf.cli import DONE, main
from splitnerf.config import Config
from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.data.dataset import load_dataset, write_ground
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb, read_image, read_radiance
from splitnerf.data.json_files import read_json, write_json
from splitnerf.export.scene import write_assets, write_environment, write_mesh_ply
from splitnerf.export.simplify import is_closed
from splitnerf.export.writers import write_glb, write_obj, write_usdz
from splitnerf.fields import Light
from splitnerf.render.model import SceneModel
from splitnerf.render.seen import Cameras
from splitnerf.training.checkpoint import load_checkpoint
from splitnerf.training.loop import Training
from tiny_runs import refused, train


@pytest.fixture
def ball():
    mesh = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.asarray(mesh.vertices) * [1, 2, 3]
    albedo = (np.asarray(mesh.vertices) + 1) / 2
    return vertices, np.asarray(mesh.faces), np.asarray(mesh.vertex_normals), albedo


def parse_glb(path):
    """Document and decoded attributes, read by the glTF specification and not by the writer's code."""
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and length % 4 == 0
    document = json.loads(data[20 : 20 + length])
    size, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert kind == b"BIN\0" and size == document["buffers"][0]["byteLength"] and size % 4 == 0
    binary = data[28 + length :]
    primitive = document["meshes"][0]["primitives"][0]
    arrays = {}
    for name, index in (primitive["attributes"] | {"indices": primitive["indices"]}).items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["target"] == (34963 if name == "indices" else 34962)
        dtype = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
        values = np.frombuffer(binary, dtype, view["byteLength"] // np.dtype(dtype).itemsize, view["byteOffset"])
        arrays[name] = values.reshape(accessor["count"], -1)
    return document, arrays, binary


@pytest.fixture
def asset(ball):
    vertices, faces, normals, _ = ball
    rng = np.random.default_rng(0)
    uv = rng.random((len(vertices), 2)).astype(np.float32)
    albedo, gloss = (rng.random((8, 8, n)).astype(np.float32) for n in (3, 2))
    normal = np.broadcast_to(np.float32([0.6, 0, 0.8]), (8, 8, 3))
    material = Material("paint", (0.5, 0.25, 1.0), 0.9, 0.8, (0, 0, 0), albedo, gloss, normal)
    vertices, normals, faces = np.float32(vertices), np.float32(normals), np.int32(faces)
    tangents = vertex_tangents(vertices, faces, normals, uv)
    return Asset("ball", vertices, faces, normals, np.zeros(len(faces), np.int32), [material], uv, tangents)


def image_of(document, binary, index):
    view = document["bufferViews"][document["images"][document["textures"][index]["source"]]["bufferView"]]
    start = view.get("byteOffset", 0)
    return np.asarray(Image.open(io.BytesIO(binary[start : start + view["byteLength"]])))


def test_glb_is_y_up_with_textures_in_their_colour_spaces(tmp_path, asset):
    occlusion = np.random.default_rng(1).random((8, 8)).astype(np.float32)
    asset.colors = np.random.default_rng(2).random((len(asset.vertices), 3)).astype(np.float32)
    write_glb(tmp_path / "a.glb", asset, occlusion)
    document, arrays, binary = parse_glb(tmp_path / "a.glb")
    to_file = lambda v: v[:, [0, 2, 1]] * [1, 1, -1]  # noqa: E731 - +z in the world is +y in the file
    assert arrays["POSITION"] == pytest.approx(to_file(asset.vertices), abs=1e-6)
    assert arrays["NORMAL"] == pytest.approx(to_file(asset.normals), abs=1e-6)
    assert arrays["TANGENT"][:, :3] == pytest.approx(to_file(asset.tangents[:, :3]), abs=1e-6)
    assert np.array_equal(arrays["TANGENT"][:, 3], asset.tangents[:, 3])
    assert np.array_equal(arrays["COLOR_0"], asset.colors)
    assert arrays["TEXCOORD_0"] == pytest.approx(asset.uv, abs=1e-6)
    assert np.array_equal(arrays["indices"].reshape(-1, 3), asset.triangles)
    material = document["materials"][0]
    pbr = material["pbrMetallicRoughness"]
    assert pbr["baseColorFactor"] == pytest.approx([0.5, 0.25, 1.0, 1.0])
    assert (pbr["roughnessFactor"], pbr["metallicFactor"]) == pytest.approx((0.9, 0.8))
    assert material["occlusionTexture"]["index"] == pbr["metallicRoughnessTexture"]["index"]
    assert {x["name"] for x in document["images"]} == {f"{asset.name}_{k}" for k in ("basecolor", "orm", "normal")}
    assert {part[0]["name"] for part in (document[k] for k in ("nodes", "meshes", "materials"))} == {asset.name}
    stored = asset.materials[0]
    albedo = image_of(document, binary, pbr["baseColorTexture"]["index"]) / 255
    assert albedo == pytest.approx(linear_to_srgb(stored.albedo_texture), abs=0.51 / 255)
    orm = image_of(document, binary, pbr["metallicRoughnessTexture"]["index"]) / 255
    assert orm == pytest.approx(np.dstack([occlusion, stored.roughness_metallic_texture]), abs=0.51 / 255)
    normal = image_of(document, binary, material["normalTexture"]["index"]) / 255 * 2 - 1
    assert normal == pytest.approx(stored.normal_texture, abs=1.01 / 255)


def test_without_textures_there_are_factors_alone(tmp_path, asset):
    plain = dataclasses.replace(asset, uv=None, tangents=None, materials=[Material("grey", (0.3, 0.3, 0.3), 0.5)])
    write_glb(tmp_path / "a.glb", plain)
    document, arrays, _ = parse_glb(tmp_path / "a.glb")
    assert set(arrays) == {"POSITION", "NORMAL", "indices"} and "images" not in document
    write_obj(tmp_path / "a.obj", plain)
    first = [line for line in (tmp_path / "a.obj").read_text().splitlines() if line.startswith("f ")][0]
    assert first == "f " + " ".join(f"{i}//{i}" for i in plain.triangles[0] + 1)
    assert document["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 0.5


def test_obj_reads_back(tmp_path, asset):
    files = write_obj(tmp_path / "a.obj", asset)
    assert sorted(tmp_path.iterdir()) == sorted(files) and len(files) == 6
    mesh = trimesh.load(tmp_path / "a.obj", process=False)
    assert mesh.vertices == pytest.approx(asset.vertices[:, [0, 2, 1]] * [1, 1, -1], abs=1e-6)
    assert mesh.visual.uv == pytest.approx(asset.uv * [1, -1] + [0, 1], abs=1e-6)
    text = (tmp_path / "a.mtl").read_text()
    for line in ("map_Kd a_albedo.png", "map_Pr a_roughness.png", "map_Pm a_metallic.png", "norm a_normal.png"):
        assert line in text.splitlines()
    stored = asset.materials[0]
    assert read_image(tmp_path / "a_albedo.png") == pytest.approx(linear_to_srgb(stored.albedo_texture), abs=0.51 / 255)
    for i, name in enumerate(("roughness", "metallic")):
        values = read_image(tmp_path / f"a_{name}.png")[..., 0]
        assert values == pytest.approx(stored.roughness_metallic_texture[..., i], abs=0.51 / 255)
    assert {"Kd 0.5 0.25 1", "Pr 0.9", "Pm 0.8"} < set(text.splitlines())


def test_usdz_passes_usd_s_own_validators(tmp_path, asset):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    validation = pytest.importorskip("pxr.UsdValidation", reason="this usd-core has no validators")
    write_usdz(tmp_path / "a.usdz", asset, np.ones((8, 8), np.float32))
    stage = usd.Stage.Open(str(tmp_path / "a.usdz"))
    context = validation.ValidationContext(validation.ValidationRegistry().GetOrLoadAllValidators())
    assert [error.GetMessage() for error in context.Validate(stage)] == []
    points = np.array(stage.GetPrimAtPath("/ball/mesh").GetAttribute("points").Get())
    assert points == pytest.approx(asset.vertices[:, [0, 2, 1]] * [1, 1, -1], abs=1e-6)
    with zipfile.ZipFile(tmp_path / "a.usdz") as package:
        assert {"textures/albedo.png", "textures/orm.png", "textures/normal.png"} < set(package.namelist())
        assert all(info.compress_type == zipfile.ZIP_STORED for info in package.infolist())


@pytest.mark.parametrize("write", [write_glb, write_obj])
def test_bad_assets_write_nothing(tmp_path, asset, write):
    broken = {
        "vertices must be finite": {"vertices": asset.vertices * np.nan},
        "normals must be finite": {"normals": asset.normals[:5]},
        "empty mesh": {"triangles": np.zeros((0, 3), np.int32)},
        "2 materials": {"materials": asset.materials * 2},
        "have texture coordinates": {"uv": None},
        "tangents must be finite": {"tangents": asset.tangents * np.nan},
        "degenerate or empty": {"triangles": asset.triangles + 1},
    }
    for message, change in broken.items():
        with pytest.raises(RuntimeError, match=message):
            write(tmp_path / "a.out", dataclasses.replace(asset, **change))
    assert not list(tmp_path.iterdir())


CAMERAS = Cameras(torch.eye(4)[None], torch.tensor([[8.0, 8, 8, 8]]), torch.tensor([[16, 16]]))


def test_a_ply_stands_in_its_frame_with_encoded_colours(tmp_path, ball):
    vertices, faces, _, albedo = ball
    mesh = trimesh.Trimesh(vertices + [-100, 50, 30], faces, process=False)
    write_mesh_ply(tmp_path / "a.ply", mesh, albedo)
    read = trimesh.load(tmp_path / "a.ply", process=False)
    assert read.vertices == pytest.approx(mesh.vertices, abs=1e-5) and (read.faces == faces).all()
    assert read.visual.vertex_colors[:, :3] / 255 == pytest.approx(linear_to_srgb(albedo), abs=0.5 / 255 + 1e-6)


def test_an_environment_beyond_halves_keeps_its_numbers(tmp_path):
    bright = np.full((2, 4, 3), 1e6, np.float32)
    write_environment(tmp_path, bright)
    assert np.array_equal(read_radiance(tmp_path / "environment.exr"), bright)


@pytest.fixture
def run(data, tmp_path):
    """A run that was never trained: its surface is a sphere of radius 0.7 about the box's centre, in a world of its own."""
    torch.manual_seed(0)
    config = Config().replace({"n_levels": 4, "log2_table_size": 10, "grid_resolution": 16, "export.resolution": 48})
    (tmp_path / "run").mkdir()
    Training(load_dataset(data), config, tmp_path / "run", torch.device("cpu")).save()
    path, box_from_world = tmp_path / "run/checkpoint.pt", torch.diag(torch.tensor([2.0, 2, 2, 1]).double())
    box_from_world[:3, 3] = torch.tensor([-2.0, 0.0, 4.0])
    torch.save(load_checkpoint(path) | {"box_from_world": box_from_world, "cameras": CAMERAS._asdict()}, path)
    return path.parent


def test_export_writes_the_asset_in_the_data_s_world(tmp_path, run, capsys):
    out = tmp_path / "out"
    options = ["--out", str(out), "--faces", "1000", "--texture-size", "128", "--formats", "glb,ply,obj"]
    assert main(["export", str(run), *options]) == DONE
    line = capsys.readouterr().out.splitlines()[0]
    assert line.startswith("mesh: watertight, 1000 faces of ")
    assert line.endswith(", 0 floating, enclosed or unseen components dropped")
    files = "mesh.glb mesh.ply mesh.obj mesh.mtl environment.exr environment.hdr".split()
    maps = [f"mesh_{name}.png" for name in ("albedo", "roughness", "metallic", "normal")]
    assert {p.name for p in out.iterdir()} == {*files, *maps}
    full = trimesh.load(out / "mesh.ply", process=False)
    assert full.is_watertight and full.vertices.mean(axis=0) == pytest.approx([1, 0, -2], abs=0.05)
    document, arrays, _ = parse_glb(out / "mesh.glb")
    centre = (arrays["POSITION"].min(axis=0) + arrays["POSITION"].max(axis=0)) / 2
    assert centre == pytest.approx([1, -2, 0], abs=0.05)
    assert np.ptp(arrays["POSITION"], axis=0) == pytest.approx(0.7, rel=0.2)
    outward = ((arrays["POSITION"] - centre) * arrays["NORMAL"]).sum(axis=1)
    assert (outward > 0).all() and "TANGENT" in arrays and len(document["images"]) == 3


def test_an_asset_ends_at_the_ground(tmp_path, data):
    """The sphere stands in it: what training and a later export write is closed, and has nothing below it."""
    data = shutil.copytree(data, tmp_path / "data")
    write_ground(data, np.array([0, 0.6, 0.8, -0.2]))
    assert train(data, tmp_path / "run", "--steps", "2") == DONE
    assert main(["export", str(tmp_path / "run"), "--out", str(tmp_path / "again"), "--formats", "glb"]) == DONE
    for folder in ("run", "again"):
        asset = read_asset(tmp_path / folder / "mesh.glb")
        heights = asset.vertices @ [0, 0.6, 0.8] + 0.2
        assert abs(heights.min()) < 1e-3 and heights.max() > 0.5
        _, place = np.unique(asset.vertices, axis=0, return_inverse=True)
        assert is_closed(place.reshape(-1)[asset.triangles])


def test_export_stands_the_asset_on_its_foot_at_its_height(tmp_path, run, capsys):
    """The sphere's foot is the origin of all files, and origin.json takes them back to the data."""
    small = ["--faces", "1000", "--texture-size", "64", "--pivot", "foot", "--height", "0.25"]
    assert main(["export", str(run), "--out", str(tmp_path / "out"), *small]) == DONE
    assert "cameras of the data no longer fit" in capsys.readouterr().out
    document, arrays, _ = parse_glb(tmp_path / "out" / "mesh.glb")
    low, high = arrays["POSITION"].min(axis=0), arrays["POSITION"].max(axis=0)
    assert [low[1], high[1], low[0] + high[0], low[2] + high[2]] == pytest.approx([0, 0.25, 0, 0], abs=1e-6)
    assert document["meshes"][0]["name"] == "run"
    full = trimesh.load(tmp_path / "out" / "mesh.ply", process=False)
    placed = read_json(tmp_path / "out" / "origin.json", "origin")
    back = full.vertices / placed["scale"] + placed["origin"]
    assert back.mean(axis=0) == pytest.approx([1, 0, -2], abs=0.05) and np.ptp(back) > 0
    assert np.ptp(full.vertices[:, 2]) == pytest.approx(0.25, rel=0.02)
    again = ["--out", str(tmp_path / "out"), "--formats", "ply", "--overwrite"]
    assert main(["export", str(run), *again]) == DONE
    assert not (tmp_path / "out" / "origin.json").exists()


def test_export_scales_the_asset_and_adds_where_the_runs_own_world_is(tmp_path, run):
    moved = shutil.copytree(run, tmp_path / "moved")
    write_json(moved / "origin.json", {"origin": [10.0, 20.0, 30.0]})
    size = ["--faces", "1000", "--texture-size", "64", "--formats", "ply", "--pivot", "foot", "--scale", "2"]
    assert main(["export", str(moved), "--out", str(tmp_path / "out"), *size]) == DONE
    full = trimesh.load(tmp_path / "out" / "mesh.ply", process=False)
    placed = read_json(tmp_path / "out" / "origin.json", "origin")
    assert placed["scale"] == 2 and np.ptp(full.vertices, axis=0) == pytest.approx(1.4, rel=0.2)
    assert (full.vertices / 2 + placed["origin"]).mean(axis=0) == pytest.approx([11, 20, 28], abs=0.05)


class ThreeLamps(Light):
    """A red lamp along +x, a green one along +y, a blue one along +z, ten degrees wide, over a dim sky."""

    def __init__(self):
        super().__init__()
        self.level = torch.nn.Parameter(torch.tensor(5.0))

    def forward(self, directions, roughness):
        return 0.1 + self.level * (directions > np.cos(np.radians(10.0)))


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_the_exported_light_stands_as_it_does_in_the_world(tmp_path, suffix):
    """u = 0.5 - atan2(y, x) / (2 pi) from the left, v = acos(z) / pi from the top: +x in the middle, +y a quarter of the
    width to the left of it, +z at the top, as Blender has it. Read without the package."""
    torch.manual_seed(0)
    small = {"n_levels": 2, "log2_table_size": 8, "export_resolution": 24}
    model = SceneModel(Config().replace(small))
    model.light = ThreeLamps()
    write_assets(tmp_path, model, np.eye(4), CAMERAS, formats=("ply",))
    pixels = oiio.ImageBuf(str(tmp_path / f"environment.{suffix}")).get_pixels(oiio.FLOAT)[..., :3]
    assert pixels.shape == (128, 256, 3)
    row, column = np.mgrid[:128, :256] + 0.5
    red, green, blue = (pixels[..., k] > 1 for k in range(3))
    for lamp, x, y in ((red, 128, 64), (green, 64, 64)):
        assert (column[lamp].mean(), row[lamp].mean()) == pytest.approx((x, y), abs=0.4) and lamp.sum() > 64
        assert np.hypot(column[lamp] - x, row[lamp] - y).max() < 12
    assert row[blue].max() < 128 * 11 / 180 and blue[0].all()
    assert pixels[~(red | green | blue)] == pytest.approx(0.1, rel=0.01)


def test_export_goes_into_the_run_and_ply_needs_no_textures(run):
    assert main(["export", str(run), "--formats", "ply"]) == DONE
    assert {p.name for p in run.iterdir()} == {"checkpoint.pt", "mesh.ply", "environment.exr", "environment.hdr"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--formats", "glb,fbx"], "--formats: unknown 'fbx'; there are glb, ply, obj, usdz"),
        (["--faces", "-5"], "--faces must be 0 or at least 100, got -5"),
        (["--texture-size", "4"], r"--texture-size must be in \[8, 8192\], got 4"),
        (["--resolution", "2"], r"--resolution must be in \[8, 4096\], got 2"),
        (["--scale", "0"], "--scale must lie between 1e-6 and 1e6, got 0"),
        (["--height", "nan"], "--height must lie between 1e-6 and 1e6, got nan"),
        (["--pivot", "foot", "--out", "RUN"], "the run's own asset stands where the data are"),
        ([], "no such run"),
    ],
)
def test_bad_options_are_one_line_and_write_nothing(tmp_path, run, options, message, capsys):
    run = tmp_path / "none" if message == "no such run" else run
    options = [run if word == "RUN" else word for word in options]
    assert re.search(message, refused(capsys, "export", run, "--out", tmp_path / "out", *options))
    assert not (tmp_path / "out").exists()
