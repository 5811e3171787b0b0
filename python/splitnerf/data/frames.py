"""The frames of a posed image set of any layout: which are for training and which for testing, and in which world."""

from __future__ import annotations

import re
from pathlib import Path
from types import ModuleType

import numpy as np

from splitnerf.data.layouts import colmap, neus, transforms, view_folders
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.normalisation import SAME_PLACE
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError

LAYOUTS = (transforms, view_folders, neus, colmap)
"""The first that a folder has counts."""
TEST_STRIDE = 8
WORDS = {"train": r"(?<![a-z])train", "test": r"(?<![a-z])(test|eval)"}  # in the path of a split's image
PHOTOS = (".jpg", ".jpeg", ".png", ".heic", ".tif", ".tiff", ".webp", ".dng", ".cr2", ".nef", ".arw")
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm")
FAR = 1e3  # distances between the cameras; farther from the origin, float32 loses what pixels show


def read_frames(root: Path, split: str, reading: Reading = Reading()) -> tuple[list[Frame], np.ndarray]:
    """The frames of one split, "train" or "test", of a folder of any layout, in the data's order, and the origin of
    their world: the point [3] float64 of the data's own world that was subtracted from their positions. It is 0 but
    where all cameras are so far from the origin that float32 would lose what their pixels show, and the same for both
    splits. Raises InputError where no layout is recognised, the split has no frame, or a frame has no image, no usable
    pose or no lens."""
    layout = layout_of(root)
    if layout is None:
        if meant := what_is_in(root) or (not root.is_dir() and "no such folder; give the folder that holds the data"):
            raise InputError(f"{root}: {meant}")
        raise InputError(
            f"{root}: has neither transforms_{split}.json nor transforms.json, nor view folders like train_000, nor "
            f"{neus.CAMERAS}, nor a COLMAP model in sparse/0; give the folder that holds one"
        )
    if reading.eval_mode == "auto" and layout.splits(root) is not None:
        frames = layout.read(root, split)
        listed = frames if are_near(frames) else layout.read(root, None)
    else:
        listed = layout.read(root, None)
        frames = _chosen(root, listed, split, reading.eval_mode)
    origin = far_origin(listed)
    for frame in frames:
        frame.pose[:3, 3] -= origin
    return frames, origin


def has_test_split(root: Path, reading: Reading = Reading()) -> bool:
    """Whether there are test views that are no training views; true for a folder of unknown layout, so that reading it
    raises the error."""
    if reading.eval_mode != "auto":
        return reading.eval_mode != "all"
    layout = layout_of(root)
    own = None if layout is None else layout.splits(root)
    return own is None or "test" in own


def layout_of(root: Path) -> ModuleType | None:
    """The layout of a folder, or None."""
    return next((layout for layout in LAYOUTS if layout.present(root)), None)


def what_is_in(folder: Path) -> str:
    """What a folder without a layout holds instead, and what to do with it; "" where that is unknown."""
    prepare = "`splitnerf prepare {} --out DATA` finds these".format
    if folder.is_file():
        return f"is a video, whose cameras are not known; {prepare(folder)}" if folder.suffix.lower() in VIDEOS else ""
    if not folder.is_dir():
        return ""
    if (folder / "checkpoint.pt").is_file():
        return f"is a run; look at it by `splitnerf view {folder}`, or continue it by --resume with its data"
    if layout_of(folder.resolve().parent) is not None:
        return f"is a part of the data set {folder.resolve().parent}; give that"
    if inner := run_in(folder):
        return f"holds runs; give one, such as {inner}"
    inside = sorted(folder.iterdir())
    for path in inside:
        if path.is_dir() and layout_of(path) is not None:
            return f"holds data sets; give one, such as {path}"
    if any(path.suffix.lower() in PHOTOS for path in inside):
        return f"holds photos without cameras; {prepare(folder)}"
    nested = {path.parent for path in folder.glob("*/*") if path.suffix.lower() in PHOTOS}
    if len(nested) != 1:  # several are parts of data that lack their cameras
        return ""
    return f"holds photos without cameras in a folder; {prepare(nested.pop())}"


def run_in(folder: Path) -> Path | None:
    """The first run that lies in a folder, or None."""
    return next((path.parent for path in sorted(folder.glob("*/checkpoint.pt"))), None)


def refuse_data(folder: Path) -> None:
    """Raises InputError where a folder holds a data set: results would replace the truth beside the photos."""
    if layout_of(folder) is not None:
        raise InputError(f"{folder}: holds a data set, which results would replace; give another --out")


def split_rule(root: Path, reading: Reading = Reading()) -> str:
    """How the views are split, in words for the user."""
    if reading.eval_mode == "auto":
        by_data = layout_of(root).splits(root) is not None
        return "as the data say" if by_data else f"every {TEST_STRIDE}th; --eval-mode all trains on all"
    rules = {
        "all": "all are trained on and evaluated",
        "fraction": f"every {TEST_STRIDE}th",
        "filename": "by the words train and test in their paths",
    }
    return rules[reading.eval_mode]


def far_origin(frames: list[Frame]) -> np.ndarray:
    """[3] the middle of the cameras, rounded; 0 where they are at most `FAR` times as far away as apart."""
    middle, extent = _middle_and_extent(frames)
    far = np.linalg.norm(middle)
    if extent <= SAME_PLACE * far or far <= FAR * extent:
        return np.zeros(3)
    step = 10.0 ** np.ceil(np.log10(extent))
    return np.round(middle / step) * step + 0.0  # no -0


def are_near(frames: list[Frame]) -> bool:
    """Whether the cameras are so near to the origin that, whatever the other frames are, :func:`far_origin` is 0."""
    middle, extent = _middle_and_extent(frames)
    return np.linalg.norm(middle) <= 0.1 * FAR * extent


def _middle_and_extent(frames: list[Frame]) -> tuple[np.ndarray, float]:
    """The mean [3] of the cameras' positions, and their largest distance from it."""
    positions = np.stack([frame.pose[:3, 3] for frame in frames])
    middle = positions.mean(axis=0)
    return middle, float(np.linalg.norm(positions - middle, axis=1).max())


def _chosen(root: Path, frames: list[Frame], split: str, mode: str) -> list[Frame]:
    """Those of all frames that a mode gives to a split."""
    if mode == "all":
        return frames
    if mode == "filename":
        chosen = [frame for frame in frames if _named_split(root, frame) == split]
        hint = f"no path of an image has the word {split}; choose another --eval-mode"
    else:
        chosen = [frame for i, frame in enumerate(frames) if (i % TEST_STRIDE == 0) == (split == "test")]
        hint = "add posed images, or give --eval-mode all"
    if not chosen:
        raise InputError(f"{root}: has no frames for the {split} split; {hint}")
    return chosen


def _named_split(root: Path, frame: Frame) -> str:
    """The split that the last part of an image's path names that names one."""
    path = frame.image_path.relative_to(root) if frame.image_path.is_relative_to(root) else frame.image_path
    for part in reversed(path.parts):
        named = [split for split, word in WORDS.items() if re.search(word, part.lower())]
        if len(named) == 1:
            return named[0]
    raise InputError(
        f"{frame.image_path}: its path names neither train nor test; rename it, or choose another --eval-mode"
    )
