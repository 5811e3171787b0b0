"""The photos of a posed image set: their colours, the object's masks, and which of their pixels say something.

As many are read at a time as the memory allows, into one array in memory or in a file.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from torch.nn.functional import interpolate

from splitnerf.data.environment import NEGATIVE_SHARE
from splitnerf.data.images import (
    HDR_SUFFIXES,
    LDR_SUFFIXES,
    area_average,
    linear_to_srgb,
    read_codes,
    read_colours,
    read_header,
    read_image,
)
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import check_shape, lens_intrinsics, undistort
from splitnerf.data.pixels import (
    GB,
    averaged_codes,
    decoded,
    encoded,
    folder_of_files,
    forget_pages,
    memory_for_photos,
    new_array,
)
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError, note_once

SILHOUETTE_SIZE = 100  # pixels, about, along the shorter edge of what the object is found from
ANGLES_ALIKE = 0.02  # difference of a photo's widths by an angle and by a focal length, as a share, that counts as none
LEAST_COVERED = 0.25  # share of the undistorted image that the photo must cover
CERTAIN = 0.999  # part of a pixel that must be known
PEAK, BRIGHT = 0.9, 0.999  # a photo of floats is kept so that a share of BRIGHT lies below PEAK; 1 counts as clipped
RINGING = 0.1  # of the brightest value; a filter leaves so much below 0 at an edge
LEAST_ALPHA = 0.01
FAINT, FEW = 0.25, 20  # alpha below which colours tell whether they are straight, and how many pixels tell nothing
GREY = 0.03  # difference of a mask's channels, of their largest value, that compression leaves
WHITE = 0.98  # least part of full scale that a mask should have somewhere

MOST_LABELS = 32  # number and size of values up to which a mask of more than two of them may be one of labels
LABELLED = 0.01  # share of a mask in areas of values between the least and the largest
THREADS = 8
WORK, WORK_BENT = 24, 110  # bytes a pixel of the file, while a photo is read; where it is turned into floats


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
    """Reads a frame's image and masks, frees them from the lens's distortion, and averages them down by `downscale`. Raises
    InputError where a file cannot be used.

    Args:
        mask_kind: "object" or "ignore": what the mask file is where the frame leaves it open.
        separated: The mask that was found for the image, which counts where the frame has none or a full one; or None.
    """
    path = frame.image_path
    pixels, scale = _read_photo(path, frame.gamma)
    height, width, channels = pixels.shape
    colour = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    alpha, known = pixels[..., -1:] if channels in (2, 4) else None, None
    is_object = (mask_kind if frame.mask_kind == "auto" else frame.mask_kind) == "object"
    if alpha is not None and pixels.dtype.kind == "u":
        faint = (alpha[..., 0] > 0) & (alpha[..., 0] < FAINT * np.iinfo(alpha.dtype).max)
        if faint.sum() > FEW and (colour[faint] <= alpha[faint]).all():
            what = "colours never exceed a faint alpha, as where it was multiplied into them; save straight alpha"
            note_once(f"{path.parent}: {what}", path.name)
    if frame.mask_path is not None and is_object:
        mask = read_mask(frame.mask_path)
        darkest, brightest = (float(decoded(value)) for value in (mask.min(), mask.max()))
        if 0 < brightest < WHITE:
            note_once("masks that are nowhere white make the object clear", f"{frame.mask_path.name}: {brightest:.1%}")
        if darkest == 1 and alpha is not None and alpha.min() < alpha.max():
            note_once("where a mask is white everywhere the photo's own alpha counts", frame.mask_path.name)
        else:
            alpha = mask
    elif frame.mask_path is not None:
        known = read_mask(frame.mask_path) > 0
    if frame.dynamic_mask_path is not None:
        still = read_mask(frame.dynamic_mask_path) == 0
        known = still if known is None else known & still
    masked = alpha is not None
    alpha = alpha if masked else np.full((height, width, 1), 255, np.uint8)
    kind = np.uint8 if colour.dtype == alpha.dtype == np.uint8 else np.uint16
    rgba = np.concatenate([encoded(colour, kind), encoded(alpha, kind)], axis=-1)
    whole = is_object and frame.mask_path is not None and channels in (1, 3)  # with alpha, nothing lies behind
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
    """The sizes [n, 2] (height, width) of the photos, and whether bytes hold their values exactly, by the files'
    headers alone. Raises InputError where a file is missing or no image, a photo has another shape than its lens says,
    a mask has another size than its photo, a background another shape, or a photo is too small for the downscale."""
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
                    f"{mask_path}: is {mask.width}x{mask.height}, its image {path.name} is {width}x{height}; make them equal"
                )
            exact = exact and mask.bits == 8
        if frame.behind_path is not None:
            h, w, channels, _ = read_header(frame.behind_path)
            if channels != 4 or abs(h * width - w * height) > 2 * max(width, height):
                raise InputError(
                    f"{frame.behind_path}: must be RGBA and of its photo's shape, {width}x{height}; make it again, or leave it out"
                )
    _check_lenses(frames, sizes)
    return np.array(sizes), exact


def _check_lenses(frames: Sequence[Frame], sizes: Sequence[tuple[int, int]]) -> None:
    """Raises InputError where one lens is stated for photos of several sizes, and not for which: the camera may have been turned.
    Notes a principal point far from the middle, as of a lens for another size, or an angle that contradicts a focal length."""
    first: dict[str, int] = {}
    for i, (frame, (height, width)) in enumerate(zip(frames, sizes)):
        fx, fy, x, y = lens_intrinsics(frame.lens, (height, width))
        for axis, focal, extent in (("x", fx, width), ("y", fy, height)):
            angle = frame.lens.get(f"camera_angle_{axis}", 2 * np.arctan(0.5 * extent / focal))
            if abs(2 * focal * np.tan(0.5 * angle) - extent) > ANGLES_ALIKE * extent:
                what = f"'fl_{axis}' and 'camera_angle_{axis}' contradict each other; 'fl_{axis}' counts"
                fitting = f"{extent} pixels, they agree for {2 * focal * np.tan(0.5 * angle):.0f}"
                note_once(f"{frame.image_path.parent}: {what}", f"{frame.image_path.name}: {fitting}")
        if not all(1 / 3 < share < 2 / 3 for share in (x / width, y / height)):
            what = f"({x:.0f}, {y:.0f}) in {width}x{height} pixels"
            note_once(
                "principal points lie far from the middle of their photos; check the lens if they are no crops",
                f"{frame.image_path.name}: {what}",
            )
        if "w" in frame.lens:
            continue
        if frame.lens.keys() <= {"fl_x", "fl_y"}:
            what = "focal lengths in pixels are stated without 'w' and 'h'; they are taken for those of the photos as they are"
            note_once(f"{frame.image_path.parent}: {what}", f"{frame.image_path.name}: {width}x{height}")
        j = first.setdefault(str(sorted(frame.lens.items())), i)
        same_shape = abs(width * sizes[j][0] - height * sizes[j][1]) < max(*sizes[j], height, width)
        in_pixels = frame.lens.keys() & {"fl_x", "fl_y", "cx", "cy"}
        in_shape = frame.lens.keys() & {"camera_angle_x", "cx", "cy"}
        if (height, width) != tuple(sizes[j]) and (in_pixels if same_shape else in_shape):
            other = f"{frames[j].image_path.name} is {sizes[j][1]}x{sizes[j][0]}"
            raise InputError(
                f"{frame.image_path}: is {width}x{height}, {other}, and one lens is stated for both; give each frame its own "
                "'fl_x', 'fl_y', 'cx', 'cy', 'w' and 'h'"
            )


def _read_photo(path: Path, gamma: float) -> tuple[np.ndarray, float]:
    """The sRGB values of an image, straight alpha, and the factor by which their linear values were multiplied: floats are linear
    radiance, nearly all below PEAK by the factor; whole numbers are sRGB or, with a gamma, linear values to the power 1 / gamma."""
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
    """The values with negative ones set to 0, which are noise of raw photos or what a filter leaves beside a lamp.
    Raises InputError where they are more than that, or not finite."""
    dark, total = -pixels.sum(where=pixels < 0, dtype=np.float64), pixels.sum(where=pixels > 0, dtype=np.float64)
    deepest = -RINGING * pixels.max()
    if not (np.isfinite(pixels).all() and dark <= NEGATIVE_SHARE * total and pixels.min() >= deepest):
        raise InputError(f"{path}: has NaN, infinite or negative pixels; clean or re-export it")
    return np.maximum(pixels, 0)


def _undistort(
    rgba: np.ndarray, known: np.ndarray | None, frame: Frame, *, straight: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The image [H, W, 4] as a pinhole sees it, and its known pixels [H, W, 1] (None: all). `straight`: whether colours
    count where alpha is 0."""
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


