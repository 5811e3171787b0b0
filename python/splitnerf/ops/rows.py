"""Rows of several arrays, chosen by one list of their numbers."""

from __future__ import annotations

import torch
from torch import Tensor

from splitnerf.ops._library import lib, register


def take_rows(tensors: list[Tensor], index: Tensor) -> list[Tensor]:
    """The rows `index` of each of some arrays: `tensor[index]`, with one launch on a GPU for all of them.

    Args:
        tensors: 1 to 16 of [n, c] with any n and c, of one dtype.
        index: [m] int64 in [0, n) of every tensor; a row may be taken several times. On a GPU a number out of range counts as
            the nearest one.

    Returns:
        [m, c] each. Differentiable any number of times in the tensors; gradients of a row that is taken several times add up.

    Raises:
        ValueError: A shape or dtype does not fit, or (on the CPU) a number is out of range.
    """
    return list(lib.take_rows(tensors, index))


def clear_unless(tensors: list[Tensor], kept: Tensor) -> None:
    """Makes all numbers of some tensors 0 where `kept` is false, with one launch on a GPU for all of them.

    Args:
        tensors: 1 to 16 contiguous tensors of one dtype, which are written to.
        kept: [] bool on their device, which the host need not know.

    Raises:
        ValueError: A shape or dtype does not fit.
    """
    lib.clear_unless_(tensors, kept)


def _keep_taken(ctx, inputs, output):
    tensors, index = inputs
    ctx.n_rows = [x.shape[0] for x in tensors]
    ctx.save_for_backward(index)
    ctx.set_materialize_grads(False)
    ctx.mark_non_differentiable(*(y for x, y in zip(tensors, output) if not x.requires_grad))


def _taken_backward(ctx, grads):
    given = [k for k, grad in enumerate(grads) if grad is not None]
    found: list[Tensor | None] = [None] * len(grads)
    if given:
        sums = lib.put_rows([grads[k] for k in given], ctx.saved_tensors[0], [ctx.n_rows[k] for k in given])
        for k, total in zip(given, sums):
            found[k] = total
    return found, None


def _keep_put(ctx, inputs, output):
    ctx.save_for_backward(inputs[1])


def _put_backward(ctx, grads):
    return list(lib.take_rows(list(grads), ctx.saved_tensors[0])), None, None


register(
    "take_rows",
    fake=lambda tensors, index: [x.new_empty(index.shape[0], x.shape[1]) for x in tensors],
    setup_context=_keep_taken,
    backward=_taken_backward,
)
torch.library.register_fake("splitnerf::clear_unless_", lambda *arguments: None)
register(
    "put_rows",
    fake=lambda tensors, index, n_rows: [x.new_empty(n, x.shape[1]) for x, n in zip(tensors, n_rows)],
    setup_context=_keep_put,
    backward=_put_backward,
)
