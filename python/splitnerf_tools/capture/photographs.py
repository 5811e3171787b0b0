"""The photographs of a folder, or the sharpest frames of a video: which there are, how they were exposed, how sharp they are."""

from __future__ import annotations

import hashlib
import mmap
import os
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import ExifTags, Image
from splitnerf.data.colours import to_srgb
from splitnerf.errors import InputError, note, note_once, plain
from splitnerf.files import atomic_path

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # silence: what cannot be read is told of by the program
COMMON = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp")
HEIC = (".heic", ".heif")
HEIC_BRANDS = (b"ftypheic", b"ftypheix", b"ftypmif1")
OTHER = (".avif", ".gif", ".jp2", ".jxl", ".exr", ".hdr")
# In an MP4, and in a Matroska or WebM file: its curve is PQ or HLG, by the numbers of ITU-T H.273.
HIGH_RANGE = rb"(?s)colrncl[cx]..\0[\x10\x12]", rb"(?s)\x55\xb0.{1,99}?\x55\xba\x81[\x10\x12]"
RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".raf", ".rw2")
SHARPNESS_WIDTH = 640  # pixels to which a photo is reduced before its sharpness is measured
WHOLE = 0.95  # share of the frames that a video states which a whole one has
MAX_PIXELS = 2 * Image.MAX_IMAGE_PIXELS  # of Pillow
T = Image.Transpose
UPRIGHT = (T.FLIP_LEFT_RIGHT, T.ROTATE_180, T.FLIP_TOP_BOTTOM, T.TRANSPOSE, T.ROTATE_270, T.TRANSVERSE, T.ROTATE_90)
TURNS = dict(enumerate(UPRIGHT, start=2))  # what turns a photo upright, by its EXIF orientation


@dataclass(frozen=True)
class Photograph:
    """One photo as its file describes it.

    Attributes:
        path: The file.
        name: A name without folder and extension, unique among the photos.
        width, height: The size in pixels, upright.
        exposure: Exposure time times ISO over the squared f-number (seconds), or None where the file does not tell.
        lens: A text that photos taken with one lens at one zoom have in common.
    """

    path: Path
    name: str
    width: int
    height: int
    exposure: float | None
    lens: str