def read_mask(path: Path) -> np.ndarray:
    """A mask [H, W, 1], uint8, uint16, or float32 in [0, 1], white where it is set. Raises InputError where the file cannot be
    read, is coloured, or holds labels of more than one object, or floats out of bounds.

    Where the alpha channel varies it is the mask; else the colours are, which must be grey, or of two palette entries in colour. Of
    two values the larger one is white and the other one black, whatever they are; of two entries that which is black or not white
    is black.
    """
    pixels = read_codes(path)
    if pixels.dtype.kind == "f" and not (pixels.min() >= 0 and pixels.max() <= 1):  # false for NaN
        raise InputError(f"{path}: has NaN, infinite or negative pixels or such above 1; save it as 8 or 16 bit PNG")
    alpha = pixels[..., -1:] if pixels.shape[2] in (2, 4) else None
    if alpha is not None and alpha.min() != alpha.max():
        mask = alpha
    elif (entries := _palette_entries(path)) is not None:
        mask = entries[..., None]
    elif pixels.shape[2] >= 3 and np.ptp(pixels[..., :3], axis=2).max() > GREY * pixels[..., :3].max():
        raise InputError(f"{path}: is coloured, which no mask is; save the object as white on black")
    else:
        mask = pixels[..., :1]
    if mask.dtype.kind == "f" or path.suffix.lower() in (".jpg", ".jpeg", ".webp"):  # whose values are not exact
        return mask
    values, most = np.flatnonzero(np.bincount(mask.ravel())), np.iinfo(mask.dtype).max
    if len(values) == 2:
        return np.where(mask == values[1], most, 0).astype(mask.dtype)
    if 2 < len(values) <= MOST_LABELS and (values[-1] < MOST_LABELS or _share_between(mask) > LABELLED):
        raise InputError(f"{path}: holds the labels {', '.join(map(str, values))}; save the object's in white on black")
    return mask if values[0] == 0 or len(values) > 2 else np.full_like(mask, most)


