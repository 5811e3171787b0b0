"""Parts of the refinement with a closed form of their own: the outline, and the compact lamp."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import PHOTO, photos, sky, textured, with_textures
from splitnerf.data.environment import directions_of_texels
from splitnerf.data.images import linear_to_srgb, srgb_to_linear, write_image
from splitnerf.export.bake import rasterise
from splitnerf.ops import MeshScene
from splitnerf.refinement import lamps, outline
from splitnerf.refinement.contours import Mesh, coverage_slopes, edges_of, outline_pieces, projected
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.lamps import CompactLamp, brightest_lobe, compact_lamp, degrees_from, power_of, unit
from splitnerf.refinement.outline import by_colours, fit_outline, outline_pixels, slopes, weld
from splitnerf.refinement.pixels import PixelFilter, covered_pixels
from splitnerf.refinement.stage import Stage
from splitnerf.refinement.texels import AssetTexels


def test_the_density_is_the_windows():
    t = np.linspace(-1.499, 1.499, 601)
    u = 2 * np.pi * (t / 3 + 0.5)
    window = 0.35875 - 0.48829 * np.cos(u) + 0.14128 * np.cos(2 * u) - 0.01168 * np.cos(3 * u)
    across = np.stack([t, np.full_like(t, 0.3)], axis=1)
    peak = PixelFilter().density(np.array([0.0, 0.3]))
    np.testing.assert_allclose(PixelFilter().density(across) / peak, window / window.max(), atol=0.003)
    grid = np.stack(np.meshgrid(*[np.arange(-1.6, 1.6, 0.02)] * 2), axis=-1)
    assert PixelFilter().density(grid).sum() * 0.02**2 == pytest.approx(1.0, abs=0.002)


def test_edges_join_two_triangles():
    box = trimesh.creation.box()
    edges = edges_of(np.asarray(box.faces))
    assert len(edges.ends) == 18  # 12 of the box and a diagonal of each side
    for (a, b), sides, opposite in zip(edges.ends, edges.triangles, edges.opposite):
        for side, third in zip(sides, opposite):
            assert sorted(box.faces[side]) == sorted([a, b, third])
    assert len(edges_of(np.asarray(box.faces)[:1]).ends) == 0  # what one triangle has alone is no contour's
    assert len(edges_of(np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])).ends) == 0  # nor what three share


def test_a_piece_moves_as_its_edge_does_in_the_image(painted):
    """Long edges near a camera whose pixels are not square: each piece against finite differences of the edge's image."""
    pixels = covered_pixels(painted[1])
    pixels.intrinsics = np.tile(np.float32([30, 47, 18, 25]), (len(pixels.poses), 1))
    pose = pixels.poses[3].astype(np.float64)
    corners = np.array([[-0.8, -0.3, -3.0], [0.9, -0.5, -1.2], [0.2, 0.7, -2.5], [0.0, 0.1, -4.0]])
    vertices, faces = corners @ pose[:, :3].T + pose[:, 3], np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    pieces = outline_pieces(Mesh(vertices, faces, edges_of(faces)), pixels, 3, (50, 40))
    outline_edges = {tuple(ends) for ends in pieces.ends.tolist()}
    assert outline_edges == {(0, 1), (1, 2), (0, 2)} and len(pieces.points) > 60

    def image(points):
        return projected((points - pose[:, 3]) @ pose[:, :3], pixels.intrinsics[3])

    middle = image(vertices)[:3].mean(axis=0)
    for point, ends, moves in zip(pieces.points, pieces.ends, pieces.moves):
        a, b = image(vertices)[ends]
        outward = np.array([b[1] - a[1], a[0] - b[0]]) / np.linalg.norm(b - a)
        outward *= np.sign((point - middle) @ outward)
        for end, by_axis in zip(ends, moves):
            for axis in range(3):
                offsets = []
                for side in (-1e-4, 1e-4):
                    moved = vertices.copy()
                    moved[end, axis] += side
                    a, b = image(moved)[ends]
                    t = ((point - a) @ (b - a)) / ((b - a) @ (b - a))
                    offsets.append((a + t * (b - a) - point) @ outward)
                slope = (offsets[1] - offsets[0]) / 2e-4
                assert by_axis[axis] == pytest.approx(slope, abs=1e-3 * np.abs(pieces.moves).max())


