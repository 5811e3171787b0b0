"""Transforms files: NeRF-Blender, nerfstudio (Polycam, Metashape, Record3D and others through it) and instant-ngp.

Files:
    transforms_train.json, transforms_test.json   a file for each split (NeRF-Blender); without the second transforms_val.json
    transforms.json                               all frames; `train_filenames`, `test_filenames` or `val_filenames` may
                                                  list the splits

Keys, those of a frame before those of the file:
    frames[].file_path          the image, with or without suffix, relative to the file
    frames[].transform_matrix   4 x 4 camera-to-world, OpenGL axes
    frames[].mask_path          null or a mask
    frames[].behind_path        null or what the image would show without the object, with alpha where that is known
    mask_kind                   what the masks mean, "object" or "ignore"; without it :mod:`splitnerf.data.dataset` finds out
    frames[].light_rotation     3 x 3, from directions of the world to those in which the light stands still (a turntable)
    frames[].exposure           the factor of the image's linear values, 1 where it is missing
    gamma                       linear values are those of the image to this power, where the camera's curve is not sRGB's
    camera_angle_x, camera_angle_y, fl_x, fl_y, cx, cy, w, h   the pinhole; what is missing of one axis is that of the other
    camera_model or is_fisheye, k1 ... k4, p1, p2 the distortion, see :mod:`splitnerf.data.lens`

Beside an image NAME.png a file dynamic_mask_NAME.png is white where the image is to be ignored (instant-ngp).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Set
from pathlib import Path
from unicodedata import normalize

import numpy as np

from splitnerf.data.images import HDR_SUFFIXES, LDR_SUFFIXES
from splitnerf.data.json_files import is_number, need, read_json
from splitnerf.data.layouts.frame import RIGID_TOLERANCE, Frame, checked_pose, listed_file, listed_image
from splitnerf.data.lens import RADIAL, TANGENTIAL, Distortion, read_lens
from splitnerf.data.reading import MASK_KINDS
from splitnerf.errors import InputError, note_once, shown

SINGLE = "transforms.json"
SPLITS = {"train": ("train_filenames",), "test": ("test_filenames", "val_filenames")}
LISTS = [key for keys in SPLITS.values() for key in keys]
FOCAL = ("camera_angle_x", "camera_angle_y", "fl_x", "fl_y")
LENS = ("cx", "cy", "w", "h", "camera_model", "is_fisheye", *RADIAL, *TANGENTIAL)
SMALLEST_EXPOSURE = 1e-4
LARGEST_GAMMA = 5.0
# The first four: instant-ngp's; the others: of lenses with more coefficients, and of pixels that are skewed.
OTHER_LENSES = ("ftheta_p1", "latlong", "equirectangular", "rolling_shutter", "k5", "k6", "b1", "b2", "skew")
# Keys that are used, or say nothing of pictures or cameras.
OF_BOTH = {*FOCAL, *LENS, *OTHER_LENSES, "mask_kind", "gamma"}
OF_FILE = OF_BOTH | {"frames", *LISTS}
# The last three: a number of Blender's script, and two of instant-ngp's and nerfstudio's.
OF_FRAME = OF_BOTH | {
    *"file_path transform_matrix light_rotation mask_path behind_path exposure rotation sharpness colmap_im_id".split()
}


def present(root: Path) -> bool:
    """Whether a folder has a transforms file."""
    return any(path.is_file() for path in (root / SINGLE, *(_own(root, split) for split in SPLITS)))


def splits(root: Path) -> list[str] | None:
    """The splits that have a file of their own or a list in the single file; None for a single file without lists."""
    if own := _own_splits(root):
        return own
    meta, _ = read_entries(root / SINGLE)
    return [split for split in SPLITS if split == "train" or _held_out(meta, root)] if _has_lists(meta) else None


def read(root: Path, split: str | None) -> list[Frame]:
    """The frames of a split, or all, in the order of the files. Raises InputError where a file is missing or unusable,
    or a frame has no image, no usable pose or no lens."""
    if split is None:
        own = [_own(root, name) for name in _own_splits(root)]
        frames: dict[Path, Frame] = {}
        for path in own or [root / SINGLE]:
            for frame in _frames(path, None):
                if not np.allclose(
                    frames.setdefault(frame.image_path, frame).pose, frame.pose, RIGID_TOLERANCE, RIGID_TOLERANCE
                ):
                    raise InputError(f"{path}: has two poses of {frame.image_path.name}; remove one")
        return list(frames.values())
    own = _own(root, split)
    if not own.is_file() and not (root / SINGLE).is_file():
        raise InputError(f"{root}: has neither {own.name} nor {SINGLE}; add posed images for the {split} split")
    if split not in _own_splits(root) and (root / SINGLE).is_file():
        return _frames(root / SINGLE, split, _of_other_files(root, split))
    return _frames(own, split if split == "train" else None, _of_other_files(root, split))


def read_camera_path(path: Path) -> list[tuple[np.ndarray, dict]]:
    """The cameras of a transforms file whose images need not exist, in its order: the pose [4, 4] float64 and the
    pinhole, as in `Frame`. Notes what the file says besides. Raises InputError where the file has no frame, or one of them no
    usable pose or no lens."""
    meta, entries = read_entries(path)
    _name_unused(meta, entries, path)
    cameras = [_read_camera(entry, meta, i, path, f"frame {i}") for i, entry in enumerate(entries)]
    if any(distortion for *_, distortion in cameras):
        note_once(f"{path}: has lenses that distort; drawn as pinholes")
    return [camera[:2] for camera in cameras]


def _own(root: Path, split: str) -> Path:
    """The file of a split; that of validation where testing has none."""
    paths = [root / f"transforms_{name}.json" for name in ((split, "val") if split == "test" else (split,))]
    return next((path for path in paths if path.is_file()), paths[0])


def _own_splits(root: Path) -> list[str]:
    """The splits with a file of their own; one for testing without frames holds nothing out."""
    found = [split for split in SPLITS if _own(root, split).is_file()]
    return [split for split in found if split == "train" or read_json(_own(root, split), "frames").get("frames") != []]


def _has_lists(meta: dict) -> bool:
    """Whether a single file says which of its frames are of a split."""
    return any(meta.get(key) for key in LISTS)


def _listed(meta: dict, key: str, root: Path) -> set[str]:
    """The images that a list of a file names."""
    return {_image(name, root) for name in meta.get(key) or ()}


def _image(name: object, root: Path) -> str:
    """The image that a file lists, from the file's folder, however its path is written and without its suffix."""
    path = os.path.relpath(root / normalize("NFC", str(name).replace("\\", "/")), root)
    path, suffix = os.path.splitext(path)
    return path if suffix.lower() in LDR_SUFFIXES + HDR_SUFFIXES else path + suffix


