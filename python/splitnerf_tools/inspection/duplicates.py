"""Photos that are there twice, and poses that two photos share."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from splitnerf_tools.inspection.views import View

SAME_ANGLE, SAME_PLACE = 0.05, 1e-3  # degrees and object's radii by which one pose differs
COPIES, OTHER_POSES, ONE_POSE = "one photo twice", "one photo, two poses", "two photos, one pose"


def duplicates(views: Sequence[View], radius: float) -> list[tuple[int, int, str]]:
    """Pairs of photos, i < j, of which at most one can be right, and what they are: one file, or one pose.

    Args:
        views: The photos.
        radius: The object's radius.
    """
    poses = np.stack([view.pose for view in views])
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[None, :, :3, 3], axis=-1) / radius
    turn = (np.einsum("iab,jab->ij", poses[:, :3, :3], poses[:, :3, :3]) - 1) / 2
    one_pose = (apart < SAME_PLACE) & (np.degrees(np.arccos(np.clip(turn, -1, 1))) < SAME_ANGLE)
    files = np.array([hashlib.sha256(view.path.read_bytes()).hexdigest() for view in views])
    one_file = files[:, None] == files
    kinds = {(True, True): COPIES, (True, False): OTHER_POSES, (False, True): ONE_POSE}
    pairs = np.argwhere(np.triu(one_file | one_pose, 1)).tolist()
    return [(i, j, kinds[bool(one_file[i, j]), bool(one_pose[i, j])]) for i, j in pairs]
