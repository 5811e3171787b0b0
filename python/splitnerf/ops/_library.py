"""Loads the operator library; :func:`register` gives an operator its fake implementation and its gradient, :func:`front` a
function of the front page its errors and its leading dimensions."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

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


class Operators:
    """The operators of ``torch.ops.splitnerf`` without torch's choice of an overload: each has one."""

    def __getattr__(self, name: str) -> torch._ops.OpOverload:
        operator = getattr(torch.ops.splitnerf, name).default
        setattr(self, name, operator)
        return operator


lib = Operators()
_FRAGMENT = torch.library.Library("splitnerf", "FRAGMENT")


def register(
    name: str,
    *,
    fake: Callable,
    gradients: str = "",
    backward: Callable | None = None,
    setup_context: Callable | None = None,
) -> None:
    """Registers the fake implementation and the gradient of ``splitnerf::name``, which takes and returns no list of tensors.

    An operator without a gradient raises in a backward pass, as one does for an argument that has none; it never returns a
    gradient of zeros. Torch would lose a tangent without a word: with one every operator raises.

    Args:
        gradients: The names of the arguments that have a gradient, where ``splitnerf::name_backward`` takes the arguments and
            then the results' gradients, and returns the gradients of these arguments in this order. It is registered, too.
        backward, setup_context: Any other gradient, as ``torch.library.register_autograd`` takes it.

    This is what ``torch.library.register_autograd`` does, for fewer arguments: 66 against 86 us for ten operators of a
    step, forward and backward, in the mean (one thread; 2 % of a step on the CPU).
    """
    torch.library.register_fake(f"splitnerf::{name}", fake)
    if gradients:
        backward, setup_context = _by_operator(name, gradients.split())

    operator = getattr(lib, name)

    def below_autograd(*arguments: object) -> object:
        with torch._C._AutoDispatchBelowAutograd():
            return operator(*arguments)

    def forward(ctx, *arguments):
        output = below_autograd(*arguments)
        if setup_context is not None:
            setup_context(ctx, arguments, output)
        return output

    def refuse(ctx, *grads):
        raise RuntimeError(f"{name}: no gradient is defined for this operator; see the table in docs/ops.md")

    methods = {"forward": staticmethod(forward), "backward": staticmethod(backward or refuse)}
    node = type(f"{name}_gradient", (torch.autograd.Function,), methods)

    defaults = tuple(argument.default_value for argument in operator._schema.arguments)
    places = _tensor_places(name)

    def differentiable(*arguments: object) -> object:
        arguments += defaults[len(arguments) :]  # the dispatcher leaves out what equals a default
        tensors = [x for i in places if (x := arguments[i]) is not None]
        if forward_ad._current_level >= 0 and any(forward_ad.unpack_dual(x).tangent is not None for x in tensors):
            raise RuntimeError(f"{name}: no forward derivative (jvp) is defined; see the table in docs/ops.md")
        if torch.is_grad_enabled() and any(x.requires_grad for x in tensors):
            return node.apply(*arguments)
        return below_autograd(*arguments)

    _FRAGMENT.impl(name, differentiable, "Autograd")


def _tensor_places(name: str) -> list[int]:
    """Which arguments of an operator are tensors, or may be."""
    return [i for i, argument in enumerate(getattr(lib, name)._schema.arguments) if "Tensor" in str(argument.type)]


def _by_operator(name: str, to: Sequence[str]) -> tuple[Callable, Callable]:
    """The `backward` and `setup_context` of an operator whose gradients another one computes, which is registered."""
    names = [argument.name for argument in getattr(lib, name)._schema.arguments]
    places = [names.index(argument) for argument in to]
    others = {argument: i for i, argument in enumerate(names) if argument not in to}
    tensors = _tensor_places(name)

    def fake(*arguments):
        first, of = arguments[0], [arguments[i] for i in places]
        found = [first.new_empty(0, *first.shape[1:]) if x is None else x.new_empty(x.shape) for x in of]
        return found[0] if len(found) == 1 else tuple(found)

    def setup_context(ctx, inputs, output):
        ctx.save_for_backward(*(inputs[i] for i in tensors))
        ctx.inputs = list(inputs)
        for i in tensors:
            ctx.inputs[i] = None

    def backward(ctx, *grads):
        refuse_gradients(ctx, name, **others)
        inputs = ctx.inputs.copy()  # a graph that is kept goes backward again
        for i, x in zip(tensors, ctx.saved_tensors):
            inputs[i] = x
        found = getattr(lib, f"{name}_backward")(*inputs, *grads)
        result: list[Tensor | None] = [None] * len(names)
        for i, grad in zip(places, (found,) if isinstance(found, Tensor) else found):
            result[i] = None if inputs[i] is None else grad
        return tuple(result)

    register(f"{name}_backward", fake=fake)
    return backward, setup_context


