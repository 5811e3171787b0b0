"""Every operator on the inputs of op_cases: its reference, its gradients, what torch asks of it, few points, and errors."""

import inspect
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import op_cases
import pytest
import reference
import torch
from bench.hash_grid import SPEC
from op_cases import CASES, EVERY, ON_THE_CPU_ALONE, OPERATORS, check_against_the_cpu, truth
from op_checks import arguments_of, as_tuple, check_op, devices, floats, generator, grad_leaves, has_cuda_kernel, lib
from splitnerf import _core
from splitnerf.ops.training import quadratic_entropy
from splitnerf_tools.doctor import cases
from torch.autograd import forward_ad

# The positions of the inputs to which there is a gradient.
DIFFERENTIABLE = {
    op: tuple(arguments_of(op).index(name) for name in names.split())
    for op, names in (cases.DIFFERENTIABLE | {"quadratic_entropy": "x"}).items()
}
FORWARD = sorted(name for name in EVERY if "_backward" not in name)
# the points are their second argument
BEHIND = {"read_pixels", "occlusion_factors", "incoming_light", "visibility_bits"}
WHOLE_NUMBERS = {"visibility_bits", "vertex_grids"}  # their results
TWICE = {"sparse_product"}  # whose gradient has gradients


def smaller(name: str, dtype: torch.dtype, n: int | None = None) -> tuple:
    """A case for differences; with `n` only so many of its points, where each is worked out by itself."""
    inputs = op_cases.indirect_inputs(dtype, 0, 3, 12) if name == "split_sum_shade" else EVERY[name](dtype)
    if name == "surface_weights":
        inputs[1][5] *= 1e5  # too short a gradient has none
    if n is None:
        return inputs
    most = len(inputs[name in BEHIND])
    return tuple(x[:n] if isinstance(x, torch.Tensor) and x.dim() and len(x) == most else x for x in inputs)


def weighted(outputs: Sequence[torch.Tensor]) -> torch.Tensor:
    """A sum over all results, each number with a weight of its own."""
    weights = (torch.randn(x.shape, generator=generator(i), dtype=x.dtype) for i, x in enumerate(outputs))
    return sum((w * x).sum() for w, x in zip(weights, outputs))


# ---- the references ----

TOLERANCE = {"cached_occlusion": 2e-7}  # its directions have unit length in float32; of the others: 1e-9
LOSSES = ("pixel_losses", "gradient_losses")  # whose operators return all terms in one tensor


def as_the_operator_reads(inputs: tuple) -> tuple:
    """Numbers such as a step's length are float32 inside of some operators."""
    return tuple(float(np.float32(x)) if isinstance(x, float) else x for x in inputs)


def results(op: str, inputs: tuple) -> list[torch.Tensor]:
    got = as_tuple(getattr(lib, op)(*inputs))
    return list(got[0].unbind()) if op in LOSSES else list(got)


def deep_light(dtype: torch.dtype) -> tuple:
    """Spherical harmonics whose sums fall below 0 in places."""
    inputs = op_cases.lookup_inputs(dtype, 300)
    return (*inputs[:3], inputs[3] * torch.where(torch.arange(169) == 0, 0.1, 3.0)[:, None].to(dtype), *inputs[4:])


def far_points(dtype: torch.dtype) -> tuple:
    """Some lie off the mesh by more than the radius in which vertices count at first, some by more than any."""
    x, normals, *rest = op_cases.cached_visibility_inputs(dtype)
    heights = torch.tensor([0.2, 1.5, 3.0, 5.0, 0.0, 1.2, 2.5, 9.0, 99.0]).to(dtype)[:, None]
    return x + normals * rest[4] * heights, normals, *rest


def short_gradients(dtype: torch.dtype) -> tuple:
    """Of lengths from 1e-5 to 1, on both sides of the least that has a direction."""
    gradients, *rest = op_cases.field_gradients(dtype)
    return gradients * torch.logspace(-5, -0.3, 40).to(dtype)[torch.arange(40) * 7 % 40][:, None], *rest


def annealed(anneal: float, dtype: torch.dtype) -> tuple:
    """Of rays that end at a transmittance of 0.3."""
    *samples, _, _, n = CASES["surface_weights"](dtype)
    return *samples, torch.tensor(anneal, dtype=dtype), 0.3, n


