"""Objects With Lighting, an object: `dataset/OBJECT/test`.

    inputs/image_0000.png        8 bits, y = 255 (x 2^exposure)^(1 / 2.2) of linear x, clipped: not sRGB's curve
    inputs/mask_0000.png         white is the object
    inputs/camera_0000.txt       8 rows: K, R and t from the world to the camera (OpenCV's axes), width height channels; the
                                 first pixel's middle is at .5
    inputs/exposure.txt          of all input photos
    gt_image_0000.png, gt_mask_0000.png, gt_camera_0000.txt, gt_exposure_0000.txt   photos in three lights to compare with
    gt_env_512_rotated_0000.hdr  the light of such a photo in the world's axes, as Blender has it

The first third of the photos to compare with is in the light of the input photos.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.layouts.frame import Frame, pinhole_numbers, pose_of_motion
from splitnerf.data.layouts.lit import LitView, map_in_world
from splitnerf.data.lens import read_lens
from splitnerf.errors import InputError

INPUTS = "inputs"
GAMMA = 2.2
LIGHTS = 3  # that the photos to compare with are in
LARGEST_EXPOSURE = 13.0  # and its negative the smallest: stops


def present(root: Path) -> bool:
    """Whether a folder is an object's."""
    return any((root / INPUTS).glob("camera_*.txt"))


def splits(root: Path) -> list[str]:
    """One split: the photos to compare with are not the trainer's."""
    return ["train"]


def read(root: Path, split: str | None) -> list[Frame]:
    """The input photos, by number.

    Raises:
        InputError: A file is missing or cannot be used, or the test split was asked for.
    """
    if split == "test":
        raise InputError(f"{root}: has no test split; score with `splitnerf evaluate --protocol owl`")
    exposure = _exposure(root / INPUTS / "exposure.txt")
    return [_frame(path, exposure) for path in sorted((root / INPUTS).glob("camera_*.txt"))]


def relit(root: Path, maps: dict[str, Path]) -> list[LitView]:
    """The photos to compare with, by number, their light called "same" or "new"; `maps` is not needed.

    Raises:
        InputError: There is none, or a file cannot be used.
    """
    cameras = sorted(root.glob("gt_camera_*.txt"))
    if not cameras:
        raise InputError(f"{root}: has no gt_camera_0000.txt; give the folder OBJECT/test of the set")
    views = []
    for index, path in enumerate(cameras):
        number = path.stem.removeprefix("gt_camera_")
        frame = _frame(path, _exposure(root / f"gt_exposure_{number}.txt"))
        light = map_in_world(root / f"gt_env_512_rotated_{number}.hdr")
        views.append(LitView(frame, "same" if index < len(cameras) // LIGHTS else "new", light))
    return views


def _frame(path: Path, exposure: float) -> Frame:
    """The photo of a camera's file, which lies beside it."""
    image, mask = (path.with_name(path.name.replace("camera", kind)).with_suffix(".png") for kind in ("image", "mask"))
    numbers = _numbers(path, 24)
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = numbers[9:18].reshape(3, 3), numbers[18:21]
    lens = pinhole_numbers(numbers[:9].reshape(3, 3), f"{path}: K")
    lens |= {"w": float(numbers[21]), "h": float(numbers[22])}
    pose = pose_of_motion(motion, f"{path}: R, t")
    return Frame(
        image.stem, image, pose, *read_lens(lens, str(path)), mask_path=mask, mask_kind="object", exposure=exposure, gamma=GAMMA
    )


def _exposure(path: Path) -> float:
    """The factor of linear values."""
    stops = float(_numbers(path, 1)[0])
    if not abs(stops) <= LARGEST_EXPOSURE:
        raise InputError(f"{path}: {stops:g} is no exposure in stops; repair it")
    return 2.0**stops


def _numbers(path: Path, count: int) -> np.ndarray:
    """All numbers of a text file, [count] float64."""
    try:
        numbers = np.array(path.read_text(encoding="utf-8").split(), np.float64)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as numbers ({str(error).splitlines()[0][:80]}); replace it") from None
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InputError(f"{path}: must hold {count} finite numbers, has {len(numbers)}; replace it")
    return numbers
