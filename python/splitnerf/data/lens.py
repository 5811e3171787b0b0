"""Lenses: the numbers of a pinhole, and the distortion that a photo is freed from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.json_files import is_number
from splitnerf.errors import InputError, note_once, shown

SMALLEST, LARGEST = 1e-6, 1e9  # bounds of a pinhole's numbers
RADIAL, TANGENTIAL = ("k1", "k2", "k3", "k4"), ("p1", "p2")
LARGEST_COEFFICIENT = 1e3
PARAMETERS = {
    "SIMPLE_PINHOLE": "fl_x cx cy",
    "PINHOLE": "fl_x fl_y cx cy",
    "SIMPLE_RADIAL": "fl_x cx cy k1",
    "RADIAL": "fl_x cx cy k1 k2",
    "OPENCV": "fl_x fl_y cx cy k1 k2 p1 p2",
    "OPENCV_FISHEYE": "fl_x fl_y cx cy k1 k2 k3 k4",
    "FULL_OPENCV": "",
    "FOV": "",
    "SIMPLE_RADIAL_FISHEYE": "fl_x cx cy k1",
    "RADIAL_FISHEYE": "fl_x cx cy k1 k2",
    "THIN_PRISM_FISHEYE": "",
    "RAD_TAN_THIN_PRISM_FISHEYE": "",
}
"""COLMAP's camera models in the order of its numbers, and their parameters by a transforms file's names; "" is not read."""
MODELS = [name for name, parameters in PARAMETERS.items() if parameters]
STRIP = 1 << 20  # pixels whose places in a photo are computed at once


@dataclass(frozen=True)
class Distortion:
    """How a lens bends the image of a pinhole.

    With (x, y) = tan of the angles to the axis (right, down), r^2 = x^2 + y^2 and s(t) = 1 + k1 t^2 + k2 t^4 + k3 t^6 +
    k4 t^8, the point lies in the photo, in focal lengths from the principal point, at

        x s(r) + 2 p1 x y + p2 (r^2 + 2 x^2),  y s(r) + p1 (r^2 + 2 y^2) + 2 p2 x y    usual lens (Brown)
        (x, y) s(t) t / r  with t = atan(r)                                             fisheye (Kannala and Brandt)

    Attributes:
        radial: k1, k2, k3, k4.
        tangential: p1, p2; a fisheye has none.
        fisheye: Whether the lens is a fisheye.
    """

    radial: tuple[float, ...] = (0.0,) * 4
    tangential: tuple[float, ...] = (0.0,) * 2
    fisheye: bool = False

    def bend(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where a photo shows what a pinhole shows at points x, y, any shape, in focal lengths from the principal point, y down: x
        and y in the photo, likewise, and whether the model holds there: farther out its image would fold back."""
        k1, k2, k3, k4 = self.radial
        p1, p2 = self.tangential
        r2 = x * x + y * y
        r = np.sqrt(r2)
        t = np.arctan(r) if self.fisheye else r
        t2 = t * t
        scale = 1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))
        if self.fisheye:
            scale = scale * np.where(r > 0, t / np.maximum(r, 1e-300), 1.0)
        u = x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        v = y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return u, v, t < self.reach

    @property
    def reach(self) -> float:
        """The t up to which t s(t) grows: its slope is 1 + 3 k1 t^2 + 5 k2 t^4 + 7 k3 t^6 + 9 k4 t^8."""
        slope = [factor * k for factor, k in zip((9, 7, 5, 3), reversed(self.radial))] + [1.0]
        roots = np.roots(slope)
        turns = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
        return float(np.sqrt(turns.min())) if len(turns) else np.inf


def read_lens(numbers: dict, where: str) -> tuple[dict, Distortion | None]:
    """The pinhole's numbers and the distortion, None where the photo is a pinhole's, that the numbers of a file make. Raises
    InputError where a number is out of bounds, the focal length is missing, or the camera model is not one of `MODELS`.

    Args:
        numbers: `camera_angle_x camera_angle_y` (radians), `fl_x fl_y cx cy w h` (pixels), `k1 ... k4 p1 p2`, `camera_model`
            or `is_fisheye`; what is None or missing is not given.
        where: The file, and the frame if it is one's own lens, for messages.
    """
    numbers = {key: value for key, value in numbers.items() if value is not None}
    if (is_fisheye := numbers.pop("is_fisheye", False)) not in (0, 1):
        raise InputError(f"{where}: 'is_fisheye' must be true or false, got {shown(is_fisheye)}; repair it")
    usual = "OPENCV_FISHEYE" if is_fisheye else "OPENCV"
    model = numbers.pop("camera_model", usual)
    if not isinstance(model, str) or model not in MODELS:
        raise InputError(
            f"{where}: camera model {str(model)[:40]!r} is not read; undistort the photos, for example with "
            f"`colmap image_undistorter`, or give one of {', '.join(MODELS)}"
        )
    coefficients = {key: numbers.pop(key, 0.0) for key in RADIAL + TANGENTIAL}
    for key, value in coefficients.items():
        if not is_number(value) or not abs(value) <= LARGEST_COEFFICIENT:
            raise InputError(f"{where}: '{key}' is no coefficient of a lens: {shown(value)}; repair it")
    if not numbers.keys() & {"fl_x", "fl_y", "camera_angle_x", "camera_angle_y"}:
        raise InputError(f"{where}: missing key 'camera_angle_x' (or 'fl_x'); add it")
    for key, value in numbers.items():
        placed = key in ("cx", "cy")  # which may lie outside of a crop
        valid = is_number(value) and (-LARGEST if placed else SMALLEST) <= value <= LARGEST
        if not valid or (key.startswith("camera_angle") and value >= np.pi):
            kind = "number" if placed else "positive number"
            kind += " of radians below pi" if key.startswith("camera_angle") else ""
            raise InputError(f"{where}: '{key}' must be a {kind}, got {shown(value)}; repair it")
    fisheye = "FISHEYE" in model
    radial, tangential = (tuple(float(coefficients[key]) for key in keys) for keys in (RADIAL, TANGENTIAL))
    if fisheye and any(tangential):
        raise InputError(f"{where}: a fisheye with 'p1' or 'p2' is not read; undistort the photos")
    bends = fisheye or any(radial) or any(tangential)
    if bends and model.endswith("PINHOLE"):
        note_once(f"{where}: has coefficients of distortion, which a {model} lacks; they are used")
    return numbers, Distortion(radial, tangential, fisheye) if bends else None


