"""The self-test: runs every check of the table."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import torch
from torch import Tensor

from splitnerf_tools.doctor import checks  # noqa: F401  (fills the table)
from splitnerf_tools.doctor.table import CHECKS

TOLERANCE = 1e-3  # share of the largest number that is expected
# Meshes are traced on the CPU.
CPU_ALONE = {"incoming_light", "occlusion_factors", "trace_visibility", "vertex_grids", "visibility_bits"}


class Failure(NamedTuple):
    """An operator that does not give what is known.

    Attributes:
        operator: Its name in ``torch.ops.splitnerf``.
        device: The device that it ran on.
        said: What was found and what was expected, or the error that it raised.
        known: What the check knows.
    """

    operator: str
    device: str
    said: str
    known: str


def operators(device: str) -> list[str]:
    """The operators that run on a device, ``cpu`` or ``cuda``."""
    return [name for name in CHECKS if device == "cpu" or name not in CPU_ALONE]


def failures(device: str, names: Iterable[str] | None = None) -> list[Failure]:
    """The checks that fail on a device; of these operators, or of all."""
    failed = []
    for name in operators(device) if names is None else names:
        try:
            with torch.device(device):
                wrong = [said for pair in CHECKS[name]() if (said := difference(*pair))]
        except Exception as error:  # whatever it is, it is reported, and the other checks run
            wrong = [f"raised {type(error).__name__}: {' '.join(str(error).split())[:200]}"]
        if wrong:
            failed.append(Failure(name, device, wrong[0], " ".join(CHECKS[name].__doc__.split())))
    return failed


def difference(found: Tensor, expected: Tensor | float, tolerance: float = TOLERANCE) -> str:
    """The number that is farthest off beside the expected one; empty where all are near enough, whole numbers equal."""
    tolerance = tolerance if found.is_floating_point() else 0.0
    found = found.detach().double().cpu()
    expected = torch.as_tensor(expected).detach().double().cpu().expand(found.shape)
    off = (found - expected).abs().nan_to_num(math.inf, math.inf)
    if off.max() <= tolerance * expected.abs().max():
        return ""
    worst = off.argmax()
    return f"found {found.flatten()[worst]:.6g}, expected {expected.flatten()[worst]:.6g}"
