"""What photographs show around the object: the part of the environment that is seen directly, not in reflections.

A pixel beside the object shows light that arrives from there at the object, too, where what it shows sends equal light to all
sides. Where it shows the table, the object sees that point in another direction than the camera; what lies beyond is taken to
be far away, and is hidden from the object where the table stands before it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation
from splitnerf.data.environment import texels_of_directions
from splitnerf.data.images import srgb_to_linear
from splitnerf.data.layouts.frame import OPENCV_AXES

from splitnerf_tools.capture.poses import Lens

HEIGHT = 64  # rows of the map
HALO = 0.01  # width around the object that is left out, in the photo's width
STRIDE = 3  # pixels: every so many are looked at in a row and a column
CLIPPED = 254.5 / 255.0  # sRGB value from which a pixel only says that there was more light
ENOUGH = 12  # pixels that make a direction fully seen
FAINT = 0.1  # how well a direction that none of them shows is known by the others below the horizon


class Shot(NamedTuple):
    """One undistorted photo.

    Attributes:
        image: [h, w, 3] uint8 or uint16, sRGB.
        mask: [h, w] bool, the object.
        pose: [4, 4] camera-to-world, OpenGL axes.
        lens: The pinhole camera.
        exposure: The factor of the photo's linear values.
    """

    image: np.ndarray
    mask: np.ndarray
    pose: np.ndarray
    lens: Lens
    exposure: float


def surroundings(shots: Iterable[Shot], centre: np.ndarray, table_radius: float) -> np.ndarray:
    """[h, 2 h, 4] float32 equirectangular: the median linear radiance of each direction and how well it was seen, in [0, 1].

    Directions below the horizon that no photo shows lie mostly under the object; they get the median of the others there.

    Args:
        centre: [3] the middle of the object.
        table_radius: The radius of the table z = 0 around the origin; 0 where there is none.
    """
    texels, values = [], []
    for shot in shots:
        at, radiance = _seen(shot, centre, table_radius)
        texels.append(at), values.append(radiance)
    texel, value = np.concatenate(texels), np.concatenate(values)
    result = np.zeros((HEIGHT * 2 * HEIGHT, 4), np.float32)
    order = np.argsort(texel, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(texel[order])) + 1):
        radiance = value[group]
        clipped = np.isinf(radiance).any(axis=1)
        if len(group) and 2 * clipped.sum() < len(group):
            share = min(1.0, (len(group) - clipped.sum()) / ENOUGH)
            result[texel[group[0]]] = [*np.median(radiance[~clipped], axis=0), share]
    below = result[HEIGHT * HEIGHT :]
    seen = below[:, 3] > 0
    if seen.any():
        below[~seen] = [*np.median(below[seen, :3], axis=0), FAINT]
    return result.reshape(HEIGHT, 2 * HEIGHT, 4)


def _seen(shot: Shot, centre: np.ndarray, table_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The texels of a photo's pixels beside the object, and their radiance [n, 3], infinite where the photo is clipped."""
    h, w = shot.mask.shape
    beside = ~binary_dilation(shot.mask, iterations=max(1, round(HALO * w)))
    y, x = (part[beside[::STRIDE, ::STRIDE]] for part in np.mgrid[0:h:STRIDE, 0:w:STRIDE])
    lens = shot.lens
    local = np.stack([(x + 0.5 - lens.cx) / lens.fx, (y + 0.5 - lens.cy) / lens.fy, np.ones(len(x))], axis=1)
    rays = local @ (shot.pose @ OPENCV_AXES)[:3, :3].T
    at = lambda origin: origin - (origin[2] / np.where(rays[:, 2] < 0, rays[:, 2], -1e-9))[:, None] * rays  # noqa: E731
    meets = lambda points: (rays[:, 2] < 0) & (np.linalg.norm(points[:, :2], axis=1) < table_radius)  # noqa: E731
    points = at(shot.pose[:3, 3])
    on_table, hidden = meets(points), meets(at(centre))
    shown = on_table | ~hidden
    y, x = y[shown], x[shown]
    rays = np.where(on_table[:, None], points - centre, rays)[shown]
    photo = shot.image[y, x] / np.float32(np.iinfo(shot.image.dtype).max)
    radiance = np.where(photo >= CLIPPED, np.inf, srgb_to_linear(photo) / np.float32(shot.exposure))
    return texels_of_directions(rays, HEIGHT), radiance
