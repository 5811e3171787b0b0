"""The explicit light: its filtered maps and harmonics against integrals of its own texels, and its shared chain."""

import copy
import math
import os
from pathlib import Path

import numpy as np
import pytest
import torch
from op_cases import octahedral_directions
from op_checks import generator, precisions, unit
from splitnerf.data.environment import read_environment, sample_environment
from splitnerf.fields import EvaluatedLight, Light, LightMlp, LightPyramid, SkyCells
from splitnerf.fields import light as lights
from splitnerf.fields.light import chain_resolution, is_resolved, lobe_roughness, panorama_directions, pyramid_filters
from splitnerf.ops.light import sample_ggx_lobe, sh_projection
from torch import Tensor

DATA = Path(os.environ.get("SPLITNERF_DATA", Path(__file__).parents[3] / "shared" / "data"))


def pyramid_of(radiance: torch.Tensor) -> LightPyramid:
    """The pyramid whose texels have this radiance, [n^2, 3]."""
    light = LightPyramid(math.isqrt(len(radiance)))
    with torch.no_grad():
        light.texels.zero_()
        light.texels[-len(radiance) :] = radiance.float().clamp(min=1e-5).log()
    return light


def box_filtered(radiance_of, n: int, k: int = 8) -> torch.Tensor:
    """[n^2, 3] means over the texels by solid angle, from k^2 directions each."""
    directions = octahedral_directions(n * k)
    density = (directions.abs().sum(1) ** 3)[:, None]
    blocks = lambda x: x.view(n, k, n, k, -1).sum((1, 3)).reshape(n * n, -1)
    return blocks(radiance_of(directions) * density) / blocks(density)


def sky(w: torch.Tensor) -> torch.Tensor:
    """A blue sky over brown ground, with a glow and a small sun, 200 times brighter than the sky."""
    towards = w @ unit(torch.tensor([0.5, 0.3, 0.81], dtype=w.dtype))
    blue, brown = torch.tensor([0.3, 0.5, 1.0]), torch.tensor([0.25, 0.2, 0.15])
    above = blue * (0.4 + 0.6 * (1 - w[:, 2:]).clamp(0, 1) ** 2)
    lamp = 1.5 * torch.exp(60 * (towards - 1)) + 100.0 * (towards > math.cos(math.radians(1.5)))
    return torch.where(w[:, 2:] > 0, above, brown) + torch.tensor([1.0, 0.9, 0.7]) * lamp[:, None]


def measured_map(w: torch.Tensor) -> torch.Tensor:
    path = DATA / "scenes" / "boombox" / "light.hdr"
    if not path.is_file():
        pytest.skip(f"{path} is absent; set SPLITNERF_DATA to the folder of the test data")
    return torch.from_numpy(np.maximum(sample_environment(read_environment(path), w.numpy()), 0)).double()


def relative_error(light: LightPyramid, roughness: float, n_queries: int = 60, n_samples: int = 20000) -> float:
    """Relative RMSE of g against the mean of the texels' light over exact-lobe samples."""
    queries = unit(torch.randn(n_queries, 3, generator=generator(1)))
    rho = torch.full((n_queries, 1), roughness)
    with torch.no_grad():
        samples = sample_ggx_lobe(queries, rho, n_samples, seed=3).view(-1, 3)
        g_bar = light(samples, torch.zeros(len(samples), 1)).view(n_queries, n_samples, 3).double().mean(1)
        return ((light(queries, rho) - g_bar).square().mean() / g_bar.square().mean()).sqrt().item()


# Bounds a quarter above what was measured: a map of 3 degrees under lamps smaller than that.
MEASURED = {
    sky: {0.1: 0.026, 0.15: 0.023, 0.2: 0.021, 0.3: 0.014, 0.4: 0.022, 0.5: 0.002, 0.7: 0.001, 1.0: 0.001},
    measured_map: {0.1: 0.12, 0.15: 0.051, 0.2: 0.019, 0.3: 0.023, 0.4: 0.031, 0.5: 0.005, 0.7: 0.0012, 1.0: 0.002},
}


@pytest.mark.parametrize("radiance", MEASURED)
def test_g_is_the_integral_of_the_texels_over_the_lobe(radiance):
    light = pyramid_of(box_filtered(radiance, 64))
    for rho, bound in MEASURED[radiance].items():
        error = relative_error(light, rho)
        assert error < bound, f"rho {rho}: relative RMSE {error:.4f}"


def test_g_at_roughness_one_is_irradiance_over_pi():
    light = pyramid_of(1 + 0.9 * octahedral_directions(64)[:, 2:].expand(-1, 3))
    normals = unit(torch.randn(200, 3, generator=generator()))
    g = light(normals, torch.ones(200, 1))
    torch.testing.assert_close(g, 1 + 0.6 * normals[:, 2:].expand(-1, 3), rtol=2e-3, atol=0)


