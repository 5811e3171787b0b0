"""Every operator on the GPU against the same one on the CPU in float64, and which operators the GPU has."""

from __future__ import annotations

import pytest
import test_ops_hash_grid as hash_grid
import test_ops_light as light
import test_ops_light_pyramid as pyramid
import test_ops_losses as losses
import test_ops_monte_carlo as monte_carlo
import test_ops_rays as rays
import test_ops_sdf as sdf
import test_ops_shade_sums as sums
import test_ops_shading as shading
import test_visibility as visibility
import torch
from op_checks import as_tuple, devices, generator, has_cuda_kernel, lib

from splitnerf import _core
from splitnerf.ops import brdf_lut, light_averages

ON_THE_CPU_ALONE = {"trace_visibility", "occlusion_factors", "visibility_bits", "vertex_grids"}  # Embree; once a mesh
WRITES_TO_ARGUMENTS = {"adamw_step_"}  # has no outputs: see test_ops_adamw.py


def spread_inputs(dtype) -> tuple:
    weights, samples, phase = rays.packed(dtype)
    return weights, samples.middles, samples.offsets, phase, 0.5, 2


def ones_like_outputs(op: str, inputs: tuple) -> tuple:
    """Gradients to an operator's outputs, no two alike."""
    outputs = as_tuple(getattr(lib, op)(*inputs))
    return tuple(
        torch.randn(x.shape, generator=generator(i), dtype=torch.float64).to(x.dtype) for i, x in enumerate(outputs)
    )


def sparse_inputs(dtype) -> tuple:
    matrix = (x.to(dtype) if x.is_floating_point() else x for x in light_averages(8))
    return *matrix, torch.rand(64, 3, generator=generator(), dtype=torch.float64).to(dtype)


def interpolation(dtype) -> tuple:
    first = torch.tensor([0, 0, 1, 2, 2, 4])
    share = torch.rand(6, generator=generator(), dtype=torch.float64).to(dtype)
    return (
        torch.randn(5, 4, generator=generator(1), dtype=torch.float64).to(dtype),
        first,
        first.clamp(max=3) + 1,
        share,
    )


def interpolation_backward(dtype) -> tuple:
    values, first, second, share = interpolation(dtype)
    return torch.randn(6, 4, generator=generator(2), dtype=torch.float64).to(dtype), first, second, share, values


def with_gradients(op: str, inputs: tuple, *between: int) -> tuple:
    """The inputs of the backward pass: those of the forward one, some of its outputs, the gradients to all of them."""
    outputs = as_tuple(getattr(lib, op)(*inputs))
    return *inputs, *(outputs[i] for i in between), *ones_like_outputs(op, inputs)


def hash_backward(op: str, dtype, first: int) -> tuple:
    """positions (and from `first` = 2 the table), the gradients, the grid's numbers."""
    inputs = hash_grid.sample_inputs("cpu", dtype, 200)
    return *inputs[:first], *ones_like_outputs(op, inputs), *inputs[2:]


