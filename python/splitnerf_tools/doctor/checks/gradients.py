"""Checks of the backward passes by differences of the forward operators, which have checks of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from splitnerf.ops._library import lib
from splitnerf_tools.doctor.checks.fields import BOX, GRID, SPEC, points
from splitnerf_tools.doctor.checks.light import pyramid
from splitnerf_tools.doctor.checks.losses import metals, neighbours, pixels
from splitnerf_tools.doctor.checks.rays import between, offsets, plane_inputs, surface_inputs
from splitnerf_tools.doctor.checks.shading import LINEAR, up, views
from splitnerf_tools.doctor.table import CHECKS, N, check, column, lut, pattern, slopes, sphere


def grid() -> tuple:
    return points(), pattern(SPEC.n_entries, 2), *GRID


def field() -> tuple:
    weights = pattern(5, 7) - 1, 1 + pattern(5, 1), pattern(5), pattern(3, 5) - 1, 1 + pattern(3, 1), pattern(3)
    return 2 * BOX * (points() - 0.5), pattern(SPEC.n_entries, 2), *weights, 2.0, *GRID, BOX


def material() -> tuple:
    """Normals, views, albedo, roughness and metallic."""
    return up(), views(), 0.6 * pattern(N, 3), column(0.5), column(0.4)


def split_sum() -> tuple:
    light = pattern(N, 3), 2 * pattern(N, 3), column(0.7), column(0.6)
    return *material(), *light, lut(), 0, True, 0.3 * pattern(N, 3), 0.1 * pattern(N, 3)


def sums() -> tuple:
    light = torch.stack([k * pattern(N, 3) for k in (1.0, 0.1, 0.8, 0.05)], 1)
    return *material(), light, lut(), True, pattern(N, 3), pattern(N)


def drawn_light() -> tuple:
    directions = sphere(32)[:16].repeat(N, 1, 1)
    return up(), views(), column(0.5), directions, pattern(N, 16), pattern(N, 16, 3)


def shared_light() -> tuple:
    light = sphere(64), pattern(64), pattern(64, 3), 0.5 * pattern(N, 64), pattern(N, 64, 3)
    return up(), views(), column(0.5), *light


def corrections() -> tuple:
    """Of N rays, each with two samples in a segment."""
    every = torch.arange(2 * N)
    rays = pattern(N, 3), 2 * pattern(2 * N, 3), every, every, every // 2, every // 2
    return *rays, 0.1 + 0.1 * pattern(2 * N), 0.2 + 0.3 * pattern(N), 1e-4


# The inputs of the forward operator, and those to which the backward pass gives a gradient.
BACKWARD: dict[str, tuple[Callable[[], tuple], tuple[int, ...]]] = {
    "add_corrections_backward": (corrections, (0, 1)),
    "composite_backward": (lambda: (pattern(N), pattern(N, 3), offsets(), pattern(3), 0.75), (0, 1, 3)),
    "gradient_losses_backward": (neighbours, (0,)),
    "hash_encode_backward": (grid, (1,)),
    "hash_encode_jacobian_backward": (grid, (1,)),
    "hash_encode_jacobian_backward_positions": (grid, (0,)),
    "interpolate_backward": (lambda: (pattern(5, 3), *between()), (0,)),
    "light_queries_backward": (lambda: (up(), views(), column(0.5), lut(), True), (0, 2)),
    "light_lookup_backward": (lambda: pyramid(pattern(64, 3)), (0, 1, 2, 3)),
    "light_prior_backward": (lambda: (pattern(N, 3).flip(0), [4, N - 4]), (0,)),
    "linear_to_srgb_backward": (lambda: (pattern(N) * LINEAR[1],), (0,)),
    "log_chroma_backward": (lambda: (pattern(N, 3).flip(0),), (0,)),
    "material_losses_backward": (metals, (1,)),
    "monte_carlo_light_backward": (drawn_light, (0, 2, 5)),
    "neus_weights_backward": (plane_inputs, (0, 1, 2)),
    "pixel_losses_backward": (pixels, (0, 1)),
    "prefilter_light_backward": (lambda: (sphere(N), column(0.5), sphere(256), pattern(256, 3)), (3,)),
    "query_direction_backward": (lambda: (up(), views(), column(0.5), lut(), True), (0, 1, 2)),
    "sdf_field_backward": (field, (1, 2, 3, 4, 5, 6, 7)),
    "shade_sums_backward": (sums, (*range(6), 8)),
    "sharpness_backward": (lambda: (0.5 * pattern(N),), (0,)),
    "split_sum_shade_backward": (split_sum, tuple(range(9))),
    "summed_light_backward": (shared_light, (0, 2, 5)),
    "surface_weights_backward": (lambda: surface_inputs(pattern(N, 3).flip(0)), (0, 1, 3)),
}


def by_differences(backward: str) -> Callable[[], Iterator[tuple]]:
    """The check of a backward pass."""
    forward, (inputs, wanted) = backward.split("_backward")[0], BACKWARD[backward]

    def run() -> Iterator[tuple]:
        """Differences of the forward operator."""
        return slopes(getattr(lib, forward), inputs(), wanted)

    return run


CHECKS.update((name, by_differences(name)) for name in BACKWARD)


@check
def material_network_backward():
    """Differences of the forward operator, by inputs in two parts, weights and biases."""
    inputs = pattern(N, 2), pattern(N, 3), pattern(4, 5) - 1, pattern(5, 4) - 1, pattern(4) + 0.3, pattern(5) - 1

    def network(a: Tensor, b: Tensor, *numbers: Tensor) -> tuple[Tensor, ...]:
        return lib.material_network([a, b], list(numbers[:2]), list(numbers[2:]), 0.2)

    yield from slopes(network, inputs, tuple(range(6)))
