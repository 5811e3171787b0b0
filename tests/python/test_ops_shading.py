"""query_direction, light_queries and split_sum_shade."""

from __future__ import annotations

import math

import numpy as np
import pytest
import reference
import torch
from op_checks import DEVICES, check_error, check_no_gradient, check_op, generator, grad_leaves, lib, unit
from shading_inputs import indirect_inputs, query_inputs, split_sum_inputs

from splitnerf.ops import brdf_lut, light_queries, query_direction, split_sum_shade

MODES = [(mode, compensate, channels) for mode in range(3) for compensate in (False, True) for channels in (1, 3)]


def on_the_cpu(inputs) -> list:
    return [x.cpu() if isinstance(x, torch.Tensor) else x for x in inputs]


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("mean", [True, False])
def test_query_matches_the_reference(device, mean):
    inputs = query_inputs(device, torch.float64, mean, 200)
    np.testing.assert_allclose(
        lib.query_direction(*inputs).cpu(), reference.query_direction(*on_the_cpu(inputs)), atol=1e-12
    )
    single = lib.query_direction(*query_inputs(device, torch.float32, mean, 200))
    torch.testing.assert_close(single.double(), lib.query_direction(*inputs), rtol=0, atol=2e-5)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("mode", "compensate", "channels"), MODES)
def test_shade_matches_the_reference(device, mode, compensate, channels):
    inputs = split_sum_inputs(device, torch.float64, mode, compensate, channels, 200)
    got = lib.split_sum_shade(*inputs)
    np.testing.assert_allclose(got.cpu(), reference.split_sum_shade(*on_the_cpu(inputs)), atol=1e-12)
    single = lib.split_sum_shade(*split_sum_inputs(device, torch.float32, mode, compensate, channels, 200))
    torch.testing.assert_close(single.double(), got, rtol=0, atol=2e-5)


@pytest.mark.parametrize("device", DEVICES)
def test_opcheck(device):
    for dtype in (torch.float32, torch.float64):
        grad = torch.randn(7, 3, generator=generator(9)).to(device, dtype)
        for mean in (True, False):
            check_op(lib.query_direction, query_inputs(device, dtype, mean), (0, 1, 2))
            check_op(lib.query_direction_backward, (*query_inputs(device, dtype, mean), grad))
        for channels in (1, 3):
            inputs = split_sum_inputs(device, dtype, channels=channels)
            check_op(lib.split_sum_shade, inputs, tuple(range(9)))
            check_op(lib.split_sum_shade_backward, (*inputs, grad))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("mean", [True, False])
def test_query_gradcheck(device, mean):
    torch.autograd.gradcheck(lib.query_direction, grad_leaves(query_inputs(device, torch.float64, mean), (0, 1, 2)))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("mode", "compensate", "channels"), MODES)
def test_shade_gradcheck(device, mode, compensate, channels):
    inputs = split_sum_inputs(device, torch.float64, mode, compensate, channels, 4)
    torch.autograd.gradcheck(lib.split_sum_shade, grad_leaves(inputs, range(9)))


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


@pytest.mark.parametrize("stacked", [False, True])
def test_gradients_with_indirect_light(stacked):
    inputs = indirect_inputs(torch.float64, channels=1, n=4, stacked=stacked)
    given = [i for i in range(9) if not (stacked and i == 6)]
    torch.autograd.gradcheck(lib.split_sum_shade, grad_leaves(inputs, given))
    check_op(lib.split_sum_shade, inputs, tuple(given))
    check_op(lib.split_sum_shade_backward, (*inputs, torch.ones(4, 3, dtype=torch.float64)))


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("mean", [True, False])
def test_light_queries_are_the_lobes_directions_and_the_normals_on_the_viewers_side(device, mean):
    inputs = query_inputs(device, torch.float64, mean)
    normals, views, roughness = inputs[:3]
    directions, asked = lib.light_queries(*inputs)
    side = (normals * views).sum(1, keepdim=True).sign()
    assert (side < 0).any() and torch.equal(directions, torch.cat([lib.query_direction(*inputs), side * normals]))
    assert torch.equal(asked, torch.cat([roughness, torch.ones_like(roughness)]))
    check_op(lib.light_queries, inputs, (0, 2))
    check_op(lib.light_queries_backward, (*inputs, directions, asked))
    torch.autograd.gradcheck(lib.light_queries, grad_leaves(inputs, (0, 2)))
    check_no_gradient(lib.light_queries, inputs, 1)
    check_no_gradient(lib.light_queries, inputs, 3)
    check_error(lambda: light_queries(normals, views, roughness, "median"), "light_queries", "query", "mean", "median")


