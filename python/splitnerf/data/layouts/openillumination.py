"""OpenIllumination, an object: a folder like `obj_01_car`.

    output/transforms_train.json, transforms_test.json   `frames` is an object by camera: `file_path`, whose last part is the
                                                         camera's name, `transform_matrix` camera-to-world with OpenCV's axes,
                                                         `camera_angle_x` (radians, of an image `calib_imgw` pixels wide)
    output/com_masks/CAMERA.png, output/obj_masks/...    above 0 are object and support, or the object alone
    Lights/013/raw_undistorted/CAMERA.JPG                the photos in an illumination: 013 is the training's, where there is
                                                         one light at a time the first
    light_pos.npy                                        [142, 3] positions of the lamps, in the folder or in one above it:
                                                         photos in one light at a time, NNN is lit by lamp NNN
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from splitnerf.data.environment import directions_of_texels, texels_of_directions
from splitnerf.data.json_files import need, read_json
from splitnerf.data.layouts.frame import OPENCV_AXES, Frame, checked_pose
from splitnerf.data.layouts.lit import LitView, map_in_world
from splitnerf.data.lens import read_lens
from splitnerf.data.paths import is_file
from splitnerf.errors import InputError

OUTPUT, LIGHTS, PHOTOS = "output", "Lights", "raw_undistorted"
TRAINING = "013"  # the illumination that training sees
POSITIONS = "light_pos.npy"
SPLITS = ("train", "test")
LAMP_ROWS = 64  # of the map with one lamp
LARGEST_POSITIONS = 1 << 20  # bytes


def present(root: Path) -> bool:
    """Whether a folder is an object's."""
    return _file(root, "train").is_file() and (root / LIGHTS).is_dir()


def splits(root: Path) -> list[str]:
    """The splits that have a file."""
    return [split for split in SPLITS if _file(root, split).is_file()]


def read(root: Path, split: str | None) -> list[Frame]:
    """The photos of a split, or all, in the training's illumination, with the masks of object and support.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    names = splits(root) if split is None else [split]
    return [frame for name in names for frame in _frames(root, name, training_light(root), "com_masks")]


def relit(root: Path, maps: dict[str, Path]) -> list[LitView]:
    """The test photos in all other illuminations whose light is known, with the object's masks.

    Args:
        root: The folder.
        maps: Maps by the illumination's name, in the data's world; else the light is that of a lamp of `light_pos.npy`.

    Raises:
        InputError: A file is missing or cannot be used.
    """
    views, lamps = [], _lamps(root)
    for name in _illuminations(root):
        if name == training_light(root):
            continue
        if name in maps:
            light = map_in_world(maps[name])
        elif lamps is not None and _one_at_a_time(root) and int(name) < len(lamps):
            light = partial(lamp_map, lamps[int(name)])
        else:
            continue
        views += [LitView(frame, name, light) for frame in _frames(root, "test", name, "obj_masks")]
    if not views:
        raise InputError(
            f"{root}: no other illumination has a known light; add {POSITIONS}, or give --maps a folder of 001.hdr and so on"
        )
    return views


def training_light(root: Path) -> str:
    """The illumination of the training photos."""
    names = _illuminations(root)
    return TRAINING if TRAINING in names and not _one_at_a_time(root) else names[0]


def lamp_map(position: np.ndarray) -> np.ndarray:
    """The map [h, 2 h, 3] of one lamp far away: one bright texel towards `position` [3] that gives white a radiance of 1."""
    _, areas = directions_of_texels(LAMP_ROWS)
    texel = texels_of_directions(position[None], LAMP_ROWS)[0]
    radiance = np.zeros((areas.size, 3), np.float32)
    radiance[texel] = np.pi / areas.flat[texel]
    return radiance.reshape(*areas.shape, 3)


def _file(root: Path, split: str) -> Path:
    return root / OUTPUT / f"transforms_{split}.json"


def _illuminations(root: Path) -> list[str]:
    names = sorted(path.name for path in (root / LIGHTS).iterdir() if re.fullmatch("[0-9]+", path.name) and path.is_dir())
    if not names:
        raise InputError(f"{root / LIGHTS}: has no folder 000 or 001; add the photos")
    return names


def _one_at_a_time(root: Path) -> bool:
    return _illuminations(root)[0] == "000"


def _lamps(root: Path) -> np.ndarray | None:
    absolute = root.absolute()
    path = next((p for p in (f / POSITIONS for f in (absolute, *absolute.parents[:3])) if is_file(p)), None)
    if path is None:
        return None
    try:
        if path.stat().st_size > LARGEST_POSITIONS:
            raise ValueError("too large")
        lamps = np.load(path, allow_pickle=False).astype(np.float64)
    except Exception as error:  # NumPy raises whatever it meets
        raise InputError(f"{path}: cannot be read as an array ({str(error)[:80]}); replace it") from None
    if lamps.ndim != 2 or lamps.shape[1] != 3 or not np.isfinite(lamps).all() or not lamps.any(axis=1).all():
        raise InputError(f"{path}: must hold positions [n, 3] away from 0, has {list(lamps.shape)}; replace it")
    return lamps


def _frames(root: Path, split: str, light: str, masks: str) -> list[Frame]:
    path = _file(root, split)
    entries = need(read_json(path, "frames"), "frames", path)
    if not isinstance(entries, dict) or not entries or not all(isinstance(entry, dict) for entry in entries.values()):
        raise InputError(f"{path}: 'frames' must be an object of objects; repair it")
    frames = []
    for key, entry in sorted(entries.items()):
        name, where = Path(str(need(entry, "file_path", path, f" in frame {key}"))).name, f" of frame {key[:40]}"
        image = root / LIGHTS / light / PHOTOS / f"{name}.JPG"
        if not is_file(image):
            raise InputError(f"{image}: no such image, though {path.name} lists it; add it or remove the frame")
        pose = checked_pose(need(entry, "transform_matrix", path, where), f"{path}: transform_matrix{where}") @ OPENCV_AXES
        lens = read_lens({"camera_angle_x": entry.get("camera_angle_x")}, f"{path}{where}")
        frames.append(Frame(f"{name}", image, pose, *lens, root / OUTPUT / masks / f"{name}.png", "object"))
    return frames
