"""Photos that are there twice, and poses that two photos share."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from splitnerf.data.images import area_average
from splitnerf_tools.inspection.views import View

THUMBNAIL = 32  # pixels, about, along the shorter edge of what is compared
ALIKE = 1 / 255  # root mean square difference of thumbnails of one photo, saved twice
UNLIKE_OTHERS = 0.25  # of the usual difference between a photo and the one most like it, what such a pair may have
SAME_ANGLE, SAME_PLACE = 0.05, 1e-3  # degrees and object's radii by which one pose differs
OTHER_ANGLE, OTHER_PLACE = 1.0, 0.02  # and from which on two poses cannot be those of one photo
COPIES, OTHER_POSES, ONE_POSE = "one photo twice", "one photo, two poses", "two photos, one pose"


def duplicates(views: Sequence[View], radius: float) -> list[tuple[int, int, str]]:
    """Pairs of photos, i < j, of which at most one can be right, and what they are.

    Photos are the same where the files are, or where their thumbnails differ less than those of any other two.

    Args:
        views: The photos.
        radius: The object's radius.
    """
    poses = np.stack([view.pose for view in views])
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1) / radius
    turn = (np.einsum("iab,jab->ij", poses[:, :3, :3], poses[:, :3, :3]) - 1) / 2
    turn = np.degrees(np.arccos(np.clip(turn, -1, 1)))
    same = _same_photo(views)
    one_pose = (apart < SAME_PLACE) & (turn < SAME_ANGLE)
    pairs = []
    for i, j in np.argwhere(np.triu(same | one_pose, 1)):
        if not same[i, j]:
            what = ONE_POSE
        elif apart[i, j] > OTHER_PLACE or turn[i, j] > OTHER_ANGLE:
            what = OTHER_POSES
        else:
            what = COPIES
        pairs.append((int(i), int(j), what))
    return pairs


def _same_photo(views: Sequence[View]) -> np.ndarray:
    """[n, n] bool."""
    n = len(views)
    same = np.zeros((n, n), bool)
    sizes = np.array([view.path.stat().st_size for view in views])
    hashes = [
        hashlib.sha256(view.path.read_bytes()).digest() if (sizes == size).sum() > 1 else None
        for view, size in zip(views, sizes)
    ]
    for i in range(n):
        same[i] = [hashes[i] is not None and hashes[i] == other for other in hashes]
    shapes = [view.mask.shape for view in views]
    for shape in set(shapes):
        members = np.flatnonzero([one == shape for one in shapes])
        if len(members) > 1:
            same[np.ix_(members, members)] |= _alike(np.stack([_thumbnail(views[i]) for i in members]))
    np.fill_diagonal(same, False)
    return same


def _thumbnail(view: View) -> np.ndarray:
    """[m] float32, the colours on the object and its mask, averaged over blocks."""
    planes = np.concatenate([view.colour * view.known[..., None], view.mask[..., None]], axis=-1)
    return area_average(planes.astype(np.float32), max(1, min(view.mask.shape) // THUMBNAIL)).reshape(-1)


def _alike(thumbnails: np.ndarray) -> np.ndarray:
    """[n, n] bool, which of thumbnails [n, m] are of one photo."""
    centred = (thumbnails - thumbnails.mean(0)).astype(np.float64)
    squares = (centred**2).sum(1)
    difference = np.sqrt(np.maximum(squares[:, None] + squares - 2 * centred @ centred.T, 0) / centred.shape[1])
    np.fill_diagonal(difference, np.inf)
    return difference < min(ALIKE, UNLIKE_OTHERS * np.median(difference.min(1)))
