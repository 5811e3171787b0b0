"""From photos without masks to a folder with masks and what is around the object."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from splitnerf.data.dataset import BEHIND, SURROUNDINGS, Dataset, spread, write_ground
from splitnerf.data.images import read_image, write_image
from splitnerf.data.json_files import write_json
from splitnerf.data.normalisation import transform_plane
from splitnerf.data.photos import resized_mask, separated_mask
from splitnerf.data.reading import SEPARATION
from splitnerf.errors import InputError, note_once
from splitnerf.files import own_folder, refuse_foreign
from splitnerf.progress import Progress, ended_by_signals, tracked

from splitnerf_tools.separation.field import RadianceField
from splitnerf_tools.separation.ground import Table, find_table
from splitnerf_tools.separation.masks import find_mask, points_near, surface_points, surroundings, with_background
from splitnerf_tools.separation.region import Region, find_region
from splitnerf_tools.separation.training import train_field

SHEET = "sheet.jpg"
SHOWN, DIMMED = 12, 0.25  # photos on the sheet, and the factor of what is around the object
# How far before the middle of the views a wall may stand, scene units: seen from one side, it is vague.
BEFORE_MIDDLE = 0.7
NEAR_TABLE = 1.5  # distance from the middle within which points tell of the table, scene units
MOST_POINTS = 20000  # of those that the search for the table takes


def separate(train: Dataset, test: Dataset | None, folder: Path, *, steps: int, minutes: float, seed: int) -> float:
    """Writes a mask for each photo, what is behind the object, `surroundings.exr`, `ground.json` where a table is found, and
    `sheet.jpg`, which shows some of the masks, into an empty folder; returns the seconds that it took.

    A radiance field of the whole place is trained on the photos. What it shows within what all cameras look at, above the plane of
    a table if there is one, and hangs together in the middle, is the object. Raises InputError where nothing stands in the middle,
    and RuntimeError where numbers of the training are no longer finite.

    Args:
        train: The photos, without masks.
        test: Photos that get masks but are not trained on; or None.
        folder: The folder; what is in it is deleted once the object is found.
        steps, minutes: See :func:`splitnerf_tools.separation.training.train_field`.
    """
    started = time.monotonic()
    refuse_foreign(folder)
    data = train.root
    note_once(
        f"{data}: nothing says where the object is; it is looked for in the middle of the photos, see {folder / SHEET}"
    )
    usual = float(np.exp(np.log(train.exposures).mean()))  # the field knows colours in [0, 1]
    train, test = (split and split.exposed(split.exposures / usual) for split in (train, test))
    with ended_by_signals():
        with Progress(0.0) as bar:
            field = train_field(
                train,
                steps=steps,
                minutes=minutes,
                seed=seed,
                report=lambda share, told: bar.show(share, f"what is around the object, {told}"),
            )
        points = surface_points(field, train)
        region = find_object(field, train, table_under(points, train, seed), points)
        own_folder(folder)
        shares = [write_masks(field, region, split, folder) for split in (train, test) if split is not None]
        around = surroundings(field, region, points)
        write_image(folder / SURROUNDINGS, around / np.float32([usual] * 3 + [1]))
        write_table(region, train, folder)
        write_sheet(train, folder)
        share, seconds = float(np.mean(np.concatenate(shares))), time.monotonic() - started
        write_json(folder / SEPARATION, {"table": region.table is not None, "share": share, "seconds": seconds})
    table = "without a table under it" if region.table is None else "above a table"
    note_once(f"{data}: the object, {table}, covers {share:.0%} of the photos")
    return seconds


def find_object(field: RadianceField, photos: Dataset, table: Table | None, points: np.ndarray) -> Region:
    """What stands in the middle of photos that show points [n, 3]. Raises InputError where nothing stands there."""
    if table is not None:
        table = Table.through(
            table.normal, table.offset, points[np.linalg.norm(points, axis=1) < NEAR_TABLE].astype(np.float64)
        )
    region = find_region(points, table, len(photos))
    if region is None:
        raise InputError(f"{photos.root}: nothing stands out in the middle of the photos; add masks of the object")
    return region if table is None else region.with_foot(*points_near(field, photos, region))


def table_under(points: np.ndarray, dataset: Dataset, seed: int) -> Table | None:
    """The plane on which the object stands or, where there is none, the wall behind it; None without both. `points` [n, 3] are what
    the photos show, scene units."""
    random = np.random.default_rng(seed)
    near = points[np.linalg.norm(points, axis=1) < NEAR_TABLE]
    near = near[random.permutation(len(near))[:MOST_POINTS]].astype(np.float64)
    places = dataset.poses[:, :3, 3].astype(np.float64)
    distance = float(np.median(np.linalg.norm(places, axis=1)))
    for axis, reach in ((dataset.poses[:, :3, 1].mean(0), 0.0), (places.mean(0), BEFORE_MIDDLE)):
        axis = axis / np.linalg.norm(axis).clip(1e-9)
        plane = find_table(near, reach * axis, axis, distance, random)
        if plane is not None:
            return Table(*plane)
    return None


def write_masks(field: RadianceField, region: Region, split: Dataset, folder: Path) -> np.ndarray:
    """Writes the masks of a split and what is behind the object; returns the share [n] that each covers."""
    shares = []
    for i in tracked(range(len(split)), "masks, photo"):
        mask, behind = with_background(field, region, split, i, find_mask(field, region, split, i))
        name = separated_mask(split.image_paths[i], split.root)
        for path, picture in ((folder / name, mask), (folder / BEHIND / name, behind)):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_image(path, picture)
        shares.append(mask.mean())
    return np.array(shares)


def write_table(region: Region, photos: Dataset, folder: Path) -> None:
    """Writes the plane of the object's table, if it has one, in the world of the photos."""
    if (table := region.table) is not None:
        write_ground(folder, transform_plane(photos.world_from_box, np.append(table.normal, table.offset)))


def write_sheet(dataset: Dataset, folder: Path) -> None:
    """`sheet.jpg`: some photos, dark where they do not show the object."""
    rows, chosen = [], spread(range(len(dataset)), SHOWN)
    for i in chosen:
        photo = dataset.images[i, ..., :3]
        mask = dataset.padded(
            resized_mask(read_image(folder / separated_mask(dataset.image_paths[i], dataset.root)), *dataset.sizes[i])
        )
        rows.append(photo * (DIMMED + (1 - DIMMED) * mask[..., None]))
    columns = -(-len(rows) // 3)
    rows += [np.zeros_like(rows[0])] * (3 * columns - len(rows))
    write_image(
        folder / SHEET, np.concatenate([np.concatenate(rows[k * columns : (k + 1) * columns], 1) for k in range(3)])
    )
