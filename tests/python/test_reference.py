"""Every plain reference beside its operator in float64: results, and gradients where the operator has them."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
import reference
import torch
from bench.hash_grid import SPEC
from op_cases import (
    CASES,
    cached_visibility_inputs,
    lookup_inputs,
    neus_inputs,
    pixel_inputs,
    rand,
    shared_inputs,
    sparse_inputs,
    truth,
)
from op_checks import as_tuple, generator, grad_leaves, lib
from shading_inputs import mixed_sums_inputs, split_sum_inputs


# The inputs of each operator to which there is a gradient.
DIFFERENTIABLE = {
    "hash_encode": (0, 1), "sdf_field": range(1, 8), "march_rays": (), "neus_weights": (0, 1, 2), "surface_weights": (0, 1, 3),
    "composite": (0, 1, 3), "sharpness": (0,), "query_direction": (0, 1, 2), "split_sum_shade": range(9), "shade_sums": (*range(6), 8),
    "monte_carlo_light": (0, 2, 5), "summed_light": (0, 2, 5), "linear_to_srgb": (0,), "srgb_to_linear": (), "prefilter_light": (3,),
    "sparse_product": (6,), "light_lookup": (0, 1, 2, 3), "cached_visibility": (), "cached_occlusion": (),
    "pixel_losses": (0, 1), "gradient_losses": (0,), "material_losses": (1,), "quadratic_entropy": (0,), "log_chroma": (0,),
    "light_prior": (0,),
}  # fmt: skip
TOLERANCE = {"cached_occlusion": 2e-7}  # its directions have unit length in float32; of the others: 1e-9
LOSSES = ("pixel_losses", "gradient_losses", "material_losses")  # whose operators return all terms in one tensor


def as_the_operator_reads(inputs: tuple) -> tuple:
    """Numbers such as a step's length are float32 inside of some operators."""
    return tuple(float(np.float32(x)) if isinstance(x, float) else x for x in inputs)


def results(op: str, inputs: tuple) -> list[torch.Tensor]:
    got = as_tuple(getattr(lib, op)(*inputs))
    return list(got[0].unbind()) if op in LOSSES else list(got)


def deep_light(dtype: torch.dtype) -> tuple:
    """Spherical harmonics whose sums fall below 0 in places."""
    inputs = lookup_inputs(dtype, 300)
    return (*inputs[:3], inputs[3] * torch.where(torch.arange(169) == 0, 0.1, 3.0)[:, None].to(dtype), *inputs[4:])


def far_points(dtype: torch.dtype) -> tuple:
    """Some lie off the mesh by more than the radius in which vertices count at first, some by more than any."""
    x, normals, *rest = cached_visibility_inputs(dtype)
    return x + normals * rest[4] * torch.tensor([0.2, 1.5, 3.0, 5.0, 0.0, 1.2, 2.5, 9.0, 99.0]).to(dtype)[:, None], normals, *rest


# Other settings of the same operators: what the first case of each does not reach.
OTHERS = [
    *(("split_sum_shade", lambda t, mode=mode, gain=gain: split_sum_inputs("cpu", t, mode, gain, 1, 300))
      for mode in (0, 1, 2) for gain in (False, True)),
    ("shade_sums", lambda t: mixed_sums_inputs(300, t, compensate=False)),
    ("neus_weights", lambda t: neus_inputs("cpu", t, 0.7)),
    ("sparse_product", lambda t: tuple(0.3 * x if x.is_floating_point() else x for x in sparse_inputs(t))),
    ("light_lookup", deep_light),
    ("summed_light", lambda t: shared_inputs(40, dtype=t, with_sent=False)),
    ("cached_visibility", far_points),
    ("pixel_losses", lambda t: (*pixel_inputs(600, t), False)),
    ("material_losses", lambda t: (
        rand(600, 3, dtype=t), rand(600, 1, seed=1, dtype=t), rand(600, seed=2, dtype=t), True
    )),
]  # fmt: skip


@pytest.mark.parametrize(("op", "case"), [*((op, CASES[op]) for op in DIFFERENTIABLE), *OTHERS], ids=lambda x: x if isinstance(x, str) else "")
def test_operator_and_reference_agree(op, case):
    inputs = as_the_operator_reads(truth(case(torch.float64)))
    ours, theirs = (grad_leaves(inputs, DIFFERENTIABLE[op]) for _ in range(2))
    expected = as_tuple(getattr(reference, op)(*theirs))
    got = results(op, ours)[: len(expected)]
    for a, b in zip(got, expected, strict=True):
        torch.testing.assert_close(a, b, rtol=TOLERANCE.get(op, 1e-9), atol=1e-10)
    if not DIFFERENTIABLE[op]:
        return
    for outputs in (got, expected):
        cotangents = [torch.randn(x.shape, generator=generator(i), dtype=x.dtype) for i, x in enumerate(outputs)]
        sum((c * x).sum() for c, x in zip(cotangents, outputs)).backward()
    for i in DIFFERENTIABLE[op]:
        torch.testing.assert_close(ours[i].grad, theirs[i].grad, rtol=1e-7, atol=1e-9)
        assert theirs[i].grad.abs().max() > 0


def test_every_reference_of_an_operator_is_compared():
    functions = {name for name, _ in inspect.getmembers(reference, inspect.isfunction)}
    assert functions & set(CASES) == set(DIFFERENTIABLE)


def test_the_grid_of_the_benchmark_is_the_operator():
    """2^19 entries a level: hashes of large coordinates."""
    x = torch.rand(200, 3, generator=generator(), dtype=torch.float64)
    table = torch.randn(SPEC.n_entries, SPEC.n_features, generator=generator(1), dtype=torch.float64)
    inputs = x, table, *SPEC.arguments(SPEC.n_levels)
    torch.testing.assert_close(reference.hash_encode(*inputs), lib.hash_encode(*inputs), rtol=1e-9, atol=1e-12)