def test_what_is_behind_the_camera_or_beside_the_photo_has_no_outline(painted):
    pixels, box = covered_pixels(painted[1]), trimesh.creation.box()
    faces = np.asarray(box.faces)
    away = pixels.poses[0][:, 2]  # from the object to the camera
    right = pixels.poses[0][:, 0]
    for shift, seen in ((0 * away, True), (10 * away, False), (30 * right, False)):
        pieces = outline_pieces(Mesh(box.vertices + shift, faces, edges_of(faces)), pixels, 0, (PHOTO, PHOTO))
        assert (len(pieces.points) > 0) == seen and np.isfinite(pieces.moves).all()
    pixels.poses = np.eye(4, dtype=np.float32)[None, :3]
    across = box.vertices * [3, 1, 2] + [2, 0, -1]  # from the camera's plane on
    with np.errstate(divide="raise", invalid="raise"):
        outline_pieces(Mesh(across, faces, edges_of(faces)), pixels, 0, (PHOTO, PHOTO))


def test_an_edge_just_outside_the_photo_changes_the_pixels_at_its_border(painted):
    """A plate that ends 0.7 pixels beyond: each pixel of the last column by the window at its distance, 1.2 pixels."""
    pixels, box, size, z = covered_pixels(painted[1]), trimesh.creation.box(), 40, 3.0
    pixels.poses, pixels.intrinsics = np.eye(4, dtype=np.float32)[None, :3], np.float32([[60, 60, size / 2, size / 2]])
    right = (size / 2 + 0.7) * z / 60
    plate = box.vertices * [4.0, 8.0, 0.5] + [right - 2.0, 0.0, -z - 0.25]  # its front at distance z
    faces = np.asarray(box.faces)
    pieces = outline_pieces(Mesh(plate, faces, edges_of(faces)), pixels, 0, (size, size))
    number = np.full((size, size), -1)
    number[20, -1] = 0
    by_x = coverage_slopes(pieces, number, len(plate), PixelFilter()).toarray()[0, ::3].sum()
    window = PixelFilter().density(np.array([1.2, 0.0])) / np.sqrt(PixelFilter().density(np.zeros(2)))
    assert by_x == pytest.approx(window * 60 / z, rel=0.05)


@pytest.fixture(scope="module")
def pair():
    """A box before a ball, so that outlines end where they pass behind the other one, and its photos."""
    ball, box = trimesh.creation.icosphere(subdivisions=3, radius=0.6), trimesh.creation.box(extents=[0.5, 0.6, 0.7])
    box.apply_transform(trimesh.transformations.rotation_matrix(0.5, [1, 2, 3]))
    box.apply_translation([0.9, 0.1, 0.2])
    both = trimesh.util.concatenate([ball, box])
    asset = textured(both)
    return asset, photos(asset, sky())


def test_slopes_of_the_coverage_are_its_differences(pair, monkeypatch):
    """By rays through both meshes, for moves that differ from vertex to vertex, and along the line of sight too."""
    asset, data = pair
    monkeypatch.setattr(outline, "RAYS", 16384)
    monkeypatch.setattr(outline, "BATCH", 50)
    first = data.images[..., 3].copy()
    first[2:] = 0.0  # two photos
    data = replace(data, images=np.concatenate([data.images[..., :3], first[..., None]], axis=-1))
    pixels, _ = outline_pixels(data)
    place = weld(asset.vertices)
    faces, vertices = place[asset.triangles], np.zeros((place.max() + 1, 3))
    vertices[place] = asset.vertices
    moves = 0.003 * np.sin(vertices[:, [1, 2, 0]] * [3, 2, 4] + [0, 1.5, 1])
    moves += 0.001 * np.random.default_rng(0).normal(size=moves.shape)

    edges = edges_of(faces)

    def covered(vertices):
        return outline.coverage(Mesh(vertices, faces, edges).scene, pixels, np.random.default_rng(1))

    found = covered(vertices + 0.5 * moves) - covered(vertices - 0.5 * moves)
    expected = slopes(Mesh(vertices, faces, edges), pixels, (PHOTO, PHOTO)) @ moves.reshape(-1)
    assert np.abs(found).max() > 0.05 and np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(found)


@pytest.mark.parametrize("scale", [0.96, 1.04])
@pytest.mark.parametrize("hard", [False, True])
def test_a_balls_outline_is_found(ball, painted, scale, hard):
    """A ball that is too small or too large gets its size back, from masks with soft edges and without, and stays closed."""
    data = painted[1]
    if hard:
        alpha = (data.images[..., 3:] > 0.5).astype(np.float32)
        data = replace(data, images=np.concatenate([data.images[..., :3], alpha], -1))
    wrong = replace(ball, vertices=scale * ball.vertices)
    found, errors = fit_outline(data, wrong)
    radius = np.linalg.norm(found.vertices, axis=1)
    assert abs(radius.mean() - 1) < 0.15 * abs(scale - 1) and radius.std() < 0.01
    assert errors[-1] < 0.3 * errors[0]
    assert weld(found.vertices).max() == weld(ball.vertices).max()  # what was one vertex still is


