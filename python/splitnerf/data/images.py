"""Image files through OpenImageIO, the sRGB curve, and downscaling in linear light."""

from __future__ import annotations

import io
import mmap
import os
import re
import shutil
import struct
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import product
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import OpenImageIO as oiio
import torch
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from splitnerf import ops
from splitnerf.data.colours import from_primaries, to_srgb
from splitnerf.data.pixels import decoded
from splitnerf.errors import InputError, note_once
from splitnerf.files import atomic_path

warnings.filterwarnings("ignore", module=r"PIL\.")  # of Pillow; damage is told of by the program
oiio.attribute("exr_threads", -1)  # no threads of its own, for which a fork of this program would wait for ever

JPEG_QUALITY = 95
SOFTWARE = "SplitNeRF"  # what an EXR says of the program that wrote it
LDR_SUFFIXES = (".png", ".jpg", ".jpeg")
HDR_SUFFIXES = (".exr", ".hdr")
SIGNATURES = (b"\x89PNG", b"\xff\xd8\xff", b"v/1\x01", b"#?RADIANCE", b"#?RGBE", b"RIFF")  # RIFF: WebP
PICTURES = ("combined", "beauty", "rgba", "rgb", "color", "colour", "image", "composite")  # layers of an EXR
LARGEST_IMAGE = 1 << 29  # values of an image in memory
STORED = {"uint8": 8, "uint16": 16}  # bits of the values of files that are read as they are
VALUES_PER_BYTE = 8 * 1032  # of a file: of a PNG of one colour and one bit a pixel


def read_image(path: str | os.PathLike) -> np.ndarray:
    """Reads a PNG, JPEG, WebP, EXR or HDR image as [H, W, C] float32, top row first; the content decides the format.

    8- and 16-bit files are in [0, 1], the others as stored. Alpha is kept as stored: straight in PNG, associated in
    EXR. Raises InputError where the file is missing, unreadable, truncated, of another format, or claims a size beyond
    reason.
    """
    return decoded(read_codes(path))


def read_codes(path: str | os.PathLike, name: str = "") -> np.ndarray:
    """Reads an image like `read_image`, but the values of 8- and 16-bit files as they are stored: uint8 or uint16. Messages
    name it `name`, by default the path. Notes say what a file states that is not used."""
    path = Path(path)
    name = name or str(path)
    with _opened(path, name, whole=True) as (source, spec):
        kind = str(spec.format) if str(spec.format) in STORED else "float"
        pixels = source.read_image(source.current_subimage(), 0, 0, spec.nchannels, kind)
        if pixels is None or source.has_error:
            raise InputError(f"{name}: truncated or damaged image ({_reason(source)}); replace it")
        pixels = np.asarray(pixels).reshape(spec.height, spec.width, -1)
        kept = _named_channels(spec) or list(range(spec.nchannels))
        if len(kept) < spec.nchannels:
            others = [channel for i, channel in enumerate(spec.channelnames) if i not in kept]
            if {"RY", "BY"} <= set(others):
                raise InputError(f"{name}: holds luminance and colour differences (Y, RY, BY); re-export it as R, G, B")
            note_once(f"{path.parent}: channels of images are not used: {', '.join(others)}", path.name)
        elif source.format_name() == "openexr" and not _named_channels(spec):
            what = "images without channels R, G, B or Y: theirs count as grey or colours, and alpha"
            note_once(what, f"{name}: {', '.join(spec.channelnames)}")
        if (turn := spec.getattribute("Orientation") or 1) != 1 and source.format_name() != "hdr":
            note_once("images state an EXIF orientation; their pixels are used as they are stored", f"{name}: {turn}")
        top, left, height, width = _window(source, spec)
        exposure, order = _radiance_head(path, name) if source.format_name() == "hdr" else (1.0, (1, 1))
        primaries = spec.getattribute("chromaticities") if source.format_name() == "openexr" else None
    pixels = pixels[..., kept] if kept != list(range(spec.nchannels)) else pixels
    if primaries is not None and pixels.shape[2] >= 3:
        pixels[..., :3] = from_primaries(pixels[..., :3], primaries, path)
    pixels = pixels / np.float32(exposure) if exposure != 1 else pixels
    pixels = pixels[:: order[0], :: order[1]]
    if (top, left, height, width) != (0, 0, *pixels.shape[:2]):
        whole = np.zeros((height, width, pixels.shape[2]), pixels.dtype)
        part = pixels[max(0, -top) :, max(0, -left) :][: max(0, height - max(0, top)), : max(0, width - max(0, left))]
        whole[max(0, top) :, max(0, left) :][: part.shape[0], : part.shape[1]] = part
        pixels = whole
    return np.ascontiguousarray(pixels)