# Other settings of the same operators: what the first case of each does not reach.
OTHERS = [
    *(
        ("split_sum_shade", lambda t, mode=mode, gain=gain: op_cases.split_sum_inputs("cpu", t, mode, gain, 1, 300))
        for mode in (0, 1)
        for gain in (False, True)
    ),
    ("light_queries", lambda t: op_cases.query_inputs("cpu", t, False, 300)),
    ("shade_sums", lambda t: op_cases.mixed_sums_inputs(300, t, compensate=False)),
    *(("surface_weights", lambda t, anneal=anneal: annealed(anneal, t)) for anneal in (0.0, 1.0)),
    ("sparse_product", lambda t: tuple(0.3 * x if x.is_floating_point() else x for x in op_cases.sparse_inputs(t))),
    ("light_lookup", deep_light),
    ("summed_light", lambda t: op_cases.shared_inputs(40, dtype=t, with_sent=False)),
    ("summed_light", lambda t: op_cases.shared_inputs(700, dtype=t)),
    *(("split_sum_shade", lambda t, n=n: op_cases.indirect_inputs(t, 1, n, 40, stacked=True)) for n in (1, 3)),
    ("cached_visibility", far_points),
    ("pixel_losses", lambda t: (*op_cases.pixel_inputs(600, t), False)),
    ("gradient_losses", short_gradients),
    *(
        # Tiles of 64 points.
        ("sdf_field", lambda t, n=n, n_active=n_active: (*(x := op_cases.sdf_field_inputs(n, t))[:13], n_active, x[14]))
        for n, n_active in ((1, 3), (63, 0), (64, 3), (65, 2), (1500, 3))
    ),
    *(
        ("quadratic_entropy", lambda t, n=n, x=shift: (2 * torch.randn(n, 5, generator=generator(), dtype=t) + x,))
        for n, shift in ((1, 0.0), (2, 0.0), (31, 1000.0), (200, 1000.0))
    ),
]
REFERENCES = sorted({name for name, _ in inspect.getmembers(reference, inspect.isfunction)} & set(CASES))


@pytest.mark.parametrize(
    ("op", "case"), [*((op, CASES[op]) for op in REFERENCES), *OTHERS], ids=lambda x: x if isinstance(x, str) else ""
)
def test_operator_and_reference_agree(op, case):
    wanted = DIFFERENTIABLE.get(op, ())
    inputs = as_the_operator_reads(truth(case(torch.float64)))
    wanted = [i for i in wanted if inputs[i] is not None]
    ours, theirs = (grad_leaves(inputs, wanted) for _ in range(2))
    expected = as_tuple(getattr(reference, op)(*theirs))
    got = results(op, ours)[: len(expected)]
    for a, b in zip(got, expected, strict=True):
        torch.testing.assert_close(a, b, rtol=TOLERANCE.get(op, 1e-9), atol=1e-10)
    if not wanted:
        return
    for outputs in (got, expected):
        weighted(outputs).backward()
    for i in wanted:
        torch.testing.assert_close(ours[i].grad, theirs[i].grad, rtol=1e-7, atol=1e-9)
        assert theirs[i].grad.abs().max() > 0 or case not in CASES.values()


def test_every_differentiable_operator_has_a_reference():
    assert set(DIFFERENTIABLE) <= set(REFERENCES)


def test_the_grid_of_the_benchmark_is_the_operator():
    """2^19 entries a level: hashes of large coordinates."""
    x = torch.rand(200, 3, generator=generator(), dtype=torch.float64)
    table = torch.randn(SPEC.n_entries, SPEC.n_features, generator=generator(1), dtype=torch.float64)
    inputs = x, table, *SPEC.arguments(SPEC.n_levels)
    torch.testing.assert_close(reference.hash_encode(*inputs), lib.hash_encode(*inputs), rtol=1e-9, atol=1e-12)


# ---- devices and dtypes ----


@pytest.mark.parametrize(
    ("op", "device", "dtype"),
    [
        pytest.param(op, *getattr(d, "values", (d,)), dtype, marks=getattr(d, "marks", ()))
        for op in CASES
        for d in devices(op)
        for dtype in (torch.float32, torch.float64)
        if d != "cpu" or dtype == torch.float32  # in float64 it would be compared with itself
    ],
    ids=str,
)
def test_the_results_are_those_of_the_cpu_in_float64(op, device, dtype):
    if op == "sample_rays" and dtype == torch.float32 and device == "cuda":
        pytest.skip("the network's roundings decide which samples are kept")
    check_against_the_cpu(op, dtype, device)


