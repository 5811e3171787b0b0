"""The swap table on a scene of two balls, and the assets that are hard to reconstruct."""

import dataclasses

import numpy as np
import pytest
import trimesh
from bench import hard_scenes, limits
from bench.swap import PARTS, Canvas, NearestPoints
from bench.tubes import assemble
from painted_ball import bare
from splitnerf.data.asset import Asset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import write_image
from splitnerf.evaluate.scoring import Protocol, evaluate_asset
from splitnerf.export.writers import write_glb
from splitnerf_tools.synth.rendering import SynthSettings, synthesise
from test_synth import piece

SPP = 4


def spoiled(asset: Asset) -> Asset:
    """The same shape with wrong materials and tilted normals."""
    right = Canvas(asset, asset, 256).painted(())
    material = dataclasses.replace(
        right.materials[0],
        albedo_texture=(0.9 - 0.8 * right.materials[0].albedo_texture).astype(np.float32),
        roughness_metallic_texture=np.full((256, 256, 2), (0.9, 0.4), np.float32),
        normal_texture=np.broadcast_to(np.float32([0.6, 0, 0.8]), (256, 256, 3)).copy(),
    )
    return dataclasses.replace(right, materials=[material])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A data set of two balls, and a run's folder with a spoiled asset."""
    folder = tmp_path_factory.mktemp("limits")
    scene = trimesh.Scene(
        {
            "large": piece(trimesh.creation.icosphere(3, 0.6), (0.6, 0.2, 0.1), 0.0, 0.3, (0, 0, 0)),
            "small": piece(trimesh.creation.icosphere(3, 0.3), (0.8, 0.8, 0.4), 1.0, 0.2, (0.9, 0, 0)),
        }
    )
    (folder / "balls.glb").write_bytes(scene.export(file_type="glb", include_normals=True))
    light = np.full((16, 32, 3), 0.3, np.float32)
    light[4:8, 10:14] = 8
    write_image(folder / "light.exr", light)
    write_image(folder / "turned.exr", np.roll(light, 11, axis=1))
    settings, lights = SynthSettings(size=32, train=2, test=2, spp=64), (folder / "light.exr", [folder / "turned.exr"])
    data = synthesise(folder / "balls.glb", *lights, folder / "data", settings)
    (folder / "run").mkdir()
    write_glb(folder / "run" / "mesh.glb", spoiled(read_asset(data / "asset.glb")))
    write_image(folder / "run" / "environment.exr", 0.5 * light)
    return folder / "run", data


def read_table(text: str) -> dict[str, dict[str, float]]:
    """The rows of the last table on a page."""
    lines = [line.strip("| ") for line in text.splitlines() if line.startswith("|")]
    keys = [key for key, _ in limits.COLUMNS]
    cells = [[cell.strip() for cell in line.split("|")] for line in lines[2:]]
    return {name: dict(zip(keys, map(float, values))) for name, *values in cells}


def test_the_table_has_the_ceiling_and_mends_one_part_at_a_time(files, tmp_path, monkeypatch):
    run, data = files
    page = tmp_path / "page.md"
    words = ["limits.py", run, data, "--views", 2, "--spp", SPP, "--texture", 256, "--sweeps", 1, "--out", page]
    monkeypatch.setattr("sys.argv", [str(word) for word in words])
    limits.main()
    text = page.read_text()
    rows = read_table(text)
    assert "commit " in text and list(rows)[: -len(limits.STARTS)] == [name for name, _ in limits.ROWS]
    refined = dict(zip(limits.STARTS, list(rows.values())[-len(limits.STARTS) :]))
    assert refined["all true"]["albedo"] > refined["ours"]["albedo"] + 5

    protocol = Protocol(views=2, spp=SPP)
    for name, path in (("ours", run / "mesh.glb"), ("all true", data / "asset.glb")):
        scores = evaluate_asset(path, data, protocol).scores
        for key, value in (
            ("relit", scores["relight"]["psnr"]),
            ("relit_raw", scores["relight"]["raw"]["psnr"]),
            ("albedo", scores["albedo"]["psnr"]),
            ("roughness", scores["roughness_mae"]),
            ("smooth", scores["normal_mae_deg"]),
        ):
            assert rows[name][key] == pytest.approx(value, abs=6e-3), (name, key)

    ours, ceiling = rows["ours"], rows["all true"]
    assert ceiling["shading"] == 0 and ceiling["relit_quiet"] > ceiling["relit"] + 1
    for part in PARTS:
        key = "shading" if part == "normals" else part
        mended, left = rows[f"true {part}"], rows[f"all true but {part}"]
        tolerance = {"albedo": 0.5, "shading": 0.7}.get(key, 0.01)
        assert mended[key] == pytest.approx(ceiling[key], abs=tolerance) != pytest.approx(ours[key], abs=5 * tolerance)
        assert left[key] == pytest.approx(ours[key], abs=5 * tolerance), key
        for other in {"albedo", "roughness", "metallic", "shading"} - {key}:
            assert mended[other] == pytest.approx(ours[other], abs=0.02), (part, other)
    for whole in ("true mesh, normals", "true materials", "all true but mesh"):
        assert rows[whole]["relit"] <= ceiling["relit"] + 0.3
    assert rows["all true but mesh"]["relit"] == pytest.approx(ceiling["relit"], abs=0.3)  # the mesh is the true one
    assert ours["relit"] < ceiling["relit"] - 3


def test_nearest_points_are_on_the_sheet_that_faces_the_same_way():
    thickness = 0.01
    box = trimesh.creation.box(extents=(2, 2, thickness))
    draw = np.random.default_rng(0)
    points = draw.uniform(-0.9, 0.9, (200, 3)) * [1, 1, 0] + [0, 0, 0.004]
    for side in (1.0, -1.0):
        triangles, weights = NearestPoints(bare(box))(points, np.tile([0, 0, side], (200, 1)))
        found = (box.vertices[box.faces[triangles]] * weights[..., None]).sum(axis=1)
        assert found == pytest.approx(points * [1, 1, 0] + [0, 0, side * thickness / 2], abs=1e-5)


# ---- hard scenes ----

DETAIL = 0.12


@pytest.mark.parametrize("name", hard_scenes.SCENES)
def test_hard_scenes_are_closed_and_face_outward(name, tmp_path):
    tubes = hard_scenes.SCENES[name]()
    asset = assemble(name, tubes, DETAIL)
    write_glb(tmp_path / "a.glb", asset)
    read = read_asset(tmp_path / "a.glb")
    assert read.vertices == pytest.approx(asset.vertices, abs=1e-6) and len(read.triangles) == len(asset.triangles)
    assert np.linalg.norm(read.normals, axis=1) == pytest.approx(1, abs=1e-5)
    assert 0 <= read.uv.min() and read.uv.max() <= 1

    parts = trimesh.Trimesh(read.vertices, read.triangles, process=True, merge_tex=True, merge_norm=True).split()
    assert len(parts) == len(tubes)
    assert all(part.is_watertight and part.is_winding_consistent and part.volume > 0 for part in parts)
    flat = trimesh.Trimesh(read.vertices, read.triangles, process=False).face_normals
    assert ((flat * read.normals[read.triangles[:, 0]]).sum(axis=1) > 0).mean() > 0.99