def _of_other_files(root: Path, split: str) -> set[str]:
    """The images that the files of test and validation hold, which are none of the train split's."""
    files = [root / f"transforms_{name}.json" for name in ("test", "val")] if split == "train" else []
    found = [read_json(path, "frames").get("frames") for path in files if path.is_file()]
    entries = [entry for frames in found if isinstance(frames, list) for entry in frames if isinstance(entry, dict)]
    return {_image(entry.get("file_path"), root) for entry in entries}


def _held_out(meta: dict, root: Path) -> set[str]:
    """The images that a single file lists for testing, or else for validation."""
    return next((names for key in SPLITS["test"] if (names := _listed(meta, key, root))), set())


def _is_of(meta: dict, split: str, root: Path) -> Callable[[str], bool]:
    """Whether an image is of a split of a single file. What any list holds out is none of training; without a list of its own
    the train split is all that no list holds out."""
    if split == "test":
        return _held_out(meta, root).__contains__
    chosen = _listed(meta, "train_filenames", root)
    others = set().union(*(_listed(meta, key, root) for key in SPLITS["test"]))
    rest = chosen - others
    if chosen & others:
        what = "for testing" if rest else "for both: the scores of test views are those of photos trained on"
        note_once(f"images that transforms.json lists for training and for testing are {what}", min(chosen & others))
    return (rest or chosen).__contains__ if chosen else lambda name: name not in others


