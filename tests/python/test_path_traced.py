"""AssetRenderer: constants come out as they are, and real assets look as Blender renders them."""

import json
import math
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from mesh_shapes import scene_of
from op_checks import generator, unit
from splitnerf import _core
from splitnerf.data.asset import Asset, Material
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import linear_to_srgb, over_background, read_image
from splitnerf.evaluate.metrics import psnr
from splitnerf.fields.occlusion import bit_counts
from splitnerf.ops import MeshScene, occlusion_factors
from splitnerf.ops._library import lib
from splitnerf.render.path_traced import AssetRenderer

SCENES = Path(os.environ.get("SPLITNERF_DATA", "../shared/data")) / "scenes"
SIZE = 16
FROM_ABOVE = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4.0]])


def square(material: Material) -> Asset:
    """[-1, 1]^2 at z = 0, its texture upright when seen from above."""
    vertices, faces = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.int32([[0, 1, 2], [0, 2, 3]])
    uv, up, tangents = [[0, 1], [1, 1], [1, 0], [0, 0]], [[0, 0, 1]] * 4, np.float32([[1, 0, 0, 1]] * 4)
    arrays = np.float32(vertices), faces, np.float32(up), np.zeros(2, np.int32)
    return Asset("square", *arrays, [material], uv=np.float32(uv), tangents=tangents)


def render(asset: Asset, light: float = 1.0, **options) -> dict[str, np.ndarray]:
    environment = np.full((4, 8, 3), light, np.float32)
    focal = 4 * SIZE / 2  # the square fills the image
    lens = (focal, focal, SIZE / 2, SIZE / 2)
    return AssetRenderer(asset).render(environment, FROM_ABOVE, lens, SIZE, SIZE, **options)


def test_colours_of_vertices_multiply_the_material():
    asset = square(Material(albedo=(0.5, 1.0, 1.0), roughness=0.6, metallic=0.3))
    asset.colors = np.tile(np.array([0.5, 0.25, 1], np.float32), (4, 1))
    maps = render(asset, spp=4)
    assert maps["albedo"][8, 8] == pytest.approx([0.25, 0.25, 1])
    assert [maps[name][8, 8] for name in ("roughness", "metallic")] == pytest.approx([0.6, 0.3])


def test_triangles_have_their_own_materials_and_normals_their_tilt():
    asset = square(Material(albedo=(1.0, 0.0, 0.0)))
    asset.materials.append(Material(albedo=(0.0, 1.0, 0.0)))
    asset.material_ids = np.array([1, 0], np.int32)
    asset.normals = np.tile(np.array([0.6, 0, 0.8], np.float32), (4, 1))
    maps = render(asset, spp=1, pixel_filter="box")
    assert maps["albedo"][-3, -2] == pytest.approx([0, 1, 0]) and maps["albedo"][2, 1] == pytest.approx([1, 0, 0])
    assert maps["smooth_normal"][8, 8] == pytest.approx([0.6, 0, 0.8], abs=1e-6)


def trough() -> Asset:
    """Two white walls that meet at 45 degrees in the y axis, seen from above: light reaches the eye by many bounces."""
    asset = square(Material(albedo=(1.0, 1.0, 1.0)))
    asset.vertices = np.array(
        [[0, -1, 0], [0, 1, 0], [1, 1, 2], [1, -1, 2], [0, -1, 0], [0, 1, 0], [-1, 1, 2], [-1, -1, 2]], np.float32
    )
    asset.triangles = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]], np.int32)
    normals = np.array([[-2, 0, 1], [2, 0, 1]], np.float32) / np.sqrt(5)
    asset.normals, asset.material_ids = np.repeat(normals, 4, axis=0), np.zeros(4, np.int32)
    asset.uv = asset.tangents = None
    return asset


def test_bounces_and_their_bound_are_as_asked():
    """More bounces are brighter; indirect light of 40 is clamped to 10 unless that is not asked for, as is the default."""
    asset = trough()
    levels = {n: render(asset, light=1.0, spp=64, bounces=n)["radiance"].mean() for n in (0, 1, 4)}
    assert levels[0] < 0.8 * levels[1] < 0.8 * levels[4]
    wide = render(asset, spp=64, pixel_filter="blackman-harris")["radiance"]
    assert np.array_equal(render(asset, spp=64)["radiance"], wide) and wide.mean() == levels[4]
    bright = {c: render(asset, light=40.0, spp=64, clamp_indirect=c)["radiance"].mean() for c in (0.0, 10.0)}
    assert bright[0.0] == pytest.approx(40 * levels[4], rel=0.05) and bright[10.0] < 0.8 * bright[0.0]
    assert render(asset, light=40.0, spp=64)["radiance"].mean() == bright[10.0]


def test_a_texture_of_another_shape_is_refused():
    with pytest.raises(ValueError, match="roughness_metallic_texture must be"):
        AssetRenderer(square(Material(roughness_metallic_texture=np.zeros((2, 2, 3), np.float32))))


@pytest.mark.skipif(not _core.embree_version(), reason="needs the build with Embree: rays one by one are too slow")
@pytest.mark.parametrize("scene, least", [("boombox", 34.0), ("avocado", 43.0), ("corset", 39.0), ("teapot", 39.0)])
def test_looks_as_in_blender(scene, least):
    """One relit view against Cycles at 64 samples, denoised: camera, axes, light, colour spaces and BSDF at once."""
    folder = SCENES / scene
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent; set SPLITNERF_DATA")
    meta = json.loads((folder / "transforms_test.json").read_text())
    truth = read_image(folder / "test" / "r_000_relit_sunset.png")
    height, width = truth.shape[:2]
    focal = 0.5 * width / np.tan(0.5 * meta["camera_angle_x"])
    camera = np.array(meta["frames"][0]["transform_matrix"]), (focal, focal, width / 2, height / 2), width, height
    light = read_environment(folder / "relight_sunset.hdr")
    maps = AssetRenderer(read_asset(folder / "asset.glb")).render(light, *camera, spp=64)
    straight = maps["radiance"] / np.maximum(maps["alpha"], 1e-8)[..., None]
    image = over_background(np.clip(linear_to_srgb(straight), 0, 1), maps["alpha"])
    assert psnr(image, over_background(truth[..., :3], truth[..., 3])) > least