def read_colours(path: str | os.PathLike) -> np.ndarray:
    """Reads a photo like `read_codes`, and brings the colours of 8- and 16-bit files to sRGB from what the file states, see
    :func:`splitnerf.data.colours.to_srgb`."""
    pixels = read_codes(path := Path(path))
    if pixels.dtype.kind == "f":
        return pixels
    n_colours = 3 if pixels.shape[2] >= 3 else 1
    pixels[..., :n_colours] = to_srgb(pixels[..., :n_colours], path)
    return pixels


class Header(NamedTuple):
    """What a file says of its image: rows, columns, channels, and bits of a value (32 for floats)."""

    height: int
    width: int
    channels: int
    bits: int


def read_header(path: str | os.PathLike) -> Header:
    """What an image file says of itself, without its pixels. Raises InputError as `read_image` does."""
    with _opened(Path(path), str(path)) as (source, spec):
        height, width = _window(source, spec)[2:]
        return Header(height, width, len(_named_channels(spec)) or spec.nchannels, STORED.get(str(spec.format), 32))


def is_written_here(path: Path) -> bool:
    """Whether a file is an EXR that this program wrote."""
    with open(path, "rb") as file:
        head = file.read(4096)
    said = b"Software\0string\0" + struct.pack("<I", len(SOFTWARE)) + SOFTWARE.encode()
    return head.startswith(SIGNATURES[2]) and said in head


