"""Files of tensors and plain values: reading one runs no code, and takes about as much memory as it has bytes."""

from __future__ import annotations

import math
import pickletools
import zipfile
from pathlib import Path

import torch
from torch import Tensor

from splitnerf.files import atomic_path

GLOBALS = {"torch._utils _rebuild_tensor_v2", "collections OrderedDict"}  # STORAGES holds the storage types
STORAGES = {f"torch {kind}Storage" for kind in ("Float", "Double", "Long", "Int", "Byte", "Bool")}
LONGEST_PICKLE = 1 << 22  # bytes; a checkpoint of a run has about ten thousand


def write_tensors(path: Path, content: dict) -> None:
    """Writes tensors of any device, plain values, and lists and dictionaries of them, "format" among the keys, to a new
    file that replaces the old one. Raises OSError where the disk is full or the folder cannot be written; the old file
    is kept."""
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        try:
            torch.save(on_cpu(content), file)
        except RuntimeError as error:  # torch hides what the file raised behind words of its own
            cause = error.__context__
            raise cause if isinstance(cause, OSError) else OSError(f"{path}: cannot be written ({error})") from error


def read_tensors(path: Path) -> dict:
    """Reads a file from any source with torch's restricted unpickler.

    The container is checked first: nothing in it is compressed, and its pickle names only tensors. So reading takes
    about as much memory as the file has bytes. Raises ValueError where the file is damaged, or is none of tensors with
    a "format".
    """
    try:
        _check_container(path)
        content = torch.load(path, map_location="cpu", weights_only=True)
        content["format"]
    except Exception as error:  # zipfile and torch raise many types for a damaged file
        raise ValueError((str(error) or type(error).__name__).splitlines()[0]) from None
    return content


def on_cpu(content: object) -> object:
    """A copy of nested dictionaries and lists with all tensors on the CPU, so that any machine can read them."""
    if isinstance(content, Tensor):
        return content.cpu()
    if isinstance(content, dict):
        return type(content)((key, on_cpu(value)) for key, value in content.items())
    return [on_cpu(value) for value in content] if isinstance(content, list) else content


def _check_container(path: Path) -> None:
    """Raises ValueError where reading could take more memory than the file has bytes, or names more than tensors."""
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        if any(
            entry.compress_type != zipfile.ZIP_STORED or entry.file_size != entry.compress_size for entry in entries
        ):
            raise ValueError("its parts are compressed")
        if sum(entry.file_size for entry in entries) > path.stat().st_size:
            raise ValueError("its parts are longer than the file")
        if damaged := archive.testzip():
            raise ValueError(f"the checksum of {damaged} is wrong")
        for entry in entries:
            if entry.filename.endswith(".pkl"):
                if entry.file_size > LONGEST_PICKLE:
                    raise ValueError("its pickle is too long")
                _check_pickle(archive.read(entry))


def _check_pickle(pickled: bytes) -> None:
    for operation, argument, _ in pickletools.genops(pickled):
        named = "GLOBAL" in operation.name or operation.name in ("INST", "OBJ", "NEWOBJ", "NEWOBJ_EX")
        if named and argument not in GLOBALS | STORAGES:
            raise ValueError(f"it asks for {argument or operation.name}")


def check_tensor(name: str, value: object, shape: tuple[int, ...] | None, *dtypes: torch.dtype) -> None:
    """Raises ValueError where a value is no tensor of this shape and dtype. Shape None allows any shape, -1 any
    size."""
    fits = type(value) is Tensor and value.dtype in dtypes and value.is_contiguous()
    if fits and shape is not None:
        fits = len(shape) == value.dim() and all(a in (-1, b) for a, b in zip(shape, value.shape))
    if not fits:
        raise ValueError(f"{name} is missing or of another type or shape")
    if not (math.isfinite(value.sum().item()) or value.isfinite().all()):
        raise ValueError(f"{name} has NaN or infinite values")
