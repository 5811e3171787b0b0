"""light_queries and split_sum_shade."""

from __future__ import annotations

import math

import pytest
import torch
from op_checks import DEVICES, check_error, lib, unit
from shading_inputs import indirect_inputs, query_inputs, split_sum_inputs

from splitnerf.ops import brdf_lut, light_queries, split_sum_shade

@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("stacked", [False, True])
def test_indirect_light_is_light_that_nothing_hides(channels, stacked):
    """As if the light were o L + I and nothing in its way; the light comes in two tensors or, as it answers, in one."""
    inputs = indirect_inputs(torch.float64, channels=channels, n=40, stacked=stacked)
    *points, specular, diffuse, occlusion_s, occlusion_d, lut, mode, gain, indirect_s, indirect_d = inputs
    if stacked:
        specular, diffuse = specular.chunk(2)
    one = torch.ones(40, 1, dtype=torch.float64)
    arriving = occlusion_s * specular + indirect_s, occlusion_d * diffuse + indirect_d
    expected = lib.split_sum_shade(*points, *arriving, one, one, lut, mode, gain, None, None)
    torch.testing.assert_close(lib.split_sum_shade(*inputs), expected, rtol=1e-12, atol=1e-12)


def test_light_queries_end_with_the_normals_on_the_viewers_side():
    normals, views, roughness, *_ = query_inputs("cpu", torch.float64)
    directions, asked = light_queries(normals, views, roughness)
    side = (normals * views).sum(1, keepdim=True).sign()
    assert (side < 0).any() and torch.equal(directions[7:], side * normals)
    assert torch.equal(asked, torch.cat([roughness, torch.ones_like(roughness)]))
    check_error(lambda: light_queries(normals, views, roughness, "median"), "light_queries", "query", "mean", "median")


@pytest.mark.parametrize("device", DEVICES)
def test_white_furnace(device):
    normals, views, _, roughness, *_ = split_sum_inputs(device, torch.float64, n=500)
    one = torch.ones_like(normals)
    single = torch.ones_like(roughness)
    dielectric = split_sum_shade(normals, views, one, roughness, 0 * single, one, one, single, single)
    metal = split_sum_shade(normals, views, one, roughness, single, one, one, single, single, compensate=True)
    torch.testing.assert_close(dielectric, one)
    torch.testing.assert_close(metal, one)


@pytest.mark.parametrize("device", DEVICES)
def test_table_holds_its_exact_value(device):
    f1, f2, chi, _ = brdf_lut(device)[-1, -1].tolist()
    assert f1 + f2 == pytest.approx(1 - math.log(2), abs=1e-4) and chi == pytest.approx(0, abs=1e-3)


def test_table_made_in_inference_mode_serves_training():
    from splitnerf.ops import shading

    shading._brdf_lut.cache_clear()
    with torch.inference_mode():
        brdf_lut()
    normals, views, roughness, *_ = query_inputs("cpu", torch.float32)
    light_queries(normals.requires_grad_(), views, roughness)[0].sum().backward()
    assert normals.grad.abs().sum() > 0


def test_an_unknown_fresnel_mode_is_named():
    inputs = split_sum_inputs("cpu", torch.float32)
    check_error(lambda: split_sum_shade(*inputs[:9], fresnel_mode="fast"), "split_sum_shade", "fresnel_mode", "exact", "fast")


@pytest.mark.parametrize("compensate", [False, True])
def test_smooth_surfaces_keep_the_digits_of_their_gradient(compensate):
    """F1 + F2 is 1 but for a millionth there, and the gradient to roughness is the change of that millionth."""
    normals, view_dirs = (unit(torch.tensor([x])) for x in ([0.887, -0.036, -0.460], [-0.849, 0.157, 0.504]))
    rest = [
        torch.tensor([x]) for x in ([0.8, 0.5, 0.2], [0.0], [0.95], [0.5, 0.4, 0.45], [1.0, 1.0, 0.5], [1.0], [0.8])
    ]
    found = []
    for dtype in (torch.float32, torch.float64):
        inputs = [x.to(dtype) for x in (normals, view_dirs, *rest)]
        roughness = inputs[3].requires_grad_()
        out = lib.split_sum_shade(*inputs, brdf_lut(), 0, compensate, None, None)
        found.append([torch.autograd.grad(x, roughness, retain_graph=True)[0].item() for x in out[0]])
    assert found[0] == pytest.approx(found[1], rel=1e-5)