def test_every_operator_is_listed():
    every = {s.name.split("::")[1] for s in torch._C._jit_get_all_schemas() if s.name.startswith("splitnerf::")}
    assert every == OPERATORS


@pytest.mark.skipif(not _core.cuda_architectures(), reason="built without CUDA")
def test_the_build_holds_the_kernels():
    """Also where no GPU is: the library loads there, and knows what it could run."""
    assert {op for op in OPERATORS if not has_cuda_kernel(op)} == set(ON_THE_CPU_ALONE)


# ---- what torch asks ----


def read_in_16_bits(name: str) -> tuple:
    """A case whose table is the copy of 16 bits alone."""
    positions, table, *rest = EVERY[name](torch.float32)
    return positions, table.half(), *rest


# Forms of arguments that are not in the case of the operator.
FORMS = [
    ("cached_occlusion", lambda: op_cases.cached_occlusion_inputs(torch.float32, with_hits=False), ()),
    ("cached_visibility", lambda: op_cases.cached_visibility_inputs(torch.float32, with_hits=False), ()),
    ("hash_encode", lambda: read_in_16_bits("hash_encode"), (0,)),
    ("sdf_values", lambda: read_in_16_bits("sdf_values"), ()),
    ("hash_encode_backward_positions", lambda: read_in_16_bits("hash_encode_backward_positions"), ()),
    ("hash_encode", lambda: (*(x := CASES["hash_encode"](torch.float32)), x[1].half()), (0, 1)),
]


