"""One photo of a posed image set: its colours, the object's mask, and which of its pixels say something."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import interpolate

from splitnerf.data.environment import NEGATIVE_SHARE
from splitnerf.data.images import (
    HDR_SUFFIXES,
    LDR_SUFFIXES,
    area_average,
    linear_to_srgb,
    read_colours,
    read_header,
    read_image,
)
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import check_shape, lens_intrinsics, undistort
from splitnerf.data.masks import read_mask
from splitnerf.data.pixels import averaged_codes, decoded, encoded
from splitnerf.errors import InputError

SILHOUETTE_SIZE = 100  # pixels, about, along the shorter edge of what the object is found from
LEAST_COVERED = 0.25  # share of the undistorted image that the photo must cover
CERTAIN = 0.999  # part of a pixel that must be known
PEAK, BRIGHT = (
    0.9,
    0.999,
)  # a photo of floats is kept so that this share of its values lies below this one; 1 counts as clipped
RINGING = 0.1  # of the brightest value; a filter leaves so much below 0 at an edge
LEAST_ALPHA = 0.01


@dataclass
class Photo:
    """One photo.

    Attributes:
        rgba: [H, W, 4] downscaled, sRGB at the photo's own exposure, straight alpha; 0 where the photo says nothing. Bytes
            where the files hold bytes that nothing changes, else 16 bits; None where the pixels are kept elsewhere.
        known: [H, W] bool, the pixels that say something, or None for all.
        silhouette: [h, w] bool, the mask at a size that no downscale changes.
        seen: [h, w] bool, what is known of it, or None for all.
        size: (height, width) of the file.
        masked: Whether anything says where the object is; otherwise alpha is 1.
        whole: Whether the colours are those of the whole photo, also where alpha is less than 1.
        scale: The factor by which linear values were multiplied, so that those of a file of floats lie below 1; else 1.
    """

    rgba: np.ndarray | None
    known: np.ndarray | None
    silhouette: np.ndarray
    seen: np.ndarray | None
    size: tuple[int, int]
    masked: bool = True
    whole: bool = False
    scale: float = 1.0


def silhouette_factor(height: int, width: int) -> int:
    """The factor by which the silhouette of an image of this size is smaller."""
    return max(1, min(height, width) // SILHOUETTE_SIZE)


def load_photo(frame: Frame, downscale: int, mask_kind: str, separated: Path | None = None) -> Photo:
    """Reads a frame's image and masks, frees them from the lens's distortion, and averages them down.

    Args:
        frame: The frame.
        downscale: Integer factor of at least 1.
        mask_kind: "object" or "ignore": what the mask file is where the frame leaves it open.
        separated: The mask that was found for the image, which counts where the frame has none or a full one; or None.

    Raises:
        InputError: A file cannot be used.
    """
    path = frame.image_path
    pixels, scale = _read_photo(path, frame.gamma)
    height, width, channels = pixels.shape
    colour = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    alpha, known = pixels[..., -1:] if channels in (2, 4) else None, None
    is_object = (mask_kind if frame.mask_kind == "auto" else frame.mask_kind) == "object"
    if frame.mask_path is not None and is_object:
        alpha = read_mask(frame.mask_path)
    elif frame.mask_path is not None:
        known = read_mask(frame.mask_path) > 0
    if frame.dynamic_mask_path is not None:
        still = read_mask(frame.dynamic_mask_path) == 0
        known = still if known is None else known & still
    masked = alpha is not None
    alpha = alpha if masked else np.full((height, width, 1), 255, np.uint8)
    kind = np.uint8 if colour.dtype == alpha.dtype == np.uint8 else np.uint16
    rgba = np.concatenate([encoded(colour, kind), encoded(alpha, kind)], axis=-1)
    whole = (
        is_object and frame.mask_path is not None and channels in (1, 3)
    )  # where a photo has alpha, nothing lies behind
    says_nothing = bool((rgba[..., 3] == np.iinfo(kind).max).all())
    if frame.distortion is not None:
        straight, known = _undistort(decoded(rgba), known, frame, straight=whole)
        rgba = encoded(straight, np.uint16)
    if says_nothing and separated is not None:
        mask = resized_mask(read_image(separated), height, width)
        masked, whole, rgba[..., 3] = True, True, encoded(mask, rgba.dtype)
    factor = silhouette_factor(height, width)
    silhouette = area_average(decoded(rgba[..., 3]), factor) > 0.5
    rgba = averaged_codes(rgba, downscale)
    whole &= downscale == 1  # averages are of the object's colours alone
    if known is None or known.all():
        return Photo(rgba, None, silhouette, None, (height, width), masked, whole, scale)
    share, known = known[..., 0].astype(np.float32), area_average(known[..., 0].astype(np.float32), downscale) > CERTAIN
    seen = area_average(share, factor) > CERTAIN
    if not known.any():
        raise InputError(f"{path}: its masks ignore all of it; remove the frame")
    rgba[~known] = 0
    return Photo(rgba, known, silhouette & seen, seen, (height, width), masked, whole, scale)


def separated_mask(image_path: Path, root: Path) -> Path:
    """The name of the file with the mask that was found for an image of the data in `root`: that of its path there, as two
    images may differ in their folders or suffixes alone."""
    parts = ("up" if part == ".." else part for part in Path(os.path.relpath(image_path, root)).parts)
    name = Path(*parts)
    return name if name.suffix == ".png" else name.with_name(f"{name.name}.png")


def resized_mask(mask: np.ndarray, height: int, width: int) -> np.ndarray:
    """[height, width] a mask [h, w, 1] in [0, 1], interpolated bilinearly."""
    planes = torch.from_numpy(mask[None, None, ..., 0])
    return interpolate(planes, (height, width), mode="bilinear", align_corners=False)[0, 0].numpy()


def check_files(frames: Sequence[Frame], downscale: int) -> tuple[np.ndarray, bool]:
    """The sizes [n, 2] (height, width) of the photos, and whether bytes hold their values exactly, by the files' headers alone.

    Raises:
        InputError: A file is missing or no image, a photo has another shape than its lens says, a mask has another size than
            its photo, or a photo is too small for the downscale.
    """
    sizes, exact = [], downscale == 1 and all(frame.distortion is None for frame in frames)
    for frame in frames:
        path = frame.image_path
        if path.suffix.lower() not in LDR_SUFFIXES + HDR_SUFFIXES:
            raise InputError(f"{path}: training images must be PNG, JPEG, EXR or HDR; convert it")
        height, width, _, bits = read_header(path)
        if downscale > min(height, width):
            raise InputError(f"{path}: is {width}x{height}, too small for downscale {downscale}; use a smaller factor")
        check_shape(frame.lens, (height, width), path)
        sizes.append((height, width))
        exact = exact and bits == 8 and frame.gamma == 0
        for mask_path in filter(None, (frame.mask_path, frame.dynamic_mask_path)):
            mask = read_header(mask_path)
            if mask[:2] != (height, width):
                raise InputError(
                    f"{mask_path}: is {mask.width}x{mask.height}, its image {path.name} is {width}x{height}; make them the "
                    "same size"
                )
            exact = exact and mask.bits == 8
    _check_lenses(frames, sizes)
    return np.array(sizes), exact


def _check_lenses(frames: Sequence[Frame], sizes: Sequence[tuple[int, int]]) -> None:
    """Raises InputError where one angle or principal point is stated for photos of two shapes: only a focal length in pixels
    can be that of a camera that was turned."""
    first: dict[str, int] = {}
    for i, (frame, (height, width)) in enumerate(zip(frames, sizes)):
        if "w" in frame.lens or not frame.lens.keys() & {"camera_angle_x", "cx", "cy"}:
            continue
        j = first.setdefault(str(sorted(frame.lens.items())), i)
        if abs(width * sizes[j][0] - height * sizes[j][1]) >= max(*sizes[j], height, width):
            other = f"{frames[j].image_path.name} is {sizes[j][1]}x{sizes[j][0]}"
            raise InputError(
                f"{frame.image_path}: is {width}x{height}, {other}, and one lens is stated for both; give each frame its own "
                "'fl_x', 'fl_y', 'cx', 'cy', 'w' and 'h'"
            )


def _read_photo(path: Path, gamma: float) -> tuple[np.ndarray, float]:
    """The sRGB values of an image, straight alpha, and the factor by which their linear values were multiplied.

    Floats are linear radiance; the factor then brings nearly all below PEAK, and what is above 1 is clipped. Whole numbers are
    sRGB, or follow the camera's curve.

    Args:
        path: The image.
        gamma: The exponent that gives linear values, or 0 for sRGB's curve.

    Raises:
        InputError: Floats are negative, infinite or NaN.
    """
    pixels = read_colours(path)
    n_colours = 3 if pixels.shape[2] >= 3 else 1
    if pixels.dtype.kind != "f":
        if gamma == 0:
            return pixels, 1.0
        values = decoded(pixels)
        colour = linear_to_srgb(values[..., :n_colours] ** np.float32(gamma))
        return np.concatenate([colour, values[..., n_colours:]], axis=-1), 1.0
    if not (pixels.min() >= 0 and pixels.max() < np.inf):  # false for NaN
        pixels = _without_noise(pixels, path)
    colour, alpha = pixels[..., :n_colours], pixels[..., -1:]
    if pixels.shape[2] in (2, 4):  # EXR's alpha is associated
        colour = np.where(alpha > LEAST_ALPHA, colour / np.maximum(alpha, LEAST_ALPHA), 0.0)
    scale = min(1.0, PEAK / max(float(np.quantile(colour, BRIGHT)), 1e-6))
    kept = linear_to_srgb((colour * np.float32(scale)).clip(0, 1))
    return np.concatenate([kept, pixels[..., n_colours:].clip(0, 1)], axis=-1), scale


def _without_noise(pixels: np.ndarray, path: Path) -> np.ndarray:
    """The values with negative ones set to 0: noise of raw photos, or what a filter leaves beside a lamp. Together they are at
    most a thousandth of the sum, and none is further below 0 than a tenth of the brightest value is above.

    Raises:
        InputError: There are more, or NaN or infinite ones.
    """
    dark, total = -pixels.sum(where=pixels < 0, dtype=np.float64), pixels.sum(where=pixels > 0, dtype=np.float64)
    deepest = -RINGING * pixels.max()
    if not (np.isfinite(pixels).all() and dark <= NEGATIVE_SHARE * total and pixels.min() >= deepest):
        raise InputError(f"{path}: has NaN, infinite or negative pixels; clean or re-export it")
    return np.maximum(pixels, 0)


def _undistort(
    rgba: np.ndarray, known: np.ndarray | None, frame: Frame, *, straight: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The image [H, W, 4] as a pinhole sees it, without meaning where it is not known, and the known pixels [H, W, 1].

    Args:
        rgba: [H, W, 4], straight alpha.
        known: [H, W, 1] bool, or None.
        frame: The frame.
        straight: Whether the colours are the photo's also where alpha is 0; else only colour times alpha is one.
    """
    size = rgba.shape[:2]
    if not straight:
        rgba = np.concatenate([rgba[..., :3] * rgba[..., 3:], rgba[..., 3:]], axis=-1)
    planes = rgba if known is None else np.concatenate([rgba, known.astype(np.float32)], axis=-1)
    planes, covered = undistort(planes, frame.distortion, lens_intrinsics(frame.lens, size))
    if covered.mean() < LEAST_COVERED:
        raise InputError(
            f"{frame.image_path}: its lens, undistorted, covers {covered.mean():.0%} of the image; check k1, k2"
        )
    rgba = np.clip(planes[..., :4], 0, 1)
    if not straight:
        rgba[..., :3] = np.minimum(rgba[..., :3] / np.maximum(rgba[..., 3:], 1 / 255), 1)
    known = covered[..., None] if known is None else covered[..., None] & (planes[..., 4:] > CERTAIN)
    return rgba, known
