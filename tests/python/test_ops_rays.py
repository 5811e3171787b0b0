"""surface_weights, spread_samples, interpolate and composite; draw_rays out of range, of which the rest is in stability/properties.py."""

import pytest
import torch
from op_cases import packed_samples, surface_inputs
from op_checks import check_error, generator, lib
from splitnerf.ops import composite, surface_weights
from splitnerf.ops.rays import PackedSamples, PixelList, draw_rays, spread_samples


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_samples_of_no_ray_count_for_nothing(dtype):
    """Arrays may be longer than the last offset: outputs and gradients there are 0, whatever the inputs; others as without."""
    sdf, gradient, rays_d, s, offsets = surface_inputs(dtype)
    n, more = len(sdf), 300
    values = torch.randn(n, 4, generator=generator(3)).to(dtype)
    longer = [torch.cat([x, torch.full((more, *x.shape[1:]), 7.0, dtype=dtype)]) for x in (sdf, gradient, values)]

    def render(sdf, gradient, values):
        leaves = [x.clone().requires_grad_() for x in (sdf, gradient, values, s)]
        normals, weights, opacity = surface_weights(*leaves[:2], rays_d, leaves[3], offsets, step=0.1)
        sums = composite(weights, leaves[2], offsets)
        of_samples = (normals[:, 0] + weights) * torch.arange(1.0, len(sdf) + 1)
        (of_samples.sum() + sums.square().sum() + opacity.square().sum()).backward()
        return (normals, weights, *(x.grad for x in leaves[:3])), (opacity, sums, leaves[3].grad)

    (long, alike), (short, same) = render(*longer), render(sdf, gradient, values)
    for a, b in zip(long, short):
        assert torch.equal(a[:n], b) and not a[n:].any()
    for a, b in zip(alike, same):
        torch.testing.assert_close(a, b)


@pytest.mark.parametrize("per_ray", [1, 3, 7])
def test_spread_draws_what_weighs_and_one_of_each_ray(per_ray):
    weights, samples, phase = packed_samples()
    shaded = spread_samples(weights, samples, per_ray, phase).shaded
    assert (shaded.diff() > 0).all()
    drawn = torch.bincount(samples.ray_indices[shaded], minlength=50)
    counts = samples.offsets.diff()
    assert drawn[2] == 0 and drawn[4] == 1 and (drawn[counts > 0] >= 1).all() and (drawn <= per_ray).all()
    total = torch.zeros(50, dtype=torch.float64).index_add(0, samples.ray_indices, weights)[samples.ray_indices]
    certain = (weights > total / per_ray).nonzero().squeeze(1)
    assert (len(certain) > 0) == (per_ray > 1) and torch.isin(certain, shaded).all()


def test_spread_draws_all_and_names_the_heaviest():
    weights, samples, phase = packed_samples()
    spread = spread_samples(weights, samples, 0, phase)
    n = len(weights)
    assert torch.equal(spread.shaded, torch.arange(n))
    assert torch.equal(spread.interpolate(weights[:, None])[:, 0], weights)
    for per_ray in (0, 2):
        spread = spread_samples(weights, samples, per_ray, phase)
        rays = samples.ray_indices[spread.shaded]
        most = torch.zeros(50, dtype=torch.float64).scatter_reduce(0, rays, weights[spread.shaded], "amax")
        assert rays[spread.heaviest].tolist() == [r for r in range(50) if r != 2]
        assert torch.equal(weights[spread.shaded[spread.heaviest]], most[rays[spread.heaviest]])


def test_a_second_surface_has_a_sample_and_a_colour_of_its_own():
    """Nine tenths of the weight in front, one tenth behind a gap."""
    t = torch.tensor([0.0, 0.1, 0.2, 1.0, 1.1], dtype=torch.float64)
    samples = PackedSamples(torch.zeros(5, dtype=torch.int64), t - 0.05, t + 0.05, torch.tensor([0, 5]))
    weights = torch.tensor([0.3, 0.3, 0.3, 0.04, 0.06], dtype=torch.float64)
    for phase in torch.linspace(0, 0.99, 34, dtype=torch.float64):
        spread = spread_samples(weights, samples, 2, phase[None], gap=0.15)
        behind = spread.shaded >= 3
        assert behind.any() and not behind.all()
        colours = spread.interpolate(behind[:, None].double())[:, 0]
        assert colours.tolist() == [0, 0, 0, 1, 1]
        assert behind[spread.representatives].tolist() == [False, True]
        assert spread.segment.tolist() == behind.long().tolist()
        assert (weights[spread.shaded[spread.representatives]][spread.segment] >= weights[spread.shaded]).all()
        assert weights[spread.shaded[spread.heaviest]].tolist() == [0.3]
    assert spread_samples(weights, samples, 0, phase[None], gap=0.15).shaded.tolist() == [0, 1, 2, 3, 4]


