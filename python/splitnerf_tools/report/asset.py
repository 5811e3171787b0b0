"""The asset of the 3D view: the GLB as it is, or with smaller textures to limit the page."""

from __future__ import annotations

import copy
import io
import json
import math
import struct
from pathlib import Path

from PIL import Image

from splitnerf.data.gltf import read_asset
from splitnerf.data.gltf.document import Document
from splitnerf.errors import InputError
from splitnerf_tools.report.browser import camera_of, packed

MOST_BYTES = 4 << 20  # of a GLB within a page
TEXTURE_SIDES = (2048, 1024, 512, 256)  # pixels that are tried, one after the other


def asset_section(path: Path | None) -> dict | None:
    """The 3D view of a GLB: `packed`, its bytes; `camera`; `note`, what was changed or why nothing is shown.

    Args:
        path: The GLB; None, and a file that is not there, make no section.
    """
    if path is None or not path.is_file():
        return None
    try:
        camera = camera_of(read_asset(path))
        content, note = fitted(path, MOST_BYTES)
    except InputError as error:
        return {"packed": None, "camera": None, "note": str(error)}
    return {"packed": content and packed(content), "camera": camera, "note": note}


def fitted(path: Path, most_bytes: int) -> tuple[bytes | None, str]:
    """The bytes of a GLB, at most so many, and a line about what was changed: textures whose longer side has more
    pixels than 2048, 1024, 512 or 256 are averaged down, as far as is needed. None where even the last does not help.

    Raises:
        InputError: It is no GLB.
    """
    size = path.stat().st_size
    if size <= most_bytes:
        return path.read_bytes(), ""
    document = Document(path)
    for side in TEXTURE_SIDES:
        content = with_smaller_textures(document, side)
        if len(content) <= most_bytes:
            return content, f"Its textures have at most {side} pixels a side here, as the file has {size / 1e6:.1f} MB."
    return None, f"mesh.glb has {size / 1e6:.1f} MB, too much for this page; splitnerf view shows it."


def with_smaller_textures(document: Document, side: int) -> bytes:
    """The bytes of a GLB whose textures have at most `side` pixels a side; averages are of the stored values.

    Raises:
        InputError: A part is damaged.
    """
    tree = copy.deepcopy(document.json)
    images = {image["bufferView"]: image for image in tree.get("images", []) if "bufferView" in image}
    binary = bytearray()
    for number, view in enumerate(tree.get("bufferViews", [])):
        content = document.view(number)
        if number in images and (smaller := smaller_image(content, side)):
            content, images[number]["mimeType"] = smaller, "image/png"
        view |= {"buffer": 0, "byteOffset": len(binary), "byteLength": len(content)}
        binary += content + bytes(-len(content) % 4)
    tree["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def smaller_image(content: bytes, side: int) -> bytes | None:
    """An encoded image as a PNG of at most `side` pixels a side, by averages of whole blocks; None where it is so
    already."""
    with Image.open(io.BytesIO(content)) as image:
        factor = math.ceil(max(image.size) / side)
        if factor == 1:
            return None
        file = io.BytesIO()
        image.reduce(factor).save(file, "PNG", optimize=True)
    return file.getvalue()