def find_photographs(folder: Path) -> list[Photograph]:
    """The photos of a folder in the order of their names; files of the same content are taken once. Raises InputError where the
    folder has no photo, or one cannot be read."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give the folder with the photos")
    paths = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in COMMON + HEIC + RAW and path.is_file() and not path.name.startswith("._")  # a Mac's
    )
    if not paths:
        raise InputError(
            f"{folder}: holds no photos ({', '.join(COMMON + HEIC + RAW)}); give the folder with the photos"
        )
    if others := sorted(path.name for path in folder.iterdir() if path.suffix.lower() in OTHER):
        note_once(f"{folder}: {len(others)} pictures of kinds that are not read are left out", others[0])
    seen: dict[str, Path] = {}
    for path in paths:
        seen.setdefault(hashlib.sha256(path.read_bytes()).hexdigest(), path)
    stems = [path.stem for path in seen.values()]
    taken = {stem for stem in stems if stems.count(stem) == 1}
    named = []
    for path, stem in zip(seen.values(), stems):
        name = stem if stem in taken else path.name.replace(".", "_")
        while stem not in taken and name in taken | {photo.name for photo in named}:
            name += "_"
        named.append(_described(path, name))
    return named


def read_upright(path: Path) -> np.ndarray:
    """[H, W, 3] uint8 (uint16 of a raw photo) sRGB, turned as the file says. Raises InputError where the file is no photo, or the
    package that reads it is missing."""
    if path.suffix.lower() in RAW:
        try:
            import rawpy
        except ImportError:
            raise InputError(f"{path}: raw photos need the package rawpy; pip install 'splitnerf[raw]'") from None
        try:
            with rawpy.imread(str(path)) as raw:
                return raw.postprocess(gamma=(2.4, 12.92), no_auto_bright=True, use_camera_wb=True, output_bps=16)
        except (rawpy.LibRawError, OSError) as error:
            raise InputError(f"{path}: is no raw photo that can be read ({plain(str(error))}); remove it") from None
    with _open(path) as image:
        turn = TURNS.get(_exif(image, path).get(ExifTags.Base.Orientation))
        if image.has_transparency_data:
            note_once(f"{path.parent}: the alpha of photos is not used; give --masks if it is the object's", path.name)
        upright = image if turn is None else image.transpose(turn)
        if upright.mode == "F" or (upright.mode == "I" and not 0 <= np.min(upright) <= np.max(upright) < 1 << 16):
            raise InputError(f"{path}: holds values of 32 bits, whose white is unknown; save it in 8 or 16 bits")
        if upright.mode.startswith("I"):  # grey in 16 bits, which convert() would clip
            pixels = np.repeat(np.asarray(upright, np.uint16)[..., None], 3, axis=2)
        else:
            pixels = np.asarray(upright.convert("RGB"))
    return to_srgb(pixels, path)


def is_upright(photo: Photograph) -> bool:
    """Whether the rows of the file are those of the photo."""
    with _open(photo.path) as image:
        return _exif(image, photo.path).get(ExifTags.Base.Orientation, 1) == 1


def sharpness(photo: np.ndarray) -> float:
    """The variance of the Laplacian of the luminance of a photo [H, W, 3], reduced to a common width, in 8-bit units."""
    grey = cv2.cvtColor(np.ascontiguousarray(photo), cv2.COLOR_RGB2GRAY).astype(np.float32)
    grey *= 255.0 / np.iinfo(photo.dtype).max
    scale = min(1.0, SHARPNESS_WIDTH / max(grey.shape))
    size = [max(1, round(scale * n)) for n in grey.shape[::-1]]
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())


def write_frames(video: Path, folder: Path, n: int, report: Callable[[float], None]) -> None:
    """Cuts a video into n windows of equal length, n >= 1, and writes the sharpest frame of each as `frame_NNNNN.png` into a folder
    that is there; calls `report` with the share done. Raises InputError where the file is no video that can be read."""
    reader = cv2.VideoCapture(str(video))
    total = int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
    if not reader.isOpened() or total < 1:
        raise InputError(f"{video}: is no video that can be read; convert it to mp4, or give a folder of photos")
    with open(video, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        if any(re.search(curve, content) for curve in HIGH_RANGE):
            note(f"{video}: is a video of high dynamic range (HLG or PQ), read as if it was sRGB; convert it")
    best, most, window = None, -1.0, 0
    for number in range(total + 1):
        read, frame = reader.read() if number < total else (False, None)
        if best is not None and (not read or number * n // total > window):
            write_png(folder / f"frame_{window + 1:05d}.png", best[..., ::-1])
            best, most = None, -1.0
        if not read:
            break
        window = number * n // total
        sharp = sharpness(frame)
        if sharp > most:
            best, most = frame, sharp
        report((number + 1) / total)
    reader.release()
    if number < WHOLE * total:
        note(f"{video}: cannot be read beyond frame {number} of {total}; what was filmed after it is not used")


def write_png(path: Path, image: np.ndarray) -> None:
    """An image [h, w] or [h, w, 3], uint8 or uint16, as PNG."""
    with atomic_path(path) as temporary:
        coded, data = cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)
        if not coded:
            raise OSError(f"{path}: the image could not be encoded")
        temporary.write_bytes(data.tobytes())


def _open(path: Path) -> Image.Image:
    with open(path, "rb") as file:
        brand = file.read(12)[4:]
    if path.suffix.lower() in HEIC or brand in HEIC_BRANDS:
        try:
            import pillow_heif
        except ImportError:
            raise InputError(
                f"{path}: HEIC photos need the package pillow-heif; pip install 'splitnerf[heic]'"
            ) from None
        pillow_heif.register_heif_opener()
    try:
        image = Image.open(path)
        image.load()
    except Image.DecompressionBombError:
        raise InputError(f"{path}: has more than {MAX_PIXELS // 10**6} megapixels; scale it down") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(f"{path}: is no photo that can be read ({error}); repair or remove it") from None
    return image


def _exif(image: Image.Image, path: Path) -> Image.Exif:
    """What the file says of the photo; nothing where that is damaged, with a note."""
    try:
        exif = image.getexif()
        exif.get_ifd(ExifTags.IFD.Exif)  # read now, since damage shows only here
        return exif
    except (OSError, ValueError, TypeError, SyntaxError, KeyError, struct.error) as error:
        note_once(f"{path}: its EXIF data are damaged ({plain(str(error))}), and not used")
        return Image.Exif()


def _described(path: Path, name: str) -> Photograph:
    if path.suffix.lower() in RAW:
        height, width = read_upright(path).shape[:2]
        return Photograph(path, name, width, height, None, f"{path.suffix} {width}x{height}")
    with _open(path) as image:
        exif = _exif(image, path)
        details = exif.get_ifd(ExifTags.IFD.Exif)
        width, height = image.size
        if exif.get(ExifTags.Base.Orientation, 1) in (5, 6, 7, 8):
            width, height = height, width
    seconds, f_number = (_positive(details.get(tag)) for tag in (ExifTags.Base.ExposureTime, ExifTags.Base.FNumber))
    sensitivity = details.get(ExifTags.Base.ISOSpeedRatings)
    iso = _positive(sensitivity[0] if isinstance(sensitivity, tuple) and sensitivity else sensitivity)
    exposure = seconds * iso / f_number**2 if seconds and f_number and iso else None
    maker = [str(exif.get(tag, "")).strip() for tag in (ExifTags.Base.Make, ExifTags.Base.Model)]
    lens = " ".join([*maker, f"{width}x{height}", str(details.get(ExifTags.Base.FocalLength, ""))]).strip()
    return Photograph(path, name, width, height, exposure, lens)


def _positive(value: object) -> float | None:
    """A number above 0 that a camera can mean, or None."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if 1e-9 < number < 1e9 else None