def test_a_true_outline_stays(ball, painted):
    found, errors = fit_outline(painted[1], ball)
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < 0.01 and errors[-1] < 1.2 * errors[0] < 5e-3


def test_a_dented_outline_is_found(pair):
    """Vertices move along the surface too: a box's edges come back, and no triangle turns over."""
    asset, data = pair
    place = weld(asset.vertices)
    field = np.sin(5 * asset.vertices[:, [1, 2, 0]] + [0.0, 1.0, 2.0])
    found, errors = fit_outline(data, replace(asset, vertices=(asset.vertices + 0.012 * field).astype(np.float32)))
    assert errors[-1] < 0.2 * errors[0]
    normals = [np.cross(*np.diff(a.vertices[a.triangles], axis=1).transpose(1, 0, 2)) for a in (asset, found)]
    assert (normals[0] * normals[1]).sum(axis=1).min() > 0 and weld(found.vertices).max() == place.max()


def test_an_outline_stays_above_the_ground(ball, painted):
    ground = np.array([0, 0, 1, -0.8])
    found, _ = fit_outline(replace(painted[1], ground=ground), replace(ball, vertices=0.96 * ball.vertices))
    assert found.vertices[:, 2].min() == pytest.approx(-0.8, abs=1e-6) and found.vertices[:, 2].max() > 0.98


def test_an_outline_is_where_colours_before_a_known_background_say(ball, painted, tmp_path):
    """The masks are those of a ball that is too small."""
    true, small = painted[1], replace(ball, vertices=0.96 * ball.vertices)
    alpha = np.array(true.images)[..., 3:]
    whole = linear_to_srgb(srgb_to_linear(np.array(true.images)[..., :3]) * alpha + 0.9 * (1 - alpha))
    write_image(
        tmp_path / "behind.png",
        np.float32([*linear_to_srgb(np.float32([0.9] * 3)), 1]) + np.zeros((PHOTO, PHOTO, 4), np.float32),
    )
    masks = np.array(photos(small, sky(), n=len(true), spp=16).images)[..., 3:]
    data = replace(true, images=np.concatenate([whole, masks], -1), behind_paths=[tmp_path / "behind.png"] * len(true))
    found = [fit_outline(replace(data, whole=told), small)[0] for told in (True, False)]
    size = [np.linalg.norm(asset.vertices, axis=1).mean() for asset in found]
    assert size == pytest.approx([0.98, 0.96], abs=0.006)  # masks count, too


def test_colours_before_a_known_background_tell_the_coverage():
    """A straight edge whose mask is wrong by a pixel and a half. Light mixes linearly; a photo has its own exposure."""
    inner, outer, exposure = np.float32([0.6, 0.2, 0.1]), np.float32([0.1, 0.2, 0.4]), np.float32([0.5, 0.5, 0.5])
    true = (np.arange(64) - 30.3).clip(0, 1)[None].repeat(40, 0).astype(np.float32)
    mask = (np.arange(64) - 28.8).clip(0, 1)[None].repeat(40, 0).astype(np.float32)
    colour = linear_to_srgb(true[..., None] * inner + (1 - true[..., None]) * outer)
    behind = np.concatenate([np.broadcast_to(linear_to_srgb(outer * exposure), (40, 64, 3)), np.ones((40, 64, 1))], -1)
    behind[20:, :, 3] = 0
    found = by_colours(np.dstack([colour, mask]), behind.astype(np.float32), exposure)
    assert np.abs(found - true)[:20].max() < 0.3 < 0.9 < np.abs(mask - true).max()
    np.testing.assert_array_equal(found[20:], mask[20:])  # it is unknown there
    grey = np.full((40, 64, 4), 0.5, np.float32)
    alike = by_colours(np.dstack([grey[..., :3], mask]), grey, np.ones(3, np.float32))
    assert np.abs(alike - mask).max() < 0.1  # colours that do not differ say nothing


# ---- lamps ----


SUN = unit(np.array([0.5, -0.3, 0.8]))
POWER = np.array([3.0, 2.8, 2.5])
SIZE = 256


