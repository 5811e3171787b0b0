"""The page about prepared photos: cameras, points, masks, and what was left out."""

from __future__ import annotations

from pathlib import Path

import jinja2
import numpy as np
from markupsafe import Markup
from PIL import Image

from splitnerf.capture.world import CAMERA_DISTANCE, World
from splitnerf.files import atomic_path
from splitnerf.report.pictures import data_uri

PICTURE_WIDTH = 240  # pixels
OUTSIDE = 0.3  # brightness of what a mask leaves out
SHOWN_POINTS = 4000
SIDE = 400  # of a plan, in its own units
REACH = 1.25 * CAMERA_DISTANCE  # half of a plan's edge, in the world's units


def write_page(
    out: Path, world: World, gains: np.ndarray, mask_share: np.ndarray, left_out: dict[str, str], title: str
) -> None:
    """Writes `prepare.html`, without outside references, from the images and masks beside it.

    Args:
        out: The folder with `images` and `masks`.
        world: Cameras and points.
        gains: [n] the photos' relative exposures.
        mask_share: [n] the share of each image that its mask covers.
        left_out: Why photos were left out, by name.
        title: The heading.
    """
    scene = world.scene
    loader = jinja2.ChoiceLoader([jinja2.PackageLoader(f"splitnerf.{name}", ".") for name in ("capture", "report")])
    environment = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    tiles = [
        ("photos with a camera", f"{len(scene.names)} of {len(scene.names) + len(left_out)}"),
        ("reprojection error", f"{scene.error:.2f} pixels"),
        ("points", f"{len(scene.points)}, {int(world.object_points.sum())} on the object"),
        ("table", "found" if world.table else "not found"),
        ("masks cover", f"{100 * mask_share.min():.1f} to {100 * mask_share.max():.1f} %"),
        ("exposures", f"{gains.min():.2f} to {gains.max():.2f}"),
    ]
    photos = [
        {"name": name, "picture": _masked(out, name), "exposure": f"{gain:.2f}"} for name, gain in zip(scene.names, gains)
    ]
    page = environment.get_template("prepare.html.j2").render(
        title=title, tiles=tiles, plans=[_plan(world, 0, 1), _plan(world, 0, 2)], left_out=sorted(left_out.items()),
        photos=photos,
    )  # fmt: skip
    with atomic_path(out / "prepare.html") as temporary:
        temporary.write_text(page, encoding="utf-8")


def _masked(out: Path, name: str) -> Markup:
    """A small picture of an image, dark where its mask leaves it out."""
    with Image.open(out / "images" / f"{name}.png") as image, Image.open(out / "masks" / f"{name}.png") as mask:
        size = (PICTURE_WIDTH, round(PICTURE_WIDTH * image.height / image.width))
        photo = np.asarray(image.convert("RGB").resize(size, Image.Resampling.BOX), np.float32) / 255
        inside = np.asarray(mask.convert("L").resize(size, Image.Resampling.BOX), np.float32)[..., None] / 255
    return data_uri(photo * (OUTSIDE + (1 - OUTSIDE) * inside))


def _plan(world: World, across: int, up: int) -> Markup:
    """The cameras and points as an SVG, seen along the third axis."""
    scene = world.scene
    middle = (scene.poses[:, :3, 3].min(0) + scene.poses[:, :3, 3].max(0)) / 2
    middle[2] /= 2  # between the ground and the highest camera
    place = lambda p: tuple(SIDE / 2 * (1 + s * (p[i] - middle[i]) / REACH) for i, s in ((across, 1), (up, -1)))  # noqa: E731
    shown = np.random.default_rng(0).permutation(len(scene.points))[:SHOWN_POINTS]
    parts = []
    for index in shown:
        x, y = place(scene.points[index])
        if 0 <= x <= SIDE and 0 <= y <= SIDE:
            kind = "object" if world.object_points[index] else "other"
            parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="0.8"/>')
    for pose in scene.poses:
        tip, ahead = pose[:3, 3], -pose[:3, 2]
        (x0, y0), (x1, y1) = place(tip), place(tip + 0.3 * ahead)
        parts.append(f'<circle class="camera" cx="{x0:.1f}" cy="{y0:.1f}" r="3"/>')
        parts.append(f'<path class="camera" d="M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}"/>')
    return Markup(f'<svg viewBox="0 0 {SIDE} {SIDE}" role="img" aria-label="cameras and points">{"".join(parts)}</svg>')