def _share_between(mask: np.ndarray) -> float:
    """The share of a mask in areas of one value between the least and the largest; soft edges are lines, and none."""
    flat = maximum_filter(mask, (3, 3, 1)) == minimum_filter(mask, (3, 3, 1))
    return float((flat & (mask > mask.min()) & (mask < mask.max())).mean())


def _palette_entries(path: Path) -> np.ndarray | None:
    """[H, W] the numbers of the entries of a PNG file's palette; None where it has none, or those in use are grey: programs that
    make files small order black and white as they like."""
    with open(path, "rb") as file:
        if file.read(26)[25:26] != b"\3":  # the colour type, in the header of a PNG
            return None
    with Image.open(path) as image:
        entries, colours = np.asarray(image), np.asarray(image.getpalette("RGB")).reshape(-1, 3)
        used = colours[values := np.flatnonzero(np.bincount(entries.ravel()))]
        if len(used) == 2 and ((black := ~used.any(axis=1)) | (white := (used == 255).all(axis=1))).any():
            return (entries == values[np.argmax(~black if black.any() else white)]).astype(np.uint8)
        return None if (used == used[:, :1]).all() else entries


class Loader:
    """The photos of some frames. All sizes are known, and all is estimated, before the first pixel is read. Raises InputError where
    a file cannot be used, or neither memory nor disk can hold the photos.

    Args:
        reading: How the frames are read; its `max_memory` counts the photos that are in memory already.
        keep: Whether pixels are kept; else only what :meth:`load` returns.

    Attributes:
        sizes: [n, 2] height and width of the photos as they are kept, in the upper left corner of an array for the
            tallest and the widest.
        exposures: [n] float64, the factors of the photos' linear values, as they are kept.
    """

    def __init__(self, root: Path, frames: Sequence[Frame], downscale: int, reading: Reading, keep: bool = True):
        self.root, self.frames, self.downscale, self.separated = root, frames, downscale, reading.separated
        sizes, exact = check_files(frames, downscale)
        height, width = sizes[sizes.prod(axis=1).argmax()].tolist()  # of the largest
        self.sizes = sizes // downscale
        shape = (len(frames), *self.sizes.max(axis=0).tolist())
        kind, bent = np.dtype(np.uint8 if exact else np.uint16), any(frame.distortion is not None for frame in frames)
        masks = any(f.dynamic_mask_path or (f.mask_path and f.mask_kind != "object") for f in frames)
        hides = bent or masks or bool((self.sizes != shape[1:]).any())
        floats = bent or any(f.gamma != 0 or f.image_path.suffix.lower() in HDR_SUFFIXES for f in frames)
        work = height * width * (WORK_BENT if floats else WORK)
        size = keep * int(np.prod(shape)) * (4 * kind.itemsize + hides)
        available = memory_for_photos(reading.max_memory)
        in_file = size + work > available
        whole = max(available, int(reading.max_memory * GB))  # with what the photos of another split take
        available -= 0 if in_file else size
        if work > whole:
            raise InputError(
                f"{root}: one photo of {width}x{height} takes {work / GB:.2g} GB while it is read, more than the "
                f"{whole / GB:.2g} GB for photos; make the photos smaller, or give a larger --max-memory"
            )
        if in_file and keep:
            note_once(
                f"{root}: {len(frames)} photos take {size / GB:.2g} GB, more than the {max(available, 0) / GB:.2g} GB of memory left "
                f"for photos (--max-memory): they are read from a file in {folder_of_files()}"
            )
        self.threads = max(1, min(THREADS, os.cpu_count() or 1, available // work))
        self.codes = new_array((*shape, 4), kind, in_file) if keep else None
        self._known = new_array(shape, np.dtype(bool), in_file) if keep and hides else None
        self.known: np.ndarray | None = None
        self.exposures = np.array([frame.exposure for frame in frames])

    def load(self, mask_kind: str) -> list[Photo]:
        """Reads the photos, whose pixels it keeps, and returns them without pixels; `mask_kind` as for
        :func:`load_photo`."""
        with ThreadPoolExecutor(max_workers=self.threads) as pool:
            photos = list(pool.map(lambda i: self._load(i, mask_kind), range(len(self.frames))))
        self.exposures = np.array([frame.exposure * photo.scale for frame, photo in zip(self.frames, photos)])
        smaller = bool((self.sizes != self.sizes.max(axis=0)).any())
        self.known = self._known if smaller or any(photo.seen is not None for photo in photos) else None
        return photos

    def _load(self, i: int, mask_kind: str) -> Photo:
        frame, found = self.frames[i], self.separated
        found = None if found is None else found / separated_mask(frame.image_path, self.root)
        photo = load_photo(frame, self.downscale, mask_kind, found)
        height, width = self.sizes[i]
        if self.codes is not None:
            self.codes[i, :height, :width] = encoded(photo.rgba, self.codes.dtype)
            forget_pages(self.codes)
        if self._known is not None:
            self._known[i, :height, :width] = True if photo.known is None else photo.known
        return replace(photo, rgba=None, known=None)
