"""What the photos leave open: closed forms, and a ball of which some is seen and some is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from painted_ball import sky, textured

from splitnerf.refinement.fit import RefinementSettings, Stage
from splitnerf.refinement.texels import AssetTexels
from splitnerf.refinement.uncertainty import (
    PATCH_PIXELS,
    QUANTISATION,
    UNINFORMED,
    UNKNOWN,
    Information,
    painted_with,
    patch_width,
)
from splitnerf.refinement.unknowns import N_UNKNOWNS


def row_of_texels(n: int) -> SimpleNamespace:
    """Texels in a row of one chart."""
    return SimpleNamespace(index=np.arange(n), size=n, chart=np.zeros(n, np.int64))


def seen(information: Information, texel: int, jacobian: torch.Tensor, times: int, error: float = 0.0) -> None:
    """Pixels whose rays both meet a texel, by the derivatives [2, 3, n] of the two, and their squared error."""
    texels, shares = torch.full((2 * times, 4), texel), torch.tensor([[1.0, 0, 0, 0]]).expand(2 * times, 4)
    information.add(texels, shares, jacobian.repeat(times, 1, 1), torch.ones(2 * times, 3), torch.full((times,), error))


def test_a_patch_that_no_photo_shows_may_have_any_value():
    deviations = Information(row_of_texels(4), 1, 10).deviations(1e-4 - QUANTISATION)
    assert torch.allclose(deviations[:, :3], torch.full((4, 3), 12**-0.5))
    assert (deviations > UNKNOWN).all()


def test_the_deviation_is_that_of_the_least_squares_fit():
    """One unknown, seen by n pixels of derivative d: s / (d sqrt(n / pixels of a patch)), beside the first variance."""
    information = Information(row_of_texels(2), 1, n_pixels=50)
    jacobian = torch.zeros(2, 3, N_UNKNOWNS)
    jacobian[:, 1, 3] = 0.2
    seen(information, 1, jacobian, 100)  # each pixel twice
    found = information.deviations(1e-4 - QUANTISATION)
    wanted = (50 * 0.2**2 / 1e-4 / PATCH_PIXELS**2 + 12) ** -0.5
    assert found[1, 1].item() == pytest.approx(wanted, rel=1e-3)
    assert found[1, 0].item() == pytest.approx(12**-0.5, rel=1e-3) and found[0, 1].item() == pytest.approx(12**-0.5, rel=1e-3)


def test_less_is_known_where_the_fit_leaves_more():
    """Four patches seen alike, one of them with ten times the error: 4 * 10 / 13 of the mean."""
    information = Information(row_of_texels(4), 1, n_pixels=40_000)
    jacobian = torch.zeros(2, 3, N_UNKNOWNS)
    jacobian[:, 1, 3] = 0.2
    for texel in range(4):
        seen(information, texel, jacobian, 10_000, 1e-2 if texel == 2 else 1e-3)
    shares = information.uneven()
    assert shares.tolist() == pytest.approx([4 / 13, 4 / 13, 40 / 13, 4 / 13], rel=0.02)
    found = information.deviations(1e-3)[:, 1]
    of_data = (found**-2 - 12) ** -0.5
    assert (of_data[2] / of_data[0]).item() == pytest.approx(10**0.5, rel=0.02)


def test_unknowns_that_the_photos_mix_up_are_not_known_alone():
    information = Information(row_of_texels(1), 1, 1000)
    jacobian = torch.zeros(2, 3, N_UNKNOWNS)
    jacobian[:, :, 3] = jacobian[:, :, 4] = 0.5
    seen(information, 0, jacobian, 1000)
    assert (information.deviations(1e-4 - QUANTISATION)[0, 1:3] > 0.2).all()


def test_noise_of_the_derivatives_is_no_information():
    """Derivatives that are noise alone, independent in the two rays: a square of them would look like knowledge."""
    information = Information(row_of_texels(1), 1, 20_000)
    jacobian = 0.3 * torch.randn(40_000, 3, N_UNKNOWNS, generator=torch.Generator().manual_seed(0))
    texels, shares = torch.zeros(40_000, 4, dtype=torch.int64), torch.tensor([[1.0, 0, 0, 0]]).expand(40_000, 4)
    information.add(texels, shares, jacobian, torch.ones(40_000, 3), torch.zeros(20_000))
    square = 20_000 * 3 * 0.3**2
    assert information.sums.abs().max() < 0.03 * square


def test_texels_of_a_patch_share_what_is_known_and_charts_do_not():
    texels = SimpleNamespace(index=np.arange(8), size=8, chart=np.array([0, 0, 0, 1, 1, 1, 1, 1]))
    patch = Information(texels, 4, 1).patch_of
    assert patch[:3].unique().numel() == 1 and patch[3] != patch[0] and patch[4:].unique().numel() == 1 and patch[4] != patch[3]


def test_a_patch_is_two_pixels_wide(painted):
    """Texels share the ball's area of 4 pi; a pixel is 3.4 / 60 wide at its middle."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    texels = AssetTexels(textured(mesh.vertices, mesh.faces, 256))
    edge = np.sqrt(4 * np.pi / len(texels.index))
    assert patch_width(painted[1], texels) == pytest.approx(2 * 3.4 / 60 / edge, abs=0.55)


def test_a_ball_is_known_where_it_is_seen(painted):
    """Photos from above alone: its lower side is unknown."""
    asset, data = painted
    above = data.select([i for i in range(len(data)) if data.poses[i, 2, 3] > 1.0])
    assert 2 <= len(above) < len(data)
    stage = Stage(above, asset, sky(), RefinementSettings(sweeps=1, sweep_share=4.0, pixels=1000, directions=16, outline=False))
    stage.advance()
    uncertainty = stage.result().uncertainty
    deviations = uncertainty.map.reshape(-1, 4)[stage.fit.texels.index]
    height = stage.fit.texels.positions[:, 2]
    upper, lower = deviations[height > 0.5], deviations[height < -0.9]
    assert np.median(upper[:, 0]) < 0.05 and np.median(lower[:, 0]) > UNKNOWN[0]
    assert np.median(upper[:, 3]) < 0.7 * np.median(lower[:, 3])
    assert QUANTISATION <= uncertainty.noise < 1e-3
    saturated = np.concatenate([image[..., :3][image[..., 3] >= 0.99] for image in above.images]) >= 254.5 / 255
    assert uncertainty.saturated == pytest.approx(saturated.mean())


def test_a_painted_asset_carries_the_deviations(ball):
    deviations = np.random.default_rng(0).random((16, 16, 4), np.float32)
    material = painted_with(ball, deviations).materials[0]
    assert np.array_equal(material.albedo_texture, deviations[..., :3])
    assert np.array_equal(material.roughness_metallic_texture[..., 0], deviations[..., 3])
    assert np.allclose(UNINFORMED[:5], 12**-0.5)
