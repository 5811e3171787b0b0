"""The page about prepared photos: cameras, points, masks, and what was left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup
from PIL import Image

from splitnerf_tools.capture.world import CAMERA_DISTANCE, World
from splitnerf_tools.report.drawings import plan
from splitnerf_tools.report.embedding import photo_uri, write_html

PICTURE_WIDTH = 240  # pixels
OUTSIDE = 0.3  # brightness of what a mask leaves out
REACH = 1.25 * CAMERA_DISTANCE  # half of a plan's edge, in the world's units


def write_page(
    out: Path, world: World, gains: np.ndarray, mask_share: np.ndarray, left_out: dict[str, str], title: str
) -> None:
    """Writes `prepare.html` to `out`, without outside references, from the folders `images` and `masks` beside it.

    Args:
        gains: [n] the photos' relative exposures.
        mask_share: [n] the share of each image that its mask covers.
        left_out: Why photos were left out, by name.
    """
    scene = world.scene
    tiles = [
        ("photos with a camera", f"{len(scene.names)} of {len(scene.names) + len(left_out)}"),
        ("reprojection error", f"{scene.error:.2f} pixels"),
        ("points", f"{len(scene.points)}, {int(world.object_points.sum())} on the object"),
        ("table", "found" if world.table else "not found"),
        ("masks cover", f"{100 * mask_share.min():.1f} to {100 * mask_share.max():.1f} %"),
        ("exposures", f"{gains.min():.2f} to {gains.max():.2f}"),
    ]
    photos = [
        {"name": name, "picture": _masked(out, name), "exposure": f"{gain:.2f}"}
        for name, gain in zip(scene.names, gains)
    ]
    write_html(
        out / "prepare.html",
        "splitnerf_tools.capture",
        "prepare.html.j2",
        title=title,
        tiles=tiles,
        plans=_plans(world),
        left_out=sorted(left_out.items()),
        photos=photos,
    )


def _masked(out: Path, name: str) -> Markup:
    """A small picture of an image, dark where its mask leaves it out."""
    with Image.open(out / "images" / f"{name}.png") as image, Image.open(out / "masks" / f"{name}.png") as mask:
        size = (PICTURE_WIDTH, round(PICTURE_WIDTH * image.height / image.width))
        photo = np.asarray(image.convert("RGB").resize(size, Image.Resampling.BOX), np.float32) / 255
        inside = np.asarray(mask.convert("L").resize(size, Image.Resampling.BOX), np.float32)[..., None] / 255
    return photo_uri(photo * (OUTSIDE + (1 - OUTSIDE) * inside))


def _plans(world: World) -> list[Markup]:
    """The cameras and points from above and from the side."""
    scene = world.scene
    middle = (scene.poses[:, :3, 3].min(0) + scene.poses[:, :3, 3].max(0)) / 2
    middle[2] /= 2  # between the ground and the highest camera
    kinds = ["camera"] * len(scene.poses), np.where(world.object_points, "object", "other")
    return [plan((0, up), scene.poses, scene.points, kinds, middle, REACH) for up in (1, 2)]
