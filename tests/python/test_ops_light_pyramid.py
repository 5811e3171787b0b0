"""sparse_product, light_lookup, the maps between the texels of an explicit light; directions on the sphere and what seeds decide."""

import math

import pytest
import torch
from op_cases import EVERY, LIGHT_NODES, floor_under_a_ball, lookup_inputs, octahedral_directions
from op_checks import arguments_of, check_error, generator, lib, on_threads, unit
from splitnerf import _core, ops
from splitnerf.ops import fibonacci_directions, occlusion_factors
from splitnerf.ops.light import light_averages, light_filters, light_lookup, sparse_product, zonal_factors


def dense(matrix: ops.light.SparseRows) -> torch.Tensor:
    """The whole matrix, image by image."""
    row = torch.repeat_interleave(torch.arange(len(matrix.places)), matrix.offsets.diff())
    out = torch.zeros(matrix.places.numel(), len(matrix.images), dtype=matrix.weights.dtype)
    for places, images in zip(matrix.places.T.long(), matrix.images.T.long()):
        out.index_put_((places[row], images[matrix.columns]), matrix.weights, accumulate=True)
    return out


def test_a_map_of_several_parts_holds_its_transpose():
    matrix = light_filters(8, [(8, 0.3), (4, 0.4)]).to(torch.float64)
    values = torch.randn(64, 3, generator=generator(), dtype=torch.float64)
    torch.testing.assert_close(sparse_product(matrix, values), dense(matrix.rows) @ values, rtol=1e-12, atol=1e-12)
    torch.testing.assert_close(dense(matrix.transposed), dense(matrix.rows).T, rtol=0, atol=0)


def test_the_rows_of_a_filter_are_lobes_about_their_texels_in_all_quarters_of_the_map():
    """A lobe scales a light that is linear in the direction by the factor of degree 1."""
    axes = torch.tensor([[1.0, 2.0, 3.0], [-2.0, 1.0, 0.5], [0.0, 0.0, 1.0]]).double()
    light, texels = octahedral_directions(32).double() @ axes, octahedral_directions(16).double()
    averages = sparse_product(light_averages(32).to(torch.float64), light)
    found = sparse_product(light_filters(32, [(16, 0.5)]).to(torch.float64), averages)
    factor = zonal_factors(0.5, 2)[0, 1].item()
    torch.testing.assert_close(found, factor * texels @ axes, rtol=0, atol=0.04)


def test_the_lookup_does_not_depend_on_threads():
    inputs = lookup_inputs(torch.float32, 5000)
    grad = torch.randn(5000, 3, generator=generator(4))
    results = [on_threads(n, lambda: lib.light_lookup_backward(*inputs, grad)) for n in (1, 3)]
    assert all(map(torch.equal, *results))


def test_the_lookup_is_continuous_across_every_seam_and_node():
    *_, levels, sh, resolutions, nodes, zonal = lookup_inputs()
    along = torch.linspace(-0.999, 0.999, 201, dtype=torch.float64)
    zero, step = torch.zeros_like(along), 1e-7
    poles = torch.tensor([[0.0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -1, 0]], dtype=torch.float64)
    bow = 1 - along**2
    circles = [torch.stack(axes, -1) for axes in ((along, zero, bow), (zero, along, -bow), (along, bow, zero))]
    points = unit(torch.cat([*circles, poles]))  # where octants meet; the lower ones are the square's own edges
    for rho in (0.0, 0.1, 0.3):
        roughness = torch.full((len(points), 1), rho, dtype=torch.float64)
        rest = (levels, sh, resolutions, nodes, zonal)
        at = light_lookup(points, roughness, *rest)
        for offset in torch.eye(3, dtype=torch.float64):
            for side in (-step, step):
                near = light_lookup(unit(points + side * offset), roughness, *rest)
                assert (near - at).abs().max() < 20 * step * 16
    for node in LIGHT_NODES:
        sides = [
            light_lookup(points, torch.full_like(roughness, node + s), levels, sh, resolutions, nodes, zonal)
            for s in (-1e-9, 1e-9)
        ]
        torch.testing.assert_close(*sides, rtol=1e-6, atol=1e-6)


