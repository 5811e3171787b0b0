"""Masks of the object in photographs: those of a folder, or found by a radiance field of the whole place.

No network with downloaded weights takes part. Colours alone (GrabCut in each photo, held together by a visual hull) were worse:
they fill the gap below a handle, lose dark undersides and thin rods.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import read_header, to_uint8
from splitnerf.data.layouts.frame import OPENCV_AXES, forms
from splitnerf.data.normalisation import transform_points
from splitnerf.data.photos import read_mask
from splitnerf.data.pixels import decoded
from splitnerf.data.reading import Reading
from splitnerf.errors import InputError, note

from splitnerf_tools.capture.photographs import Photograph
from splitnerf_tools.capture.undistorted import pinhole_of, undistort
from splitnerf_tools.capture.world import World
from splitnerf_tools.separation.ground import Table
from splitnerf_tools.separation.masks import find_mask, surface_points, with_background
from splitnerf_tools.separation.separate import find_object, table_under, write_table
from splitnerf_tools.separation.training import train_field

STEPS = 5500  # of the field


def find_masks(
    out: Path, world: World, seed: int, turntable: bool, report: Callable[[float], None]
) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
    """The masks [h, w] in [0, 1] of the photos of `out/transforms.json`, in their order, at a size of their own, and what is behind
    the object, see :func:`splitnerf_tools.separation.masks.with_background`; None on a turntable, where it moves. Writes the plane
    of the table to `out`, before the first mask, and calls `report` with the share done. Raises InputError where nothing stands in
    the middle of the photos."""
    photos = load_dataset(out, "train", 1, Reading("all"), masked=False)
    to_box = photos.box_from_world
    field = train_field(photos, steps=STEPS, minutes=0.0, seed=seed, report=lambda share, _: report(0.8 * share))
    points = surface_points(field, photos)
    table = Table(np.array([0.0, 0, 1]), float(to_box[2, 3])) if world.table else table_under(points, photos, seed)
    region = find_object(field, photos, table, points)
    write_table(region, photos, out)
    for i in range(len(photos)):
        mask = find_mask(field, region, photos, i)
        found = (mask, None) if turntable else with_background(field, region, photos, i, mask)
        report(0.8 + 0.2 * (i + 1) / len(photos))
        yield found


def mask_files(photos: Sequence[Photograph], folder: Path) -> dict[str, Path]:
    """The mask of each photo by the photo's name: a file with the photo's own name, without its extension or with it. Raises
    InputError where a photo has no mask, one of another size, one that may be another's, too, one that is no mask, or a faint one,
    or where all are black."""
    found, stems = {}, {}
    for path in sorted(folder.iterdir()):
        if path.is_file() and not path.name.startswith("._"):
            other = stems.setdefault(path.stem, path)
            if other != path and any(path.stem in (photo.path.name, photo.path.stem) for photo in photos):
                raise InputError(f"{path}: may be a mask of the same photo as {other.name}; delete one of them")
    for photo in photos:
        path = next((stems[x] for name in (photo.path.name, photo.path.stem) for x in forms(name) if x in stems), None)
        if path is None:
            raise InputError(f"{folder}: has no mask {photo.path.stem}.png; add it or leave --masks out")
        if path in found.values():
            other = next(name for name, mask in found.items() if mask == path)
            raise InputError(f"{path}: may be the mask of {other} or of {photo.name}; call it {photo.path.name}.png")
        height, width, *_ = read_header(path)
        if (width, height) != (photo.width, photo.height):
            raise InputError(f"{path}: is {width}x{height}, its photo {photo.width}x{photo.height}; make them equal")
        found[photo.name] = path
    brightest = {path: float(decoded(read_mask(path).max())) for path in found.values()}
    if not any(brightest.values()):
        raise InputError(f"{folder}: every mask is black; give masks that are white on the object")
    if faint := [path for path, value in brightest.items() if 0 < value <= 0.5]:
        raise InputError(
            f"{faint[0]}: at most {brightest[faint[0]]:.1%} of white, is black; make it white on the object"
        )
    return found


def given_masks(world: World, files: Mapping[str, Path], folder: Path, max_size: int) -> list[np.ndarray]:
    """[h, w] bool, the masks of files by the photos' names, as the undistorted photos have them; those that are black on the
    object are turned around."""
    scene, masks, score = world.scene, [], 0.0
    for i, name in enumerate(scene.names):
        lens = scene.lenses[i]
        mask = to_uint8(decoded(read_mask(files[name])))[..., 0]
        masks.append(undistort(mask, lens, pinhole_of(lens, max_size)) > 127)
        of_object, others = dots_of(world, i, max_size)
        for dots, sign in ((of_object, 1), (others, -1)):
            row, column = dots[:, ::-1].astype(int).clip(0, np.array(masks[-1].shape) - 1).T
            score += sign * masks[-1][row, column].mean() if len(dots) else 0.0
    if score < 0:
        note(f"{folder}: the masks are black on the object; they are turned around")
    return [mask if score >= 0 else ~mask for mask in masks]


def dots_of(world: World, i: int, max_size: int) -> tuple[np.ndarray, np.ndarray]:
    """[k, 2] where the undistorted photo `i` shows the points that it sees, in pixels: those of the object, and the others."""
    scene = world.scene
    seen = scene.point_of[scene.photo_of == i]
    camera = np.linalg.inv(scene.poses[i] @ OPENCV_AXES)
    local = transform_points(camera, scene.points[seen]) @ pinhole_of(scene.lenses[i], max_size).matrix.T
    places = local[:, :2] / np.maximum(local[:, 2:], 1e-9)
    of_object = world.object_points[seen]
    return places[of_object], places[~of_object]
