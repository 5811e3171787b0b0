"""Arrays that NumPy pickled: all that it writes is read, nothing that a file names is called."""

from __future__ import annotations

import codecs
import copyreg
import pickle

import numpy as np
import pytest

from splitnerf.data.layouts import glossy
from splitnerf.data.pickled import unpickled_arrays
from splitnerf.errors import InputError

POSE, K = np.arange(12, dtype=np.float64).reshape(3, 4) / 7, np.float32([[300, 0, 16], [0, 310.5, 15], [0, 0, 1]])
OLD, NEW = b"numpy.core.multiarray", b"numpy._core.multiarray"


def renamed(content: bytes, old: bytes, new: bytes, protocol: int) -> bytes:
    """A pickle with another name of a module, without frames, which would state a length."""
    if protocol < 4:
        return content.replace(old, new)
    assert content[2:3] == b"\x95"
    return content[:2] + content[11:].replace(b"\x8c" + bytes([len(old)]) + old, b"\x8c" + bytes([len(new)]) + new)


@pytest.mark.parametrize("protocol", range(5))
@pytest.mark.parametrize("module", [OLD, NEW], ids=["numpy 1", "numpy 2"])
def test_what_numpy_pickles_is_read(protocol, module):
    given = (POSE, np.asfortranarray(POSE), POSE.astype(">f8"), K, np.int64([[1, -2], [3, 1 << 40]]))
    content = pickle.dumps(given, protocol)
    written = NEW if NEW in content else OLD
    content = renamed(content, written, module, protocol)
    assert (module in content) and (OLD if module == NEW else NEW) not in content
    for array, expected in zip(unpickled_arrays(content), given, strict=True):
        assert np.array_equal(array, expected) and array.shape == expected.shape


class Called:
    """A call in a pickle."""

    def __init__(self, function, *arguments, state=None):
        self.call = (function, arguments) if state is None else (function, arguments, state)

    def __reduce__(self):
        return self.call


def reconstructed(state: tuple) -> Called:
    function, arguments = np.zeros(1).__reduce__()[:2]
    return Called(function, *arguments, state=state)


F8 = np.dtype("<f8")
HOSTILE = {
    "a pointer": (Called(np.ndarray, (1,), np.dtype("O"), b"A" * 8), "not callable|numbers are"),
    "gigabytes": (Called(np.ndarray, (1 << 28,), "i1"), "not callable"),
    "objects": (reconstructed((1, (1,), np.dtype("O"), False, [7])), "numbers are 'O8'"),
    "a shape beyond its bytes": (reconstructed((1, (1 << 40, 3), F8, False, b"A" * 96)), "do not fit its shape"),
    "a negative shape": (reconstructed((1, (-3, -4), F8, False, b"A" * 96)), "do not fit its shape"),
    "many axes": (reconstructed((1, (1,) * 40, F8, False, b"A" * 8)), "described amiss"),
    "bytes that are none": (reconstructed((1, (1,), F8, False, [7.0])), "described amiss"),
    "a codec": (Called(codecs.encode, "a" * 9, "rot13"), "written as 'rot13'"),
    "a scalar": (np.float64(3), "asks for numpy._?core.*scalar"),
    "lists": ([[1.0, 2.0]] * 3, "something else than arrays"),
    "a function": (print, "asks for __builtin__.print"),
    "a class": (copyreg.__newobj__, "asks for copy_reg"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_nothing_else_is_built(name, tmp_path):
    content, message = HOSTILE[name]
    with pytest.raises(InputError, match=message) as caught:
        read_camera(tmp_path, pickle.dumps((content, K), 2))
    assert len(str(caught.value).splitlines()) == 1 and "0-camera.pkl: cannot be read as arrays" in str(caught.value)


def read_camera(folder, content: bytes):
    (folder / "0-camera.pkl").write_bytes(content)
    return glossy._read_camera(folder / "0-camera.pkl")


def test_a_memo_is_no_larger_than_the_file(tmp_path):
    put = pickle.dumps(K, 2)[:-1] + b"r" + (1 << 30).to_bytes(4, "little") + b"."
    with pytest.raises(InputError, match="memo is larger than the file"):
        read_camera(tmp_path, put)


def test_nothing_is_set_on_what_a_name_stands_for():
    """The state of a name would outlast the file."""
    for name in (b"cnumpy\ndtype\n", b"cnumpy\nndarray\n", b"c_codecs\nencode\n"):
        with pytest.raises((AttributeError, TypeError, ValueError)):
            unpickled_arrays(b"\x80\x02" + name + b"N}X\x01\x00\x00\x00aK\x01s\x86b.")
    assert len(unpickled_arrays(pickle.dumps((POSE, K), 2))) == 2


def test_only_the_sets_own_names_are_cameras(tmp_path):
    """Copies and numbers with zeros before them are other files."""
    for name in ("0 copy-camera.pkl", "007-camera.pkl", "²-camera.pkl", "1-camera.pkl.old"):
        (tmp_path / name).write_bytes(b"")
    assert glossy.read(tmp_path) == []