@pytest.fixture(scope="module")
def ball_over_plate():
    """A ball that hangs over a plate, so that the sun's shadow falls on the plate."""
    plate = trimesh.creation.box((3.0, 3.0, 0.2))
    plate.apply_translation((-0.3, 0.2, -1.1))
    both = trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=4, radius=0.5), plate.subdivide_loop(0)])
    return textured(both, SIZE)


def glowing_sky(degrees: float, direction: np.ndarray = SUN, height: int = 64) -> np.ndarray:
    """[h, 2 h, 3] a grey sky with a lamp of the power POWER that is smeared over some degrees."""
    directions, areas = directions_of_texels(height)
    glow = np.exp(-0.5 * (degrees_from(directions, direction) / degrees) ** 2)
    return (0.3 + glow[..., None] * POWER / (glow * areas).sum()).astype(np.float32)


def smeared_sun(direction: np.ndarray = SUN, kept: float = 0.7) -> np.ndarray:
    """[h, 2 h, 3] the sun as training finds it: over 12 degrees, and a part of its power in the sky."""
    glow = glowing_sky(12.0, direction) - 0.3
    return (kept * glow + 0.3 + (1 - kept) * POWER.mean() / (4 * np.pi)).astype(np.float32)


def shaded_albedo(asset, radius: float, light: np.ndarray, texture: float = 0.3) -> np.ndarray:
    """The albedo that explains photos of a texture under a lamp of a radius in degrees, if `light` is believed."""
    plain = AssetTexels(asset)
    covered = rasterise(asset.uv, asset.triangles, plain.size)
    normals = unit(covered.interpolate(asset.normals, asset.triangles))
    origins = covered.interpolate(asset.vertices, asset.triangles) + 5e-3 * normals
    points = lamps.Points(MeshScene(asset.vertices, asset.triangles), origins, normals, normals, np.zeros(len(origins)))
    arriving = lambda directions, powers: points.cosines(directions) @ powers.mean(axis=1)
    believed = arriving(*lamps.parts_of_light(light, 512))
    lamp = arriving(lamps.disc(SUN, radius, 64), np.broadcast_to(POWER / 64, (64, 3)))
    true = arriving(*lamps.parts_of_light(np.full((8, 16, 3), 0.3, np.float32), 512)) + lamp
    own = 0.4 * np.exp(texture * np.random.default_rng(1).standard_normal(len(origins)))
    image = plain.spread(torch.from_numpy((own * true / np.maximum(believed, 1e-3)).astype(np.float32))[:, None])
    return np.repeat(image.numpy(), 3, axis=2).clip(0.01, 1)


def sun_to_sky(light: np.ndarray) -> float:
    """The power of the lamp in the direction SUN beside the radiance of the sky far from it."""
    directions, areas = directions_of_texels(len(light))
    away = degrees_from(directions, SUN)
    sky = float(np.median(light[away > 60]))
    return float(((light.mean(2) - sky) * areas)[away < 6].sum()) / sky


def found(asset, albedo, light):
    return compact_lamp(AssetTexels(with_textures(asset, albedo_texture=albedo)), light, 3, 0)


def test_the_brightest_lobe_is_the_one_of_most_power():
    sky = glowing_sky(12.0)
    sky[40, 30] = 60.0  # brighter, and small
    glow = brightest_lobe(sky)
    assert degrees_from(glow.direction, SUN) < 1.5
    np.testing.assert_allclose(glow.power, POWER, rtol=0.12)
    assert (glow.radiance <= sky).all() and (glow.radiance >= 0).all()


ASKEW = unit(SUN + np.array([0.05, 0.03, 0.0]))  # by 3 degrees
POLISH = np.broadcast_to(np.float32([0.2, 0.0]), (SIZE, SIZE, 2))  # roughness and metallic of what mirrors


@pytest.mark.parametrize("kept", [0.7, 0.55])
def test_a_sun_is_found_by_its_shadow_in_the_albedo(ball_over_plate, kept):
    light = smeared_sun(ASKEW, kept)
    new, lamp = found(ball_over_plate, shaded_albedo(ball_over_plate, 0.3, light), light)
    assert degrees_from(np.array(lamp.direction), SUN) < 0.6 < degrees_from(brightest_lobe(light).direction, SUN)
    directions, areas = directions_of_texels(64)
    assert (new * areas[..., None]).sum() == pytest.approx((light * areas[..., None]).sum(), rel=1e-3)
    lit = degrees_from(directions, np.array(lamp.direction))[new.mean(2) > 2 * light.max()]
    assert len(lit) > 1 and lit.max() < 3.0  # no narrower than that, though its shadow is
    assert sun_to_sky(new) == pytest.approx(POWER.mean() / 0.3, rel=0.2)