def test_solid_angles_are_those_of_the_sphere():
    for n in (8, 64):
        angles = torch.from_numpy(_core.octahedral_solid_angles(n))
        assert angles.sum().item() == pytest.approx(4 * math.pi, rel=1e-12)
        directions = octahedral_directions(n)
        density = directions.abs().sum(1) ** 3 * 4 / n**2  # du dv / |p|^3 at the centre; folded texels differ most
        torch.testing.assert_close(angles, density, rtol=2.5 / n, atol=0)
        second = torch.einsum("n,ni,nj->ij", angles, directions, directions)
        torch.testing.assert_close(second, 4 * math.pi / 3 * torch.eye(3, dtype=torch.float64), rtol=0, atol=20 / n**2)


def test_averages_and_filters_keep_a_constant_and_the_total():
    averages, angles = light_averages(16), torch.from_numpy(_core.octahedral_solid_angles(16))
    ones = torch.ones(256, 3)
    torch.testing.assert_close(sparse_product(averages, ones), torch.ones(320, 3), rtol=0, atol=1e-6)
    light = torch.rand(256, 3, generator=generator(), dtype=torch.float64)
    coarse = sparse_product(averages.to(torch.float64), light)[256:]
    total = (coarse * torch.from_numpy(_core.octahedral_solid_angles(8))[:, None]).sum(0)
    torch.testing.assert_close(total, (light * angles[:, None]).sum(0), rtol=1e-6, atol=0)
    filters = light_filters(16, [(16, 0.2), (8, 0.4)])
    torch.testing.assert_close(sparse_product(filters, torch.ones(320, 3)), torch.ones(320, 3), rtol=0, atol=1e-6)
    assert (filters.rows.weights > 0).all()
    check_error(lambda: light_averages(12), "light_averages", "power of 2", "12")


def test_zonal_factors_of_the_cosine_lobe_and_of_all_lobes():
    factors = zonal_factors(0.5, 65).double()
    expected = torch.tensor([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64], dtype=torch.float64)  # Lambert's
    torch.testing.assert_close(factors[-1, :7], expected, rtol=0, atol=1e-6)
    assert (factors[:, 0] == 1).all() and (factors[:-1, 1:3] > factors[1:, 1:3]).all()


def test_the_projection_is_orthonormal_on_the_first_degrees():
    projection = ops.light.sh_projection(32, cells=False).double()
    w = octahedral_directions(32)
    x, y, z = w.unbind(1)
    basis = [v * math.sqrt(k / (4 * math.pi)) for v, k in ((torch.ones_like(x), 1), (y, 3), (z, 3), (x, 3))]
    got = torch.stack([projection[:4] @ b for b in basis], 1)
    torch.testing.assert_close(got, torch.eye(4, dtype=torch.float64), rtol=0, atol=5e-3)
    for n in (8, 16, 32):
        for cells in (False, True):
            totals = ops.light.sh_projection(n, cells).double().sum(1)
            assert totals[0].item() == pytest.approx(math.sqrt(4 * math.pi), rel=1e-6)
            assert totals[1:].abs().max() < 2e-6


# ---- directions and seeds ----


def test_fibonacci_directions_are_uniform_and_seeded():
    directions = fibonacci_directions(4096, generator(5), torch.float64)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(4096, dtype=torch.float64))
    torch.testing.assert_close(directions.T @ directions / 4096, torch.eye(3).double() / 3, rtol=0, atol=1e-3)
    assert directions.mean(0).abs().max() < 1e-3
    assert torch.equal(directions, fibonacci_directions(4096, generator(5), torch.float64))
    assert not torch.equal(directions, fibonacci_directions(4096, generator(6), torch.float64))


def test_the_seed_decides_the_samples_of_a_lobe():
    axes, roughness = torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([[0.5]])
    first, again, other = (ops.light.sample_ggx_lobe(axes, roughness, 8, seed) for seed in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)


def test_the_seed_decides_the_rays_and_one_factor_is_the_mean_of_the_channels():
    names, values = arguments_of("occlusion_factors")[1:6], EVERY["occlusion_factors"](None)[1:6]
    factors = lambda **more: occlusion_factors(floor_under_a_ball(), **dict(zip(names, values)), **more)
    for first, again, other, each in zip(*(factors(seed=s, n_channels=c) for s, c in ((0, 1), (0, 1), (1, 1), (0, 3)))):
        assert torch.equal(first, again) and not torch.equal(first, other) and each.shape == (9, 3)
        torch.testing.assert_close(first, each.mean(1, keepdim=True))
    check_error(lambda: factors(n_channels=2), "occlusion_factors", "n_channels", "1 or 3", "2")
