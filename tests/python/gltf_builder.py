"""Small glTF files for tests, put together by the specification and not by the program's writer."""

import base64
import json
import os
import struct
from pathlib import Path

import numpy as np
from splitnerf.data.images import encode_image

COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

# A right triangle in the file's xy plane that faces +z of the file, with texture coordinates (0, 0) at the top left.
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
TRIANGLE_UV = np.array([[0, 1], [1, 1], [0, 0]], np.float32)


class Gltf:
    """A document with one binary buffer; `json` may be changed at will before `write`."""

    def __init__(self):
        self.binary = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        for name in ("nodes", "meshes", "accessors", "bufferViews", "materials", "textures", "images"):
            self.json[name] = []

    def view(self, data: bytes, **extra) -> int:
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)} | extra)
        self.binary += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, dtype="float32", **extra) -> int:
        values = np.ascontiguousarray(values, dtype)
        values = values.reshape(len(values), -1)
        content = {"bufferView": self.view(values.tobytes()), "componentType": COMPONENTS[dtype]}
        self.json["accessors"].append(content | {"count": len(values), "type": KINDS[values.shape[1]]} | extra)
        return len(self.json["accessors"]) - 1

    def texture(self, pixels) -> int:
        """Index of a texture, [h, w, c] in [0, 1], stored as PNG."""
        view = self.view(encode_image(np.asarray(pixels), ".png"))
        self.json["images"].append({"mimeType": "image/png", "bufferView": view})
        self.json["textures"].append({"source": len(self.json["images"]) - 1})
        return len(self.json["textures"]) - 1

    def material(self, **content) -> int:
        self.json["materials"].append(content)
        return len(self.json["materials"]) - 1

    def primitive(self, position=TRIANGLE, indices=None, material=None, mode=None, **attributes) -> dict:
        """A primitive; other attributes as arrays or accessor indices."""
        content = {"attributes": {"POSITION": self.accessor(position)}}
        for name, values in attributes.items():
            content["attributes"][name] = values if isinstance(values, int) else self.accessor(values)
        if indices is not None:
            content["indices"] = self.accessor(np.ravel(indices), "uint16")
        return content | ({} if material is None else {"material": material}) | ({} if mode is None else {"mode": mode})

    def mesh(self, *primitives: dict) -> int:
        self.json["meshes"].append({"name": "part", "primitives": list(primitives)})
        return len(self.json["meshes"]) - 1

    def node(self, *, root: bool = True, **content) -> int:
        self.json["nodes"].append(content)
        if root:
            self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)
        return len(self.json["nodes"]) - 1

    def write(self, path):
        """Writes a GLB and returns its path; empty arrays are left out as the schema demands."""
        content = {key: value for key, value in self.json.items() if value != []}
        if self.binary:
            content.setdefault("buffers", [{"byteLength": len(self.binary)}])
        text = json.dumps(content).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + b"\0" * (-len(self.binary) % 4)
        size = 12 + 8 + len(text) + 8 + len(binary)
        parts = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, size) + parts)
        return path


def triangle(**primitive) -> Gltf:
    """A document with one node, mesh and primitive."""
    gltf = Gltf()
    gltf.node(mesh=gltf.mesh(gltf.primitive(**primitive)))
    return gltf


def beside(root: Path, uri: str) -> Path:
    """The triangle with its buffer in a file of this name; another one lies beside the asset's folder."""
    asset, folder = triangle(), root / "asset"
    (folder / "sub").mkdir(parents=True)
    (root / "secret.bin").write_bytes(asset.binary)
    (folder / "link.bin").symlink_to(root / "secret.bin")
    (folder / "sub/the data.bin").write_bytes(asset.binary)
    (folder / "inside.bin").symlink_to("sub/the data.bin")
    os.mkfifo(folder / "pipe.bin")
    uri = uri.format(root=root, inline=base64.b64encode(asset.binary).decode())
    asset.json["buffers"] = [{"byteLength": len(asset.binary), "uri": uri}]
    (folder / "a.gltf").write_text(json.dumps(asset.json))
    return folder / "a.gltf"
