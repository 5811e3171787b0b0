"""Checks of the hash grid, the distance field and the optimiser."""

from __future__ import annotations

import math

import torch
from torch.nn import functional as F

from splitnerf.ops import HashGridSpec
from splitnerf.ops._library import lib
from splitnerf_tools.doctor.table import N, check, pattern, sphere

SPEC = HashGridSpec(n_levels=2, n_features=2, base_resolution=4, growth=2.0, log2_table_size=7)
GRID = SPEC.arguments(2)
BOX = 1.5


def points() -> torch.Tensor:
    return 0.52 + 0.45 * sphere(N)  # on no face of a cell


def linear_table() -> torch.Tensor:
    """x + 2 z and y at the nodes of the first level, which has an entry for each; 3 in the second, which is hashed."""
    nodes = torch.cartesian_prod(*[torch.arange(5.0) / 4] * 3)
    table = torch.full((SPEC.n_entries, 2), 3.0)
    table[:125] = nodes @ torch.tensor([[1.0, 0.0], [0.0, 1.0], [2.0, 0.0]])
    return table


def linear_features(x: torch.Tensor) -> torch.Tensor:
    constant = torch.full((len(x),), 3.0)
    return torch.stack([x[:, 0] + 2 * x[:, 2], x[:, 1], constant, constant], 1)


@check
def hash_encode():
    """A linear table gives its linear function, a constant one its constant."""
    yield lib.hash_encode(points(), linear_table(), *GRID), linear_features(points())


@check
def hash_encode_jacobian():
    """A linear table has its slopes, a constant one none."""
    features, jacobian = lib.hash_encode_jacobian(points(), linear_table(), *GRID)
    yield features, linear_features(points())
    yield jacobian, torch.tensor([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0]])


def difference_of_softplus(n_features: int) -> tuple[torch.Tensor, ...]:
    """Weights of z + the first feature, since softplus(y) - softplus(-y) = y; a second output is 7."""
    hidden = torch.zeros(2, 3 + n_features)
    hidden[0, 2:4], hidden[1, 2:4] = 1.0, -1.0
    return hidden, torch.zeros(2), torch.tensor([[1.0, -1.0], [0.0, 0.0]]), torch.tensor([0.0, 7.0])


@check
def sdf_field():
    """z + a linear function of the grid, and its slopes; the weights' directions are not of the weights' lengths."""
    x = 2 * BOX * (points() - 0.5)
    hidden, hidden_bias, out, out_bias = difference_of_softplus(4)
    out[1, 0] = 1.0  # a direction, of length 0
    lengths = torch.full((2, 1), 2**0.5), torch.tensor([[2**0.5], [0.0]])
    outputs, features, gradient = lib.sdf_field(
        x, linear_table(), 3 * hidden, lengths[0], hidden_bias, 5 * out, lengths[1], out_bias, 100.0, *GRID, BOX, None
    )
    yield outputs, torch.stack([x[:, 2] + linear_features(points())[:, 0], torch.full((N,), 7.0)], 1)
    yield features, linear_features(points())
    yield gradient, torch.tensor([0.0, 0.0, 1.0]) + torch.tensor([1.0, 0.0, 2.0]) / (2 * BOX)


@check
def sdf_values():
    """z + a linear function of the grid."""
    x = sphere(N)
    values = lib.sdf_values(x, linear_table(), *difference_of_softplus(4), 100.0, *GRID, BOX)
    yield values, x[:, 2] + linear_features(x / (2 * BOX) + 0.5)[:, 0]


@check
def sample_rays():
    """Rays that cross a flat surface, each of whose 30 samples has some weight; with room for one sample more."""
    rays_o, rays_d = torch.zeros(N, 3), torch.zeros(N, 3)
    rays_o[:, 2], rays_d[:, 2] = 3.0, -1.0
    cells, table = torch.ones(2, 2, 2, dtype=torch.uint8), torch.zeros(SPEC.n_entries, 2)
    rays, starts, ends, offsets, evaluated, found = lib.sample_rays(
        rays_o, rays_d, torch.zeros(N), cells, table, *difference_of_softplus(4), 100.0, *GRID, BOX, 0.1, 64, 10.0, 1.0,
        0.0, 0.0, 10.0, 1.25, 30 * N + 1,
    )  # fmt: skip
    yield rays, F.pad(torch.arange(N).repeat_interleave(30), (0, 1))
    yield starts, F.pad((1.5 + 0.1 * torch.arange(30)).repeat(N), (0, 1))
    yield ends, F.pad((1.6 + 0.1 * torch.arange(30)).repeat(N), (0, 1))
    yield found, torch.tensor(30 * N)
    yield offsets, 30 * torch.arange(N + 1)
    yield evaluated, torch.full((N,), 30)


@check
def adamw_step_():
    """The first step is lr against the gradient's sign, beside the decay; a copy in 16 bits follows."""
    gradient = pattern(N) - 1
    param, average, square, copy = torch.full((N,), 2.0), torch.zeros(N), torch.zeros(N), torch.zeros(N).half()
    lib.adamw_step_(param, gradient, average, square, 0.1, 0.9, 0.99, 1e-15, 0.5, 1, False, copy)
    moved = 2 * (1 - 0.1 * 0.5) - 0.1 * gradient.sign()
    yield param, moved
    yield average, 0.1 * gradient
    yield square, 0.01 * gradient**2
    yield copy, moved


@check
def adamw_steps_():
    """The same for two parameters, the second at twice the rate and without decay; of the second a copy in 16 bits."""
    gradients = [pattern(N) - 1, pattern(5) + 1]
    params, averages, squares = [[torch.full_like(g, x) for g in gradients] for x in (2.0, 0.0, 0.0)]
    copy = torch.zeros(5).half()
    lib.adamw_steps_(
        params, gradients, averages, squares, [0.1, 0.2], 0.9, 0.99, 1e-15, [0.5, 0.0], [1, 1], [False, True], [copy], [1]
    )
    yield params[0], 2 * (1 - 0.1 * 0.5) - 0.1 * gradients[0].sign()
    yield params[1], 2 - 0.2 * gradients[1].sign()
    yield copy, params[1]
    for average, square, gradient in zip(averages, squares, gradients):
        yield average, 0.1 * gradient
        yield square, 0.01 * gradient**2


@check
def step_numbers():
    """A loss of .5, gradients whose norm is 5 and N points: all below 100, then N not below N."""
    gradients, evaluated = [torch.full((N, 1), 3.0 / N**0.5), torch.tensor(4.0)], torch.ones(N, dtype=torch.int64)
    expected = torch.tensor([0.5, 5.0, 7.0, N, 2.0])
    for limits in (torch.full((5,), 100.0), expected + torch.tensor([1.0, 1.0, 1.0, 0.0, 1.0])):
        numbers, allowed = lib.step_numbers(
            gradients, [torch.tensor(0.5)], [torch.tensor([7])], evaluated, torch.tensor(2.0), limits
        )
        yield numbers, expected
        yield allowed, torch.tensor(bool(limits[3] > N))


@check
def clear_unless_():
    """Two arrays, one of which holds what is no number, kept and cleared."""
    for kept in (True, False):
        arrays = [pattern(N), torch.full((5,), 2.0 if kept else math.nan)]
        lib.clear_unless_(arrays, torch.tensor(kept))
        yield arrays[0], pattern(N) * kept
        yield arrays[1], torch.full((5,), 2.0 * kept)
