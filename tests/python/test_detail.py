"""Detail as fine as the photos: what it adds to the albedo, and what it does not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import FOCAL, photos, sky, textured, with_textures
from splitnerf.data.images import area_average
from splitnerf.export.bake import rasterise
from splitnerf.refinement.detail import WINDOW, FineTexels, Windows, detail_size, scattered_light, with_detail
from splitnerf.refinement.fit import FitSettings
from splitnerf.refinement.refine import with_normal_texture, without_detail
from splitnerf.refinement.stage import Stage

SIZE, FINE = 256, 2  # texels of the fit, by which the true texture is larger


def albedo_of(asset) -> np.ndarray:
    return asset.materials[0].albedo_texture


def covered(asset, size: int) -> torch.Tensor:
    """The texels of a texture of a size, in a light that does not matter."""
    return FineTexels(asset, torch.ones(8, 16, 3), size)


@pytest.fixture(scope="module")
def plain():
    """A ball of one colour."""
    return textured(trimesh.creation.icosphere(subdivisions=4), SIZE)


def pattern(texels: FineTexels) -> np.ndarray:
    """An albedo with stripes of about a texel of the fit."""
    x, y, z = texels.positions.unbind(1)
    return texels.texture(torch.stack([0.4 + 0.2 * torch.sin(90 * z), 0.4 + 0.2 * torch.sin(90 * x), 0.4 + 0 * y], 1))


@pytest.mark.parametrize(("roughness", "metallic"), [(0.6, 0.0), (0.5, 1.0)])
def test_photos_add_the_detail_that_the_fit_cannot_hold(plain, roughness, metallic):
    gloss = np.tile(np.float32([roughness, metallic]), (SIZE, SIZE, 1))
    texels = covered(plain, FINE * SIZE)
    true = with_textures(plain, roughness_metallic_texture=gloss, albedo_texture=pattern(texels))
    fitted = with_textures(true, albedo_texture=area_average(albedo_of(true), FINE))
    data = photos(true, sky(), n=12, spp=16, sharpness=5)
    found = with_detail(data, fitted, sky(), FINE * SIZE, math.inf, print)
    rows = rasterise(plain.uv, plain.triangles, FINE * SIZE).index
    in_charts = lambda texture: texture.reshape(-1, 3)[rows]  # noqa: E731
    before, after = (
        in_charts(x) - in_charts(albedo_of(true))
        for x in (albedo_of(fitted).repeat(FINE, 0).repeat(FINE, 1), albedo_of(found))
    )
    assert np.square(after).mean() < 0.5 * np.square(before).mean()
    assert abs(after.mean()) < 0.01, "the level is the fit's"


def test_what_each_photo_shows_elsewhere_is_not_added(plain):
    """As reflections do: here the noise of each photo."""
    data = photos(plain, sky(), n=12, spp=16, sharpness=5)
    noise = np.random.default_rng(0).normal(0, 0.05, data.images.shape[:3])[..., None]
    images = np.stack([data.images[i] for i in range(len(data))])
    images[..., :3] = (images[..., :3] + noise).clip(0, 1)
    found = with_detail(replace(data, images=images), plain, sky(), FINE * SIZE, math.inf, print)
    assert (albedo_of(found) - 0.4).std() < 0.012


def test_a_diffuse_surface_scatters_the_light_of_a_white_sky(plain):
    """The radiance of albedo 1 on a convex body is that of the sky; the estimate's noise is that of 48 directions."""
    found = scattered_light(plain, covered(plain, SIZE).scene, torch.full((8, 16, 3), 0.7), 16)
    assert abs(found.mean() - 0.7) < 0.02


def test_means_of_windows_end_at_the_charts():
    """What is constant in a chart stays it, and what one chart holds is no part of the mean of another."""
    index, chart = np.arange(256), (np.arange(256) % 16 >= 8).astype(np.int64)
    windows = Windows(index, chart, 16, WINDOW)
    values = torch.from_numpy(chart).float()[:, None]
    assert torch.allclose(windows.means(torch.arange(256), values), values, atol=1e-6)
    rows = torch.arange(0, 256, 3)  # of a part of the texels, too
    assert torch.allclose(windows.means(rows, values[rows]), values[rows], atol=1e-6)


def test_a_texture_gets_as_fine_as_the_photos(plain):
    """Texels as wide as 0.75 to 1.5 pixels are fine enough; photos of wider pixels are too coarse."""
    corners = plain.uv[plain.triangles].astype(np.float64)
    (ux, uy), (vx, vy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    texel = np.sqrt(4 * np.pi / (0.5 * np.abs(ux * vy - uy * vx).sum())) / SIZE
    data = photos(plain, sky(), n=5, spp=1)
    distance = np.linalg.norm(data.world_poses[0, :3, 3])
    photos_of = lambda width: replace(data, intrinsics=data.intrinsics / FOCAL * distance * width / texel)  # noqa: E731
    sizes = [detail_size(photos_of(width), plain, 4096) for width in (0.7, 0.8, 1.4, 1.6, 3.2)]
    assert sizes == [None, SIZE, SIZE, 2 * SIZE, 4 * SIZE]
    assert detail_size(photos_of(3.2), plain, 2 * SIZE) == 2 * SIZE
    assert detail_size(photos_of(3.2), plain, 16) == SIZE and detail_size(photos_of(3.2), plain, 0) is None


def test_few_photos_cannot_judge(plain):
    data = photos(plain, sky(), n=4, spp=1, sharpness=8)
    assert detail_size(data, plain, 4096) is None


@pytest.mark.parametrize("most", [0, 4096])
def test_a_refinement_delivers_it(painted, most):
    """The albedo alone gets finer, and another refinement begins with the size of the other textures."""
    asset, data = painted
    before = len(albedo_of(asset))
    settings = FitSettings(sweeps=1, minutes=2.0, pixels=128, directions=4, outline=False, albedo_size=most)
    stage = Stage(data, asset, sky(), settings)
    assert stage.limit == (120 if most == 0 else 90)  # seconds for the sweeps
    stage.advance()
    delivered = stage.result().asset
    assert len(albedo_of(delivered)) == (before if most == 0 else 2 * before)
    assert len(delivered.materials[0].roughness_metallic_texture) == before
    again = without_detail(delivered)
    assert albedo_of(again).shape == (before, before, 3)
    assert np.allclose(albedo_of(again).mean(), albedo_of(delivered).mean(), atol=1e-4)
    plain = replace(delivered, tangents=None, materials=[replace(delivered.materials[0], normal_texture=None)])
    straight = with_normal_texture(plain)  # as where photos showed nothing of the normals
    assert (straight.materials[0].normal_texture == [0, 0, 1]).all() and np.allclose(straight.tangents, asset.tangents)
