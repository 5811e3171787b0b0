"""Exports: axes, winding, colours, and nothing written for a degenerate mesh."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import trimesh

from splitnerf.data.images import linear_to_srgb, read_hdr
from splitnerf.export.environment import write_environment
from splitnerf.export.mesh import write_mesh_glb, write_mesh_ply


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
        dtype = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
        values = np.frombuffer(binary, dtype, view["byteLength"] // np.dtype(dtype).itemsize, view["byteOffset"])
        arrays[name] = values.reshape(accessor["count"], -1)
    return document, arrays


def test_glb_is_y_up_with_linear_colours_and_factors(tmp_path, ball):
    vertices, faces, normals, albedo = ball
    write_mesh_glb(tmp_path / "a.glb", vertices, faces, normals, albedo, 0.4, 0.1)
    document, arrays = parse_glb(tmp_path / "a.glb")
    top = vertices[:, 2].argmax()
    assert arrays["POSITION"][top] == pytest.approx([0, 3, 0], abs=1e-6)  # +z in the world is +y in the file
    assert arrays["POSITION"] == pytest.approx(vertices[:, [0, 2, 1]] * [1, 1, -1], abs=1e-6)
    assert arrays["NORMAL"] == pytest.approx(normals[:, [0, 2, 1]] * [1, 1, -1], abs=1e-6)
    assert arrays["COLOR_0"][:, :3] / 65535 == pytest.approx(albedo, abs=1e-5)
    assert (arrays["COLOR_0"][:, 3] == 65535).all()
    assert np.array_equal(arrays["indices"].reshape(-1, 3), faces)
    material = document["materials"][0]["pbrMetallicRoughness"]
    assert (material["roughnessFactor"], material["metallicFactor"]) == pytest.approx((0.4, 0.1))
    accessor = document["accessors"][0]
    assert accessor["min"] == arrays["POSITION"].min(axis=0).tolist()
    assert accessor["max"] == arrays["POSITION"].max(axis=0).tolist()


@pytest.mark.parametrize("flip", [False, True])
def test_faces_point_outward_whatever_came_in(tmp_path, ball, flip):
    vertices, faces, normals, albedo = ball
    faces = faces[:, ::-1] if flip else faces
    write_mesh_glb(tmp_path / "a.glb", vertices, faces, normals, albedo, 0.4, 0.1)
    write_mesh_ply(tmp_path / "a.ply", vertices, faces)
    for name in ("a.glb", "a.ply"):
        assert trimesh.load(tmp_path / name, force="mesh").volume > 20


@pytest.mark.parametrize("flip", [False, True])
def test_winding_of_an_open_mesh_does_not_depend_on_where_it_stands(tmp_path, ball, flip):
    vertices, faces, _, _ = ball
    faces = faces[vertices[faces].mean(axis=1)[:, 0] > -0.5]
    moved = vertices + [-100, 50, 30]
    write_mesh_ply(tmp_path / "a.ply", moved, faces[:, ::-1] if flip else faces)
    mesh = trimesh.load(tmp_path / "a.ply", process=False)
    outward = mesh.triangles_center - [-100, 50, 30]
    assert ((mesh.face_normals * outward).sum(axis=1) > 0).all()


def test_ply_keeps_the_frame_and_encodes_colours(tmp_path, ball):
    vertices, faces, _, albedo = ball
    write_mesh_ply(tmp_path / "a.ply", vertices, faces, albedo)
    mesh = trimesh.load(tmp_path / "a.ply", process=False)
    assert mesh.vertices == pytest.approx(vertices, abs=1e-6)
    assert mesh.visual.vertex_colors[:, :3] / 255 == pytest.approx(linear_to_srgb(albedo), abs=0.5 / 255 + 1e-6)


BAD_MESHES = {
    "empty": (np.zeros((0, 3)), np.zeros((0, 3), int)),
    "no faces": (np.eye(3), np.zeros((0, 3), int)),
    "no area": (np.zeros((3, 3)), np.array([[0, 1, 2]])),
    "NaN": (np.full((3, 3), np.nan), np.array([[0, 1, 2]])),
    "infinite": (np.array([[np.inf, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2]])),
    "index too large": (np.eye(3), np.array([[0, 1, 3]])),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", BAD_MESHES)
def test_degenerate_mesh_writes_nothing(tmp_path, case):
    vertices, faces = BAD_MESHES[case]
    with pytest.raises(RuntimeError, match="a.ply: degenerate or empty mesh"):
        write_mesh_ply(tmp_path / "a.ply", vertices, faces)
    with pytest.raises(RuntimeError, match="a.glb: degenerate or empty mesh"):
        write_mesh_glb(tmp_path / "a.glb", vertices, faces, vertices, vertices, 0.5, 0.0)
    assert not list(tmp_path.iterdir())


def test_bad_attributes_are_named(tmp_path, ball):
    vertices, faces, normals, albedo = ball
    with pytest.raises(RuntimeError, match="albedo must be finite"):
        write_mesh_glb(tmp_path / "a.glb", vertices, faces, normals, albedo * np.nan, 0.5, 0.0)
    with pytest.raises(RuntimeError, match="normals must be finite"):
        write_mesh_glb(tmp_path / "a.glb", vertices, faces, normals[:5], albedo, 0.5, 0.0)
    with pytest.raises(RuntimeError, match="roughness and metallic must be finite"):
        write_mesh_glb(tmp_path / "a.glb", vertices, faces, normals, albedo, float("nan"), 0.0)


def test_environment_keeps_rows_and_columns(tmp_path):
    radiance = np.random.default_rng(0).random((8, 16, 3)).astype(np.float32)
    radiance[0, 4] = [100, 50, 25]
    exr, hdr = write_environment(tmp_path, radiance)
    assert (exr.name, hdr.name) == ("environment.exr", "environment.hdr")
    assert read_hdr(exr) == pytest.approx(radiance, rel=1e-3)
    assert np.abs(read_hdr(hdr) - radiance).max() <= 100 / 128
    assert np.unravel_index(read_hdr(hdr)[..., 0].argmax(), (8, 16)) == (0, 4)


def test_environment_brighter_than_half_is_stored_as_float(tmp_path):
    radiance = np.full((2, 4, 3), 1e6, np.float32)
    exr, _ = write_environment(tmp_path, radiance)
    assert np.array_equal(read_hdr(exr), radiance)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_bad_environment_writes_nothing(tmp_path, value):
    with pytest.raises(ValueError, match="finite and not negative"):
        write_environment(tmp_path, np.full((2, 4, 3), value))
    assert not list(tmp_path.iterdir())
