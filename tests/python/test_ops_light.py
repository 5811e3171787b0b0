"""fibonacci_directions, and the seed of sample_ggx_lobe."""

import torch
from op_checks import generator
from splitnerf.ops import fibonacci_directions
from splitnerf.ops.light import sample_ggx_lobe


def test_fibonacci_directions_are_uniform_and_seeded():
    directions = fibonacci_directions(4096, generator(5), torch.float64)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(4096, dtype=torch.float64))
    torch.testing.assert_close(
        directions.T @ directions / 4096, torch.eye(3, dtype=torch.float64) / 3, rtol=0, atol=1e-3
    )
    assert directions.mean(0).abs().max() < 1e-3
    assert torch.equal(directions, fibonacci_directions(4096, generator(5), torch.float64))
    assert not torch.equal(directions, fibonacci_directions(4096, generator(6), torch.float64))


def test_the_seed_decides_the_samples_of_a_lobe():
    axes, roughness = torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([[0.5]])
    first, again, other = (sample_ggx_lobe(axes, roughness, 8, seed) for seed in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)