class Asked(Exception):
    """What the test's signal raises."""


def test_a_signal_ends_a_rendering():
    """The handler runs while views are rendered: it would run but once if it waited for their end."""
    calls, done = [], threading.Event()

    def handler(number, frame) -> None:
        calls.append(number)
        if len(calls) == 2:
            raise Asked

    def ask() -> None:
        while not done.wait(0.02):
            os.kill(os.getpid(), signal.SIGUSR1)

    previous = signal.signal(signal.SIGUSR1, handler)
    asking = threading.Thread(target=ask)
    try:
        asking.start()
        with pytest.raises(Asked):
            render(square(Material()), spp=1 << 15)
    finally:
        done.set()
        asking.join()
        signal.signal(signal.SIGUSR1, previous)


BAD = [math.nan, math.inf, -math.inf, 1e19, 3e38]
DOWN, ABOVE = torch.tensor([0.0, 0.0, -1.0]), torch.tensor([0.0, 0.0, 3.0])
NORMALS, OTHERS = unit(torch.randn(20, 3, generator=generator(0))), torch.arange(20) != 4


# ---- numbers that would end the process: refused, or meet nothing ----


@pytest.fixture(scope="module")
def ball() -> MeshScene:
    return scene_of(trimesh.creation.icosphere(subdivisions=2))


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e13, 1e18, 3e38])
def test_vertices_out_of_reach_are_refused(value):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, value, 0]], np.float32)
    with pytest.raises(ValueError, match="Scene: vertex 2 is not finite, or farther than 1e12"):
        MeshScene(vertices, np.array([[0, 1, 2]]))


@pytest.mark.parametrize(
    ("n_vertices", "columns", "faces"),
    [(3, 3, [1, 2, 3]), (3, 3, [-1, 0, 1]), (3, 3, [1 << 32, 1, 2]), (3, 3, []), (0, 3, [0, 1, 2]), (3, 2, [0, 1, 2])],
)
def test_meshes_that_are_none_are_refused(n_vertices, columns, faces):
    with pytest.raises(ValueError):
        MeshScene(np.eye(3, dtype=np.float32)[:n_vertices, :columns], np.reshape(faces, (-1, 3)).astype(np.int64))
    with pytest.raises(TypeError, match="faces must be integers, got float64"):
        MeshScene(np.eye(3), np.array([[0, 1, 1.7]]))


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("which", ["origin", "direction"])
def test_rays_that_are_none_meet_nothing_and_their_neighbours_what_they_met(ball, value, which):
    """In a packet of 16 with others, alone, and in the last packet."""
    origins, directions = ABOVE.repeat(35, 1), DOWN.repeat(35, 1)
    bad = torch.zeros(35, dtype=torch.bool)
    bad[[0, 7, 16, 34]] = True
    (origins if which == "origin" else directions)[bad, 1] = value
    assert torch.equal(ball.is_open(origins, directions), bad)
    triangles, _, _ = ball.trace_closest(origins.numpy(), directions.numpy())
    assert np.array_equal(triangles < 0, bad.numpy())


LENGTHS = {math.nan: False, -1.0: False, -math.inf: False, math.inf: True, 3e38: True, 1.9: False, 2.1: True}


@pytest.mark.parametrize(("t_far", "meets"), LENGTHS.items())
def test_rays_end_at_their_length_and_lengths_that_are_none_meet_nothing(ball, t_far, meets):
    """The ball begins at 2."""
    assert bool(ball.is_open(ABOVE[None], DOWN[None], t_far)) != meets


@pytest.mark.parametrize("value", BAD)
def test_points_that_are_none_leave_the_factors_of_others_alone(ball, value):
    inputs = {name: NORMALS.clone() for name in ("positions", "normals", "lobe_dirs")}
    inputs |= {"roughness": torch.full((20, 1), 0.5), "environment": torch.ones(4, 8, 3), "offset": 0.01}
    inputs |= {"n_diffuse_rays": 16, "n_specular_rays": 16, "seed": 1}
    factors = lambda **changed: occlusion_factors(ball, **inputs | changed)
    for name in ("positions", "normals", "lobe_dirs"):
        changed = NORMALS.clone()
        changed[4, 0] = value
        assert all(torch.equal(a[OTHERS], b[OTHERS]) for a, b in zip(factors(), factors(**{name: changed})))
    if math.isfinite(value):
        assert all((part > 0.999).all() for part in factors(offset=value))  # nothing is met from there


@pytest.mark.parametrize("value", BAD)
def test_bits_of_points_that_are_none(ball, value):
    """They are open wherever they count; those of others are as they were."""
    points, directions = 0.5 * NORMALS, unit(torch.randn(64, 3, generator=generator(1)))
    good, hits = lib.visibility_bits(ball.handle, points, NORMALS, directions, 0.01, True)
    points[4, 0] = value
    found, their_hits = lib.visibility_bits(ball.handle, points, NORMALS, directions, 0.01, True)
    assert torch.equal(good[OTHERS], found[OTHERS]) and torch.equal(hits[OTHERS], their_hits[OTHERS])
    assert bit_counts(found[4:5, 1]) == 0 and (their_hits[4] < 0).all() and bit_counts(good[4:5, 1]) > 0
