"""Launches of a training step on a GPU, counted on the CPU.

An operator of torch is one launch unless it is a view or an allocation; one of ours is as many as its launcher in
cpp/cuda/ makes. Calls on tensors that a GPU's training keeps on the CPU are left out: the optimiser's counts of steps,
and the sharpness as a number.
"""

from __future__ import annotations

import sys

from torch.utils._python_dispatch import TorchDispatchMode

# Kernels and memory sets of an operator with more than one, as its launcher in cpp/cuda/ and cpp/torch/ makes them.
KERNELS = {
    "pixel_losses": 2,
    "gradient_losses": 2,
    "gradient_losses_backward": 2,
    "light_prior": 2,
    "quadratic_entropy": 4,
    "sdf_values": 2,
    "sdf_field": 2,
    "sdf_field_backward": 5,
    "hash_encode_backward": 2,
    "light_lookup_backward": 3,
    "summed_light_backward": 2,
    "prefilter_light": 2,
    "prefilter_light_backward": 2,
    "interpolate_backward": 2,
    "march_rays": 3,
    "sample_rays": 6,
    "spread_samples": 3,
    "adamw_steps_": 1,
}
# The same where no count is waited for: `room` of samples, or a tensor with the number of candidates.
WITH_ROOM = {"sample_rays": 7}
NO_LAUNCH = {
    "empty",
    "empty_like",
    "empty_strided",
    "new_empty",
    "new_empty_strided",
    "_unsafe_view",
    "_reshape_alias",
    "lift_fresh",
    "_local_scalar_dense",
    "_record_function_enter_new",
    "_record_function_exit",
}
# operators, and the functions whose calls are the CPU's
ON_THE_HOST = {"_foreach_add_": "_step", "exp": "s_value", "mul": "s_value", "clamp": "s_value"}


class Launches(TorchDispatchMode):
    """Within its block every call that reaches a device is counted, in `total`."""

    def __init__(self) -> None:
        super().__init__()
        self.total = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func._schema.name.split("::")[1]
        looks = any(r.alias_info is not None and not r.alias_info.is_write for r in func._schema.returns)
        if not looks and name not in NO_LAUNCH and not calls_from(ON_THE_HOST.get(name)):
            kernels = WITH_ROOM if name in WITH_ROOM and args[-1] else KERNELS
            self.total += kernels.get(name, 1) if func.namespace == "splitnerf" else 1
        return func(*args, **(kwargs or {}))


def calls_from(function: str | None) -> bool:
    """Whether a function of this name is on the stack."""
    frame = sys._getframe(2) if function else None
    while frame is not None and frame.f_code.co_name != function:
        frame = frame.f_back
    return frame is not None
