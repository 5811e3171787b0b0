"""That a smeared lamp is made compact where the albedo shows its shadow, and nowhere else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import photos, textured, with_textures
from splitnerf.data.environment import directions_of_texels
from splitnerf.export.bake import rasterise
from splitnerf.ops import MeshScene
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.lamps import Points, brightest_lobe, compact_lamp, degrees_from, disc, parts_of_light, unit
from splitnerf.refinement.stage import Stage
from splitnerf.refinement.texels import AssetTexels

SUN = unit(np.array([0.5, -0.3, 0.8]))
POWER = np.array([3.0, 2.8, 2.5])
SIZE = 256


@pytest.fixture(scope="module")
def ball_over_plate():
    """A ball that hangs over a plate, so that the sun's shadow falls on the plate."""
    plate = trimesh.creation.box((3.0, 3.0, 0.2))
    plate.apply_translation((-0.3, 0.2, -1.1))
    both = trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=4, radius=0.5), plate.subdivide_loop(0)])
    return textured(np.asarray(both.vertices), np.asarray(both.faces), SIZE)


def glowing_sky(degrees: float, direction: np.ndarray = SUN, height: int = 64) -> np.ndarray:
    """[h, 2 h, 3] a grey sky with a lamp of the power POWER that is smeared over some degrees."""
    directions, areas = directions_of_texels(height)
    glow = np.exp(-0.5 * (degrees_from(directions, direction) / degrees) ** 2)
    return (0.3 + glow[..., None] * POWER / (glow * areas).sum()).astype(np.float32)


def shaded_albedo(asset, radius: float, light: np.ndarray, texture: float = 0.3) -> np.ndarray:
    """The albedo that explains photos of a texture under a lamp of a radius in degrees, if `light` is believed."""
    plain = AssetTexels(asset)
    covered = rasterise(asset.uv, asset.triangles, plain.size)
    normals = unit(covered.interpolate(asset.normals, asset.triangles))
    origins = covered.interpolate(asset.vertices, asset.triangles) + 5e-3 * normals
    points = Points(MeshScene(asset.vertices, asset.triangles), origins, normals, normals, np.zeros(len(origins)))
    arriving = lambda directions, powers: points.cosines(directions) @ powers.mean(axis=1)  # noqa: E731
    believed = arriving(*parts_of_light(light, 512))
    lamp = arriving(disc(SUN, radius, 64), np.broadcast_to(POWER / 64, (64, 3)))
    true = arriving(*parts_of_light(np.full((8, 16, 3), 0.3, np.float32), 512)) + lamp
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


def test_a_disc_is_filled_evenly():
    away = degrees_from(disc(SUN, 4.0, 2000), SUN)
    assert away.max() < 4.01
    assert np.mean(away < 2.0) == pytest.approx(0.25, abs=0.01)


def test_a_sun_is_found_by_its_shadow_in_the_albedo(ball_over_plate):
    light = glowing_sky(12.0, unit(SUN + np.array([0.05, 0.03, 0.0])))  # smeared, and 3 degrees off
    new, lamp = found(ball_over_plate, shaded_albedo(ball_over_plate, 0.3, light), light)
    assert degrees_from(np.array(lamp.direction), SUN) < 0.6 < degrees_from(brightest_lobe(light).direction, SUN)
    directions, areas = directions_of_texels(64)
    assert (new * areas[..., None]).sum() == pytest.approx((light * areas[..., None]).sum(), rel=1e-3)
    lit = degrees_from(directions, np.array(lamp.direction))[new.mean(2) > 2 * light.max()]
    assert len(lit) > 1 and lit.max() < 3.0  # no narrower than that, though its shadow is
    assert sun_to_sky(new) == pytest.approx(POWER.mean() / 0.3, rel=0.2)


def test_the_width_of_a_soft_sun_is_found(ball_over_plate):
    """A shadow whose edge is soft: its sharpest part lies beside the lamp's middle, and is not taken for it."""
    light = glowing_sky(12.0, unit(SUN + np.array([0.05, 0.03, 0.0])))
    new, lamp = found(ball_over_plate, shaded_albedo(ball_over_plate, 8.0, light), light)
    assert 6.0 < lamp.radius < 9.0 and degrees_from(np.array(lamp.direction), SUN) < 1.5
    directions, areas = directions_of_texels(64)
    away, power = degrees_from(directions, SUN), (new - np.median(new)).mean(2) * areas
    assert power[away < 10].sum() == pytest.approx(power[away < 20].sum(), rel=0.1)


def test_a_sun_whose_glow_is_too_dim_gets_its_share(ball_over_plate):
    """Training took 45 % of the sun's power for the sky's."""
    glow = glowing_sky(12.0) - 0.3
    light = (0.55 * glow + 0.3 + 0.45 * POWER.mean() / (4 * np.pi)).astype(np.float32)
    new, lamp = found(ball_over_plate, shaded_albedo(ball_over_plate, 0.3, light), light)
    assert lamp.factor > 1.8
    assert sun_to_sky(new) == pytest.approx(POWER.mean() / 0.3, rel=0.12)


ASIDE = unit(np.cross(SUN, [0.0, 0.0, 1.0]))
NO_LAMP = {  # a light, the radius of the lamp whose shadow the albedo shows, and what else is done to the albedo
    "too dark": (SUN, 0.3, 0.04),
    "a broad lamp": (SUN, 20.0, 1.0),
    "no shadow": (SUN, None, 1.0),
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


def test_metal_and_a_light_without_a_lamp_say_nothing(ball_over_plate):
    light, flat = glowing_sky(12.0), np.full((16, 32, 3), 0.7, np.float32)
    metal = with_textures(
        ball_over_plate,
        albedo_texture=shaded_albedo(ball_over_plate, 0.3, light),
        roughness_metallic_texture=np.ones((SIZE, SIZE, 2), np.float32),
    )
    assert compact_lamp(AssetTexels(metal), light, 3, 0)[1] is None
    assert compact_lamp(AssetTexels(ball_over_plate), flat, 3, 0) == (flat, None)


def test_refinement_begins_with_the_compact_lamp(ball_over_plate):
    light = glowing_sky(12.0)
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