# The inputs of each operator, on the CPU.
CASES = {
    "hash_encode": lambda t: hash_grid.sample_inputs("cpu", t, 200),
    "hash_encode_backward": lambda t: hash_backward("hash_encode", t, 1),
    "hash_encode_jacobian": lambda t: hash_grid.sample_inputs("cpu", t, 200),
    "hash_encode_jacobian_backward": lambda t: hash_backward("hash_encode_jacobian", t, 1),
    "hash_encode_jacobian_backward_positions": lambda t: hash_backward("hash_encode_jacobian", t, 2),
    "query_direction": lambda t: shading.query_inputs("cpu", t, True, 300),
    "query_direction_backward": lambda t: with_gradients("query_direction", shading.query_inputs("cpu", t, True, 300)),
    "split_sum_shade": lambda t: shading.sample_inputs("cpu", t, 0, True, 3, 300),
    "split_sum_shade_backward": lambda t: with_gradients(
        "split_sum_shade", shading.sample_inputs("cpu", t, 2, True, 1, 300)
    ),
    "prefilter_light": lambda t: light.sample_inputs("cpu", t, 100, 900),
    "prefilter_light_backward": lambda t: light.backward_inputs("cpu", t),
    "sample_ggx_lobe": lambda t: (*light.sample_inputs("cpu", t, 50)[:2], 70, 3),
    "sparse_product": sparse_inputs,
    "light_lookup": lambda t: pyramid.lookup_inputs(t, 300),
    "light_lookup_backward": lambda t: with_gradients("light_lookup", pyramid.lookup_inputs(t, 300)),
    "sample_bsdf": lambda t: (*monte_carlo.inputs(40, dtype=t)[:3], 70, 3),
    "monte_carlo_light": lambda t: monte_carlo.inputs(40, 70, t),
    "monte_carlo_light_backward": lambda t: with_gradients("monte_carlo_light", monte_carlo.inputs(40, 70, t)),
    "summed_light": lambda t: monte_carlo.shared_inputs(40, dtype=t),
    "summed_light_backward": lambda t: with_gradients("summed_light", monte_carlo.shared_inputs(40, dtype=t)),
    "shade_sums": lambda t: (*sums.inputs(300, t), brdf_lut(), True),
    "shade_sums_backward": lambda t: with_gradients("shade_sums", (*sums.inputs(300, t), brdf_lut(), True)),
    "linear_to_srgb": lambda t: (losses.rand(40, 7, dtype=t),),
    "linear_to_srgb_backward": lambda t: (losses.rand(40, 7, dtype=t), losses.rand(40, 7, seed=1, dtype=t)),
    "srgb_to_linear": lambda t: (losses.rand(40, 7, dtype=t),),
    "pixel_losses": lambda t: (*losses.pixels(600, t), True),
    "gradient_losses": losses.field_gradients,
    "material_losses": lambda t: (
        losses.rand(600, 3, dtype=t), losses.rand(600, 1, seed=1, dtype=t), losses.rand(600, seed=2, dtype=t), False
    ),
    "quadratic_entropy": lambda t: (losses.rand(70, 11, dtype=t),),
    "march_rays": lambda t: rays.march_inputs("cpu", t, 300),
    "neus_weights": lambda t: rays.sample_inputs("cpu", t, 0.01),
    "neus_weights_backward": lambda t: with_gradients("neus_weights", rays.sample_inputs("cpu", t, 0.01), 0),
    "surface_weights": lambda t: (*rays.surface_inputs(t), torch.tensor(0.1, dtype=t), torch.tensor(0.4, dtype=t), 1e-3),
    "surface_weights_backward": lambda t: with_gradients(
        "surface_weights", (*rays.surface_inputs(t), torch.tensor(0.1, dtype=t), torch.tensor(0.4, dtype=t), 1e-3), 1
    ),
    "composite": lambda t: rays.composite_inputs("cpu", t),
    "composite_backward": lambda t: with_gradients("composite", rays.composite_inputs("cpu", t)),
    "spread_samples": spread_inputs,
    "sample_rays": sdf.arguments,
    "sdf_layer": lambda t: sdf.layer_inputs(150, t),
    "sdf_layer_backward": lambda t: with_gradients("sdf_layer", sdf.layer_inputs(150, t)),
    "sdf_values": lambda t: (sdf.arguments(t)[0], *sdf.arguments(t)[4:16]),
    "cached_occlusion": visibility.op_inputs,
    "cached_visibility": visibility.visibility_inputs,
    "interpolate": interpolation,
    "interpolate_backward": interpolation_backward,
}  # fmt: skip
# Which samples there are depends on roundings: the truth is the CPU's own in the same dtype.
ROUNDED_ALIKE = {"march_rays", "spread_samples", "sample_rays"}
STAY_ON_THE_CPU = {"light_lookup": (4, 5), "light_lookup_backward": (4, 5)}  # resolutions and nodes
# Largest error, relative to the largest number of an output.
TOLERANCE = {torch.float64: 1e-11, torch.float32: 2e-5}


def moved(op: str, inputs: tuple, device: str) -> tuple:
    stay = STAY_ON_THE_CPU.get(op, ())
    return tuple(x.to(device) if isinstance(x, torch.Tensor) and i not in stay else x for i, x in enumerate(inputs))


def truth(inputs: tuple) -> tuple:
    """The same numbers in float64, but the table of F1, F2 and chi, which is float32."""
    is_table = lambda x: x.shape == (32, 32, 3)  # noqa: E731
    return tuple(
        x.double() if isinstance(x, torch.Tensor) and x.is_floating_point() and not is_table(x) else x for x in inputs
    )


def check_against_the_cpu(op: str, dtype, device: str) -> None:
    inputs = CASES[op](dtype)
    expected = as_tuple(getattr(lib, op)(*(inputs if op in ROUNDED_ALIKE else truth(inputs))))
    for got, x in zip(as_tuple(getattr(lib, op)(*moved(op, inputs, device))), expected):
        assert got.device.type == device and got.shape == x.shape
        scale = float(x.double().abs().max()) if x.numel() else 1.0
        torch.testing.assert_close(got.cpu().double(), x.double(), rtol=0, atol=TOLERANCE[dtype] * max(scale, 1e-30))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=["float32", "float64"])
@pytest.mark.parametrize(
    ("op", "device"), [pytest.param(op, *d.values, marks=d.marks) for op in CASES for d in devices(op)[1:]]
)
def test_the_gpu_agrees_with_the_cpu_in_float64(op, device, dtype):
    if op == "sample_rays" and dtype == torch.float32:
        pytest.skip("the network's roundings decide which samples are kept")
    check_against_the_cpu(op, dtype, device)


@pytest.mark.parametrize("op", CASES)
def test_the_inputs_serve_every_operator(op):
    """On the CPU, so that nothing but the GPU itself is left to find out."""
    check_against_the_cpu(op, torch.float64, "cpu")
    check_against_the_cpu(op, torch.float32, "cpu")


def test_every_operator_is_listed():
    every = {s.name.split("::")[1] for s in torch._C._jit_get_all_schemas() if s.name.startswith("splitnerf::")}
    assert every == set(CASES) | ON_THE_CPU_ALONE | WRITES_TO_ARGUMENTS


@pytest.mark.skipif(not _core.cuda_architectures(), reason="built without CUDA")
def test_the_build_holds_the_kernels():
    """Also where no GPU is: the library loads there, and knows what it could run."""
    assert {op for op in {*CASES, *WRITES_TO_ARGUMENTS} if not has_cuda_kernel(op)} == set()
    assert {op for op in ON_THE_CPU_ALONE if has_cuda_kernel(op)} == set()
