"""Loads the operator library; helpers with which the wrappers register their operators."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from torch import Tensor
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


def holds_tensors(kind: torch.JitType) -> bool:
    """Whether an argument or a result of this type is a list of tensors."""
    return isinstance(kind, torch.ListType) and isinstance(kind.getElementType(), torch.TensorType)


class Operator:
    """One of ``torch.ops.splitnerf``, called by a shorter way.

    torch's way leads from Python through the dispatcher back to Python, where the gradient is registered, and through the
    dispatcher again, once forward and once for the operator of the backward pass. Here Python makes the gradient's node itself.
    What traces, transforms or asks for forward derivatives takes torch's way, and so do gradients of a call that leaves
    arguments out, and of an operator that has none.

    Args:
        packet: The operator.
    """

    def __init__(self, packet: torch._ops.OpOverloadPacket):
        self._packet, self._operator = packet, packet.default
        kinds = [argument.type for argument in packet.default._schema.arguments]
        self._count, self._has_lists = len(kinds), any(map(holds_tensors, kinds))

    def __call__(self, *arguments: object) -> object:
        if is_transformed():
            return self._packet(*arguments)
        if self._has_lists:  # torch sees whether a list requires a gradient, but not a tuple
            arguments = tuple(list(x) if isinstance(x, tuple) else x for x in arguments)
        if torch.is_grad_enabled() and torch._C._any_requires_grad(*arguments):
            node = _NODES.get(self._packet.__name__)
            return self._packet(*arguments) if node is None or len(arguments) < self._count else node(*arguments)
        with below_autograd():
            return self._operator(*arguments)

    def handing_on(self, *arguments: object) -> tuple[tuple[Tensor, ...], tuple[Tensor, ...]]:
        """The results, and once more the arguments that :func:`register` names with ``hands_on``, for their next reader.

        When each reader of a tensor takes it from the reader before, each adds the next one's gradient to its own. Torch then needs no
        addition of its own.
        """
        name = self._packet.__name__
        which = HANDED_ON[name]
        if is_transformed() or not (torch.is_grad_enabled() and torch._C._any_requires_grad(*arguments)):
            found = self(*arguments)
            return found if isinstance(found, tuple) else (found,), tuple(arguments[i] for i in which)
        found = _HANDING_NODES[name](*arguments)
        return found[: -len(which)], found[-len(which) :]


class Operators:
    """All of ``torch.ops.splitnerf``, each an :class:`Operator`, made here: within ``torch.compile`` none can be made."""

    def __init__(self) -> None:
        for name in torch._C._dispatch_get_all_op_names():
            if name.startswith("splitnerf::"):
                self._make(name.split("::")[1])

    def __getattr__(self, name: str) -> Operator:
        return self._make(name)

    def _make(self, name: str) -> Operator:
        operator = Operator(getattr(torch.ops.splitnerf, name))
        setattr(self, name, operator)
        return operator


lib = Operators()
below_autograd = torch._C._AutoDispatchBelowAutograd
_NODES: dict[str, Callable] = {}
_HANDING_NODES: dict[str, Callable] = {}
HANDED_ON: dict[str, tuple[int, ...]] = {}


def is_transformed() -> bool:
    """Whether ``torch.compile`` traces, a transform of ``torch.func`` or a mode that changes calls is active, or tensors may
    carry tangents."""
    return (
        torch.compiler.is_compiling()
        or forward_ad._current_level >= 0
        or torch._C._functorch.peek_interpreter_stack() is not None
        or torch._C._len_torch_function_stack() > 0
    )


def node_of(name: str, backward: Callable, setup_context: Callable) -> Callable:
    """The gradient of an operator as a node of the graph, a function of the operator's arguments, from what :func:`register`
    takes. Where an argument is a list of tensors, ``ctx.needs_input_grad`` is of no use."""
    operator = getattr(torch.ops.splitnerf, name).default
    has_lists = any(holds_tensors(argument.type) for argument in operator._schema.arguments)
    returns_list = holds_tensors(operator._schema.returns[0].type)

    def forward(ctx, *given):
        arguments = nested(*given) if has_lists else given
        with below_autograd():
            output = operator(*arguments)
        setup_context(ctx, arguments, output)
        return tuple(output) if returns_list else output

    def of_output(ctx, *grads):
        found = backward(ctx, list(grads)) if returns_list else backward(ctx, *grads)
        found = found if isinstance(found, tuple) else (found,)
        return (None, *flattened(found)) if has_lists else found

    methods = {"forward": staticmethod(forward), "backward": staticmethod(of_output)}
    node = type(f"{name}_gradient", (torch.autograd.Function,), methods)
    return (lambda *arguments: node.apply(sizes_of(arguments), *flattened(arguments))) if has_lists else node.apply


def handing_node_of(name: str, backward: Callable, setup_context: Callable, which: tuple[int, ...]) -> Callable:
    """The gradient of an operator without lists as a node that returns its arguments ``which`` as well, and gives ``backward`` the
    gradients to these, or None, as `more`."""
    operator = getattr(torch.ops.splitnerf, name).default

    def forward(ctx, *arguments):
        with below_autograd():
            output = operator(*arguments)
        setup_context(ctx, arguments, output)
        outputs = output if isinstance(output, tuple) else (output,)
        ctx.shapes = [(x.shape, x.dtype, x.device) for x in outputs]
        ctx.set_materialize_grads(False)  # else zeros are made for what nobody reads next
        return (*outputs, *(arguments[i] for i in which))

    def of_output(ctx, *grads):
        own = [
            torch.zeros(shape, dtype=dtype, device=device) if grad is None else grad
            for grad, (shape, dtype, device) in zip(grads, ctx.shapes)
        ]
        found = backward(ctx, *own, more=grads[len(own) :])
        return found if isinstance(found, tuple) else (found,)

    methods = {"forward": staticmethod(forward), "backward": staticmethod(of_output)}
    return type(f"{name}_handing_on", (torch.autograd.Function,), methods).apply


def is_list(argument: object) -> bool:
    """Whether an argument is a list of tensors."""
    return isinstance(argument, list) and not (argument and isinstance(argument[0], int | float))


def sizes_of(arguments: Sequence) -> list[int]:
    """The lengths of the arguments that are lists of tensors, -1 for others."""
    return [len(x) if is_list(x) else -1 for x in arguments]


def flattened(arguments: Sequence) -> list:
    """The arguments, and in place of a list of tensors what is in it: a node of the graph takes tensors alone."""
    return [y for x in arguments for y in (x if is_list(x) else [x])]


def nested(sizes: list[int], *flat: object) -> tuple:
    """The reverse of :func:`flattened`."""
    rest = iter(flat)
    return tuple(next(rest) if n < 0 else [next(rest) for _ in range(n)] for n in sizes)


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


def register(name: str, *, fake, backward=None, setup_context=None, hands_on: tuple[int, ...] = ()) -> None:
    """Registers the fake implementation and the gradient of ``splitnerf::name``.

    An operator without ``backward`` raises in a backward pass; it never returns a gradient of zeros. ``hands_on`` are positions of
    arguments that :meth:`Operator.handing_on` returns once more. ``backward`` then takes `more`: for each of them the gradient that its
    next reader sent back, or None; it adds that to its own.
    """
    qualified = f"splitnerf::{name}"
    torch.library.register_fake(qualified, fake)

    def refuse(ctx, *grads):
        raise RuntimeError(f"{name}: no gradient is defined for this operator; see the table in docs/ops.md")

    torch.library.register_autograd(qualified, backward or refuse, setup_context=setup_context, lib=_FRAGMENT)
    if backward:
        _NODES[name] = node_of(name, backward, setup_context)
    if hands_on:
        HANDED_ON[name] = hands_on
        _HANDING_NODES[name] = handing_node_of(name, backward, setup_context, hands_on)


_FRAGMENT = NoDuals("splitnerf", "FRAGMENT")
