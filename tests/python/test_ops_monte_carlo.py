"""monte_carlo_light and summed_light: closed forms, gradients, errors."""

from __future__ import annotations

import math

import pytest
import torch
from op_cases import drawn_inputs, shared_inputs
from op_checks import generator, grad_leaves, lib

from splitnerf.ops import brdf_lut, monte_carlo_light
from reference import drawn_directions

GRADIENTS = (0, 2, 5)  # normals, roughness, radiance


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


def test_a_normal_that_faces_away_is_turned():
    normals, view_dirs, roughness, directions, pdf, radiance = drawn_inputs()
    flipped = monte_carlo_light(-normals, view_dirs, roughness, directions, pdf, radiance)
    for a, b in zip(flipped, monte_carlo_light(normals, view_dirs, roughness, directions, pdf, radiance)):
        torch.testing.assert_close(a, b)


@pytest.mark.parametrize("roughness", [0.0, 1e-4, 1.0])
@pytest.mark.parametrize("n_dot_v", [0.0, 1e-7, 1.0])
def test_edges_stay_finite(n_dot_v, roughness):
    point = tuple(x.requires_grad_() for x in at(n_dot_v, roughness, torch.float32))
    directions, pdf = drawn_directions(*(x.detach() for x in point), 0.5, 64)
    sums = torch.stack(
        monte_carlo_light(point[0], point[1].detach(), point[2], directions, pdf, torch.ones_like(directions))
    )
    sums.sum().backward()
    assert torch.isfinite(sums).all()
    assert torch.isfinite(point[0].grad).all() and torch.isfinite(point[2].grad).all()


# ---- one set of directions for all points ----


@pytest.mark.parametrize("with_sent", [True, False])
@pytest.mark.parametrize("n", [0, 1, 5, 700])
def test_shared_directions_sum_as_drawn_ones_of_their_solid_angle(n, with_sent):
    x = shared_inputs(n, with_sent=with_sent)
    ours, theirs = grad_leaves(x, GRADIENTS), grad_leaves(x, GRADIENTS)
    sums = lib.summed_light(*ours)
    normals, view_dirs, roughness, directions, solid_angles, radiance, visible, sent = theirs
    k = len(directions)
    incoming = visible[..., None] * radiance + (sent if with_sent else 0)
    pdf = (1 / (k * solid_angles)).expand(n, k)
    expected = lib.monte_carlo_light(normals, view_dirs, roughness, directions.expand(n, k, 3), pdf, incoming)
    torch.testing.assert_close(sums, expected)
    weights = torch.randn(sums.shape, generator=generator(), dtype=torch.float64)
    for s in (sums, expected):
        (s * weights).sum().backward()
    for i in GRADIENTS:
        torch.testing.assert_close(ours[i].grad, theirs[i].grad)
