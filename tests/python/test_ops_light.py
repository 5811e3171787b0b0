"""prefilter_light, fibonacci_directions and sample_ggx_lobe."""

import pytest
import torch
from op_checks import generator, unit
from splitnerf.ops import fibonacci_directions, prefilter_light
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


def lamp(w: torch.Tensor) -> torch.Tensor:
    """A lamp of 12 degrees over a dim sky."""
    axis = unit(torch.tensor([[0.4, -0.2, 0.8]], dtype=w.dtype))
    return (0.1 + 20.0 * torch.exp(40.0 * (w @ axis.T - 1.0))).expand(-1, 3)


@pytest.mark.parametrize("rho", [0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
def test_gbar_against_a_million_samples_of_the_lobe(rho):
    """The shared lattice where it resolves the lobe, 4096 of the lobe's own samples at every roughness."""
    axes = unit(torch.tensor([[0.4, -0.2, 0.8], [0.5, 0.1, 0.7], [-0.3, 0.2, 0.5]], dtype=torch.float64))
    roughness = torch.full((3, 1), rho, dtype=torch.float64)

    def mean(n: int, seed: int) -> torch.Tensor:
        return torch.stack([lamp(w).mean(0) for w in sample_ggx_lobe(axes, roughness, n, seed)])

    exact = mean(1_000_000, 1)
    torch.testing.assert_close(mean(4096, 2), exact, rtol=0.01, atol=0.003)
    if rho < 0.06:  # the lobe is far narrower than the lamp
        torch.testing.assert_close(exact, lamp(axes), rtol=0.01, atol=0)
    if rho >= 0.2:
        w = fibonacci_directions(8129, generator(3), torch.float64)
        bound = {0.2: 0.03, 0.4: 0.01, 0.7: 0.01, 1.0: 0.01}[rho]
        torch.testing.assert_close(
            prefilter_light(axes, roughness, light_dirs=w, light=lamp(w)), exact, rtol=bound, atol=0
        )