def test_the_gradient_to_texels_is_that_of_the_whole_chain():
    light = LightPyramid(16)
    directions, rho = unit(torch.randn(40, 3, generator=generator())), torch.rand(40, 1, generator=generator(1))
    wanted = torch.randn(40, 3, generator=generator(2))
    (light(directions, rho) * wanted).sum().backward()
    for index in (0, 50, 150, 333):
        values = []
        for step in (-1e-2, 1e-2):
            with torch.no_grad():
                light.texels[index, 1] += step
                values.append((light(directions, rho) * wanted).double().sum().item())
                light.texels[index, 1] -= step
        slope = (values[1] - values[0]) / 2e-2
        assert light.texels.grad[index, 1].item() == pytest.approx(slope, rel=2e-2, abs=2e-4)


def ask(light: LightPyramid) -> torch.Tensor:
    return light(torch.tensor([[0.0, 0, 1]]), torch.tensor([[1.0]]))


def doubled(light: LightPyramid) -> None:
    with torch.no_grad():
        light.texels += math.log(2) / 3  # of three levels


def test_the_chain_is_never_stale():
    light = LightPyramid(16, start=0.5)
    torch.testing.assert_close(ask(light), torch.full((1, 3), 0.5))
    doubled(light)
    torch.testing.assert_close(ask(light), torch.full((1, 3), 1.0))
    with torch.no_grad():
        torch.testing.assert_close(ask(light), torch.full((1, 3), 1.0))
        doubled(light)
        torch.testing.assert_close(ask(light), torch.full((1, 3), 2.0))
    assert ask(light).requires_grad
    light.load_state_dict(LightPyramid(16, start=3.0).state_dict())
    torch.testing.assert_close(ask(light), torch.full((1, 3), 3.0))
    other = copy.deepcopy(light)
    doubled(other)
    torch.testing.assert_close(ask(other), 2 * ask(light))


# ---- what lights share: gradients that gather, other tensors in their place, panoramas ----

CELLS = SkyCells(64)
W, RHO = unit(torch.randn(30, 3, generator=generator(1))), torch.rand(30, 1, generator=generator(2))


def light_of(kind: str, seed: int = 0) -> Light:
    torch.manual_seed(seed)
    light = LightPyramid(16) if kind == "pyramid" else LightMlp(16, 1, 2, 1, "softplus")
    with torch.no_grad():
        for parameter in light.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return light


def evaluated(light: Light) -> EvaluatedLight:
    evaluated = light.evaluate()
    return evaluated.with_cells(CELLS.light(evaluated))


def use(light: EvaluatedLight) -> torch.Tensor:
    """Something that reads all parts of a light."""
    return light(W, RHO).square().sum() + (light.cells.radiance.square() * light.cells.solid_angles[:, None]).sum()


def test_a_light_may_read_other_tensors_and_leaves_its_gradients_there():
    """Of the pyramid: maps, harmonics and the cells' radiance, whose solid angles have no gradient."""
    ours, theirs = evaluated(light_of("pyramid")), evaluated(light_of("pyramid", seed=1))
    assert len(ours.leaves) == 3
    leaves = [leaf.detach().clone().requires_grad_() for leaf in theirs.leaves]
    copy = ours.with_leaves(leaves)
    assert len(copy.leaves) == 3 and all(a is b for a, b in zip(copy.leaves, leaves))
    assert use(copy).item() == use(theirs).item() != use(ours).item()
    use(copy).backward()
    use(theirs).backward()
    for a, b, untouched in zip(leaves, theirs.leaves, ours.leaves):
        assert torch.equal(a.grad, b.grad) and a.grad.abs().sum() > 0 and untouched.grad is None
    with torch.no_grad():
        for leaf in leaves:
            leaf.mul_(2.0)
    torch.testing.assert_close(copy(W, RHO), 2 * theirs(W, RHO))
    again = ours.with_leaves(ours.leaves)
    assert use(again).item() == use(ours).item()


@pytest.mark.parametrize("read", ["lookups", "cells", "both"])
def test_what_gathers_is_handed_on_whatever_was_read(read):
    """The gradient of maps alone, of the cells alone, and of both: after two steps twice that of a light evaluated for one."""
    light = light_of("pyramid")

    def loss(shared, cells) -> torch.Tensor:
        parts = {"lookups": shared(W, RHO).square().sum(), "cells": (cells.radiance**3).sum()}
        return parts[read] if read in parts else sum(parts.values())

    shared = evaluated(light)
    for _ in range(2):
        loss(shared, shared.cells).backward()
        assert light.texels.grad is None
    shared.backward()
    gathered, light.texels.grad = light.texels.grad, None
    loss(light, CELLS.light(light)).backward()
    torch.testing.assert_close(gathered, 2 * light.texels.grad)


