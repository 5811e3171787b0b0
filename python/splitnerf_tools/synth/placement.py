"""A copy of a GLB file, moved and scaled into a dataset's world."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from splitnerf.data.gltf.geometry import scene_roots
from splitnerf.files import atomic_path

HEADER = 20  # of the file and of its first chunk, which is the JSON


def write_placed_glb(source: Path, target: Path, centre: np.ndarray, scale: float) -> bool:
    """Writes the asset with a node above its scene that applies (x - centre) scale, `centre` [3] in the source's world, z up, and
    without emission; whether the file was written, as a .gltf is not copied, whose data are in other files.

    Raises:
        OSError: The file cannot be written.
    """
    data = source.read_bytes()
    if data[:4] != b"glTF":
        return False
    length = struct.unpack_from("<I", data, 12)[0]
    document, rest = json.loads(data[HEADER : HEADER + length]), data[HEADER + length :]
    stored = [item for kind in ("buffers", "images") for item in document.get(kind, [])]
    if any(not item.get("uri", "data:").startswith("data:") for item in stored):
        return False
    x, y, z = (float(-value * scale) for value in centre)
    root = {"name": "unit sphere", "children": scene_roots(document), "scale": [scale] * 3, "translation": [x, z, -y]}
    document["scenes"], document["scene"] = [{"nodes": [len(document["nodes"])]}], 0
    document["nodes"].append(root)
    for material in document.get("materials", []):
        material.pop("emissiveFactor", None)
        material.pop("emissiveTexture", None)
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with atomic_path(target) as temporary, open(temporary, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, HEADER + len(text) + len(rest)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text + rest)
    return True
