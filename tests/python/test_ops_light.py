"""prefilter_light, fibonacci_directions and sample_ggx_lobe."""

from __future__ import annotations

import pytest
import torch
from op_cases import prefilter_inputs
from op_checks import DEVICES, check_error, generator, unit

from splitnerf.ops import fibonacci_directions, prefilter_light, sample_ggx_lobe


@pytest.mark.parametrize("device", DEVICES)
def test_constant_light_stays_itself(device):
    queries, _, lights, light = prefilter_inputs(device, torch.float32, 50, 300)
    for roughness in (0.0, 0.05, 0.5, 1.0):
        out = prefilter_light(queries, torch.full_like(queries[:, :1], roughness), lights, torch.full_like(light, 3.0))
        torch.testing.assert_close(out, torch.full_like(out, 3.0))


@pytest.mark.parametrize("device", DEVICES)
def test_no_light_above_the_horizon_gives_black(device):
    up, down = (torch.tensor([[0.0, 0, z]], device=device) for z in (1, -1))
    light = torch.ones(1, 3, device=device, requires_grad=True)
    out = prefilter_light(up, torch.full((1, 1), 0.5, device=device), down, light)
    out.sum().backward()
    assert not out.any() and not light.grad.any()


def test_fibonacci_directions_are_uniform_and_seeded():
    directions = fibonacci_directions(4096, generator(5), torch.float64)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(4096, dtype=torch.float64))
    torch.testing.assert_close(
        directions.T @ directions / 4096, torch.eye(3, dtype=torch.float64) / 3, rtol=0, atol=1e-3
    )
    assert directions.mean(0).abs().max() < 1e-3
    assert torch.equal(directions, fibonacci_directions(4096, generator(5), torch.float64))
    assert not torch.equal(directions, fibonacci_directions(4096, generator(6), torch.float64))


@pytest.mark.parametrize("device", DEVICES)
def test_lobe_samples_estimate_the_prefiltered_light(device):
    queries, _, lights, _ = prefilter_inputs(device, torch.float64, 20, 60000)
    smooth = lambda w: 1 + torch.sin(2 * w)  # noqa: E731
    for rho in (0.2, 0.6, 1.0):
        roughness = torch.full_like(queries[:, :1], rho)
        samples = sample_ggx_lobe(queries, roughness, 2048, seed=1)
        torch.testing.assert_close(samples.norm(dim=-1), torch.ones_like(samples[..., 0]))
        expected = prefilter_light(queries, roughness, lights, smooth(lights))
        torch.testing.assert_close(smooth(samples).mean(1), expected, rtol=0, atol=2e-3)
    assert not torch.equal(samples, sample_ggx_lobe(queries, roughness, 2048, seed=2))


@pytest.mark.parametrize("device", DEVICES)
def test_errors_name_what_is_wrong(device):
    queries, roughness, lights, light = prefilter_inputs(device, torch.float32)
    check_error(
        lambda: prefilter_light(queries, roughness[:, 0], lights, light),
        "prefilter_light",
        "roughness",
        "[6, 1] float32",
        "[6]",
    )
    check_error(
        lambda: prefilter_light(queries, roughness, lights, light[1:]), "prefilter_light", "light", "[40, 3]", "[39, 3]"
    )
    check_error(lambda: prefilter_light(queries.double(), roughness, lights, light), "query_dirs", "float32", "float64")
    check_error(
        lambda: prefilter_light(queries, roughness, lights[:0], light[:0]),
        "prefilter_light",
        "light_dirs",
        "at least one",
    )
    check_error(lambda: sample_ggx_lobe(queries[:, :2], roughness, 4), "sample_ggx_lobe", "axes", "[n, 3]", "[6, 2]")
    check_error(lambda: sample_ggx_lobe(queries, roughness, 0), "sample_ggx_lobe", "n_samples", "[1, 2^20]")


# ---- gbar against a million samples of the lobe ----


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
        torch.testing.assert_close(prefilter_light(axes, roughness, w, lamp(w)), exact, rtol=bound, atol=0)