def test_gradients_that_are_dropped_are_dropped_everywhere():
    """Of maps, harmonics and cells: what gathers afterwards is that of the next step alone."""
    light = light_of("pyramid")
    shared = evaluated(light)
    use(shared).backward()
    assert all(leaf.grad is not None for leaf in shared.leaves)
    shared.zero_grad()
    assert all(leaf.grad is None for leaf in shared.leaves)
    use(shared).backward()
    once = [leaf.grad.clone() for leaf in evaluated_once(light)]
    for leaf, grad in zip(shared.leaves, once, strict=True):
        torch.testing.assert_close(leaf.grad, grad)
    shared.zero_grad()
    shared.backward()
    assert light.texels.grad is None


def evaluated_once(light: Light) -> tuple[torch.Tensor, ...]:
    """The leaves of an evaluation that was used once."""
    shared = evaluated(light)
    use(shared).backward()
    return shared.leaves


class Painted(Light):
    """The direction as a colour, and the roughness as a fourth of it, so that it shows."""

    def __init__(self):
        super().__init__()
        self.one = torch.nn.Parameter(torch.ones(1))

    def forward(self, directions, roughness):
        return self.one * (2 + directions + 0.25 * roughness)


@pytest.mark.parametrize("height", [8, 200])
def test_a_panorama_is_the_light_in_each_of_its_directions(height):
    """More texels than are asked at a time (65,536), too."""
    panorama, directions = Painted().panorama(height, 0.8), panorama_directions(height)
    assert panorama.shape == directions.shape == (height, 2 * height, 3) and not panorama.requires_grad
    torch.testing.assert_close(panorama, 2.2 + directions)
    torch.testing.assert_close(Painted().panorama(8), 2 + panorama_directions(8))
    assert directions[0, 0, 2] > 0.9 > -0.9 > directions[-1, 0, 2] and directions[height // 2, height, 0] > 0.9


def test_a_lobe_as_wide_as_the_sphere_is_rough():
    """Roughness r: 4 pi r^4; whatever is wider counts as 1."""
    for roughness in (0.1, 0.5, 1.0):
        solid_angle = 4 * math.pi * roughness**4
        assert lobe_roughness(solid_angle) == pytest.approx(roughness)
    assert lobe_roughness(50.0) == 1.0


@pytest.mark.parametrize(
    ("resolution", "maps", "nodes"),
    [
        (16, [16, 16, 16], [0.05, 0.3, 0.4, 0.5]),
        (32, [32, 32, 32], [0.05, 0.3, 0.4, 0.5]),
        (64, [64, 64, 64, 64, 32], [0.05, 0.15, 0.2, 0.3, 0.4, 0.5]),
    ],
)
def test_maps_are_as_fine_as_their_lobes(resolution, maps, nodes):
    """5 texels for ggx_alpha = rho^2, where the lobe, 2.57 alpha wide, is wider than a texel, and what is wide is wider
    than one of its own map."""
    filters = pyramid_filters(resolution)
    assert filters.resolutions.tolist() == maps and filters.nodes.tolist() == pytest.approx(nodes)
    assert torch.equal(filters.projection, sh_projection(resolution, cells=False))  # as texels are read: bilinearly
    for rho in (0.1, 0.15, 0.2, 0.3, 0.4):
        assert is_resolved(resolution, rho) == (2.57 * rho**2 >= math.sqrt(4 * math.pi) / resolution)
        m = chain_resolution(1 << 12, rho)
        assert m >= 5 / rho**2 > m / 2 and chain_resolution(resolution, rho) == min(m, resolution)


def test_the_light_starts_as_it_is_told_and_its_texels_stay_in_bounds():
    """exp(-12) to exp(12), where the gradient ends."""
    for start in (0.5, 3.0):
        light = LightPyramid(16, start)
        torch.testing.assert_close(light.radiance(), torch.full((256, 3), start))
        assert not light.texels[16:].any()
    assert LightMlp.needs_consistency_loss and not light.needs_consistency_loss  # lobes are integrals of the texels
    light = LightPyramid(16, 1.0)
    with torch.no_grad():
        light.texels[-256:] = torch.linspace(-21, 21, 256)[:, None]
    radiance = light.radiance()
    expected = torch.linspace(-21, 21, 256).clamp(-12, 12).exp()[:, None].expand(256, 3)
    torch.testing.assert_close(radiance, expected, rtol=1e-4, atol=0)
    radiance.log().sum().backward()
    inside = torch.linspace(-21, 21, 256).abs() < 12
    torch.testing.assert_close(light.texels.grad[-256:, 0], inside.float())


def test_texels_are_read_as_they_are_up_to_a_roughness_of_a_twentieth():
    light = light_of("pyramid")
    sharp, still, rough = (light(W, torch.full((30, 1), rho)) for rho in (0.0, 0.05, 0.06))
    assert torch.equal(sharp, still) and not torch.allclose(still, rough)


def test_harmonics_are_those_of_the_averages_where_maps_are_large(monkeypatch):
    """By averages of 16 texels along the edge of 32. c + z + z^3 at roughness 1, where it is the irradiance over pi:
    z^3 = 3/5 P1 + 2/5 P3, of which P1 counts by 2/3 and P3 by nothing."""
    monkeypatch.setattr(lights, "SH_RESOLUTION", 16)
    filters = pyramid_filters.__wrapped__(32)
    monkeypatch.setattr(lights, "filters_on", lambda *_: filters)
    assert filters.projected == slice(32 * 32, 32 * 32 + 16 * 16) and filters.projection.shape == (169, 256)
    assert torch.equal(filters.projection, sh_projection(16, cells=True))  # averages are constant in their cells
    light, z = LightPyramid(32), octahedral_directions(32)[:, 2:].float()
    with torch.no_grad():
        light.texels.zero_()
        light.texels[-(32 * 32) :] = (2.5 + z + z**3).log()
    expected = (2.5 + (2 / 3) * 1.6 * W[:, 2:]).expand(30, 3)
    torch.testing.assert_close(light(W, torch.ones(30, 1)), expected, rtol=0.015, atol=0)


def test_harmonics_are_not_rounded_to_tensor_cores():
    asked = precisions(light_of("pyramid").parts)
    assert asked["__matmul__"] | asked["matmul"] == {"ieee"}


# ---- the light as a network: its waves, layers, activations, and where it starts ----

ACTIVATIONS = {"softplus": lambda x: torch.logaddexp(x, torch.zeros(())), "exp": lambda x: x.clamp(-12, 12).exp()}


def mlp_of(activation: str, n_layers: int = 3) -> LightMlp:
    torch.manual_seed(0)
    return LightMlp(16, n_layers, direction_frequencies=3, roughness_frequencies=2, activation=activation)


def waves(w: Tensor, rho: Tensor) -> Tensor:
    """Sines and cosines of 1, 2 and 4 times each coordinate, then of 1 and 2 times the roughness."""
    angles = torch.stack([2**k * w[:, i] for i in range(3) for k in range(3)], 1)
    rough = torch.cat([rho, 2 * rho], 1)
    return torch.cat([angles.sin(), angles.cos(), rough.sin(), rough.cos()], 1)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("n_layers", [1, 3])
def test_it_is_its_layers_and_the_last_reads_the_waves_again(activation, n_layers):
    light = mlp_of(activation, n_layers)
    with torch.no_grad():
        for parameter in light.parameters():
            parameter.normal_(std=0.4)
    w, rho = (x.clone().requires_grad_() for x in (W, RHO))
    x = encoded = waves(w, rho)
    torch.testing.assert_close(light.encode(w, rho), encoded)
    assert [tuple(layer.weight.shape) for layer in light.hidden] == [(16, 22)] + [(16, 16)] * (n_layers - 1)
    for layer in light.hidden:
        x = x @ layer.weight.T + layer.bias
        x = x * (x > 0)
    expected = ACTIVATIONS[activation](torch.cat([x, encoded], 1) @ light.out.weight.T + light.out.bias)
    found = light(w, rho)
    torch.testing.assert_close(found, expected)
    for a, b in zip(*(torch.autograd.grad(g.sum(), (w, rho)) for g in (found, expected)), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5)
        assert a.abs().mean() > 0.01


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_it_starts_near_a_half_and_stays_positive_and_finite(activation):
    light = mlp_of(activation)
    assert light.out.weight.std().item() == pytest.approx(0.01, rel=0.2)
    with torch.no_grad():
        light.out.weight.zero_()
        torch.testing.assert_close(light(W, RHO), torch.full((30, 3), 0.5))
        light.out.bias.copy_(torch.tensor([-30.0, 3.0, 200.0]))
    found = light(W, RHO)[0].tolist()
    expected = {"softplus": [9.36e-14, 3.04859, 200.0], "exp": [6.1442e-06, 20.0855, 162754.8]}[activation]
    assert found == pytest.approx(expected, rel=1e-3)