def _frames(path: Path, split: str | None, held_out: Set[str] = frozenset()) -> list[Frame]:
    """The frames of a file, or those of a split by its lists; without those that other files hold out, if that leaves any."""
    meta, entries = read_entries(path)
    _name_unused(meta, entries, path)
    names = [_image(entry.get("file_path"), path.parent) for entry in entries]
    chosen = (lambda name: True) if split is None or not _has_lists(meta) else _is_of(meta, split, path.parent)
    listed = set().union(*(_listed(meta, key, path.parent) for key in LISTS))
    if unknown := sorted(listed - {*names}):
        note_once(f"{path}: lists of the splits name {len(unknown)} images that no frame has", unknown[0])
    if split and meta.get("train_filenames") and (others := sorted({*names} - listed)):
        note_once(f"{path}: {len(others)} images are in no list of the splits, and not used", others[0])
    kept = [i for i, name in enumerate(names) if chosen(name)]
    if held_out & {names[i] for i in kept}:
        rest = [i for i in kept if names[i] not in held_out]
        what = "not trained on" if rest else "all there are: the scores of test views are those of photos trained on"
        note_once(f"{path.parent}: the images of {path.name} that a file holds out for testing are {what}")
        kept = rest or kept
    frames = [read_frame(entries[i], meta, i, path) for i in kept]
    if not frames:
        raise InputError(f"{path}: has no frames for the {split} split; add posed images")
    if any((path.parent / "masks").glob("*.png")) and not any(frame.mask_path for frame in frames):
        note_once(f"{path.parent / 'masks'}: no frame has a mask there; 'mask_path' of a frame would name it")
    return frames


def _name_unused(meta: dict, entries: list[dict], path: Path) -> None:
    """Notes which keys of a file say something that is not used."""
    unused = sorted(({*meta} - OF_FILE) | (set().union(*entries) - OF_FRAME))
    if unused:
        note_once(f"{path}: keys that are not used: {', '.join(key[:40] for key in unused[:10])}")


def read_entries(path: Path) -> tuple[dict, list[dict]]:
    """A transforms file and its frames. Raises InputError where it is none."""
    meta = read_json(path, "frames")
    entries = need(meta, "frames", path)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{path}: 'frames' must be a list of objects; repair it")
    if not entries:
        raise InputError(f"{path}: has no frames; add posed images")
    for key in LISTS:
        if not isinstance(meta.get(key), (list, type(None))):
            raise InputError(f"{path}: '{key}' must be a list of images; repair it")
    return meta, entries


def read_frame(entry: dict, meta: dict, index: int, path: Path) -> Frame:
    """Frame `index` of a transforms file; its image is relative to the file's folder."""
    others = mask_path, behind_path = [
        listed_file(path.parent, str(entry[key]), path) if entry.get(key) else None
        for key in ("mask_path", "behind_path")
    ]
    name = str(need(entry, "file_path", path, f" in frame {index}"))
    image_path = listed_image(path.parent, name, path, others)
    dynamic = image_path.with_name(f"dynamic_mask_{image_path.stem}.png")
    pose, lens, distortion = _read_camera(entry, meta, index, path, f"frame {index} ({image_path.name})")
    mask_kind = entry.get("mask_kind", meta.get("mask_kind", "auto"))
    if mask_kind not in MASK_KINDS:
        raise InputError(
            f"{path}: 'mask_kind' must be one of {', '.join(MASK_KINDS)}, got {shown(mask_kind)}; repair it"
        )
    return Frame(
        image_path.stem,
        image_path,
        pose,
        lens,
        distortion,
        mask_path,
        mask_kind,
        dynamic_mask_path=dynamic if os.path.isfile(dynamic) else None,
        behind_path=behind_path,
        exposure=_read_exposure(entry, index, path),
        gamma=_read_gamma(entry.get("gamma", meta.get("gamma", 0.0)), path),
        light_turn=_read_turn(entry.get("light_rotation"), index, path),
    )


