"""The colours of a photo, brought to sRGB from what its file states."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import OpenImageIO as oiio
import torch
from PIL import ExifTags, Image, ImageCms

from splitnerf import ops
from splitnerf.errors import note_once, plain

ROWS = 256  # of a photo that are converted at once
# Chromaticities x, y of red, green, blue and white.
REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
ADOBE_RGB = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329)
DISPLAY_P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
REC2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
ALIKE = 0.01  # difference of chromaticities, at most, that counts as none
ADOBE_GAMMA = 2.19921875
CODED_PRIMARIES = {1: REC709, 9: REC2020, 12: DISPLAY_P3}  # of ITU-T H.273
CODED_SRGB = 13  # sRGB's curve, likewise
UNCALIBRATED, ADOBE_INDEX = 0xFFFF, "R03"  # of EXIF: another space than sRGB, and that it is Adobe RGB
RAMPS = np.uint8([[1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]])  # lines in a cube
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


class Stated(NamedTuple):
    """What a file states of its colours."""

    profile: bytes | None = None  # an ICC profile
    gamma: float = 0.0  # the power of the values that is the light; 0: sRGB's curve
    primaries: tuple[float, ...] = REC709  # chromaticities of red, green, blue and white
    is_known: bool = True  # whether nothing else is stated


def stated_colours(path: Path) -> Stated:
    """What a photo's file states of its colours; nothing, with a note, where that cannot be read."""
    try:
        with Image.open(path) as image:
            said, (space, index) = image.info, exif_space(image)
            source = oiio.ImageInput.open(str(path)) if image.format == "PNG" else None
        codes = (source.spec().getattribute("CICP") if source else None) or ()  # of the primaries, the curve and others
    except Exception:  # of any kind where a file is damaged
        note_once(f"{path.parent}: what photos state of their colours cannot be read; they count as sRGB", path.name)
        return Stated()
    if codes:
        primaries = CODED_PRIMARIES.get(codes[0], REC709)
        return Stated(None, 0.0, primaries, codes[0] in CODED_PRIMARIES and codes[1] == CODED_SRGB)
    if said.get("icc_profile"):
        return Stated(said["icc_profile"])
    if space == UNCALIBRATED:
        is_adobe = index == ADOBE_INDEX
        return Stated(None, ADOBE_GAMMA, ADOBE_RGB) if is_adobe else Stated(is_known=False)
    if "srgb" in said:
        return Stated()
    white, red, green, blue = np.reshape(said.get("chromaticity", REC709[6:] + REC709[:6]), (4, 2)).tolist()
    return Stated(None, 1 / (said.get("gamma") or math.inf), (*red, *green, *blue, *white))


def exif_space(image: Image.Image) -> tuple[int | None, str]:
    """The number of the colour space and the index of interoperability of EXIF; None and nothing where it is damaged."""
    try:
        exif = image.getexif()
        index = str(exif.get_ifd(ExifTags.IFD.Interop).get(1, ""))
        return exif.get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.ColorSpace), index.rstrip("\0 ")
    except Exception:  # of any kind
        return None, ""


def to_srgb(codes: np.ndarray, path: Path) -> np.ndarray:
    """Colours [H, W, 1 or 3] of a photo, uint8 or uint16, as sRGB from what its file states. A note says what was converted,
    and what is stated and cannot be."""
    stated = stated_colours(path)
    if not stated.is_known:
        what = "photos state that their colours are not sRGB, and not what they are"
        note_once(f"{path.parent}: {what}; their values count as sRGB, convert them", path.name)
    if stated.profile is not None:
        return from_profile(codes, stated.profile, path)
    return from_space(codes, stated.gamma, stated.primaries, path)


def from_primaries(light: np.ndarray, primaries: tuple[float, ...], path: Path) -> np.ndarray:
    """Linear colours [..., 3] in given primaries in those of Rec. 709, 0 where that is negative, with a note; as they are where that is
    no difference, or the primaries are none."""
    matrix = _matrix_of(primaries, path)
    if matrix is None:
        return light
    note_once(f"{path.parent}: images state primaries that are not sRGB's; they are brought to sRGB's", path.name)
    return np.maximum(light @ matrix.T.astype(light.dtype), 0)


def _matrix_of(primaries: tuple[float, ...], path: Path) -> np.ndarray | None:
    """:func:`to_rec709` of primaries that a file states; None where they are Rec. 709's or, with a note, none."""
    if np.abs(np.subtract(primaries, REC709)).max() <= ALIKE:
        return None
    with np.errstate(all="ignore"):
        matrix = to_rec709(primaries)
    if np.isfinite(matrix).all() and np.abs(matrix).max() <= 10:
        return matrix
    note_once(f"{path.parent}: images state primaries that are none; they are not used", path.name)
    return None