def test_the_width_of_a_soft_sun_is_found(ball_over_plate):
    """A shadow whose edge is soft: its sharpest part lies beside the lamp's middle, and is not taken for it."""
    light = smeared_sun(unit(SUN + np.array([0.05, 0.03, 0.0])))
    new, lamp = found(ball_over_plate, shaded_albedo(ball_over_plate, 8.0, light), light)
    assert 6.0 < lamp.radius < 9.0 and degrees_from(np.array(lamp.direction), SUN) < 1.5
    directions, areas = directions_of_texels(64)
    away, power = degrees_from(directions, SUN), (new - np.median(new)).mean(2) * areas
    assert power[away < 10].sum() == pytest.approx(power[away < 20].sum(), rel=0.1)


def test_a_lobe_that_mirrors_have_shown_has_its_lamp_in_its_middle(ball_over_plate):
    """Shadows tell its width alone: its middle is known better than they tell it, and it need not have lost power."""
    light, glossy = glowing_sky(6.0), with_textures(ball_over_plate, roughness_metallic_texture=POLISH)
    askew = shaded_albedo(ball_over_plate, 0.3, glowing_sky(6.0, ASKEW))
    assert found(ball_over_plate, askew, light)[1] is None  # of what mirrors nothing, the lobe has lost no power
    new, lamp = found(glossy, askew, light)
    assert degrees_from(np.array(lamp.direction), SUN) < 0.3
    assert lamp.radius < 4.0 and new.max() > 2 * light.max()
    dim = (0.6 * (light - 0.3) + 0.3).astype(np.float32)
    blurred = shaded_albedo(ball_over_plate, 0.3, dim) ** 0.7  # as by training: the best lamp has 1.2
    new, lamp = found(glossy, blurred, dim)
    assert 1.3 < lamp.factor < 1.6 / 0.6
    away = degrees_from(directions_of_texels(64)[0], SUN) > 60
    np.testing.assert_allclose(new[away].mean(1), 0.3, rtol=1e-3)  # the rest stays


def test_light_beside_a_warm_lamp_becomes_as_blue_as_all_light_was_grey():
    """Training finds a lamp's colour, and takes the rest for grey: made stronger, the lamp must not make all light yellow."""
    warm, areas = glowing_sky(6.0) * np.float32([1.2, 1.0, 0.8]), directions_of_texels(64)[1]
    lobe = brightest_lobe(warm)
    grey = (lobe.radiance + 0.3 * np.float32([0.9, 1.0, 1.1])).astype(np.float32)
    colour = lambda light: (light * areas[..., None]).sum((0, 1)) / power_of(light)
    for mirrored in (True, False):
        new = lamps.with_lamp(grey, lobe, CompactLamp(SUN.tolist(), 3.0, 1.8, 0), mirrored=mirrored)
        np.testing.assert_allclose(colour(new), colour(grey), rtol=1e-3)
        gain = 1.0 if not mirrored else 1 + 0.8 * lobe.power.mean() / power_of(grey)
        assert power_of(new) == pytest.approx(gain * power_of(grey), rel=1e-3)
        assert new[0, 0, 2] / new[0, 0, 0] > 1.1 * grey[0, 0, 2] / grey[0, 0, 0]
    strong = lamps.with_lamp(grey, lobe, CompactLamp(SUN.tolist(), 3.0, 40.0, 0), mirrored=True)
    assert (strong > 0).all()  # however strong the lamp


def test_where_the_rest_of_the_light_is_known_the_sun_alone_gets_brighter(ball_over_plate):
    light = (0.5 * glowing_sky(12.0) + 0.15).astype(np.float32)  # half of the sun's power, under a true sky of 0.3
    asset = with_textures(ball_over_plate, albedo_texture=shaded_albedo(ball_over_plate, 0.3, light))
    new, lamp = compact_lamp(AssetTexels(asset), light, 3, 0, rest_is_known=True)
    directions, areas = directions_of_texels(64)
    away = degrees_from(directions, SUN)
    assert ((new.mean(2) - 0.3) * areas)[away < 6].sum() == pytest.approx(POWER.mean(), rel=0.15)
    np.testing.assert_array_equal(new[away > 60], light[away > 60])


