"""One photo of a posed image set: its colours, the object's mask, and which of its pixels say something."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import interpolate

from splitnerf.data.images import LDR_SUFFIXES, area_average, downscale_rgba, linear_to_srgb, read_image, srgb_to_linear
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics, undistort
from splitnerf.errors import InputError

SILHOUETTE_SIZE = 100  # pixels, about, along the shorter edge of what the object is found from
LEAST_COVERED = 0.25  # share of the undistorted image that the photo must cover
CERTAIN = 0.999  # part of a pixel that must be known


@dataclass
class Photo:
    """One photo.

    Attributes:
        rgba: [H, W, 4] float32, downscaled, sRGB at an exposure of 1, straight alpha; 0 where the photo says nothing.
        known: [H, W] bool, the pixels that say something, or None for all.
        silhouette: [h, w] bool, the mask at a size that no downscale changes.
        seen: [h, w] bool, what is known of it, or None for all.
        size: (height, width) of the file.
        masked: Whether anything says where the object is; otherwise alpha is 1.
    """

    rgba: np.ndarray
    known: np.ndarray | None
    silhouette: np.ndarray
    seen: np.ndarray | None
    size: tuple[int, int]
    masked: bool = True


def silhouette_factor(height: int, width: int) -> int:
    """The factor by which the silhouette of an image of this size is smaller."""
    return max(1, min(height, width) // SILHOUETTE_SIZE)


def load_photo(frame: Frame, downscale: int, mask_kind: str, separated: Path | None = None) -> Photo:
    """Reads a frame's image and masks, frees them from the lens's distortion, and averages them down.

    Args:
        frame: The frame.
        downscale: Integer factor of at least 1.
        mask_kind: "object" or "ignore": what the mask file is where the frame leaves it open.
        separated: A folder with masks for frames that have none or a full one, named by :func:`separated_mask`; or None.

    Raises:
        InputError: A file cannot be used.
    """
    path = frame.image_path
    if path.suffix.lower() not in LDR_SUFFIXES:
        raise InputError(f"{path}: training images must be PNG or JPEG; convert it")
    pixels = _read_pixels(path)
    height, width, channels = pixels.shape
    if downscale > min(height, width):
        raise InputError(f"{path}: is {width}x{height}, too small for downscale {downscale}; use a smaller factor")
    colour = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    alpha, known = pixels[..., -1:] if channels in (2, 4) else None, None
    is_object = (mask_kind if frame.mask_kind == "auto" else frame.mask_kind) == "object"
    if frame.mask_path is not None and is_object:
        alpha = _read_mask(frame.mask_path, frame, height, width)
    elif frame.mask_path is not None:
        known = _read_mask(frame.mask_path, frame, height, width) > 0
    if frame.dynamic_mask_path is not None:
        still = _read_mask(frame.dynamic_mask_path, frame, height, width) == 0
        known = still if known is None else known & still
    masked = alpha is not None
    alpha = alpha if masked else np.ones_like(colour[..., :1])
    says_nothing = bool((alpha == 1).all())
    rgba = np.concatenate([colour, alpha], axis=-1)
    if frame.distortion is not None:
        rgba, known = _undistort(rgba, known, frame, straight=is_object and frame.mask_path is not None)
    if frame.exposure != 1.0:
        rgba[..., :3] = linear_to_srgb(srgb_to_linear(rgba[..., :3]) / np.float32(frame.exposure))
    if says_nothing and separated is not None:
        masked, rgba[..., 3] = True, resized_mask(read_image(separated / separated_mask(frame.image_path)), height, width)
    factor = silhouette_factor(height, width)
    silhouette = area_average(rgba[..., 3], factor) > 0.5
    rgba = downscale_rgba(rgba, downscale)
    if known is None or known.all():
        return Photo(rgba, None, silhouette, None, (height, width), masked)
    share, known = known[..., 0].astype(np.float32), area_average(known[..., 0].astype(np.float32), downscale) > CERTAIN
    seen = area_average(share, factor) > CERTAIN
    if not known.any():
        raise InputError(f"{path}: its masks ignore all of it; remove the frame")
    return Photo(rgba * known[..., None], known, silhouette & seen, seen, (height, width), masked)


def separated_mask(image_path: Path) -> str:
    """The name of the file with the mask that was found for an image."""
    return f"{image_path.parent.name}_{image_path.stem}.png"


def resized_mask(mask: np.ndarray, height: int, width: int) -> np.ndarray:
    """[height, width] a mask [h, w, 1] in [0, 1], interpolated bilinearly."""
    planes = torch.from_numpy(mask[None, None, ..., 0])
    return interpolate(planes, (height, width), mode="bilinear", align_corners=False)[0, 0].numpy()


def _read_pixels(path: Path) -> np.ndarray:
    """An image whose values lie in [0, 1]. Raises InputError where they do not, as in floats by another name."""
    pixels = read_image(path)
    if not (pixels.min() >= 0 and pixels.max() <= 1):  # false for NaN
        raise InputError(f"{path}: has NaN, infinite or negative pixels or such above 1; save it as 8 or 16 bit PNG")
    return pixels


def _read_mask(path: Path, frame: Frame, height: int, width: int) -> np.ndarray:
    """[H, W, 1] of the size of the frame's image."""
    mask = _read_pixels(path)
    if mask.shape[:2] != (height, width):
        raise InputError(
            f"{path}: is {mask.shape[1]}x{mask.shape[0]}, its image {frame.image_path.name} is {width}x{height}; "
            "make them the same size"
        )
    return mask[..., :1]


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