def from_space(codes: np.ndarray, gamma: float, primaries: tuple[float, ...], path: Path) -> np.ndarray:
    """Colours in given primaries as sRGB; their light is a power of the values (gamma 0: sRGB's curve). Unchanged if about sRGB."""
    matrix = _matrix_of(primaries, path) if codes.shape[2] == 3 else None
    if matrix is None and (gamma == 0 or 2.0 < gamma < 2.4):
        return codes
    most = np.iinfo(codes.dtype).max
    values = np.arange(most + 1, dtype=np.float32) / np.float32(most)
    light = values ** np.float32(gamma) if gamma else ops.shading.srgb_to_linear(torch.from_numpy(values)).numpy()
    turned = np.eye(codes.shape[2], dtype=np.float32) if matrix is None else matrix.T.astype(np.float32)
    result = np.empty_like(codes)
    for top in range(0, len(codes), ROWS):
        mixed = np.clip(light[codes[top : top + ROWS]] @ turned, 0, 1)
        result[top : top + ROWS] = np.rint(most * ops.linear_to_srgb(torch.from_numpy(mixed)).numpy())
    parts = ["" if gamma == 0 else f"the gamma {gamma:.4g}", "" if matrix is None else "primaries that are not sRGB's"]
    note_once(f"{path.parent}: photos state {' and '.join(filter(None, parts))}; they are brought to sRGB", path.name)
    return result


def to_rec709(primaries: tuple[float, ...]) -> np.ndarray:
    """[3, 3] from linear colours in primaries to those in Rec. 709's, with one white for the other; not finite where the primaries
    are none. Source: SMPTE RP 177, 1993; the whites by Bradford's cones (Lam, Metamerism and colour constancy, 1985)."""
    (ours, our_white), (theirs, white) = to_xyz(REC709), to_xyz(primaries)
    cones = np.diag((BRADFORD @ our_white) / (BRADFORD @ white))
    return np.linalg.inv(ours) @ np.linalg.inv(BRADFORD) @ cones @ BRADFORD @ theirs


def to_xyz(primaries: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """From linear colours in primaries to CIE XYZ [3, 3], and the white there [3]."""
    x, y = np.reshape(primaries, (4, 2)).T.astype(np.float64)
    xyz = np.stack([x, y, 1 - x - y]) / y
    directions, white = xyz[:, :3], xyz[:, 3]
    try:
        return directions * np.linalg.solve(directions, white), white
    except np.linalg.LinAlgError:
        return np.full((3, 3), np.nan), white


def from_profile(codes: np.ndarray, profile: bytes, path: Path) -> np.ndarray:
    """A photo's colours [H, W, 1 or 3] as sRGB by its ICC profile; as they are, with a note, where that cannot be done."""
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = ImageCms.getProfileDescription(source).strip()
        mode, n = ("L", 1) if source.profile.xcolor_space.strip() == "GRAY" else ("RGB", 3)
        target, intent = ImageCms.createProfile("sRGB"), ImageCms.Intent.RELATIVE_COLORIMETRIC
        change = ImageCms.buildTransform(source, target, mode, "RGB", intent)

        def changed(values: np.ndarray) -> np.ndarray:
            image = Image.fromarray(np.ascontiguousarray(values[..., 0] if n == 1 else values))
            return np.asarray(ImageCms.applyTransform(image, change))

        ramps = np.arange(256, dtype=np.uint8)[:, None, None] * RAMPS
        ramps = ramps[:, :1] if n == 1 else ramps
        if np.abs(np.subtract(changed(ramps), ramps, dtype=int)).max() <= 2:
            return codes  # the profile is sRGB's, whatever its name
        of_bytes = codes if codes.dtype == np.uint8 else np.rint(codes / 257).astype(np.uint8)
        converted = changed(np.broadcast_to(of_bytes, (*codes.shape[:2], 3)))[..., : codes.shape[2]]
    except (ImageCms.PyCMSError, OSError, ValueError) as error:
        said = plain(str(error))
        note_once(
            f"{path.parent}: the colour profile of photos is not used, as {said}; convert them to sRGB", path.name
        )
        return codes
    note_once(f"{path.parent}: photos have the colour profile {name}; they are converted to sRGB", path.name)
    return converted if codes.dtype == np.uint8 else converted.astype(np.uint16) * np.uint16(257)
