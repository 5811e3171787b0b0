"""Posed images of one object in the frame that training uses; the layouts are :mod:`splitnerf.data.frames`'s."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import interpolate

from splitnerf.data.environment import read_surroundings
from splitnerf.data.frames import read_frames
from splitnerf.data.images import area_average, read_image
from splitnerf.data.json_files import read_json, write_json
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics
from splitnerf.data.normalisation import (
    LOOKS_AWAY,
    MasksContradict,
    box_of_views,
    estimate_box,
    looks_away,
    transform_points,
)
from splitnerf.data.photos import CERTAIN, Loader, Photo, separated_mask, silhouette_factor
from splitnerf.data.pixels import Photos, averaged_codes, forget_pages, memory_for_photos, new_array
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError, note_once
from splitnerf.progress import tracked

SURROUNDINGS = "surroundings.exr"
GROUND = "ground.json"
BEHIND = "behind"  # the folder of what is behind the object, in that of separated data
CLIPPED = 250 / 255  # sRGB from which on a background may be brighter than the photo says
EXPOSURES = "exposures.json"  # in a run: the exposures of photos that it learned
JPEG = (".jpg", ".jpeg")
HULL_VIEWS = 40
MEAN_EDGE = 1000  # pixels along the shorter edge of a photo from which a fingerprint takes every other one, or fewer
Average = Callable[[np.ndarray, int, "np.ndarray | None"], np.ndarray]  # see `Dataset.averaged`
NEARLY_ALL, NEARLY_ALL_EDGE = 0.6, 0.5  # medians of what a mask keeps, and of the image's edge, if it is no object's


@dataclass
class Dataset:
    """One split of a posed image set, poses in the internal frame where the object fits the box [-1.5, 1.5]^3.

    Attributes:
        split: "train" or "test".
        downscale: Integer factor by which the images were averaged down.
        images: [n, H, W, 4] float32, sRGB, straight alpha; brought to one exposure, at which colours are in [0, 1] but for
            those of photos that were exposed less. Kept as bytes, see :class:`Photos`; an array may be given.
        poses: [n, 4, 4] float32 camera-to-world, OpenGL axes, internal frame.
        intrinsics: [n, 4] float32, (fx, fy, cx, cy) in pixels of the downscaled images; pixel centres at +0.5.
        frame_names: Names of the images' files without extension, or of the view folders.
        box_from_world: [4, 4] float64, uniform scale and translation from the data's world to the internal frame.
        known: [n, H, W] bool, the pixels that say something: not what a mask ignores, not what an undistorted photo
            does not cover, and not what lies beside a photo that is smaller than others; the others are 0 in `images`. None
            where all are known.
        sizes: [n, 2] int, height and width of the photos, each in the upper left corner of its H x W pixels; None stands for
            H and W.
        origin: [3] float64, the point of the data's files that is the origin of the data's world here; 0 but where the
            files' origin is too far away for float32.
        exposures: [n] or [n, 3] float64, the factors by which the images' linear values were divided; None stands for 1.
        stated: [n] float64, the exposures that the data state; None stands for 1. Those of files of floats are kept at another
            one of `exposures`.
        surroundings: [h, 2 h, 4] float32, equirectangular: linear radiance that the photos see around the object, and how
            well it was seen, in [0, 1]; None where the data have no such map.
        ground: [4] float64, the unit normal of a plane and its product with the plane's points, in the data's world: nothing of
            the object lies below it; None where the data have no such plane.
        light_turns: [n, 3, 3] float32, the rotations that carry directions of the internal frame to those in which the light
            stands still; None where it stands still in the internal frame. On a turntable each photo has its own.
        behind_paths: The files of :meth:`behind`, or None for photos without.
        masked: Whether alpha says where the object is; otherwise it is 1.
        whole: Whether the colours are those of the whole photos, also where alpha is less than 1.
    """

    name: str
    root: Path
    split: str
    downscale: int
    images: Photos
    poses: np.ndarray
    intrinsics: np.ndarray
    frame_names: list[str]
    image_paths: list[Path]
    box_from_world: np.ndarray
    known: np.ndarray | None = None
    sizes: np.ndarray | None = None
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    exposures: np.ndarray | None = None
    stated: np.ndarray | None = None
    surroundings: np.ndarray | None = None
    ground: np.ndarray | None = None
    light_turns: np.ndarray | None = None
    behind_paths: list[Path | None] | None = None
    masked: bool = True
    whole: bool = False

    def __post_init__(self) -> None:
        self.images = self.images if isinstance(self.images, Photos) else Photos(self.images)
        n, size = len(self.images), self.images.shape[1:3]
        self.sizes = np.tile(size, (n, 1)) if self.sizes is None else self.sizes
        self.exposures, self.stated = (np.ones(n) if x is None else x for x in (self.exposures, self.stated))
        self.behind_paths = [None] * n if self.behind_paths is None else self.behind_paths

    def __len__(self) -> int:
        return len(self.images)

    @property
    def height(self) -> int:
        """H, the height of the tallest photo."""
        return self.images.shape[1]

    @property
    def width(self) -> int:
        """W, the width of the widest photo."""
        return self.images.shape[2]

    def cropped(self, view: int, picture: np.ndarray) -> np.ndarray:
        """The part of a picture [H, W, ...] that a photo covers."""
        height, width = self.sizes[view]
        return picture[:height, :width]

    def padded(self, picture: np.ndarray) -> np.ndarray:
        """A picture [h, w, ...] of a photo's size as [H, W, ...], 0 beside it."""
        beside = [(0, self.height - picture.shape[0]), (0, self.width - picture.shape[1])]
        return np.pad(picture, beside + [(0, 0)] * (picture.ndim - 2)) if np.any(beside) else picture

    def behind(self, view: int) -> np.ndarray | None:
        """[H, W, 4] float32, what a photo would show without the object: sRGB at the photo's own exposure, and 1 where that is
        known and not clipped, along the mask's edges, else 0; None where the data do not say. Raises InputError where the file
        cannot be read."""
        path, (height, width) = self.behind_paths[view], self.sizes[view].tolist()
        if path is None:
            return None
        image = read_image(path)
        image[..., :3] *= image[..., 3:]
        planes = torch.from_numpy(image).permute(2, 0, 1)[None]
        planes = interpolate(planes, (height, width), mode="bilinear", antialias=True, align_corners=False)[0]
        image = planes.permute(1, 2, 0).numpy()
        known = (image[..., 3:] > CERTAIN) & (image[..., :3].max(-1, keepdims=True) < CLIPPED)
        return self.padded(np.where(known, np.concatenate([image[..., :3], known], axis=-1), np.float32(0)))

    @property
    def world_from_box(self) -> np.ndarray:
        """[4, 4] float64, the inverse of `box_from_world`."""
        return np.linalg.inv(self.box_from_world)

    @property
    def world_poses(self) -> np.ndarray:
        """[n, 4, 4] float64 camera-to-world, OpenGL axes, in the data's world frame."""
        poses = self.poses.astype(np.float64)
        poses[:, :3, 3] = transform_points(self.world_from_box, poses[:, :3, 3])
        return poses

    @property
    def photographed(self) -> bool:
        """Whether the images look as cameras write them: JPEG, or with exposures."""
        return bool((self.stated != 1).any()) or any(path.suffix.lower() in JPEG for path in self.image_paths)

    def exposed(self, exposures: np.ndarray) -> Dataset:
        """The split with other exposures [n] or [n, 3]."""
        return replace(self, images=Photos(self.images.codes, exposures), exposures=exposures)

    def in_box(self, box_from_world: np.ndarray) -> Dataset:
        """The split in another internal frame, such as that of a run; `box_from_world` is as in `Dataset`."""
        if np.array_equal(box_from_world, self.box_from_world):
            return self
        poses = self.world_poses
        poses[:, :3, 3] = transform_points(box_from_world, poses[:, :3, 3])
        return replace(self, poses=poses.astype(np.float32), box_from_world=box_from_world)

    def averaged(self, factor: int, max_memory: float, average: Average | None = None) -> Dataset:
        """The split with photos averaged down by a whole factor, in 16 bits.

        Args:
            factor: At least 2, at most the smallest photo's shorter edge.
            max_memory: GB for all photos, see :func:`splitnerf.data.pixels.memory_for_photos`; what needs more goes to a file.
            average: Takes a photo's codes [H, W, 4], the factor, and the known pixels [h, w] of the average (None: all); gives
                the average [h, w, 4] uint16, with whole colours, see the attribute. By default averages are those of `downscale`.
        """
        shape = (len(self), self.height // factor, self.width // factor)
        in_file = 2 * 4 * int(np.prod(shape)) > memory_for_photos(max_memory)
        codes, known = new_array((*shape, 4), np.dtype(np.uint16), in_file), None
        if self.known is not None:
            known = np.stack([area_average(one.astype(np.float32), factor) > CERTAIN for one in self.known])
        for i in tracked(range(len(self)), "averages, photo"):
            photo = self.images.codes[i]
            known_here = None if known is None else known[i]
            self.images.ask_for(i)
            codes[i] = averaged_codes(photo, factor) if average is None else average(photo, factor, known_here)
            if known_here is not None:
                codes[i][~known_here] = 0
            forget_pages(self.images.codes)
            forget_pages(codes)
        return replace(
            self,
            downscale=self.downscale * factor,
            images=Photos(codes, self.images.exposures),
            intrinsics=self.intrinsics / np.float32(factor),
            known=known,
            sizes=self.sizes // factor,
            whole=average is not None,
        )

    def select(self, views: Sequence[int]) -> Dataset:
        """The split reduced to these views, in this order."""
        views = list(views)
        if views == list(range(len(self))):
            return self
        arrays = ("known", "sizes", "light_turns", "poses", "intrinsics", "exposures", "stated")
        chosen = {name: x if (x := getattr(self, name)) is None else x[views] for name in arrays}
        for name in ("frame_names", "image_paths", "behind_paths"):
            chosen[name] = [getattr(self, name)[i] for i in views]
        return replace(self, images=self.images.select(views), **chosen)


def load_dataset(
    root: str | os.PathLike,
    split: str = "train",
    downscale: int = 1,
    reading: Reading = Reading(),
    *,
    masked: bool = True,
) -> Dataset:
    """Loads one split, "train" or "test", of a posed image set in a folder of any layout. Raises InputError where the folder, its
    files, an image, a mask or a pose cannot be used.

    The normalisation is always estimated from the train split, so that train and test share a frame.

    Args:
        downscale: Integer factor >= 1, averaged in premultiplied linear light.
        masked: Whether photos without masks are refused. Without masks the frame is that of what all cameras look at.
    """
    root = Path(root)
    if split not in ("train", "test"):
        raise InputError(f"{root}: no split '{split}'; use train or test")
    if downscale < 1 or int(downscale) != downscale:
        raise InputError(f"{root}: downscale must be a whole number of at least 1, got {downscale}")
    downscale = int(downscale)
    frames, origin = read_frames(root, split, reading)
    _check_once(frames)
    if split == "train":
        loader = Loader(root, frames, downscale, reading)
        photos, box_from_world, _ = _load_train(root, loader, reading)
    else:
        train = spread(read_frames(root, "train", reading)[0], HULL_VIEWS)
        masks = Loader(root, train, downscale, reading, keep=False)
        train_photos, box_from_world, mask_kind = _load_train(root, masks, reading)
        loader = Loader(root, frames, downscale, reading)
        photos = loader.load(mask_kind)
        if _has_masks(train_photos):
            _check_masks(frames, photos)
    if masked and not _has_masks(photos):
        raise InputError(
            f"{frames[0].image_path.parent}: nothing says where the object is (an alpha channel or mask_path); add masks, "
            "or let `splitnerf train` find them"
        )

    intrinsics = np.stack([lens_intrinsics(frame.lens, photo.size) for frame, photo in zip(frames, photos)]) / downscale
    poses = np.stack([frame.pose for frame in frames])
    poses[:, :3, 3] = poses[:, :3, 3] @ box_from_world[:3, :3].T + box_from_world[:3, 3]
    whole, behind_paths = all(photo.whole for photo in photos), [_behind_path(frame, root, reading) for frame in frames]
    if any(frame.behind_path for frame in frames) and not whole:
        note_once(f"{root}: 'behind_path' is not used: the photos have their own alpha, or --downscale averages them")
    return Dataset(
        name=root.resolve().name,
        root=root,
        split=split,
        downscale=downscale,
        images=Photos(loader.codes, loader.exposures),
        poses=poses.astype(np.float32),
        intrinsics=intrinsics.astype(np.float32),
        frame_names=[frame.name for frame in frames],
        image_paths=[frame.image_path for frame in frames],
        box_from_world=box_from_world,
        known=loader.known,
        sizes=loader.sizes,
        origin=origin,
        exposures=loader.exposures,
        stated=np.array([frame.exposure for frame in frames]),
        surroundings=read_surroundings(path) if (path := _found(SURROUNDINGS, root, reading)) else None,
        ground=_read_ground(path, origin * (path.parent == root)) if (path := _found(GROUND, root, reading)) else None,
        light_turns=_light_turns(frames),
        behind_paths=behind_paths,
        masked=_has_masks(photos),
        whole=whole,
    )


def _found(name: str, root: Path, reading: Reading) -> Path | None:
    """A file of what is around the object: the data's own, else that of what training separated; None without both."""
    folders = [root] if reading.separated is None else [root, reading.separated]
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


def write_ground(folder: Path, plane: np.ndarray) -> None:
    """Writes the plane [4] on which the object stands, see :class:`Dataset`."""
    write_json(folder / GROUND, {"normal": plane[:3].tolist(), "offset": float(plane[3])})


def _read_ground(path: Path, origin: np.ndarray) -> np.ndarray:
    """The plane of a file, seen from an origin [3]. Raises InputError where it is none."""
    content = read_json(path, "normal")
    try:
        normal, offset = np.array(content["normal"], np.float64), float(content["offset"])
    except (KeyError, TypeError, ValueError, OverflowError):
        normal, offset = np.zeros(3), np.nan
    if normal.shape != (3,) or not abs(np.linalg.norm(normal) - 1) < 1e-3 or not np.isfinite(offset):
        raise InputError(
            f"{path}: is no plane: 'normal' of three numbers, of length 1, and 'offset'; repair or delete it"
        )
    return np.append(normal, offset - normal @ origin)


def _behind_path(frame: Frame, root: Path, reading: Reading) -> Path | None:
    """The file with what is behind the object: the data's own, else what training separated."""
    if frame.behind_path is not None or reading.separated is None:
        return frame.behind_path
    path = reading.separated / BEHIND / separated_mask(frame.image_path, root)
    return path if path.is_file() else None


def _light_turns(frames: list[Frame]) -> np.ndarray | None:
    """The rotations of the photos' lights; those that state none have the identity."""
    if all(frame.light_turn is None for frame in frames):
        return None
    turns = [np.eye(3) if frame.light_turn is None else frame.light_turn for frame in frames]
    return np.stack(turns).astype(np.float32)


def dataset_fingerprint(dataset: Dataset) -> str:
    """Hashes names, poses, sizes and mean colours, so that a run is not resumed on another scene: 16 hexadecimal
    digits, which depend on the folder's content, split and downscale but not on its path."""
    digest = hashlib.sha256()
    digest.update(json.dumps([dataset.split, dataset.frame_names, list(dataset.images.shape)]).encode())
    shares = [] if dataset.known is None else [dataset.known.mean(axis=(1, 2))]
    shares += [x for x in (dataset.light_turns, dataset.ground) if x is not None]
    step = max(1, min(dataset.height, dataset.width) // MEAN_EDGE)
    means = np.stack([dataset.images[i, ::step, ::step].mean(axis=(0, 1)) for i in range(len(dataset))])
    for values in (dataset.poses, dataset.intrinsics, means, *shares):
        digest.update((np.round(values.astype(np.float64), 3) + 0.0).tobytes())
    return digest.hexdigest()[:16]


def write_exposures(run: Path, dataset: Dataset) -> None:
    """Writes the exposures of a split."""
    meaning = "factors of each photo's linear red, green and blue, with the geometric mean of those that the data state"
    factors = dict(zip(_names(dataset), np.round(dataset.exposures, 6).tolist()))
    write_json(run / EXPOSURES, {"meaning": meaning, "exposures": factors})


def _names(dataset: Dataset) -> list[str]:
    """The images' paths in the data's folder."""
    return [os.path.relpath(path, dataset.root) for path in dataset.image_paths]


def with_exposures(dataset: Dataset, run: Path) -> Dataset:
    """A split with the exposures that a run learned; as it is where it learned none. Raises InputError where the file
    is damaged, or is of other photos."""
    path = run / EXPOSURES
    if not path.is_file():
        return dataset
    stored = read_json(path, "exposures")["exposures"]
    try:
        factors = np.array([stored[name] for name in _names(dataset)], np.float64)
    except (KeyError, TypeError, ValueError):
        factors = np.zeros(0)
    if factors.shape != (len(dataset), 3) or not (np.isfinite(factors) & (factors > 0)).all():
        raise InputError(f"{path}: is not of these photos; delete it to take the exposures that the data state")
    return dataset.exposed(factors)


def spread(items: Sequence, count: int) -> list:
    """At most `count` of the items, evenly spread."""
    chosen = np.unique(np.linspace(0, len(items) - 1, count).round().astype(int)) if len(items) else []
    return [items[i] for i in chosen]


class _Contradiction(InputError):
    """Masks of the object that cannot be of one object, seen from these poses."""


def _load_train(root: Path, loader: Loader, reading: Reading) -> tuple[list[Photo], np.ndarray, str]:
    """The photos of the train split, or of a part of it, the similarity to the internal frame, and what masks of open meaning are:
    the object's, unless the user says otherwise, they keep nearly all of the photos, or they contradict the poses."""
    frames, kind = loader.frames, "ignore" if reading.mask_kind == "ignore" else "object"
    photos = loader.load(kind)
    masked = _has_masks(photos)
    pairs = zip(spread(frames, HULL_VIEWS), spread(photos, HULL_VIEWS))
    masks = [_kept(photo) for frame, photo in pairs if frame.mask_path is not None and frame.mask_kind == "auto"]
    if reading.mask_kind != "auto" or not (masks and masked):
        return photos, _estimate_box(root, frames, photos, masked), kind
    kept, edge = np.median(masks, axis=0)
    ignoring = (
        f"{root}: its mask files are taken to ignore what is black, as {{}}; --mask-kind object if white is the object"
    )
    if kept > NEARLY_ALL and edge > NEARLY_ALL_EDGE:
        note_once(ignoring.format(f"they keep {kept:.0%} of the photos"))
        photos = loader.load("ignore")
        return photos, _estimate_box(root, frames, photos), "ignore"
    try:
        box_from_world = _estimate_box(root, frames, photos)
    except _Contradiction as error:
        try:
            photos = loader.load("ignore")
            box_from_world = _estimate_box(root, frames, photos)
        except InputError:
            raise error from None
        note_once(ignoring.format("masks of the object would contradict the poses"))
        return photos, box_from_world, "ignore"
    what = f"taken for the object's, which covers {kept:.0%} of the photos"
    note_once(f"{root}: its mask files are {what}; --mask-kind ignore if black is only to be ignored")
    return photos, box_from_world, "object"


def _estimate_box(root: Path, frames: list[Frame], photos: list[Photo], masked: bool = True) -> np.ndarray:
    """The similarity to the internal frame from a part of the train split: by masks or, without, by what all cameras look at."""
    if masked:
        _check_masks(frames, photos)
        frames, photos = spread(frames, HULL_VIEWS), spread(photos, HULL_VIEWS)
    poses = np.stack([frame.pose for frame in frames])
    intrinsics = np.stack([lens_intrinsics(frame.lens, photo.size) for frame, photo in zip(frames, photos)])
    try:
        if not masked:
            return box_of_views(poses, intrinsics, np.array([photo.size for photo in photos]))
        intrinsics /= [[silhouette_factor(*photo.size)] for photo in photos]
        return estimate_box([photo.silhouette for photo in photos], poses, intrinsics, [photo.seen for photo in photos])
    except MasksContradict as error:
        names = [frames[i].image_path.name for i in error.views]
        where = f" (those of {', '.join(names[:5])} and the others)" if names else ""
        cure = LOOKS_AWAY if looks_away(poses) else "check the poses and masks"
        raise _Contradiction(f"{root}: {error}{where}; {cure}") from None
    except ValueError as error:
        raise InputError(f"{root}: {error}") from None


def _has_masks(photos: list[Photo]) -> bool:
    """Whether photos say where the object is; a mask that is full everywhere says nothing."""
    full = ((photo.silhouette if photo.seen is None else photo.silhouette | ~photo.seen).all() for photo in photos)
    return any(photo.masked for photo in photos) and not all(full)


def _kept(photo: Photo) -> tuple[float, float]:
    """The shares of the silhouette and of its edge that are white."""
    s = photo.silhouette
    return float(s.mean()), float(np.concatenate([s[0], s[-1], s[:, 0], s[:, -1]]).mean())


def _check_once(frames: list[Frame]) -> None:
    """Raises InputError where two frames have the same image."""
    seen = set()
    for frame in frames:
        path = os.path.normpath(frame.image_path)
        if path in seen:
            raise InputError(f"{frame.image_path}: two frames have this image; remove one of them")
        seen.add(path)


def _check_masks(frames: list[Frame], photos: list[Photo]) -> None:
    """Raises InputError where a photo has no mask though others have one, or no mask shows an object; notes where one shows none."""
    for frame, photo in zip(frames, photos):
        if not photo.masked:
            has, cure = "no mask_path, as others have", "add a mask or remove it"
            if frame.mask_path is not None:
                has = "a mask that only says what to ignore (black)"
                cure = "invert it if black is the object, else add one of it"
            raise InputError(f"{frame.image_path}: has no alpha channel and its frame {has}; {cure}")
    folder, empty = frames[0].image_path.parent, [f for f, photo in zip(frames, photos) if not photo.silhouette.any()]
    if len(empty) == len(frames):
        raise InputError(f"{folder}: every mask is empty, no pixel is foreground; check alpha or mask_path")
    if empty:
        what = f"masks of {len(empty)} photos are empty; training takes the object to be nowhere in them"
        note_once(f"{folder}: {what}", empty[0].image_path.name)
