"""Photographs as pinhole images: the lens's distortion taken out, reduced to a size."""

from __future__ import annotations

import cv2
import numpy as np
from splitnerf.data.images import linear_to_srgb, srgb_to_linear

from splitnerf_tools.capture.poses import Lens

HALF_PIXEL = np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])  # OpenCV's pixel centres are whole numbers
LEAST_LIGHT = 0.2  # of a corner, in the middle's


def pinhole_of(lens: Lens, max_size: int) -> Lens:
    """The pinhole camera, without distortion, whose image a lens's photo covers wholly.

    Args:
        max_size: The longest edge in pixels; 0 keeps the photo's.
    """
    size = (lens.width, lens.height)
    covered, _ = cv2.getOptimalNewCameraMatrix(lens.matrix - HALF_PIXEL, lens.distortion, size, 0)
    fx, fy, cx, cy = map(float, (covered[0, 0], covered[1, 1], covered[0, 2] + 0.5, covered[1, 2] + 0.5))
    scale = min(1.0, max_size / max(size)) if max_size else 1.0
    return Lens(*size, fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0).resized(*(max(1, round(edge * scale)) for edge in size))


def without_vignetting(photo: np.ndarray, lens: Lens, vignetting: tuple[float, float]) -> np.ndarray:
    """A photo [H, W, 3] as a lens without vignetting would give it; what gets brighter than white stays white.

    Args:
        photo: uint8 or uint16, sRGB.
        vignetting: (a, b) of the factor 1 + a r^2 + b r^4 of linear values, r in half diagonals from the principal point.
    """
    y, x = np.mgrid[: lens.height, : lens.width] + 0.5
    squared = ((x - lens.cx) ** 2 + (y - lens.cy) ** 2) / (0.25 * (lens.width**2 + lens.height**2))
    factor = np.maximum(1 + vignetting[0] * squared + vignetting[1] * squared**2, LEAST_LIGHT).astype(np.float32)[
        ..., None
    ]
    white = np.iinfo(photo.dtype).max
    even = linear_to_srgb(srgb_to_linear(photo / np.float32(white)) / factor)
    even = np.where(photo == white, 1.0, even.clip(0, 1))
    return (even * white + 0.5).astype(photo.dtype)


def undistort(photo: np.ndarray, lens: Lens, pinhole: Lens) -> np.ndarray:
    """A photo [H, W, c] of `lens` as `pinhole` sees it, [h, w, c] of the same type."""
    size = (lens.width, lens.height)
    old, new = lens.matrix - HALF_PIXEL, pinhole.resized(*size).matrix - HALF_PIXEL
    maps = cv2.initUndistortRectifyMap(old, lens.distortion, None, new, size, cv2.CV_32FC1)
    image = cv2.remap(photo, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    if (pinhole.width, pinhole.height) != size:
        image = cv2.resize(image, (pinhole.width, pinhole.height), interpolation=cv2.INTER_AREA)
    return image