def decode_image(data: bytes, name: str, spend: Callable[[int], None] = lambda n_values: None) -> np.ndarray:
    """Decodes an image file in memory like :func:`read_image`; messages name it `name`. `spend` is told the number of values
    before they are unpacked, and may refuse it. Raises InputError where the data are unreadable, truncated, of another format
    or too large."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image"
        path.write_bytes(data)
        with _opened(path, name) as (_, spec):
            spend(spec.width * spec.height * max(3, spec.nchannels))
        return decoded(read_codes(path, name))


def read_radiance(path: str | os.PathLike) -> np.ndarray:
    """Linear radiance [H, W, 3] float32 of an EXR or HDR file; grey is repeated. Raises InputError where the file is unreadable,
    or holds NaN or infinite pixels."""
    pixels = read_image(path)
    radiance = np.repeat(pixels[..., :1], 3, axis=2) if pixels.shape[2] < 3 else pixels[..., :3]
    if not np.isfinite(radiance).all():
        raise InputError(f"{path}: has NaN or infinite pixels; clean or re-export it")
    return np.ascontiguousarray(radiance)


def write_image(path: str | os.PathLike, pixels: np.ndarray, *, half: bool = False) -> None:
    """Writes an image atomically; the suffix decides the format. Raises ValueError where the suffix is unknown, the shape is wrong
    or a pixel is not finite, and OSError where the file cannot be written.

    Args:
        path: Ends in .png or .jpg (8 bit, values clipped to [0, 1], alpha straight), .exr or .hdr (linear, as given).
        pixels: [H, W, C] or [H, W], C = 1, 3 or 4.
        half: Whether an EXR is stored as half instead of float.
    """
    path = Path(path)
    data = encode_image(pixels, path.suffix, str(path), half=half)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def encode_image(pixels: np.ndarray, suffix: str, name: str = "a picture", *, half: bool = False) -> bytes:
    """The bytes of an image file; `name` stands in messages, other arguments and errors as for `write_image`."""
    suffix, pixels = suffix.lower(), np.asarray(pixels)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    if suffix not in LDR_SUFFIXES + HDR_SUFFIXES:
        raise ValueError(f"{name}: unknown image format, use one of {', '.join(LDR_SUFFIXES + HDR_SUFFIXES)}")
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3, 4) or 0 in pixels.shape:
        raise ValueError(f"{name}: pixels must be [H, W, 1 | 3 | 4], got {list(pixels.shape)}")
    if not np.isfinite(pixels).all():
        raise ValueError(f"{name}: pixels must be finite")
    if suffix in LDR_SUFFIXES:
        return _encode_ldr(to_uint8(pixels), suffix)
    return _encode_hdr(np.ascontiguousarray(pixels, dtype=np.float32), suffix, name, oiio.HALF if half else oiio.FLOAT)


def to_uint8(pixels: np.ndarray) -> np.ndarray:
    """Rounds values in [0, 1] to 8 bit, clipping what lies outside; any shape."""
    return np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)


def srgb_to_linear(srgb: np.ndarray) -> np.ndarray:
    """:func:`splitnerf.ops.shading.srgb_to_linear` of an array."""
    return ops.shading.srgb_to_linear(torch.from_numpy(np.array(srgb, order="C"))).numpy()


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """:func:`splitnerf.ops.shading.linear_to_srgb` of an array."""
    return ops.linear_to_srgb(torch.from_numpy(np.array(linear, order="C"))).numpy()


def area_average(pixels: np.ndarray, factor: int) -> np.ndarray:
    """Averages blocks of factor x factor pixels of [H, W] or [H, W, C]; incomplete blocks at the bottom and right are
    cropped. The factor is at most min(H, W)."""
    if factor == 1:
        return pixels
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    blocks = pixels[: height * factor, : width * factor].reshape(height, factor, width, factor, *pixels.shape[2:])
    return blocks.mean(axis=(1, 3), dtype=np.float32).astype(pixels.dtype)


def over_background(srgb: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """A straight-alpha image [..., 3] sRGB with coverage [...] over white, in sRGB values as the protocol demands."""
    return srgb * alpha[..., None] + (1 - alpha[..., None])


def straight_srgb(radiance: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """[..., 3] float32 straight sRGB colours in [0, 1] of linear premultiplied ones with coverage [...]; 0 where clear."""
    return linear_to_srgb(np.clip(radiance / np.maximum(alpha, 1e-8)[..., None], 0, 1)).astype(np.float32)


def _encode_ldr(pixels: np.ndarray, suffix: str) -> bytes:
    """PNG or JPEG of [H, W, 1 | 3 | 4] uint8. Pillow writes into memory: the other library's JPEG writer ends the
    process, and its PNG writer says nothing, where a disk is full."""
    image, data = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels), io.BytesIO()
    if suffix == ".png":
        chunks = PngInfo()
        chunks.add(b"sRGB", b"\0")
        image.save(data, "png", pnginfo=chunks)
    else:
        image = image.convert("RGB") if pixels.shape[2] == 4 else image
        image.save(data, "jpeg", quality=JPEG_QUALITY, subsampling=0)
    return data.getvalue()


def _encode_hdr(pixels: np.ndarray, suffix: str, name: str, kind: oiio.BASETYPE) -> bytes:
    """EXR or HDR of [H, W, 1 | 3 | 4] float32, through a temporary folder. It is read again there, since its last part
    is written without a check."""
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("oiio:ColorSpace", "Linear")
    spec.attribute("DateTime", "")  # else the time of writing: equal pixels, unequal files
    spec.attribute("Software", SOFTWARE)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"image{suffix}"
        sink = oiio.ImageOutput.create(str(path))
        if sink is None:
            raise OSError(f"{name}: OpenImageIO cannot write it ({_reason(oiio)})")
        written = sink.open(str(path), spec) and sink.write_image(pixels)
        if not (sink.close() and written):
            raise OSError(f"{name}: writing into {folder} failed ({_reason(sink)})")
        source = oiio.ImageInput.open(str(path))
        if source is None or source.read_image(0, 0, 0, channels, "float") is None or source.has_error:
            raise OSError(f"{name}: writing into {folder} failed; it may be full")
        source.close()
        return path.read_bytes()


def _named_channels(spec: oiio.ImageSpec) -> list[int]:
    """The channels R, G, B and A, or Y and A, by their names, of the layer that is the picture: one without a name, one that is
    named so, else the first; none where the names are others."""
    names = [name.lower() for name in spec.channelnames]
    layers = dict.fromkeys(name[: name.rfind(".") + 1] for name in names)
    for layer, colours in product(sorted(layers, key=_rank), ("rgb", "y")):
        if all(layer + colour in names for colour in colours):
            return [names.index(layer + name) for name in f"{colours}a" if layer + name in names]
    return []


def _rank(layer: str) -> int:
    """0 for a layer or a part of an EXR file without a name, 1 for one that is named as pictures are, 2 for others."""
    last = layer.lower().rstrip(".").rpartition(".")[2]
    return 0 if not last else 1 if last in PICTURES else 2


def _window(source: oiio.ImageInput, spec: oiio.ImageSpec) -> tuple[int, int, int, int]:
    """Where the pixels lie in the image, and its size: top, left, height, width. An EXR file's pixels may be a part of it."""
    if source.format_name() != "openexr":
        return 0, 0, spec.height, spec.width
    return spec.y - spec.full_y, spec.x - spec.full_x, spec.full_height, spec.full_width