ASIDE = unit(np.cross(SUN, [0.0, 0.0, 1.0]))
NO_LAMP = {  # a light, the radius of the lamp whose shadow the albedo shows, and what else is done to the albedo
    "too dark": (SUN, 0.3, 0.04),
    "a broad lamp": (SUN, 20.0, 1.0),
    "no shadow": (SUN, None, 1.0),
    "a lobe that lost no power": (SUN, 4.0, 1.0),  # its smear is no training's
    # 13 degrees beside the glow: the nearest that is tried explains the shadow in part, and is not it
    "a lamp at the rim of those tried": (unit(SUN + np.tan(np.radians(13.0)) * ASIDE), 0.3, 1.0),
}


@pytest.mark.parametrize("case", NO_LAMP)
def test_where_the_albedo_shows_no_compact_lamp_the_light_stays(ball_over_plate, case):
    direction, radius, factor = NO_LAMP[case]
    light, grey = glowing_sky(12.0, direction), np.full((SIZE, SIZE, 3), 0.4, np.float32)
    albedo = grey if radius is None else factor * shaded_albedo(ball_over_plate, radius, light)
    new, lamp = found(ball_over_plate, albedo, light)
    assert lamp is None and new is light


def test_shadows_on_metal_and_in_a_light_without_a_lamp_say_nothing(ball_over_plate):
    light, flat = glowing_sky(12.0), np.full((16, 32, 3), 0.7, np.float32)
    albedo = shaded_albedo(ball_over_plate, 0.3, light)
    polish = POLISH + np.float32([0, 1])
    metal = with_textures(ball_over_plate, albedo_texture=albedo, roughness_metallic_texture=polish)
    assert compact_lamp(AssetTexels(metal), light, 3, 0)[1] is None
    # its middle is known, and what is usual must do
    _, mirrored = compact_lamp(AssetTexels(metal), glowing_sky(6.0), 3, 0)
    assert degrees_from(np.array(mirrored.direction), SUN) < 0.3 and mirrored.pairs == 0
    assert compact_lamp(AssetTexels(ball_over_plate), flat, 3, 0) == (flat, None)


def test_refinement_begins_with_the_compact_lamp(ball_over_plate):
    light = smeared_sun()
    asset = with_textures(ball_over_plate, albedo_texture=shaded_albedo(ball_over_plate, 0.3, light))
    settings = FitSettings(sweeps=1, sweep_share=0.05, pixels=200, directions=4, outline=False)
    data = photos(ball_over_plate, light, n=3, spp=4)
    stage = Stage(data, asset, light, settings)
    assert degrees_from(np.array(stage.lamp.direction), SUN) < 1.0
    assert stage.fit.light.radiance().max() > 5 * light.max()
    state = stage.state()
    again = Stage(data, asset, light, settings, state)
    assert again.lamp == stage.lamp and torch.equal(again.fit.light.radiance(), stage.fit.light.radiance())
    assert Stage(data, asset, light, dataclasses.replace(settings, light_step=0.0)).lamp is None


def test_under_a_stronger_lamp_in_a_light_that_photos_show_the_albedo_begins_darker(ball_over_plate):
    """But for metals; also after an interruption."""
    light = (0.5 * glowing_sky(12.0) + 0.15).astype(np.float32)
    gloss = np.zeros((SIZE, SIZE, 2), np.float32)
    gloss[..., 0], gloss[:, : SIZE // 8, 1] = 0.8, 1.0
    asset = with_textures(
        ball_over_plate, albedo_texture=shaded_albedo(ball_over_plate, 0.3, light), roughness_metallic_texture=gloss
    )
    settings = FitSettings(sweeps=1, sweep_share=0.05, pixels=200, directions=4, outline=False)
    seen = np.full((16, 32, 4), 0.3, np.float32)
    data = dataclasses.replace(photos(ball_over_plate, light, n=3, spp=4), surroundings=seen)
    stage = Stage(data, asset, light, settings)
    before, after = AssetTexels(asset).start, stage.fit.texels.start
    factor = power_of(stage.fit.light.radiance().numpy()) / power_of(light)
    metal = before[:, 4] > 0.99
    assert stage.lamp is not None and factor > 1.3 and metal.any()
    torch.testing.assert_close(after[metal], before[metal])
    torch.testing.assert_close(after[~metal, :3], before[~metal, :3] / factor, rtol=1e-3, atol=1e-4)
    again = Stage(data, asset, light, settings, stage.state())
    assert torch.equal(again.fit.texels.start, after)
