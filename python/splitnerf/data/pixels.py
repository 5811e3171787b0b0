"""The photos' pixels: whole numbers in memory or in a file, floats where they are read."""

from __future__ import annotations

import mmap
import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np
import torch
from torch import Tensor

from splitnerf import _core, ops
from splitnerf.errors import InputError
from splitnerf.memory import SHARE_OF_PHOTOS, memory_bytes

GB = 10**9
READ_AHEAD = 1 << 17  # bytes that Linux reads at one request, by default; it takes no more of a longer one
CURE = "give a larger --downscale or --max-memory, or set TMPDIR to a folder on a larger disk"
_in_memory: WeakValueDictionary[int, np.ndarray] = WeakValueDictionary()  # the arrays of all photos that are there


def decoded(codes: np.ndarray) -> np.ndarray:
    """Whole numbers of 8 or 16 bits as float32 in [0, 1]; floats stay as they are."""
    if codes.dtype.kind == "f":
        return codes
    return np.multiply(codes, np.float32(1 / np.iinfo(codes.dtype).max), dtype=np.float32)


def encoded(values: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Values as numbers of another kind: floats in [0, 1] rounded, bytes exactly."""
    if values.dtype == dtype or np.dtype(dtype).kind == "f":
        return values if values.dtype == dtype else decoded(values)
    if values.dtype == np.uint8:
        return values.astype(np.uint16) * np.uint16(257)
    return np.rint(values * np.float32(np.iinfo(dtype).max)).astype(dtype)


def averaged_codes(rgba: np.ndarray, factor: int, *, object_alone: bool = True) -> np.ndarray:
    """A photo [H, W, 4] sRGB, straight alpha, whole numbers or floats in [0, 1], averaged down in linear light, block
    by block, to [H // factor, W // factor, 4] uint16; with a factor of 1 the photo itself. Incomplete blocks are
    cropped. With `object_alone` colours weigh by alpha, and are 0 where it is 0; else they are the means of all."""
    if factor == 1:
        return rgba
    return _core.average_photo(rgba if rgba.dtype.kind != "f" else encoded(rgba, np.uint16), factor, object_alone)


class Photos:
    """Photos of one size that are read like an array [n, H, W, 4] of float32: sRGB at an exposure of 1, straight alpha.

    An index gives floats of what it names, whatever is kept: so take one photo, or some pixels, at a time. Nothing can be
    written.

    Args:
        codes: [n, H, W, 4] uint8 or uint16, the values times 255 or 65535; or float32, the values. In memory or in a file.
        exposures: [n] or [n, 3] factors by which linear values are divided on reading; None stands for 1.
    """

    def __init__(self, codes: np.ndarray, exposures: np.ndarray | None = None):
        self.codes, self.shape, self.file = codes, codes.shape, file_of(codes)
        plain = exposures is None or bool((exposures == 1).all())
        self.exposures = None if plain else per_channel(exposures).astype(np.float32)

    def __len__(self) -> int:
        return len(self.codes)

    def __getitem__(self, index: object) -> np.ndarray:
        first = index[0] if isinstance(index, tuple) else index
        if isinstance(first, (int, np.integer)):
            self.ask_for(int(first))
        values = decoded(self.codes[index])
        forget_pages(self.codes)
        if self.exposures is None:
            return values
        of_each = np.ones((len(self), 1, 1, 4), np.float32)
        of_each[:, 0, 0, :3] = self.exposures
        factor = np.broadcast_to(of_each, self.shape)[index]
        return at_unit_exposure(*(torch.from_numpy(np.array(x, order="C")) for x in (values, factor))).numpy()

    def ask_for(self, i: int) -> None:
        """Has the system begin to read photo i, where it is kept in a file."""
        if self.file is not None:
            size = self.codes.itemsize * int(np.prod(self.shape[1:]))
            ask_for(self.file, range(len(self))[i] * size, size)

    def __array__(self, dtype: object = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self[:], dtype)

    def select(self, views: Sequence[int]) -> Photos:
        """These photos, in this order, kept where all of them are."""
        codes = new_array((len(views), *self.shape[1:]), self.codes.dtype, self.file is not None)
        for i, view in enumerate(views):
            codes[i] = self.codes[view]
            forget_pages(codes)
        return Photos(codes, None if self.exposures is None else self.exposures[list(views)])


def per_channel(exposures: np.ndarray) -> np.ndarray:
    """[n, 3] exposures of photos [n] or [n, 3]."""
    return np.broadcast_to(np.asarray(exposures).reshape(len(exposures), -1), (len(exposures), 3))


def at_unit_exposure(values: Tensor, exposures: Tensor) -> Tensor:
    """sRGB values as they were at an exposure of 1, where each was exposed by `exposures` of the same shape."""
    return torch.where(exposures == 1, values, ops.linear_to_srgb(ops.shading.srgb_to_linear(values) / exposures))


def memory_for_photos(max_memory: float) -> int:
    """Bytes that photos may still take: of `max_memory` GB, or where that is 0 of half of the memory available."""
    if max_memory > 0:
        return int(max_memory * GB) - sum(array.nbytes for array in _in_memory.values())
    return int(SHARE_OF_PHOTOS * memory_bytes()[1])


def new_array(shape: tuple[int, ...], dtype: np.dtype, in_file: bool) -> np.ndarray:
    """An array of zeros, in memory or in a file without a name, which ends with the array or the program. Raises
    InputError where the disk has no room for it."""
    if not in_file:
        array = np.zeros(shape, dtype)
        _in_memory[id(array)] = array
        return array
    size, folder = int(np.prod(shape)) * np.dtype(dtype).itemsize, folder_of_files()
    free = shutil.disk_usage(folder).free
    if free < size:
        raise InputError(f"{folder}: has {free / GB:.1f} GB free, and photos would take {size / GB:.1f} GB; {CURE}")
    with tempfile.TemporaryFile(dir=folder) as file:
        try:
            if hasattr(os, "posix_fallocate"):  # else a disk that others fill ends the program without a word
                os.posix_fallocate(file.fileno(), 0, size)
            array = np.memmap(file, dtype, "r+", shape=shape)
        except OSError as error:
            raise InputError(f"{folder}: cannot hold {size / GB:.1f} GB of photos ({error.strerror}); {CURE}") from None
    # Pixels are drawn one by one: reading ahead would read a hundred times as much.
    file_of(array).madvise(mmap.MADV_RANDOM)
    return array


def folder_of_files() -> Path:
    """The folder of photos' files: TMPDIR, else /var/tmp, which is on a disk where /tmp may be in memory."""
    folder = Path(os.environ.get("TMPDIR", "/var/tmp"))
    return folder if folder.is_dir() else Path(tempfile.gettempdir())


def file_of(array: np.ndarray) -> mmap.mmap | None:
    """The mapped file that an array lies in, or None."""
    return getattr(array, "_mmap", None)


def forget_pages(array: np.ndarray) -> None:
    """Takes the pages of a file that was written out of this program's memory; the system keeps or writes them."""
    file = file_of(array)
    if file is not None:
        file.madvise(mmap.MADV_DONTNEED)


def ask_for(file: mmap.mmap, start: int, size: int) -> None:
    """Has the system begin to read bytes of a file, so that its pages are not waited for one by one."""
    begin, end = start - start % mmap.PAGESIZE, start + size
    for part in range(begin, end, READ_AHEAD):
        file.madvise(mmap.MADV_WILLNEED, part, min(READ_AHEAD, end - part))
