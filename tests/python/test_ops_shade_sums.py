"""shade_sums: what is reflected of the sums over incoming light."""

from __future__ import annotations

import pytest
import torch
from op_cases import shared_inputs
from op_checks import grad_leaves, lib
from shading_inputs import mixed_sums_inputs, sums_inputs

from splitnerf.ops import LightSums, shade_sums, split_sum_shade, summed_correction, summed_light

DIFFERENTIABLE = tuple(range(6))


def shade(*x: torch.Tensor, compensate: bool) -> torch.Tensor:
    return shade_sums(*x[:5], LightSums(*x[5].unbind(1)), compensate)


@pytest.mark.parametrize("compensate", [False, True])
@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_one_light_for_the_whole_lobe_is_the_split_sum(compensate, turned):
    """Where the light is L over the specular lobe, the sums are (F1 + F2) L, F2 L and E_d L."""
    normals, view_dirs, albedo, roughness, metallic, sums = sums_inputs(200)
    light, _, diffuse, _ = sums.unbind(1)
    normals = turned * normals
    one, black = torch.ones_like(albedo), torch.zeros_like(albedo)
    metal = torch.ones_like(metallic)

    def lobe(albedo, metallic=metal):  # albedo F1 + F2, E_d of a dielectric
        return split_sum_shade(normals, view_dirs, albedo, roughness, metallic, one, black, one, one)

    sums = LightSums(lobe(one) * light, lobe(black) * light, diffuse, lobe(black, 0 * metal) * light)
    there = split_sum_shade(
        normals, view_dirs, albedo, roughness, metallic, light, diffuse, one, one, "exact", compensate
    )
    torch.testing.assert_close(shade_sums(normals, view_dirs, albedo, roughness, metallic, sums, compensate), there)


def test_light_at_grazing_angles_alone_is_reflected_whole():
    """All of the light where both Fresnel terms are 1: reflected by every material alike."""
    normals, view_dirs, albedo, roughness, metallic, sums = sums_inputs()
    light = sums[:, 0]
    sums = LightSums(light, light, torch.zeros_like(light), light)
    torch.testing.assert_close(shade_sums(normals, view_dirs, albedo, roughness, metallic, sums), light)


@pytest.mark.parametrize("n_dot_v", [0.0, 1e-7, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 1e-4, 1.0])
def test_edges_stay_finite(n_dot_v, roughness):
    x = list(sums_inputs(1, torch.float32))
    x[0] = torch.tensor([[0.0, 0.0, 1.0]])
    x[1] = torch.tensor([[(1 - n_dot_v**2) ** 0.5, 0.0, n_dot_v]])
    x[3] = torch.tensor([[roughness]])
    leaves = grad_leaves(x, DIFFERENTIABLE)
    radiance = shade(*leaves, compensate=True)
    radiance.sum().backward()
    assert torch.isfinite(radiance).all() and all(torch.isfinite(leaf.grad).all() for leaf in leaves)


def test_empty_batch_and_errors():
    assert shade(*sums_inputs(0), compensate=True).shape == (0, 3)
    x = sums_inputs()
    specular, grazing, diffuse, dielectric = x[5].unbind(1)
    with pytest.raises(ValueError, match=r"grazing must be \[6, 3\], got \[6, 1\]"):
        shade_sums(*x[:5], LightSums(specular, grazing[:, :1], diffuse, dielectric))


def test_a_share_turns_another_radiance_into_a_mixture():
    """other + correction = (1 - share) other + share sums, and so for the gradients; the share itself has none."""
    *x, lut, compensate, other, share = mixed_sums_inputs(40, torch.float64)
    correction = lib.shade_sums(*x, lut, compensate, other, share)
    mixture = torch.lerp(other, shade(*x, compensate=True), share[:, None])
    torch.testing.assert_close(other + correction, mixture, rtol=1e-12, atol=1e-12)


def test_the_correction_is_the_sum_less_the_split_by_its_share():
    normals, view_dirs, roughness, *light = shared_inputs(12)
    albedo, metallic, split, share = (torch.rand(12, *k, dtype=torch.float64) for k in ((3,), (1,), (3,), ()))
    summed = shade_sums(normals, view_dirs, albedo, roughness, metallic, summed_light(normals, view_dirs, roughness, *light), True)
    found = summed_correction(normals, view_dirs, albedo, roughness, metallic, split, share, *light, compensate=True)
    torch.testing.assert_close(found, (summed - split) * share[:, None])
