"""The self-test: asks every operator once, with its gradients, and compares with the answers of a build that passed its tests.

The answers, `answers.json`, are those in float64 on a CPU. ``python -m splitnerf_tools.doctor.self_test`` writes them again
after an operator or its case in :mod:`splitnerf_tools.doctor.cases` has changed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import torch
from splitnerf.ops._library import lib
from torch import Tensor
from torch.utils._pytree import tree_flatten, tree_leaves, tree_map

from splitnerf_tools.doctor.cases import DIFFERENTIABLE, OWN, pattern, usual

TOLERANCE = 5e-5  # share of the sum of absolute values
# Meshes are traced on the CPU, in float32, and a ray at an edge may fall on its other side.
CPU_ALONE = {"incoming_light", "occlusion_factors", "vertex_grids", "visibility_bits"}
TOLERANCE_OF_RAYS = 5e-3
MODULUS = 61  # of whole numbers
READ_ON_THE_CPU = {"resolutions", "nodes"}  # arguments


class Failure(NamedTuple):
    """An operator that does not give what is known."""

    operator: str  # its name in ``torch.ops.splitnerf``
    device: str  # on which it ran
    said: str  # what was found and what was expected, or the error that it raised
    known: str  # what these are


def operators(device: str) -> list[str]:
    """The operators that run on a device, ``cpu`` or ``cuda``; their backward passes are tested with them."""
    return [name for name in answers() if device == "cpu" or name not in CPU_ALONE]


@cache
def answers() -> dict[str, dict[str, list[float]]]:
    """What each operator gives: by the name of a result the two sums of :func:`sums`."""
    return json.loads(files("splitnerf_tools.doctor").joinpath("answers.json").read_text())


def failures(device: str, names: Iterable[str] | None = None) -> list[Failure]:
    """The operators that fail on a device; of these, or of all."""
    failed = []
    for name in operators(device) if names is None else names:
        try:
            found, result = dict(results(name, device)), ""
            tolerance = TOLERANCE_OF_RAYS if name in CPU_ALONE else TOLERANCE
            wrong = [
                (result, f"found {found[result][0]:.6g}, expected {known[0]:.6g}")
                for result, known in answers()[name].items()
                if any(not abs(a - b) <= tolerance * known[1] for a, b in zip(found[result], known))
            ]
        except Exception as error:  # whatever it is, it is reported, and the other operators are asked
            wrong = [("", f"raised {type(error).__name__}: {' '.join(str(error).split())[:200]}")]
        if wrong:
            result, said = wrong[0]
            failed.append(Failure(name, device, said, f"a weighted sum over its {result}" if result else "no answer"))
    return failed


def results(operator: str, device: str, dtype: torch.dtype = torch.float32) -> Iterator[tuple[str, list[float]]]:
    """The sums over everything that an operator returns or writes to, and over its gradients."""
    function = getattr(lib, operator)
    inputs, wanted = case(operator, device, dtype), DIFFERENTIABLE.get(operator, "").split()
    for name in wanted:
        inputs[name] = tree_map(lambda x: x.requires_grad_(), inputs[name])
    returned = function(*inputs.values())
    written = [inputs[a.name] for a in getattr(torch.ops.splitnerf, operator).default._schema.arguments if a.alias_info]
    outputs = [x for x in tree_leaves([returned, written]) if isinstance(x, Tensor)]
    for i, x in enumerate(outputs):
        yield f"output {i}", sums(x)
    if wanted:
        leaves, _ = tree_flatten([inputs[name] for name in wanted])
        names = [name for name in wanted for _ in tree_leaves(inputs[name])]
        total = sum((x.double() * weights(x)).sum() for x in outputs if x.requires_grad)
        for i, (name, gradient) in enumerate(zip(names, torch.autograd.grad(total, leaves))):
            yield f"gradient to {name}" + (f" {i}" if names.count(name) > 1 else ""), sums(gradient)


def case(operator: str, device: str, dtype: torch.dtype) -> dict[str, object]:
    """The arguments of an operator by name."""
    values = usual() | OWN.get(operator, dict)()

    def made(name: str, value: object) -> object:
        if not isinstance(value, Tensor) or name in READ_ON_THE_CPU:
            return value
        keeps = name == "lut" or value.dtype != torch.float32
        return value.to(device).clone() if keeps else value.to(device, dtype, copy=True)

    arguments = getattr(torch.ops.splitnerf, operator).default._schema.arguments
    given = {a.name: values.get(a.name, a.default_value) for a in arguments}
    return {name: tree_map(lambda x, name=name: made(name, x), value) for name, value in given.items()}


def weights(x: Tensor) -> Tensor:
    return pattern(*x.shape).double().to(x.device)


def sums(x: Tensor) -> list[float]:
    """Weighted sums of numbers and their absolute values; of whole numbers the remainder, where a change of the last bit shows."""
    numbers = (x.detach() if x.is_floating_point() else x.long() % MODULUS).double()
    return [float((y * weights(x)).sum()) for y in (numbers, numbers.abs())]


def write_answers(path: Path) -> None:
    """Asks all operators in float64, where they have it, and keeps what they give."""
    names = {
        name.removeprefix("splitnerf::") for name in torch._C._dispatch_get_all_op_names() if "splitnerf::" in name
    }
    lines = []
    for name in sorted(name for name in names if "_backward" not in name):
        found = results(name, "cpu", torch.float32 if name in CPU_ALONE else torch.float64)
        lines.append(f'"{name}": {json.dumps({result: [float(f"{x:.9g}") for x in pair] for result, pair in found})}')
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    write_answers(Path(__file__).with_name("answers.json"))