@pytest.mark.parametrize("device", DEVICES)
def test_missing_gradients_raise(device):
    query, shade = query_inputs(device, torch.float64), split_sum_inputs(device, torch.float64)
    grad = torch.ones(7, 3, dtype=torch.float64, device=device)
    for index in (0, 1, 2, 5):
        check_no_gradient(lib.query_direction_backward, (*query, grad), index)
    for index in (*range(9), 14):
        check_no_gradient(lib.split_sum_shade_backward, (*shade, grad), index)
    # The table is data, not a parameter.
    check_no_gradient(lib.query_direction, query, 3)
    check_no_gradient(lib.split_sum_shade, shade, 9)
    for index in (12, 13):
        check_no_gradient(lib.split_sum_shade, (*shade[:12], grad, grad), index)


@pytest.mark.parametrize("device", DEVICES)
def test_empty_batch(device):
    for op, inputs, n in ((lib.query_direction, query_inputs(device, torch.float32, n=0), 3),
                          (lib.split_sum_shade, split_sum_inputs(device, torch.float32, n=0), 9)):  # fmt: skip
        leaves = grad_leaves(inputs, range(n))
        out = op(*leaves)
        assert out.shape == (0, 3)
        out.sum().backward()
        assert leaves[0].grad.shape == (0, 3)


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
    query_direction(normals.requires_grad_(), views, roughness).sum().backward()
    assert normals.grad.abs().sum() > 0


@pytest.mark.parametrize("device", DEVICES)
def test_errors_name_what_is_wrong(device):
    normals, views, roughness, *_ = query_inputs(device, torch.float32)
    check_error(
        lambda: query_direction(normals, views, roughness[:, 0]),
        "query_direction",
        "roughness",
        "[7, 1] float32",
        "[7]",
    )
    check_error(
        lambda: query_direction(normals, views.double(), roughness),
        "query_direction",
        "view_dirs",
        "float32",
        "float64",
    )
    check_error(lambda: query_direction(normals, views[:3], roughness), "view_dirs", "[7, 3]", "[3, 3]")
    check_error(
        lambda: query_direction(normals, views, roughness, "median"), "query_direction", "query", "mean", "median"
    )
    check_error(
        lambda: lib.query_direction(normals, views, roughness, brdf_lut(device)[1:], True),
        "lut",
        "[32, 32, 4]",
        "[31, 32, 4]",
    )
    inputs = split_sum_inputs(device, torch.float32)
    names = (
        "normals",
        "view_dirs",
        "albedo",
        "roughness",
        "metallic",
        "specular",
        "diffuse",
        "occlusion_s",
        "occlusion_d",
    )
    for i, name in enumerate(names):
        bad = [*inputs]
        bad[i] = inputs[i].repeat(1, 2)
        check_error(
            lambda bad=bad: lib.split_sum_shade(*bad), "split_sum_shade", name, "float32", f"[7, {bad[i].shape[1]}]"
        )
    check_error(
        lambda: split_sum_shade(*inputs[:9], fresnel_mode="fast"), "split_sum_shade", "fresnel_mode", "exact", "fast"
    )
    check_error(lambda: lib.split_sum_shade(*inputs[:10], 3, False, None, None), "split_sum_shade", "fresnel_mode", "3")
    for i, name in ((12, "indirect_s"), (13, "indirect_d")):
        bad = [*inputs]
        bad[i] = torch.ones(7, 1)
        check_error(lambda bad=bad: lib.split_sum_shade(*bad), "split_sum_shade", name, "[7, 3] float32", "[7, 1]")
    check_error(lambda: lib.split_sum_shade(*inputs[:6], None, *inputs[7:]), "split_sum_shade", "specular", "[14, 3] float32")


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