@pytest.mark.parametrize(
    ("name", "case", "gradients"),
    [*((name, lambda name=name: smaller(name, torch.float32), DIFFERENTIABLE.get(name, ())) for name in EVERY), *FORMS],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_opcheck(name, case, gradients):
    check_op(getattr(lib, name), case(), gradients)


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_gradcheck(name):
    op, inputs = getattr(lib, name), grad_leaves(smaller(name, torch.float64), DIFFERENTIABLE[name])

    def smooth(*leaves):  # the second result of the losses has no gradient
        return tuple(x for x in as_tuple(op(*leaves)) if x.requires_grad)

    torch.autograd.gradcheck(smooth, inputs, eps=1e-7, atol=1e-5, rtol=1e-3, fast_mode=True, nondet_tol=1e-12)


def float_positions(inputs: tuple) -> list[int]:
    return [i for i, x in enumerate(inputs) if isinstance(x, torch.Tensor) and x.is_floating_point()]


@pytest.mark.parametrize("name", sorted(set(EVERY) - WHOLE_NUMBERS))
def test_a_gradient_that_is_not_defined_raises(name):
    """It is never zeros and never silently absent; so is every second derivative."""
    inputs = smaller(name, torch.float64)
    for i in float_positions(inputs):
        if i in DIFFERENTIABLE.get(name, ()):
            continue
        leaves = grad_leaves(inputs, [i])
        with pytest.raises(RuntimeError, match="gradient|does not require grad"):
            sum(x.sum() for x in floats(getattr(lib, name)(*leaves))).backward()
        assert leaves[i].grad is None


@pytest.mark.parametrize("name", sorted(set(DIFFERENTIABLE) - TWICE))
def test_a_second_derivative_raises(name):
    inputs = grad_leaves(smaller(name, torch.float64), DIFFERENTIABLE[name])
    leaves = [inputs[i] for i in DIFFERENTIABLE[name]]
    first = torch.autograd.grad(weighted([x**2 for x in results(name, inputs)]), leaves, create_graph=True)
    with pytest.raises(RuntimeError, match="no gradient is defined|once_differentiable"):
        sum(x.sum() for x in first).backward()


def test_a_second_derivative_of_the_entropy_raises_for_a_constant_cotangent():
    """Its gradient was computed with its value, and would look like a constant."""
    x = torch.rand(64, 3, requires_grad=True)
    (first,) = torch.autograd.grad(quadratic_entropy(x), x, create_graph=True)
    with pytest.raises(RuntimeError, match="quadratic_entropy: no gradient is defined of its gradient"):
        first.square().sum().backward()


@pytest.mark.parametrize("name", EVERY)
def test_a_tangent_raises(name):
    inputs = list(smaller(name, torch.float64))
    i = float_positions(inputs)[0]
    with forward_ad.dual_level():
        inputs[i] = forward_ad.make_dual(inputs[i], torch.ones_like(inputs[i]))
        with pytest.raises(RuntimeError, match="no forward derivative"):
            getattr(lib, name)(*inputs)


def test_compilation_in_a_new_process():
    """Of an operator that nobody called before."""
    code = """
import torch
from splitnerf.ops import MeshScene, linear_to_srgb
f = torch.compile(lambda x: linear_to_srgb(x) + 1, fullgraph=True, backend="aot_eager")
x = torch.rand(5, requires_grad=True)
f(x).sum().backward()
assert x.grad is not None
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=100)


# ---- few points ----

# Operators whose results at a point depend on nothing else of the call.
BY_POINT = (
    "hash_encode sdf_field sdf_values split_sum_shade prefilter_light sample_ggx_lobe light_lookup "
    "monte_carlo_light summed_light shade_sums linear_to_srgb srgb_to_linear read_pixels cached_occlusion "
    "cached_visibility occlusion_factors incoming_light visibility_bits"
).split()
NONE_3, NONE, LONG = torch.zeros(0, 3), torch.zeros(0), torch.zeros(0, dtype=torch.int64)
NO_SAMPLE, HALF_AND_NONE = torch.zeros(3, dtype=torch.int64), torch.tensor([0.5, 0.0])
CELLS, TWO_RAYS = torch.ones(4, 4, 4, dtype=torch.uint8), torch.eye(3)[:2]
# The others without a point, or without a sample on two rays.
EMPTY = {
    "light_queries": lambda t: op_cases.query_inputs("cpu", t, True, 0),
    "march_rays": lambda t: (NONE_3, NONE_3, NONE, CELLS, 1.5, 0.1, 64),
    "sample_rays": lambda t: (NONE_3, NONE_3, NONE, *CASES["sample_rays"](torch.float32)[3:]),
    "draw_rays": lambda t: (NONE, 0, *CASES["draw_rays"](torch.float32)[2:]),
    "surface_weights": lambda t: (NONE, NONE_3, TWO_RAYS, *torch.tensor([9.0]), NO_SAMPLE, *HALF_AND_NONE, 0.0, -1),
    "composite": lambda t: (NONE, NONE_3, NO_SAMPLE, HALF_AND_NONE, 0.1),
    "spread_samples": lambda t: (NONE, NONE, NO_SAMPLE, HALF_AND_NONE, 1.0, 2),
    "interpolate": lambda t: (torch.ones(2, 3), LONG, LONG, NONE),
    "pixel_losses": lambda t: (NONE_3, NONE, torch.zeros(0, 4), NONE_3, None, None, True),
    "gradient_losses": lambda t: (NONE_3, NONE, LONG),
}
ALWAYS_SOME = {"sparse_product", "quadratic_entropy", "light_prior", "vertex_grids"}


@pytest.mark.parametrize("name", BY_POINT)
def test_one_point_alone_is_that_point_among_others_and_none_is_none(name):
    inputs = smaller(name, torch.float64)
    among, alone, none = (
        as_tuple(getattr(lib, name)(*x))
        for x in (inputs, smaller(name, torch.float64, 1), smaller(name, torch.float64, 0))
    )
    for many, one, nothing in zip(among, alone, none, strict=True):
        torch.testing.assert_close(one, many[: len(one)], rtol=1e-12, atol=1e-12)
        assert len(one) == min(1, len(many)) and nothing.shape == (0, *many.shape[1:])


@pytest.mark.parametrize("name", [*EMPTY, *(name for name in BY_POINT if name in DIFFERENTIABLE)])
def test_nothing_gives_gradients_of_nothing(name):
    inputs = EMPTY[name](torch.float32) if name in EMPTY else smaller(name, torch.float32, 0)
    inputs = grad_leaves(inputs, [i for i in DIFFERENTIABLE.get(name, ()) if inputs[i] is not None])
    found = floats(getattr(lib, name)(*inputs))
    assert all(not x.any() for x in found)
    if name in DIFFERENTIABLE:
        sum(x.sum() for x in found).backward()
        assert all(not inputs[i].grad.any() for i in DIFFERENTIABLE[name] if inputs[i] is not None)


def test_every_operator_is_asked_about_nothing():
    assert set(FORWARD) == {*BY_POINT, *EMPTY} | ALWAYS_SOME