def check_shape(lens: dict, size: tuple[int, int], path: object) -> None:
    """Raises InputError where an image of this (height, width) is no larger or smaller copy of the one that its lens is stated
    for, by more than rounding: it is turned or cropped."""
    height, width = size
    w, h = lens.get("w", width), lens.get("h", height)
    if abs(width * h - height * w) > max(w, h):
        raise InputError(
            f"{path}: is {width}x{height}, but its lens is stated for {w:g}x{h:g}; turn the image (an EXIF orientation is not "
            "used), or repair 'w' and 'h'"
        )


def lens_intrinsics(lens: dict, size: tuple[int, int]) -> np.ndarray:
    """[4] float64 (fx, fy, cx, cy) in pixels of an image of this (height, width), a scaled copy of the one that the lens is
    stated for."""
    height, width = size
    scale_x, scale_y = width / lens.get("w", width), height / lens.get("h", height)
    focal = {}
    for axis, extent, scale in (("x", width, scale_x), ("y", height, scale_y)):
        if f"fl_{axis}" in lens:
            focal[axis] = lens[f"fl_{axis}"] * scale
        elif f"camera_angle_{axis}" in lens:
            focal[axis] = 0.5 * extent / np.tan(0.5 * lens[f"camera_angle_{axis}"])
    fx, fy = focal.get("x", focal.get("y")), focal.get("y", focal.get("x"))
    cx = lens["cx"] * scale_x if "cx" in lens else width / 2
    cy = lens["cy"] * scale_y if "cy" in lens else height / 2
    return np.array([fx, fy, cx, cy], dtype=np.float64)


def undistort(planes: np.ndarray, distortion: Distortion, intrinsics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The image [H, W, C] float32 that a pinhole with the same focal length, principal point and size takes, of a photo [H, W, C]
    float32 with a distortion, and the pixels [H, W] bool that the photo covers; what the others hold has no meaning. `intrinsics`
    [4] are (fx, fy, cx, cy) in pixels, pixel centres at +0.5. The image may leave the photo's range of values a little."""
    height, width, channels = planes.shape
    fx, fy, cx, cy = intrinsics
    photo = torch.from_numpy(np.ascontiguousarray(planes.transpose(2, 0, 1)))[None]
    result, covered = np.empty_like(planes), np.empty((height, width), bool)
    rows = max(1, STRIP // width)
    for start in range(0, height, rows):
        strip = slice(start, min(start + rows, height))
        y, x = np.mgrid[strip, :width] + 0.5
        u, v, holds = distortion.bend((x - cx) / fx, (y - cy) / fy)
        u, v = u * fx + cx - 0.5, v * fy + cy - 0.5
        covered[strip] = holds & (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)
        places = np.stack([np.clip(u, 0, width - 1), np.clip(v, 0, height - 1)], axis=-1)
        result[strip] = sample_cubic(photo, torch.from_numpy(places)).numpy()
    return result, covered


def sample_cubic(photo: Tensor, places: Tensor) -> Tensor:
    """[h, w, C] values of a photo [1, C, H, W] at places [h, w, 2] float64 (x, y), 0 at the first pixel's centre, by Keys' cubic
    convolution with a = -1/2, which is exact for quadratic functions. It is linear in a: two thirds of torch's, with -3/4, and one
    third of a = 0, bilinear at the fraction 3 t^2 - 2 t^3."""
    size = torch.tensor([photo.shape[3], photo.shape[2]])

    def sampled(at: Tensor, mode: str) -> Tensor:
        grid = ((2.0 * at + 1.0) / size - 1.0).float()[None]
        return F.grid_sample(photo, grid, mode=mode, padding_mode="border", align_corners=False)[0].permute(1, 2, 0)

    whole = places.floor()
    t = places - whole
    return (2.0 * sampled(places, "bicubic") + sampled(whole + t * t * (3.0 - 2.0 * t), "bilinear")) / 3.0


def pixel_width(poses: np.ndarray, intrinsics: np.ndarray, middle: np.ndarray, *, nearest: float = 0.0) -> float:
    """The width of a pixel at a point `middle` [3], in the unit of the poses [n, 4, 4], as a median over the photos, whose
    `intrinsics` [n, 4] are in pixels. Cameras that are nearer to the point than `nearest` count as that far from it."""
    distance = np.maximum(np.linalg.norm(poses[:, :3, 3] - middle, axis=1), nearest)
    return float(np.median(distance / intrinsics[:, 0]))
