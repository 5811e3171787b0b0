"""specular_share, sample_bsdf and monte_carlo_light: densities, closed forms, gradients, errors."""

from __future__ import annotations

import math

import pytest
import torch
from op_cases import drawn_inputs, shared_inputs
from op_checks import check_error, check_no_gradient, check_op, generator, grad_leaves, lib
from shading_inputs import sums_inputs

from splitnerf import _core
from splitnerf.ops import brdf_lut, monte_carlo_light, sample_bsdf, shade_sums, specular_share

GRADIENTS = (0, 2, 5)  # normals, roughness, radiance


def at(n_dot_v: float, roughness: float, dtype=torch.float64) -> tuple:
    normals = torch.tensor([[0.0, 0.0, 1.0]], dtype=dtype)
    view_dirs = torch.tensor([[math.sqrt(1 - n_dot_v**2), 0.0, n_dot_v]], dtype=dtype)
    return normals, view_dirs, torch.tensor([[roughness]], dtype=dtype)


def half(point: tuple) -> torch.Tensor:
    return torch.full_like(point[2], 0.5)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("n_dot_v", [0.2, 0.6, 1.0])
def test_a_white_sky_gives_the_brdf_table(n_dot_v, roughness):
    """Under radiance 1 the sums are F1 + F2, F2, 1 and E_d."""
    point = at(n_dot_v, roughness)
    directions, pdf = sample_bsdf(*point, half(point), 1 << 16)
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


@pytest.mark.parametrize("share", [0.0, 0.1, 0.618, 0.95])
@pytest.mark.parametrize("roughness", [0.05, 0.4, 1.0])
def test_density_integrates_to_one_and_matches_the_samples(roughness, share):
    """What 1 / pdf of the samples estimates is the solid angle that they can reach: the hemisphere, 2 pi."""
    point = at(0.5, roughness)
    directions, pdf = sample_bsdf(*point, torch.full_like(point[2], share), 1 << 17)
    up = directions[0, :, 2] > 0
    assert torch.equal(pdf[0] > 0, up)
    torch.testing.assert_close(directions.norm(dim=-1), torch.ones_like(pdf))
    solid_angle = torch.where(up, 1 / pdf[0].clamp(min=1e-300), torch.zeros_like(pdf[0])).mean().item()
    assert solid_angle == pytest.approx(2 * math.pi, rel=0.01)


@pytest.mark.parametrize("share", [0.1, 0.382, 0.618, 0.95])
@pytest.mark.parametrize("n", [1, 2, 7, 64])
def test_few_directions_of_any_share_have_the_mean_of_quadrature(n, share):
    """Under a sky of three harmonics: means over many points of n directions each, within five standard errors."""
    points, roughness = 20000, 0.35
    normals, view_dirs, rho = (x.expand(points, -1) for x in at(0.6, roughness))

    def sky(w: torch.Tensor) -> torch.Tensor:
        return torch.stack([1.0 + 0 * w[..., 2], 1 + w[..., 0], (1 + w[..., 1]) * w[..., 2] ** 2], -1)

    directions, pdf = sample_bsdf(normals, view_dirs, rho, torch.full_like(rho, share), n)
    drawn = torch.stack(monte_carlo_light(normals, view_dirs, rho, directions, pdf, sky(directions)), 1)
    lattice = torch.from_numpy(_core.fibonacci_sphere(1 << 17))[None]
    density = torch.full(lattice.shape[:2], 1 / (4 * math.pi), dtype=torch.float64)
    exact = torch.stack(monte_carlo_light(*at(0.6, roughness), lattice, density, sky(lattice)), 1)
    apart = (drawn.mean(0) - exact[0]) / (drawn.std(0) / points**0.5)
    assert apart.abs().max() < 5


def test_the_share_follows_the_material():
    """A smooth metal .95, a rough white dielectric .1; the path tracer's share of light between them."""
    n, v, _ = at(0.8, 0.0)

    def of(albedo: float, roughness: float, metallic: float) -> float:
        column = lambda x: torch.tensor([[x]], dtype=torch.float64)  # noqa: E731
        return specular_share(n, v, column(albedo).expand(1, 3), column(roughness), column(metallic)).item()

    assert of(0.9, 0.1, 1.0) == 0.95 and of(1.0, 1.0, 0.0) == 0.1
    assert of(0.9, 0.1, 0.5) == pytest.approx(0.5, abs=0.05)
    fresnel = 0.0439  # of index 1.5 at this angle
    assert of(0.02, 0.0, 0.0) == pytest.approx(fresnel / (fresnel + (1 - fresnel) * 0.02), abs=0.005)
    assert of(1.0, 1.0, 1.0) == pytest.approx(1 - math.log(2), abs=0.06)  # most of it is scattered twice or more


@pytest.mark.parametrize("roughness", [0.1, 0.5])
def test_a_metal_has_less_noise_with_its_own_share_than_with_a_half(roughness):
    """Of 16 directions under a lamp on the mirrored side."""
    points, metal = 4000, torch.ones(4000, 1, dtype=torch.float64)
    normals, view_dirs, rho = (x.expand(points, -1) for x in at(0.6, roughness))
    albedo = torch.full((points, 3), 0.9, dtype=torch.float64)

    def spread(share: torch.Tensor) -> float:
        directions, pdf = sample_bsdf(normals, view_dirs, rho, share, 16)
        mirrored = torch.tensor([-0.8, 0.0, 0.6], dtype=torch.float64)
        light = torch.exp(4 * (directions @ mirrored - 1))[..., None].expand_as(directions)
        sums = monte_carlo_light(normals, view_dirs, rho, directions, pdf, light)
        return shade_sums(normals, view_dirs, albedo, rho, metal, sums).std().item()

    assert spread(specular_share(normals, view_dirs, albedo, rho, metal)) < 0.9 * spread(0.5 * metal)


