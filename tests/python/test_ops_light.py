"""fibonacci_directions, and what the seeds of sample_ggx_lobe and occlusion_factors decide."""

import torch
from op_cases import EVERY, floor_under_a_ball
from op_checks import arguments_of, check_error, generator
from splitnerf.ops import fibonacci_directions, occlusion_factors
from splitnerf.ops.light import sample_ggx_lobe


def test_fibonacci_directions_are_uniform_and_seeded():
    directions = fibonacci_directions(4096, generator(5), torch.float64)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(4096, dtype=torch.float64))
    torch.testing.assert_close(directions.T @ directions / 4096, torch.eye(3).double() / 3, rtol=0, atol=1e-3)
    assert directions.mean(0).abs().max() < 1e-3
    assert torch.equal(directions, fibonacci_directions(4096, generator(5), torch.float64))
    assert not torch.equal(directions, fibonacci_directions(4096, generator(6), torch.float64))


def test_the_seed_decides_the_samples_of_a_lobe():
    axes, roughness = torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([[0.5]])
    first, again, other = (sample_ggx_lobe(axes, roughness, 8, seed) for seed in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)


def test_the_seed_decides_the_rays_and_one_factor_is_the_mean_of_the_channels():
    names, values = arguments_of("occlusion_factors")[1:6], EVERY["occlusion_factors"](None)[1:6]
    factors = lambda **more: occlusion_factors(floor_under_a_ball(), **dict(zip(names, values)), **more)
    for first, again, other, each in zip(*(factors(seed=s, n_channels=c) for s, c in ((0, 1), (0, 1), (1, 1), (0, 3)))):
        assert torch.equal(first, again) and not torch.equal(first, other) and each.shape == (9, 3)
        torch.testing.assert_close(first, each.mean(1, keepdim=True))
    check_error(lambda: factors(n_channels=2), "occlusion_factors", "n_channels", "1 or 3", "2")
