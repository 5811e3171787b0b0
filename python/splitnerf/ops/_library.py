"""Loads the operator library; helpers with which the wrappers register their operators."""

from __future__ import annotations

from pathlib import Path

import torch
from torch.autograd import forward_ad

from splitnerf import _core


def _load() -> None:
    """Loads the operators into torch, from the library beside the compiled module."""
    folder = Path(_core.__file__).parent
    found = sorted(folder.glob("libsplitnerf_ops.*"))
    if not found:
        raise ImportError(
            f"libsplitnerf_ops is missing in {folder}: reinstall with `pip install --no-build-isolation .`"
        )
    torch.ops.load_library(str(found[0]))


_load()
lib = torch.ops.splitnerf


def refuse_gradients(ctx, op: str, **arguments: int) -> None:
    """Raises RuntimeError where an argument without a defined gradient requires one; ``arguments``: name = position."""
    for name, position in arguments.items():
        if ctx.needs_input_grad[position]:
            raise RuntimeError(f"{op}: no gradient to {name} is defined; see the table in docs/ops.md")


class NoDuals(torch.library.Library):
    """Registers kernels that raise where an argument carries a tangent; torch itself would lose it in silence."""

    def impl(self, op_name, fn, *key, **options):
        def refusing(keyset, *arguments, **others):
            if forward_ad._current_level >= 0 and any(map(is_dual, arguments)):
                raise RuntimeError(f"{op_name}: no forward derivative (jvp) is defined; see the table in docs/ops.md")
            return fn(keyset, *arguments, **others)

        super().impl(op_name, refusing, *key, **options)


def is_dual(argument: object) -> bool:
    """Whether an argument of an operator is a tensor with a tangent."""
    return isinstance(argument, torch.Tensor) and forward_ad.unpack_dual(argument).tangent is not None


def register(name: str, *, fake, backward=None, setup_context=None) -> None:
    """Registers the fake implementation and the gradient of ``splitnerf::name``.

    An operator without ``backward`` raises in a backward pass; it never returns a gradient of zeros.
    """
    qualified = f"splitnerf::{name}"
    torch.library.register_fake(qualified, fake)

    def refuse(ctx, *grads):
        raise RuntimeError(f"{name}: no gradient is defined for this operator; see the table in docs/ops.md")

    torch.library.register_autograd(qualified, backward or refuse, setup_context=setup_context, lib=_FRAGMENT)


_FRAGMENT = NoDuals("splitnerf", "FRAGMENT")
