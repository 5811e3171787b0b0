"""Other libraries for the same work. Each is optional: a missing library is left out, with a note on stderr."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from torch import Tensor

from splitnerf.notes import note
from splitnerf.ops import HashGridSpec


def peer(name: str, why: str) -> object | None:
    """A library, or None with a line on stderr that says what is missing without it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        note(f"{name} is not installed ({str(error).splitlines()[0]}): {why} is left out")
        return None


def drjit_ready() -> bool:
    """Whether Dr.Jit can compile for this processor; it needs an LLVM library, which DRJIT_LIBLLVM_PATH may name."""
    if peer("drjit", "Dr.Jit's hash grid") is None:
        return False
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(Path("/usr/lib").glob("*/libLLVM-1[6-9].so")) + sorted(Path("/usr/lib").glob("*/libLLVM.so.1*"))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = str(found[-1])
    import drjit

    if drjit.has_backend(drjit.JitBackend.LLVM):
        return True
    note("Dr.Jit finds no LLVM library; set DRJIT_LIBLLVM_PATH: what needs it is left out")
    return False


class DrJitHashGrid:
    """Dr.Jit's encoding of a grid of the same shape, with a random table of its own.

    Its nodes are shifted by half a cell, so that its features differ from ours and only times can be compared.

    Args:
        spec: The shape of the grid.
        storage: The type of table and features, ``Float16`` or ``Float32``.
        positions: [n, 3] points in [0, 1].
        cotangent: [n, C] gradient of the features.
    """

    def __init__(self, spec: HashGridSpec, storage: str, positions: Tensor, cotangent: Tensor):
        import drjit
        from drjit.llvm import ad
        from drjit.nn import HashGridEncoding

        self.drjit, kind = drjit, getattr(ad, storage)
        self.grid = HashGridEncoding(
            kind, 3, n_levels=spec.n_levels, n_features_per_level=spec.n_features, hashmap_size=2**spec.log2_table_size,
            base_resolution=spec.base_resolution, per_level_scale=spec.growth, init_scale=0.1,
        )  # fmt: skip
        self.positions = ad.ArrayXf(positions.T.contiguous().numpy())
        self.cotangent = [kind(column.numpy()) for column in cotangent.T.contiguous()]
        drjit.eval(self.positions, self.cotangent, self.grid.data)

    def forward_backward(self) -> None:
        """Features, and the gradient to the table."""
        dr = self.drjit
        dr.enable_grad(self.grid.data)
        dr.set_grad(self.grid.data, 0)
        features = self.grid(self.positions)
        dr.backward(dr.sum(sum(f * g for f, g in zip(features, self.cotangent))))
        dr.eval(*features, dr.grad(self.grid.data))
        dr.sync_thread()
        dr.disable_grad(self.grid.data)
