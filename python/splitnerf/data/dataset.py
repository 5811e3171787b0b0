"""Posed images of one object in the frame that training uses; the layouts are :mod:`splitnerf.data.frames`'s."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from splitnerf.data.environment import read_surroundings
from splitnerf.data.frames import Frame, lens_intrinsics, read_frames
from splitnerf.data.images import LDR_SUFFIXES, area_average, downscale_rgba, linear_to_srgb, read_image, srgb_to_linear
from splitnerf.data.normalisation import estimate_box, transform_points
from splitnerf.errors import InputError

SURROUNDINGS = "surroundings.exr"
HULL_VIEWS = 40
SILHOUETTE_SIZE = 100


@dataclass
class Dataset:
    """One split of a posed image set, poses in the internal frame where the object fits the box [-1.5, 1.5]^3.

    Attributes:
        name: The folder's name.
        root: The folder.
        split: "train" or "test".
        downscale: Integer factor by which the images were averaged down.
        images: [n, H, W, 4] float32, sRGB, straight alpha; brought to one exposure, at which colours are in [0, 1] but for
            those of photos that were exposed less.
        poses: [n, 4, 4] float32 camera-to-world, OpenGL axes, internal frame.
        intrinsics: [n, 4] float32, (fx, fy, cx, cy) in pixels of the downscaled images; pixel centres at +0.5.
        frame_names: Names of the images' files without extension, or of the view folders.
        image_paths: The image files.
        box_from_world: [4, 4] float64, uniform scale and translation from the data's world to the internal frame.
        exposures: [n] float64, the factors by which the images' linear values were divided; None stands for 1.
        surroundings: [h, 2 h, 4] float32, equirectangular: linear radiance that the photos see around the object, and how
            well it was seen, in [0, 1]; None where the data have no such map.
    """

    name: str
    root: Path
    split: str
    downscale: int
    images: np.ndarray
    poses: np.ndarray
    intrinsics: np.ndarray
    frame_names: list[str]
    image_paths: list[Path]
    box_from_world: np.ndarray
    exposures: np.ndarray | None = None
    surroundings: np.ndarray | None = None

    def __post_init__(self) -> None:
        self.exposures = np.ones(len(self.images)) if self.exposures is None else self.exposures

    def __len__(self) -> int:
        return len(self.images)

    @property
    def height(self) -> int:
        return self.images.shape[1]

    @property
    def width(self) -> int:
        return self.images.shape[2]

    @property
    def world_from_box(self) -> np.ndarray:
        """[4, 4] float64, the inverse of `box_from_world`."""
        return np.linalg.inv(self.box_from_world)

    def transform_to_world(self, points: np.ndarray) -> np.ndarray:
        """Carries points [..., 3] from the internal frame to the data's world frame; directions need no change."""
        return transform_points(self.world_from_box, points)

    @property
    def world_poses(self) -> np.ndarray:
        """[n, 4, 4] float64 camera-to-world, OpenGL axes, in the data's world frame."""
        poses = self.poses.astype(np.float64)
        poses[:, :3, 3] = self.transform_to_world(poses[:, :3, 3])
        return poses

    def select(self, views: Sequence[int]) -> Dataset:
        """The split reduced to these views, in this order."""
        views = list(views)
        return replace(
            self,
            images=self.images[views],
            poses=self.poses[views],
            intrinsics=self.intrinsics[views],
            exposures=self.exposures[views],
            frame_names=[self.frame_names[i] for i in views],
            image_paths=[self.image_paths[i] for i in views],
        )


@dataclass
class _Image:
    """One image: [H, W, 4] downscaled, its mask at a size that no downscale changes, and the file's (height, width)."""

    rgba: np.ndarray
    silhouette: np.ndarray
    size: tuple[int, int]


def load_dataset(root: str | os.PathLike, split: str = "train", downscale: int = 1) -> Dataset:
    """Loads one split of a posed image set.

    The normalisation is always estimated from the train split, so that train and test share a frame.

    Args:
        root: Folder of any layout.
        split: "train" or "test".
        downscale: Integer factor >= 1, averaged in premultiplied linear light.

    Returns:
        The split as a `Dataset`.

    Raises:
        InputError: The folder, its json, an image, a mask or a pose cannot be used.
    """
    root = Path(root)
    if split not in ("train", "test"):
        raise InputError(f"{root}: no split '{split}'; use train or test")
    if downscale < 1 or int(downscale) != downscale:
        raise InputError(f"{root}: downscale must be a whole number of at least 1, got {downscale}")
    if not root.is_dir():
        raise InputError(f"{root}: no such folder; give the folder that holds transforms_train.json or transforms.json")
    frames = read_frames(root, split)
    loaded = _load_images(frames, int(downscale))
    if split == "train":
        hull_frames, hull_images = spread(frames, HULL_VIEWS), spread(loaded, HULL_VIEWS)
    else:
        hull_frames = spread(read_frames(root, "train"), HULL_VIEWS)
        hull_images = _load_images(hull_frames, int(downscale))
    box_from_world = _estimate_box(root, hull_frames, hull_images)

    intrinsics = np.stack([lens_intrinsics(frame.lens, image.size) for frame, image in zip(frames, loaded)]) / downscale
    poses = np.stack([frame.pose for frame in frames])
    poses[:, :3, 3] = poses[:, :3, 3] @ box_from_world[:3, :3].T + box_from_world[:3, 3]
    return Dataset(
        name=root.resolve().name,
        root=root,
        split=split,
        downscale=int(downscale),
        images=np.stack([image.rgba for image in loaded]),
        poses=poses.astype(np.float32),
        intrinsics=intrinsics.astype(np.float32),
        frame_names=[frame.name for frame in frames],
        image_paths=[frame.image_path for frame in frames],
        box_from_world=box_from_world,
        exposures=np.array([frame.exposure for frame in frames]),
        surroundings=read_surroundings(root / SURROUNDINGS) if (root / SURROUNDINGS).is_file() else None,
    )


