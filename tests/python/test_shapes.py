"""Built-in shapes: closed, of known topology, volume and walls, open where they should be, and data made of them."""

from __future__ import annotations

import numpy as np
import pytest
from splitnerf.cli import BAD_INPUT, DONE, build_parser, main
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import write_image
from splitnerf.data.truth import load_scene_truth, load_view_truths
from splitnerf.evaluate.scoring import asset_mesh
from splitnerf_tools.commands import synth as command
from splitnerf_tools.synth.shapes import MATERIALS, SHAPES, pattern, shape_asset

TUNNELS = {"mug": 1, "rings": 1, "mask": 2}  # through the body; the others have none
WALLS = {"bowl": 0.08, "mug": 0.08, "box": 0.08, "vase": 0.07, "shell": 0.06, "mask": 0.07}
FLOORS = {"bowl": -0.87, "mug": -0.52, "box": -0.37, "vase": -0.73}  # where a ray down the axis ends


@pytest.fixture(scope="module")
def assets():
    """All shapes, meshed coarsely."""
    return {name: shape_asset(name, "matte", resolution=96) for name in SHAPES}


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_one_closed_body_with_as_many_tunnels_as_it_says(assets, name):
    mesh = asset_mesh(assets[name])
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert mesh.euler_number == 2 - 2 * TUNNELS.get(name, 0)
    assert np.abs(mesh.vertices).max() < 1 and mesh.volume > 0


def edges(length: float, radius: float) -> float:
    """The volume that rounding takes from right-angled edges."""
    return (1 - np.pi / 4) * radius**2 * length


def bowl() -> float:
    """A shell of radii 0.87 and 0.95 below z = -0.04, and half a ring of radius 0.04 on it."""
    outer, inner, low, rim = 0.95, 0.87, 0.04, 0.04
    half = np.pi * (2 * (outer**3 - inner**3) / 3 - low * (outer**2 - inner**2))
    return half + 2 * np.pi * (outer + inner) / 2 * np.pi * rim**2 / 2


def box() -> float:
    """1.4 x 1 x 0.85 with edges of 0.06, less a cavity with walls of 0.08, less the rim's two rounded edges of 0.04."""
    outer = 1.4 * 1.0 * 0.85 - edges(4 * 0.85 + 2 * (1.4 + 1.0), 0.06)
    return outer - 1.24 * 0.84 * 0.77 - edges(2 * 2 * (1.32 + 0.92), 0.04)


def plinth() -> float:
    """A ball of radius 0.45 that sinks 0.01 into a block of 1.2 x 1.2 x 0.4 with edges of 0.04."""
    sunk = np.pi * 0.01**2 * (0.45 - 0.01 / 3)
    return 4 / 3 * np.pi * 0.45**3 - sunk + 1.2 * 1.2 * 0.4 - edges(4 * (1.2 + 1.2 + 0.4), 0.04)


@pytest.mark.parametrize("volume", [bowl, box, plinth], ids=lambda f: f.__name__)
def test_volumes_are_those_of_the_formulas(assets, volume):
    assert asset_mesh(assets[volume.__name__]).volume == pytest.approx(volume(), rel=0.004)


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


@pytest.fixture(scope="module")
def light(tmp_path_factory):
    path = tmp_path_factory.mktemp("light") / "light.exr"
    write_image(path, np.full((8, 16, 3), 0.7, np.float32))
    return path


def test_the_command_renders_a_shape_with_its_truth(light, tmp_path):
    words = f"synth --shape mug --material glossy --light {light} --out {tmp_path / 'data'}"
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


def test_the_command_names_what_there_is():
    assert command.SHAPES == tuple(SHAPES) and command.MATERIALS == tuple(MATERIALS)


@pytest.mark.parametrize(
    ("words", "listed"),
    [
        ("--shape cup", SHAPES),
        ("--shape mug --material wood", MATERIALS),
        ("", ["ASSET.glb", "--shape"]),
        ("a.glb --shape mug", ["ASSET.glb", "--shape"]),
    ],
)
def test_wrong_names_are_refused_in_a_line_that_lists_the_right_ones(words, listed, capsys):
    with pytest.raises(SystemExit) as ended:
        build_parser().parse_args(f"synth {words} --light l.hdr --out o".split())
    assert ended.value.code == BAD_INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    assert all(name in line for name in listed)


def test_a_material_needs_a_shape(tmp_path, capsys):
    words = f"synth a.glb --material metal --light l.hdr --out {tmp_path / 'o'}"
    assert main(words.split()) == BAD_INPUT and "give --shape" in capsys.readouterr().err
