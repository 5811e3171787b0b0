"""Arrays that NumPy pickled, read without calling anything that the file names."""

from __future__ import annotations

import io
import math
import pickle
import pickletools

import numpy as np

KINDS = ("f4", "f8", "i4", "i8")
CORES = ("numpy.core.multiarray", "numpy._core.multiarray")  # of NumPy 1 and 2
PUTS = ("PUT", "BINPUT", "LONG_BINPUT")  # the place of a memo that they name is allocated, with all before it


def unpickled_arrays(content: bytes) -> tuple[np.ndarray, ...]:
    """The arrays of a pickled tuple or list of arrays of numbers, protocols 0 to 4; at most 2-D.

    Raises:
        Exception: Whatever pickle meets in a damaged file; ValueError or pickle.UnpicklingError for anything else than arrays.
    """
    for opcode, argument, _ in pickletools.genops(content):
        if opcode.name in PUTS and argument > len(content):
            raise ValueError("its memo is larger than the file")
    parts = _Arrays(io.BytesIO(content)).load()
    if not isinstance(parts, (tuple, list)) or not all(isinstance(part, _Array) for part in parts):
        raise ValueError("it holds something else than arrays")
    return tuple(part.values for part in parts)


class _Kind:
    """A type of numbers."""

    __slots__ = ("name", "order")

    def __init__(self, name: str):
        if name not in KINDS:
            raise ValueError(f"its numbers are {str(name)[:20]!r}")
        self.name, self.order = name, "<"

    def __setstate__(self, state: tuple) -> None:
        if state[1] not in ("<", ">"):
            raise ValueError(f"the order of its bytes is {str(state[1])[:20]!r}")
        self.order = state[1]


class _Array:
    """An array, empty until its state is set."""

    __slots__ = ("values",)

    def __init__(self):
        self.values = np.empty(0)

    def __setstate__(self, state: tuple) -> None:
        _, shape, kind, fortran, data = state
        if not isinstance(kind, _Kind) or not isinstance(data, bytes) or not isinstance(shape, tuple) or len(shape) > 2:
            raise ValueError("an array is described amiss")
        if not all(type(n) is int and n >= 0 for n in shape) or math.prod(shape) * int(kind.name[1]) != len(data):
            raise ValueError("an array's bytes do not fit its shape")
        self.values = np.frombuffer(data, kind.order + kind.name).reshape(shape, order="F" if fortran else "C")


class _Arrays(pickle.Unpickler):
    """Knows the four names that NumPy writes and gives own functions for them."""

    def find_class(self, module: str, name: str) -> object:
        if (module, name) == ("numpy", "ndarray"):
            return name  # what it reconstructs
        if (module, name) == ("numpy", "dtype"):
            return self._kind
        if (module, name) == ("_codecs", "encode"):
            return self._encoded
        if module in CORES and name == "_reconstruct":
            return self._array
        raise pickle.UnpicklingError(f"it asks for {module[:40]}.{name[:40]}")

    def _kind(self, name: str, align: bool = False, copy: bool = True) -> _Kind:
        return _Kind(name)

    def _array(self, made: str, shape: tuple, kind: bytes) -> _Array:
        return _Array()

    def _encoded(self, text: str, code: str) -> bytes:
        if code != "latin1":
            raise ValueError(f"bytes are written as {str(code)[:20]!r}")
        return text.encode("latin1")