def _read_turn(matrix: object, index: int, path: Path) -> np.ndarray | None:
    """The rotation of a frame's light. Raises InputError where it is none."""
    if matrix is None:
        return None
    try:
        turn = np.array(matrix, np.float64)
    except (ValueError, TypeError, OverflowError):
        turn = np.empty(0)
    if turn.shape != (3, 3) or not np.abs(turn.T @ turn - np.eye(3)).max() < RIGID_TOLERANCE or np.linalg.det(turn) < 0:
        raise InputError(f"{path}: 'light_rotation' of frame {index} must be a rotation, 3 x 3; repair it")
    return turn


def _read_exposure(entry: dict, index: int, path: Path) -> float:
    exposure = entry.get("exposure", 1.0)
    if not is_number(exposure) or not SMALLEST_EXPOSURE <= exposure <= 1 / SMALLEST_EXPOSURE:
        raise InputError(
            f"{path}: 'exposure' of frame {index} must be a positive number, got {shown(exposure)}; repair it"
        )
    return float(exposure)


def _read_gamma(gamma: object, path: Path) -> float:
    if not is_number(gamma) or not (gamma == 0 or 1 <= gamma <= LARGEST_GAMMA):
        raise InputError(
            f"{path}: 'gamma' must be 0 (sRGB's curve) or a number from 1 to {LARGEST_GAMMA:g}, got {shown(gamma)}; repair it"
        )
    return float(gamma)


def _read_camera(
    entry: dict, meta: dict, index: int, path: Path, name: str
) -> tuple[np.ndarray, dict, Distortion | None]:
    matrix = need(entry, "transform_matrix", path, f" in frame {index}")
    pose = checked_pose(matrix, f"{path}: transform_matrix of {name}")
    for key in OTHER_LENSES:
        value = meta.get(key) if entry.get(key) is None else entry[key]
        if any(value) if isinstance(value, list) else value:
            raise InputError(f"{path}: '{key}' is not read; undistort the photos and leave it out")
    numbers, own = _lens_numbers(entry, meta, f"{path}: {name}"), any(key in entry for key in (*FOCAL, *LENS))
    return pose, *read_lens(numbers, f"{path}: {name}" if own or index else str(path))


def _lens_numbers(entry: dict, meta: dict, where: str) -> dict:
    """The numbers of a frame's lens: its own, else the file's for the frame's own size. Raises InputError where the file's are for
    another shape."""
    own, shared = ({key: of[key] for key in (*FOCAL, *LENS) if of.get(key) is not None} for of in (entry, meta))
    axes, axes_of_file = ({key[-1] for key in of if key in FOCAL} for of in (own, shared))
    if axes:  # an axis without a number of its own is as the other, unless the file says how they differ
        dropped = {key for key in FOCAL if axes & {key[-1], *axes_of_file}}
        x, y = (shared.get(key) for key in ("fl_x", "fl_y"))
        shared = {key: value for key, value in shared.items() if key not in dropped}
        if len(axes) == 1 and _are_positive(x, y, focal := own.get(f"fl_{min(axes)}")):
            own["fl_y" if "x" in axes else "fl_x"] = focal * (y / x if "x" in axes else x / y)
    width, height, w, h = own.get("w"), own.get("h"), shared.get("w"), shared.get("h")
    if not _are_positive(width, height, w, h) or (width, height) == (w, h):
        return shared | own
    taken = {key for key, value in shared.items() if key not in own and is_number(value)}
    if abs(width * h - height * w) <= max(width, height, w, h):
        factors = {"fl_x": width / w, "cx": width / w, "fl_y": height / h, "cy": height / h}
        return shared | {key: shared[key] * factors[key] for key in taken & factors.keys()} | own
    angles = set() if {"fl_x", "fl_y"} & (shared.keys() | own) else {"camera_angle_x", "camera_angle_y"}
    if wrong := sorted(taken & {"cx", "cy", *angles}):
        raise InputError(f"{where}: is {width}x{height} and {wrong[0]!r} is of {w}x{h}; give the frame its own")
    return shared | own


def _are_positive(*values: object) -> bool:
    """Whether all are positive numbers."""
    return all(is_number(value) and value > 0 for value in values)