def _radiance_head(path: Path, name: str) -> tuple[float, tuple[int, int]]:
    """The product of the exposures by which a Radiance file says that its values were multiplied; and 1 or, where they are
    stored from below or from the right, -1 for its rows and columns. Raises InputError where it is stored by columns."""
    with open(path, "rb") as file:
        head, _, size = file.read(1 << 16).partition(b"\n\n")
    stored = re.match(rb"([+-][XY]) +\d+ +([+-][XY])", size)
    rows, columns = stored.groups() if stored else (b"-Y", b"+X")
    if rows.endswith(b"X"):
        raise InputError(f"{name}: is stored by columns; re-export it")
    factor, order = 1.0, (-1 if rows == b"+Y" else 1, -1 if columns == b"-X" else 1)
    for line in head.splitlines():
        key, _, value = line.partition(b"=")
        if key.strip() == b"EXPOSURE":
            with suppress(ValueError):
                factor *= float(value)
        elif key.strip() in (b"PRIMARIES", b"COLORCORR", b"GAMMA") and line.strip(b" .0") != b"GAMMA=1":
            note_once(f"{path.parent}: the {key.strip().decode()} of maps are not used", path.name)
    if not 1e-6 < factor < 1e6:
        note_once(f"{path.parent}: the EXPOSURE of maps is beyond reason and not used", path.name)
        factor = 1.0
    return factor, order


