"""light_queries, split_sum_shade, and the sums over directions: monte_carlo_light, summed_light and shade_sums."""

import math

import pytest
import torch
from op_cases import query_inputs, shared_inputs, split_sum_inputs, sums_inputs
from op_checks import check_error, lib, unit
from splitnerf import ops
from splitnerf.ops import light_queries, split_sum_shade
from splitnerf.ops.shading import SHADED, LightSums, brdf_lut, monte_carlo_light, shade_sums, summed_light
from stability.cases import drawn_directions


def test_table_made_in_inference_mode_serves_training():
    brdf_lut.cache_clear()
    with torch.inference_mode():
        brdf_lut(torch.device("cpu"))
    normals, views, roughness, *_ = query_inputs("cpu", torch.float32)
    light_queries(normals.requires_grad_(), views, roughness)[0].sum().backward()
    assert normals.grad.abs().sum() > 0


def test_an_option_that_is_not_known_is_named():
    inputs = split_sum_inputs("cpu", torch.float32)
    shade = lambda: split_sum_shade(**dict(zip(SHADED, inputs)), fresnel_mode="fast")
    check_error(shade, "split_sum_shade", "fresnel_mode", "exact", "fast")
    ask = lambda: light_queries(*query_inputs("cpu", torch.float32)[:3], "median")
    check_error(ask, "light_queries", "query", "mean", "median")


SMOOTH = ([0.887, -0.036, -0.46], [-0.849, 0.157, 0.504], [0.8, 0.5, 0.2], [0.0], [0.95], [0.5, 0.4, 0.45], [1, 1, 0.5])
GRAZED = [0.0, 0.0, 1.0], [1.0, 0.0, 6.27e-4], [0.009, 0.0, 0.002], [0.0], [0.0], [0.7, 0.4, 0.05], [0.0, 0.0, 0.0]


@pytest.mark.parametrize("compensate", [False, True])
@pytest.mark.parametrize(("values", "of"), [(SMOOTH, 3), (GRAZED, 4)])
def test_gradients_keep_their_digits_where_shares_of_light_nearly_cancel(compensate, values, of):
    """To roughness: F1 + F2 of smooth surfaces is 1 but for a millionth, and it is the change of that millionth. To metallic: dark
    metal at a grazing angle reflects 0.97 of the light, a thousandth more than the dielectric does."""
    inputs, found = [torch.tensor([x]) for x in (*values, [1.0], [0.8])], []
    inputs[:2] = map(unit, inputs[:2])
    for dtype in (torch.float32, torch.float64):
        leaves = [x.to(dtype).requires_grad_() for x in inputs]
        out = lib.split_sum_shade(*leaves, brdf_lut(), 0, compensate, None, None)
        found.append([torch.autograd.grad(x, leaves[of], retain_graph=True)[0].item() for x in out[0]])
    assert found[0] == pytest.approx(found[1], rel=1e-5)


def at(n_dot_v: float, roughness: float, dtype=torch.float64) -> tuple:
    normals = torch.tensor([[0.0, 0.0, 1.0]], dtype=dtype)
    view_dirs = torch.tensor([[math.sqrt(1 - n_dot_v**2), 0.0, n_dot_v]], dtype=dtype)
    return normals, view_dirs, torch.tensor([[roughness]], dtype=dtype)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("n_dot_v", [0.2, 0.6, 1.0])
def test_a_white_sky_gives_the_brdf_table(n_dot_v, roughness):
    """Under radiance 1 the sums are F1 + F2, F2, 1 and E_d."""
    point = at(n_dot_v, roughness)
    directions, pdf = drawn_directions(*point, 0.5, 1 << 16)
    sums = monte_carlo_light(*point, directions, pdf, torch.ones_like(directions))
    table = brdf_lut().double()
    x, y = math.sqrt(n_dot_v) * 31, roughness * 31
    x0, y0 = min(int(x), 30), min(int(y), 30)
    rows = [torch.lerp(table[j, x0], table[j, x0 + 1], x - x0) for j in (y0, y0 + 1)]
    f1, f2, _, layer = torch.lerp(*rows, y - y0).tolist()
    assert sums.specular[0].tolist() == pytest.approx([f1 + f2] * 3, abs=4e-3)
    assert sums.grazing[0].tolist() == pytest.approx([f2] * 3, abs=3e-3)
    assert sums.diffuse[0].tolist() == pytest.approx([1.0] * 3, abs=1e-3)
    assert sums.dielectric[0].tolist() == pytest.approx([layer] * 3, abs=1e-3)


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
        material = {"albedo": albedo, "roughness": roughness, "metallic": metallic}
        return split_sum_shade(normals, view_dirs, **material, specular=one, diffuse=black)

    sums = LightSums(lobe(one) * light, lobe(black) * light, diffuse, lobe(black, 0 * metal) * light)
    material = {"albedo": albedo, "roughness": roughness, "metallic": metallic, "compensate": compensate}
    there = split_sum_shade(normals, view_dirs, **material, specular=light, diffuse=diffuse)
    torch.testing.assert_close(shade_sums(normals, view_dirs, **material, sums=sums), there)


def test_a_sum_of_another_shape_is_named():
    x = sums_inputs()
    specular, grazing, diffuse, dielectric = x[5].unbind(1)
    with pytest.raises(ValueError, match=r"grazing must be \[6, 3\], got \[6, 1\]"):
        shade_sums(**dict(zip(SHADED[:5], x)), sums=LightSums(specular, grazing[:, :1], diffuse, dielectric))


def test_the_correction_is_the_sum_less_the_split_by_its_share():
    normals, view_dirs, roughness, *light = shared_inputs(12)
    albedo, metallic, split, share = (torch.rand(12, *k, dtype=torch.float64) for k in ((3,), (1,), (3,), ()))
    material = {"albedo": albedo, "roughness": roughness, "metallic": metallic, "compensate": True}
    summed = shade_sums(normals, view_dirs, **material, sums=summed_light(normals, view_dirs, roughness, *light))
    named = dict(zip(("directions", "solid_angles", "radiance", "visible", "sent"), light))
    found = ops.shading.summed_correction(normals, view_dirs, **material, split=split, share=share, **named)
    torch.testing.assert_close(found, (summed - split) * share[:, None])