def test_room_that_is_given_holds_the_same_and_what_counts_for_nothing():
    weights, samples, phase = packed_samples()
    free = spread_samples(weights, samples, 2, phase, 0.3)
    n_shaded, n_rays, n_segments = free.sizes.tolist()
    assert (n_shaded, n_rays, n_segments) == (len(free.shaded), 49, len(free.representatives))
    longer = torch.cat([weights, weights.new_full((9,), 5.0)])
    padded = PackedSamples(*(torch.cat([x, x[:9]]) for x in samples[:3]), samples.offsets)
    unit = torch.tensor(0.1, dtype=weights.dtype)
    roomy = spread_samples(longer, padded, 2, phase, 3.0, capacity=(300, 250), unit=unit)
    lengths = [len(x) for x in (roomy.shaded, roomy.segment, roomy.representatives, roomy.heaviest)]
    assert lengths == [300, 300, 250, 50]
    assert roomy.sizes.tolist() == free.sizes.tolist()
    for name, short in free._asdict().items():
        long = getattr(roomy, name)
        torch.testing.assert_close(long[: len(short)], short)
        assert (long[len(short) :] >= 0).all(), name
    assert not any(x[len(weights) :].any() for x in (roomy.first, roomy.second, roomy.share))
    assert max(roomy.representatives.max(), roomy.heaviest.max()) < 300 and roomy.segment.max() < 250
    assert roomy.shaded.max() < len(weights) and roomy.shaded[n_shaded:].unique().numel() > 20
    values = torch.randn(300, 3, generator=generator(), dtype=weights.dtype)
    torch.testing.assert_close(roomy.interpolate(values)[: len(weights)], free.interpolate(values[:n_shaded]))
    assert not roomy.gather(torch.cat([weights, weights.new_zeros(9)]))[n_shaded:].any()


def test_too_little_room_is_told_and_indices_stay_in_range():
    weights, samples, phase = packed_samples()
    n_shaded, _, n_segments = spread_samples(weights, samples, 2, phase, 0.3).sizes.tolist()
    for capacity in ((n_shaded - 1, n_segments), (n_shaded, n_segments - 1), (1, 1)):
        spread = spread_samples(weights, samples, 2, phase, 0.3, capacity=capacity)
        assert spread.sizes.tolist() == [n_shaded, 49, n_segments]
        assert spread.interpolate(weights.new_ones(capacity[0], 1)).eq(1).all() and spread.segment.max() < capacity[1]
        assert max(spread.representatives.max(), spread.heaviest.max()) < capacity[0]
        assert spread.shaded.max() < len(weights)
    check_error(
        lambda: lib.spread_samples(weights, samples.middles, samples.offsets, phase, 0.3, 2, 5), "max_stretches"
    )


def test_spread_draws_in_proportion_to_the_weights():
    weights, samples, _ = packed_samples()
    counts = torch.zeros(len(weights), dtype=torch.float64)
    for phase in torch.linspace(0, 1, 1001, dtype=torch.float64)[:-1]:
        counts[spread_samples(weights, samples, 3, phase.expand(50)).shaded] += 1e-3
    total = torch.zeros(50, dtype=torch.float64).index_add(0, samples.ray_indices, weights)[samples.ray_indices]
    expected = torch.where(total > 0, 3 * weights / total.clamp(min=1e-12), 0.0).clamp(max=1)
    heard = samples.ray_indices != 4
    torch.testing.assert_close(counts[heard], expected[heard], atol=3e-3, rtol=0)


def test_interpolation_is_exact_for_what_is_linear_along_a_ray():
    weights, samples, phase = packed_samples()
    spread = spread_samples(weights, samples, 4, phase)
    middle = 0.5 * (samples.t_starts + samples.t_ends)
    slope = torch.randn(50, 2, generator=generator(), dtype=torch.float64)[samples.ray_indices]
    values = slope * middle[:, None] + 1
    got = spread.interpolate(values[spread.shaded])
    rays = samples.ray_indices
    lowest, highest = (
        torch.zeros(50, dtype=torch.float64).scatter_reduce(
            0, rays[spread.shaded], middle[spread.shaded], kind, include_self=False
        )[rays]
        for kind in ("amin", "amax")
    )
    expected = slope * middle.clamp(lowest, highest)[:, None] + 1  # the nearest counts beyond the ends
    torch.testing.assert_close(got, expected)
    assert (rays[spread.shaded[spread.first]] == rays).all() and (rays[spread.shaded[spread.second]] == rays).all()
    shares = spread.gather(weights)
    torch.testing.assert_close(shares @ values[spread.shaded], weights @ got)


def test_numbers_that_are_out_of_range_stay_within_the_photos():
    """Of two photos of 4 rows and 5 columns: of a list that names pixels which are not there, and of random numbers that are
    none."""
    cameras, every = (torch.eye(3).repeat(2, 1, 1), torch.zeros(2, 3)), PixelList.all(2 * 4 * 5, torch.device("cpu"))
    runs = PixelList(torch.tensor([2, 3, 7]), torch.tensor([1, 5, 30]), 7)  # pixels 1 2, 7, 33 34 35 36
    beyond = PixelList(torch.tensor([3]), torch.tensor([1000]), 3)
    draws = ([0.5, 0.5], 2, beyond, [39, 39]), ([-3.0, 2.0], 0, runs, [0, 39]), ([-3.0, 2.0], 2, runs, [1, 36])
    for random, n_near, near, pixels in draws:
        assert draw_rays(torch.tensor(random), n_near, near, every, *cameras, 4, 5)[3].tolist() == pixels