@contextmanager
def _opened(path: Path, name: str, *, whole: bool = False) -> Iterator[tuple[oiio.ImageInput, oiio.ImageSpec]]:
    """An image file with its header read, whose size is no more than its bytes and the memory allow; `whole`: its pixels will be
    read, too."""
    if not os.path.isfile(path):
        raise InputError(f"{name}: no such image; check the path")
    try:
        str(path).encode()
    except UnicodeEncodeError:  # a name that is not UTF-8, which OpenImageIO does not open
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "image"
            shutil.copyfile(path, copy)
            with _opened(copy, name, whole=whole) as opened:
                yield opened
        return
    with open(path, "rb") as file:
        if not (head := file.read(16)).startswith(SIGNATURES):
            raise InputError(f"{name}: cannot be read as an image (no PNG, JPEG, WebP, EXR or HDR file); replace it")
        if head.startswith(SIGNATURES[0]):
            _check_png(file, name, b"IEND" if whole else b"IDAT")
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), config)
    if source is None:
        raise InputError(f"{name}: cannot be read as an image ({_reason(oiio)}); replace it")
    if source.format_name() == "jpeg" and str(source.spec().format) != "uint8":  # Ultra HDR: the gain map was applied
        source.close()
        data = path.read_bytes()
        plain = data.replace(b"hdrgm:", b"other:").replace(b"iso:ts:21496", b"iso:ts:other")
        if plain == data:
            raise InputError(f"{name}: is a JPEG of a kind that is not known; save it as a PNG")
        note_once(f"{path.parent}: the gain maps of photos are not used", path.name)
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "image"
            copy.write_bytes(plain)
            with _opened(copy, name, whole=whole) as opened:
                yield opened
        return
    try:
        spec = _first_picture(source, path) if source.format_name() == "openexr" else source.spec()
        if spec.deep:
            raise InputError(f"{name}: holds several samples a pixel (deep); flatten it")
        if str(spec.format) == "uint":
            raise InputError(
                f"{name}: holds whole numbers of 32 bits, which are no colours; re-export it in half or float"
            )
        n_values = spec.width * spec.height * spec.depth * spec.nchannels
        size = f"{spec.width}x{spec.height}"
        if min(spec.width, spec.height) < 1 or spec.depth > 1 or n_values > VALUES_PER_BYTE * path.stat().st_size:
            raise InputError(f"{name}: is said to be {size}, too large for its file; replace it")
        n_values = max(n_values, spec.full_width * spec.full_height * spec.nchannels if spec.full_width > 0 else 0)
        if n_values > LARGEST_IMAGE:
            most = f"the most is {LARGEST_IMAGE // spec.nchannels / 1e6:.0f} megapixels of {spec.nchannels} channels"
            raise InputError(f"{name}: is {size}, {most}; make it smaller")
        yield source, spec
    finally:
        source.close()


def _check_png(file: BinaryIO, name: str, until: bytes) -> None:
    """Raises InputError where a PNG is cut or damaged before its first chunk `until`: its library would print a line of its own."""
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = 8
        while (kind := data[start + 4 : start + 8]) != until:
            end = start + 8 + int.from_bytes(data[start : start + 4], "big")
            stated, needed = int.from_bytes(data[end : end + 4], "big"), kind[:1].isupper()
            if not kind or needed and zlib.crc32(data[start + 4 : end]) != stated:
                raise InputError(f"{name}: truncated or damaged image (by its checksums); replace it")
            start = end + 4


def _first_picture(source: oiio.ImageInput, path: Path) -> oiio.ImageSpec:
    """Goes to the part of an EXR file that is the picture: the first of least rank that holds colours."""
    parts = [source.spec()]
    while source.seek_subimage(len(parts), 0):
        parts.append(source.spec())
    source.geterror()  # there is no further part
    coloured = [i for i, part in enumerate(parts) if _named_channels(part)]
    chosen = min(coloured, key=lambda i: _rank(str(parts[i].getattribute("oiio:subimagename") or "")), default=0)
    if len(parts) > 1:
        note_once(f"{path.parent}: of images with several parts one is used", f"{path.name}: part {chosen + 1}")
        source.seek_subimage(chosen, 0)
    return parts[chosen]


def _reason(source) -> str:
    """The first line of the error message of OpenImageIO or of one of its readers or writers."""
    try:
        lines = source.geterror().strip().splitlines()
    except UnicodeDecodeError:  # it repeats bytes of the file
        lines = []
    return lines[0] if lines else "no reason given"