def dataset_fingerprint(dataset: Dataset) -> str:
    """Hashes names, poses, sizes and mean colours, so that a run is not resumed on another scene.

    Args:
        dataset: A loaded split.

    Returns:
        16 hexadecimal digits, which depend on the folder's content, split and downscale but not on its path.
    """
    digest = hashlib.sha256()
    digest.update(json.dumps([dataset.split, dataset.frame_names, list(dataset.images.shape)]).encode())
    for values in (dataset.poses, dataset.intrinsics, dataset.images.mean(axis=(1, 2))):
        digest.update((np.round(values.astype(np.float64), 3) + 0.0).tobytes())
    return digest.hexdigest()[:16]


def spread(items: Sequence, count: int) -> list:
    """At most `count` of the items, evenly spread."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, count).round().astype(int))]


def _estimate_box(root: Path, frames: list[Frame], images: list[_Image]) -> np.ndarray:
    height, width = images[0].size
    factor = _silhouette_factor(height, width)
    try:
        return estimate_box(
            np.stack([image.silhouette for image in images]),
            np.stack([frame.pose for frame in frames]),
            np.stack([lens_intrinsics(frame.lens, image.size) for frame, image in zip(frames, images)]) / factor,
        )
    except ValueError as error:
        raise InputError(f"{root}: {error}") from None


def _silhouette_factor(height: int, width: int) -> int:
    return max(1, min(height, width) // SILHOUETTE_SIZE)


def _load_images(frames: list[Frame], downscale: int) -> list[_Image]:
    with ThreadPoolExecutor(max_workers=min(8, os.cpu_count() or 1)) as pool:
        loaded = list(pool.map(lambda frame: _load_image(frame, downscale), frames))
    size = loaded[0].size
    for frame, image in zip(frames, loaded):
        if image.size != size:
            raise InputError(
                f"{frame.image_path}: is {image.size[1]}x{image.size[0]}, but {frames[0].image_path.name} is "
                f"{size[1]}x{size[0]}; make all images the same size"
            )
    folder = frames[0].image_path.parent
    if not any(image.silhouette.any() for image in loaded):
        raise InputError(f"{folder}: every mask is empty, no pixel is foreground; check alpha or mask_path")
    if all(image.silhouette.all() for image in loaded):
        raise InputError(f"{folder}: every mask is full, no pixel is background; check alpha or mask_path")
    return loaded


def _check_pixels(pixels: np.ndarray, path: Path) -> None:
    """Raises InputError where a photo or mask, which may be a file of floats by another name, leaves [0, 1]."""
    if not (pixels.min() >= 0 and pixels.max() <= 1):  # false for NaN
        raise InputError(f"{path}: has NaN, infinite or negative pixels or such above 1; save it as 8 or 16 bit PNG")


def _load_image(frame: Frame, downscale: int) -> _Image:
    path = frame.image_path
    if path.suffix.lower() not in LDR_SUFFIXES:
        raise InputError(f"{path}: training images must be PNG or JPEG; convert it")
    pixels = read_image(path)
    height, width, channels = pixels.shape
    _check_pixels(pixels, path)
    if downscale > min(height, width):
        raise InputError(f"{path}: is {width}x{height}, too small for downscale {downscale}; use a smaller factor")
    colour = pixels[..., :3] if channels >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    if frame.mask_path is not None:
        mask = read_image(frame.mask_path)
        _check_pixels(mask, frame.mask_path)
        if mask.shape[:2] != (height, width):
            raise InputError(
                f"{frame.mask_path}: is {mask.shape[1]}x{mask.shape[0]}, its image {path.name} is {width}x{height}; "
                "make them the same size"
            )
        alpha = mask[..., :1]
    elif channels in (2, 4):
        alpha = pixels[..., -1:]
    else:
        raise InputError(f"{path}: has no alpha channel and its frame no mask_path; save it with alpha or add a mask")
    if frame.exposure != 1.0:
        colour = linear_to_srgb(srgb_to_linear(colour) / np.float32(frame.exposure))
    rgba = downscale_rgba(np.concatenate([colour, alpha], axis=-1), downscale)
    silhouette = area_average(alpha[..., 0], _silhouette_factor(height, width)) > 0.5
    return _Image(rgba, silhouette, (height, width))
