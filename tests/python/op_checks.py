"""What the tests of all operators share: devices, opcheck, and the refusal of missing gradients."""

from collections import defaultdict
from collections.abc import Callable

import pytest
import torch
from splitnerf import ops  # noqa: F401  (loads torch.ops.splitnerf)
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map

lib = torch.ops.splitnerf


def has_cuda_kernel(op: str) -> bool:
    return torch._C._dispatch_has_kernel_for_dispatch_key(f"splitnerf::{op}", "CUDA")


def devices(op: str) -> list:
    """The devices that a test of this operator is to run on; "cuda" is skipped, and says why, where it cannot."""
    reason = None
    if not torch.cuda.is_available():
        reason = "no CUDA device"
    elif not has_cuda_kernel(op):
        reason = f"{op} has no CUDA kernel in this build"
    return ["cpu", pytest.param("cuda", marks=pytest.mark.skipif(reason is not None, reason=str(reason)))]


DEVICES = devices("hash_encode")


def arguments_of(name: str) -> list[str]:
    return [argument.name for argument in getattr(lib, name).default._schema.arguments]


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def rand(*shape: int, seed: int = 0, dtype=torch.float64) -> torch.Tensor:
    return torch.rand(*shape, generator=generator(seed), dtype=torch.float64).to(dtype)


def unit(x: torch.Tensor) -> torch.Tensor:
    return x / x.norm(dim=-1, keepdim=True)


def grad_leaves(inputs: tuple, names_or_indices) -> tuple:
    """The inputs, those at the given positions as leaves that require a gradient."""
    wanted = set(names_or_indices)
    return tuple(x.detach().clone().requires_grad_() if i in wanted else x for i, x in enumerate(inputs))


def check_op(op, inputs: tuple, differentiable: tuple = ()) -> None:
    """torch.library.opcheck with and without gradients, and on inputs that are not contiguous."""
    torch.library.opcheck(op, inputs)
    if differentiable:
        torch.library.opcheck(op, grad_leaves(inputs, differentiable))
    turned = lambda x: x.t().contiguous().t() if isinstance(x, torch.Tensor) and x.dim() == 2 and x.numel() else x
    strided = tree_map(turned, inputs)
    torch.library.opcheck(op, strided, test_utils=("test_schema", "test_faketensor"))
    for got, expected in zip(as_tuple(op(*strided)), as_tuple(op(*inputs))):
        torch.testing.assert_close(got, expected, rtol=0, atol=0)


def as_tuple(x) -> tuple:
    return x if isinstance(x, (tuple, list)) else (x,)


def floats(outputs) -> list[torch.Tensor]:
    return [x for x in as_tuple(outputs) if x.is_floating_point()]


def on_threads(n: int, call: Callable[[], object]) -> object:
    """What a call gives on so many threads."""
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(n)
        return call()
    finally:
        torch.set_num_threads(before)


def check_error(call, *parts: str) -> None:
    """A ValueError whose message holds every part: operator, argument, what was expected, what came."""
    with pytest.raises(ValueError) as error:
        call()
    for part in parts:
        assert part in str(error.value), f"{part!r} is missing in {error.value!s}"


class Noting(TorchFunctionMode):
    """Notes the setting at each call of a function of torch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, set[str]] = defaultdict(set)

    def __torch_function__(self, func, types, args=(), kwargs=None):
        self.found[getattr(func, "__name__", str(func))].add(torch.backends.cuda.matmul.fp32_precision)
        return func(*args, **(kwargs or {}))


def precisions(function: Callable[[], object]) -> dict[str, set[str]]:
    """The settings, "tf32" or "ieee", with which each function of torch is called; "tf32" is set outside."""
    products = torch.backends.cuda.matmul
    before, products.fp32_precision = products.fp32_precision, "tf32"
    try:
        with Noting() as mode:
            function()
    finally:
        products.fp32_precision = before
    return mode.found
