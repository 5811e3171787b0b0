"""Which precision of a GPU's matrix products is set while a function runs."""

from collections import defaultdict
from collections.abc import Callable

import torch
from torch.overrides import TorchFunctionMode


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
