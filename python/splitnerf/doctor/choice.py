"""The choice of a device that is known to be right."""

from __future__ import annotations

import torch

from splitnerf import _core
from splitnerf.doctor.machine import devices
from splitnerf.doctor.self_test import failures, operators


def fit_device() -> tuple[str, str]:
    """The GPU where all operators pass their test on it, else the CPU: ``cuda`` or ``cpu``, and why, in a clause."""
    if not _core.cuda_architectures():
        return "cpu", "this build has no GPU kernels"
    if not torch.cuda.is_available():
        return "cpu", "torch finds no GPU"
    name = torch.cuda.get_device_name()
    if "cuda" not in devices():
        return "cpu", f"this build has no kernels for the {name}"
    if failed := failures("cuda"):
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        return "cpu", f"the {name} fails the test of {failed[0].operator}{others} (splitnerf doctor)"
    return "cuda", f"the {name} passes the test of {len(operators('cuda'))} operators"
