"""Every operator on the GPU against the same one on the CPU in float64, and which operators the GPU has."""

from __future__ import annotations

import pytest
import torch
from op_cases import CASES, check_against_the_cpu
from op_checks import devices, has_cuda_kernel

from splitnerf import _core

ON_THE_CPU_ALONE = {  # Embree; once a mesh
    "trace_visibility", "occlusion_factors", "incoming_light", "visibility_bits", "vertex_grids"
}  # fmt: skip
WRITES_TO_ARGUMENTS = {"adamw_step_", "adamw_steps_", "clear_unless_"}  # have no outputs: see test_ops_adamw.py, test_ops_rows.py


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