def refuse_gradients(ctx, op: str, **arguments: int) -> None:
    """Raises RuntimeError where an argument without a defined gradient requires one; ``arguments``: name = position."""
    needed = ctx.needs_input_grad
    for name, position in arguments.items():
        if needed[position]:
            raise RuntimeError(f"{op}: no gradient to {name} is defined; see the table in docs/ops.md")


Function = TypeVar("Function", bound=Callable)  # type checkers see the signature of what is decorated


def front(n_rows: int = 1, **own: int) -> Callable[[Function], Function]:
    """Decorates what the front page offers: an argument of a wrong type is named in one line, and rows may be arrays.

    Args:
        n_rows: The rows of a result for each row of the arguments.
        own: The arguments that have a row for each point, the first of them always given: name = the number of a row's own
            dimensions. All may then have the same further dimensions, [2, 5, 3] in place of [10, 3], and so do the results.
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        name, names = function.__name__, list(signature.parameters)
        first, n_own = next(iter(own.items()), (names[0], None))
        position = names.index(first)

        def in_rows(arguments: dict) -> object:
            lead = arguments[first].shape[:-n_own]

            def flat(argument: str, x: Tensor) -> Tensor:
                split = x.dim() - own[argument]
                if split != len(lead) or x.shape[1:split] != lead[1:]:  # the operator compares the numbers of rows
                    raise ValueError(f"{name}: {argument} must begin with {list(lead)}, got {list(x.shape)}")
                return x.flatten(0, split - 1)

            given = {k: _each(functools.partial(flat, k), arguments[k]) for k in own}
            behind = (n_rows * lead[0], *lead[1:])
            return _each(lambda x: x.reshape(*behind, *x.shape[1:]), function(**(arguments | given)))

        @functools.wraps(function)
        def called(*args: object, **kwargs: object) -> object:
            try:
                rows = args[position] if position < len(args) else kwargs.get(first)
                if n_own is None or not isinstance(rows, Tensor) or rows.dim() <= n_own + 1:
                    return function(*args, **kwargs)
                bound = signature.bind(*args, **kwargs)
                bound.apply_defaults()
                return in_rows(bound.arguments)
            except (AttributeError, RuntimeError, TypeError) as error:
                if failed := re.search('torch_call_dispatcher\\( "(.*?)"', str(error)):
                    raise MemoryError(f"{name}: {failed[1]} failed, as a rule for want of memory") from None
                if (wrong := _wrong_type(signature, args, kwargs, str(error))) is None:
                    raise
            raise TypeError(f"{name}: {wrong}")

        return called

    return decorate


def _wrong_type(signature: inspect.Signature, args: tuple, kwargs: dict, error: str) -> str | None:
    """What is wrong with the type of an argument, if that is why a call ended in an error, whose words are given."""
    try:
        given = signature.bind(*args, **kwargs).arguments
    except TypeError:  # Python's own words name what is missing or unknown
        return None
    for argument, x in given.items():
        kind = str(signature.parameters[argument].annotation)
        if kind.startswith("Tensor") and not isinstance(x, Tensor) and (x is not None or "None" not in kind):
            return f"{argument} must be a tensor, got {type(x).__name__}"
        if kind == "MeshScene" and not hasattr(x, "handle"):
            return f"{argument} must be a MeshScene, got {type(x).__name__}"
        if isinstance(x, Tensor) and (x.layout is not torch.strided or x.is_quantized):
            return f"{argument} must be dense, got {'quantised numbers' if x.is_quantized else x.layout}"
    found = re.search("a value of type '(.*)' for argument '(.*)' but instead found type '(.*)'", error)
    return None if found is None else f"{found[2]} must be of type {found[1]}, got {found[3]}"


def _each(change: Callable[[Tensor], Tensor], x: object) -> object:
    """`x` with each tensor changed, where it is one, or a tuple of some."""
    if isinstance(x, tuple):
        parts = [_each(change, y) for y in x]
        return type(x)(*parts) if hasattr(x, "_fields") else tuple(parts)
    return change(x) if isinstance(x, Tensor) else x