def test_a_normal_that_faces_away_is_turned():
    normals, view_dirs, roughness, directions, pdf, radiance = drawn_inputs()
    flipped = monte_carlo_light(-normals, view_dirs, roughness, directions, pdf, radiance)
    for a, b in zip(flipped, monte_carlo_light(normals, view_dirs, roughness, directions, pdf, radiance)):
        torch.testing.assert_close(a, b)


def test_opcheck():
    point = drawn_inputs()[:3]
    check_op(lib.specular_share, (*sums_inputs()[:5], brdf_lut()))
    check_op(lib.sample_bsdf, (*point, half(point), 4, 1))
    check_op(lib.monte_carlo_light, drawn_inputs(), GRADIENTS)
    grad_sums = torch.ones(5, 4, 3, dtype=torch.float64)
    check_op(lib.monte_carlo_light_backward, (*drawn_inputs(), grad_sums))


def test_gradcheck():
    x = drawn_inputs()
    assert torch.autograd.gradcheck(
        lambda n, r, l: torch.stack(monte_carlo_light(n, x[1], r, x[3], x[4], l)), grad_leaves((x[0], x[2], x[5]), (0, 1, 2)),
        atol=1e-7, rtol=1e-6,
    )  # fmt: skip


def test_float32_is_close_to_float64():
    exact = monte_carlo_light(*drawn_inputs(200, 32))
    single = monte_carlo_light(*(x.float() for x in drawn_inputs(200, 32)))
    for a, b in zip(single, exact):
        torch.testing.assert_close(a.double(), b, rtol=2e-4, atol=1e-5)


@pytest.mark.parametrize("roughness", [0.0, 1e-4, 1.0])
@pytest.mark.parametrize("n_dot_v", [0.0, 1e-7, 1.0])
def test_edges_stay_finite(n_dot_v, roughness):
    point = tuple(x.requires_grad_() for x in at(n_dot_v, roughness, torch.float32))
    directions, pdf = sample_bsdf(*(x.detach() for x in point), half(point).detach(), 64)
    assert torch.isfinite(directions).all() and torch.isfinite(pdf).all() and (pdf >= 0).all()
    sums = torch.stack(
        monte_carlo_light(point[0], point[1].detach(), point[2], directions, pdf, torch.ones_like(directions))
    )
    sums.sum().backward()
    assert torch.isfinite(sums).all()
    assert torch.isfinite(point[0].grad).all() and torch.isfinite(point[2].grad).all()


def test_missing_gradients_raise():
    for position in (1, 3, 4):
        with pytest.raises(RuntimeError, match="no gradient to"):
            torch.stack(monte_carlo_light(*grad_leaves(drawn_inputs(), (position,)))).sum().backward()
    with pytest.raises(RuntimeError, match="no gradient"):
        sample_bsdf(*grad_leaves(drawn_inputs()[:3], (0,)), half(drawn_inputs()), 4)[0].sum().backward()
    with pytest.raises(RuntimeError, match="no gradient"):
        specular_share(*grad_leaves(sums_inputs()[:5], (3,))).sum().backward()


def test_empty_batch():
    three, one = torch.empty(0, 3), torch.empty(0, 1)
    share = specular_share(three, three, three, one, one)
    directions, pdf = sample_bsdf(torch.empty(0, 3), torch.empty(0, 3), torch.empty(0, 1), share, 4)
    assert directions.shape == (0, 4, 3) and pdf.shape == (0, 4)
    sums = monte_carlo_light(torch.empty(0, 3), torch.empty(0, 3), torch.empty(0, 1), directions, pdf, directions)
    assert sums.specular.shape == (0, 3)


def test_errors_name_what_is_wrong():
    n, v, r, d, p, l = drawn_inputs()
    with pytest.raises(Exception, match=r"pdf must be \[5, 6\] float64"):
        monte_carlo_light(n, v, r, d, p[:, :3], l)
    with pytest.raises(Exception, match="n_samples must be in"):
        sample_bsdf(n, v, r, half((n, v, r)), 0)
    with pytest.raises(Exception, match=r"specular_share must be \[5, 1\] float64"):
        sample_bsdf(n, v, r, half((n, v, r))[0], 4)


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


def test_shared_directions_opcheck_gradcheck_precision_and_errors():
    check_op(lib.summed_light, shared_inputs(), GRADIENTS)
    check_op(lib.summed_light_backward, (*shared_inputs(), torch.ones(5, 4, 3, dtype=torch.float64)))
    assert torch.autograd.gradcheck(
        lambda *x: lib.summed_light(*x), grad_leaves(shared_inputs(3, 5), GRADIENTS), atol=1e-6
    )
    single, exact = lib.summed_light(*shared_inputs(dtype=torch.float32)), lib.summed_light(*shared_inputs())
    torch.testing.assert_close(single.double(), exact, rtol=2e-4, atol=1e-5)
    for index in (1, 3, 4, 6, 7):
        check_no_gradient(lib.summed_light, shared_inputs(), index)
    x = list(shared_inputs())
    x[7] = x[7][:2]
    check_error(lambda: lib.summed_light(*x), "summed_light", "sent must hold as many points")
