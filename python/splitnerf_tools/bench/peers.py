"""Other libraries for the same work. Each is optional: a missing library is left out, with a note on stderr."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from splitnerf.notes import note


def peer(name: str, why: str) -> object | None:
    """A library, or None with a line on stderr that says what is missing without it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        note(f"{name} is not installed ({str(error).splitlines()[0]}): {why} is left out")
        return None


def drjit_ready() -> bool:
    """Whether Dr.Jit can compile for this processor; it needs an LLVM library, which DRJIT_LIBLLVM_PATH may name."""
    if peer("drjit", "what Dr.Jit compiles") is None:
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
