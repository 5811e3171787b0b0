"""The container: a GLB's chunks or a .gltf with its files, and typed arrays out of them."""

from __future__ import annotations

import base64
import binascii
import json
import os
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from splitnerf.errors import InputError
from splitnerf.memory import memory_bytes

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
GLB_HEADER, CHUNK_HEADER = 12, 8
LEAST_VALUES, MOST_VALUES, VALUES_PER_BYTE = 1 << 22, 1 << 30, 4096
BYTES_OF_VALUE, BYTES_OF_PIXEL = 40, 12  # that a number of an accessor or of a texture takes while the asset is made
OF_NOTHING = 64  # how many numbers one counts as that the file does not store
MEMORY_SHARE = 0.5  # of what is available, for one file


class Document:
    """A parsed glTF file; `json` is a dict with "asset"."""

    def __init__(self, path: Path):
        """Reads the JSON and, of a GLB, the binary chunk. Raises InputError where there is no file, or it is not glTF
        2.0."""
        self.path = path
        if not path.is_file():
            raise InputError(f"{path}: no such file; give a .glb or .gltf file, or a run")
        data = path.read_bytes()
        text, self._binary = self._split_glb(data) if data[:4] == b"glTF" else (data, None)
        try:
            self.json = json.loads(text)
        except (ValueError, RecursionError):
            raise InputError(f"{path}: is neither a GLB nor glTF's JSON; export the mesh as GLB") from None
        if not isinstance(self.json, dict) or not isinstance(self.json.get("asset"), dict):
            raise InputError(f"{path}: is JSON but not glTF, it has no 'asset'; export the mesh as GLB")
        version = str(self.json["asset"].get("version"))
        if version.split(".")[0] != "2":
            raise InputError(f"{path}: is glTF {version}; only 2.0 is read, export it again")
        self._buffers: dict[int, bytes] = {}
        self._files: dict[str, bytes] = {}
        self._left, self._memory = LEAST_VALUES, MEMORY_SHARE * memory_bytes()[1]
        self._earn(len(data))

    def spend(self, n_values: int, bytes_each: int) -> None:
        """Counts numbers before they are unpacked, since few bytes can expand to very many numbers. Raises InputError
        where the total is larger than files of this size can hold, or than memory is available for it."""
        self._left -= n_values
        if self._left < 0:
            raise InputError(f"{self.path}: unpacks to more than its size makes likely; export it again, smaller")
        self._memory -= n_values * bytes_each
        if self._memory < 0:
            raise InputError(f"{self.path}: needs more than half of the available memory; export it again, smaller")

    def get(self, name: str) -> list:
        """A top-level array such as "nodes", empty where the file has none."""
        return self.json.get(name, [])

    def array(self, index: int) -> np.ndarray:
        """Decodes one accessor as [count, components], float64 where the file stores floats or normalised integers,
        else int64. Raises InputError where the accessor reaches beyond its buffer, or a file is missing."""
        accessor = self.json["accessors"][index]
        dtype, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        count = accessor["count"]
        empty = not {"bufferView", "sparse"} & accessor.keys()  # numbers of no bytes at all
        self.spend(max(0, count) * width * (OF_NOTHING if empty else 1), BYTES_OF_VALUE)
        values = np.zeros((count, width), dtype)
        if "bufferView" in accessor:
            values = self._table(accessor, dtype, width, count)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            where, what = sparse["indices"], sparse["values"]
            rows = self._table(where, np.dtype(COMPONENTS[where["componentType"]]), 1, sparse["count"])
            values = values.copy()
            values[rows[:, 0]] = self._table(what, dtype, width, sparse["count"])
        if dtype.kind == "f":
            return values.astype(np.float64)
        if accessor.get("normalized", False):
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values.astype(np.int64)

    def image(self, index: int) -> tuple[bytes, str]:
        """The encoded bytes of an image, and its name for messages."""
        image = self.json["images"][index]
        name = f"{self.path}: image {index}" + (f" '{image['name']}'" if "name" in image else "")
        return (bytes(self.view(image["bufferView"])) if "bufferView" in image else self._resource(image["uri"])), name

    def _split_glb(self, data: bytes) -> tuple[bytes, bytes | None]:
        """The JSON chunk and the binary one, or None."""
        if len(data) < GLB_HEADER + CHUNK_HEADER:
            raise InputError(f"{self.path}: truncated GLB, {len(data)} bytes; copy or export it again")
        version, total = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise InputError(f"{self.path}: is GLB version {version}; only 2 is read, export it again")
        if total > len(data):
            raise InputError(f"{self.path}: truncated GLB, {len(data)} of {total} bytes; copy or export it again")
        chunks, offset = {}, GLB_HEADER
        while offset + CHUNK_HEADER <= total:
            length, kind = struct.unpack_from("<I4s", data, offset)
            offset += CHUNK_HEADER
            if offset + length > total:
                raise InputError(f"{self.path}: damaged GLB, a chunk reaches beyond its end; export it again")
            chunks.setdefault(kind, data[offset : offset + length])
            offset += length
        if b"JSON" not in chunks:
            raise InputError(f"{self.path}: damaged GLB, it has no JSON chunk; export it again")
        return chunks[b"JSON"], chunks.get(b"BIN\0")

    def _table(self, place: dict, dtype: np.dtype, width: int, count: int) -> np.ndarray:
        view, offset = place["bufferView"], place.get("byteOffset", 0)
        stride = self.json["bufferViews"][view].get("byteStride", dtype.itemsize * width)
        data = self.view(view)
        if stride < dtype.itemsize * width:
            raise InputError(f"{self.path}: damaged, a byteStride is shorter than what it parts; export it again")
        if count and offset + stride * (count - 1) + dtype.itemsize * width > len(data):
            raise InputError(f"{self.path}: damaged, an accessor reaches beyond its buffer view; export it again")
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view, which are not copied: many accessors may share a large one."""
        view = self.json["bufferViews"][index]
        data, start = self._buffer(view["buffer"]), view.get("byteOffset", 0)
        if start + view["byteLength"] > len(data):
            raise InputError(f"{self.path}: damaged, a buffer view reaches beyond its buffer; export it again")
        return memoryview(data)[start : start + view["byteLength"]]

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = self.json["buffers"][index]
            data = self._resource(buffer["uri"]) if "uri" in buffer else None if index else self._binary
            if data is None:
                raise InputError(f"{self.path}: buffer {index} has neither a file nor a binary chunk; export it again")
            self._buffers[index] = data
        return self._buffers[index]

    def _resource(self, uri: str) -> bytes:
        """The bytes of a data URI or of a file beside this one."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error:
                raise InputError(f"{self.path}: holds a data URI that is not base64; export it again") from None
        folder = self.path.parent.resolve()
        path = self.path.parent / unquote(uri)
        if folder not in path.resolve().parents:
            raise InputError(f"{self.path}: refers to {uri[:200]!r}, outside its folder; put the file there")
        if not os.path.isfile(path):  # false for names that are too long, too
            raise InputError(f"{path}: no such file, though {self.path.name} refers to it; add it or export a GLB")
        if uri not in self._files:
            self._files[uri] = path.read_bytes()
            self._earn(len(self._files[uri]))
        return self._files[uri]

    def _earn(self, n_bytes: int) -> None:
        self._left = min(MOST_VALUES, self._left + VALUES_PER_BYTE * n_bytes)
