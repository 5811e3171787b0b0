"""Loading the photos of a split: as many at a time as the memory allows, into one array in memory or in a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from splitnerf.data.images import HDR_SUFFIXES
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.photos import Photo, check_files, load_photo, separated_mask
from splitnerf.data.pixels import GB, Photos, encoded, folder_of_files, forget_pages, new_array, room_for_photos
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError
from splitnerf.notes import note_once

THREADS = 8
WORK, WORK_BENT = 24, 110  # bytes a pixel of the file, while a photo is read; where it is turned into floats


class Loader:
    """The photos of some frames.

    All sizes are known, and all is estimated, before the first pixel is read.

    Args:
        root: The data's folder.
        frames: The frames.
        downscale: Integer factor of at least 1.
        reading: How the frames are read; its `max_memory` counts the photos that are in memory already.
        keep: Whether pixels are kept; else only what :meth:`load` returns.

    Attributes:
        frames: The frames.
        sizes: [n, 2] height and width of the photos as they are kept, in the upper left corner of an array for the tallest
            and the widest.
        exposures: [n] float64, the factors of the photos' linear values, as they are kept.

    Raises:
        InputError: A file cannot be used, or neither memory nor disk have room for the photos.
    """

    def __init__(self, root: Path, frames: Sequence[Frame], downscale: int, reading: Reading, keep: bool = True):
        self.root, self.frames, self.downscale, self.separated = root, frames, downscale, reading.separated
        sizes, exact = check_files(frames, downscale)
        height, width = sizes[sizes.prod(axis=1).argmax()].tolist()  # of the largest
        self.sizes = sizes // downscale
        shape = (len(frames), *self.sizes.max(axis=0).tolist())
        kind, bent = np.dtype(np.uint8 if exact else np.uint16), any(frame.distortion is not None for frame in frames)
        hides = (
            bent
            or bool((self.sizes != shape[1:]).any())
            or any(f.dynamic_mask_path or (f.mask_path and f.mask_kind != "object") for f in frames)
        )
        floats = bent or any(f.gamma != 0 or f.image_path.suffix.lower() in HDR_SUFFIXES for f in frames)
        work = height * width * (WORK_BENT if floats else WORK)
        size = keep * int(np.prod(shape)) * (4 * kind.itemsize + hides)
        room = room_for_photos(reading.max_memory)
        in_file = size + work > room
        whole = max(room, int(reading.max_memory * GB))  # with what the photos of another split take
        room -= 0 if in_file else size
        if work > whole:
            raise InputError(
                f"{root}: one photo of {width}x{height} takes {work / GB:.2g} GB while it is read, more than the "
                f"{whole / GB:.2g} GB for photos; make the photos smaller, or give a larger --max-memory"
            )
        if in_file and keep:
            note_once(
                f"{root}: {len(frames)} photos take {size / GB:.2g} GB, more than the {max(room, 0) / GB:.2g} GB of memory left "
                f"for photos (--max-memory): they are read from a file in {folder_of_files()}"
            )
        self.threads = max(1, min(THREADS, os.cpu_count() or 1, room // work))
        self.codes = new_array((*shape, 4), kind, in_file) if keep else None
        self._known = new_array(shape, np.dtype(bool), in_file) if keep and hides else None
        self.known: np.ndarray | None = None
        self.exposures = np.array([frame.exposure for frame in frames])

    def load(self, mask_kind: str) -> list[Photo]:
        """Reads the photos, whose pixels it keeps.

        Args:
            mask_kind: "object" or "ignore", see :func:`load_photo`.

        Returns:
            The photos without pixels.
        """
        with ThreadPoolExecutor(max_workers=self.threads) as pool:
            photos = list(pool.map(lambda i: self._load(i, mask_kind), range(len(self.frames))))
        self.exposures = np.array([frame.exposure * photo.scale for frame, photo in zip(self.frames, photos)])
        smaller = bool((self.sizes != self.sizes.max(axis=0)).any())
        self.known = self._known if smaller or any(photo.seen is not None for photo in photos) else None
        return photos

    @property
    def photos(self) -> Photos:
        """The pixels."""
        return Photos(self.codes, self.exposures)

    def _load(self, i: int, mask_kind: str) -> Photo:
        found = (
            None if self.separated is None else self.separated / separated_mask(self.frames[i].image_path, self.root)
        )
        photo = load_photo(self.frames[i], self.downscale, mask_kind, found)
        height, width = self.sizes[i]
        if self.codes is not None:
            self.codes[i, :height, :width] = encoded(photo.rgba, self.codes.dtype)
            forget_pages(self.codes)
        if self._known is not None:
            self._known[i, :height, :width] = True if photo.known is None else photo.known
        return replace(photo, rgba=None, known=None)
