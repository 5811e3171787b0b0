"""The world of a reconstruction: which way is up, where the object stands, how large it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from splitnerf_tools.capture.poses import Reconstruction
from splitnerf_tools.separation.ground import TABLE_TOLERANCE, find_table

CAMERA_DISTANCE = 3.0  # of the median camera from the centre, in the world's units
NEARLY_ALL = 0.95  # share of the table's points within its radius
NEAREST = 8  # the neighbour whose median distance is the spacing of the object's points
SMALLEST_GROUP = 0.02  # share of the points above the table that a group needs
STANDS_OVER = 1.0  # horizontal distance of a group's middle from the largest one's, in the latter's radii
LINK = 1.5  # distance of two points that hang together, in spacings


@dataclass
class World:
    """A reconstruction in the frame that is written: z up, the object above the origin.

    Attributes:
        scene: The reconstruction in this frame.
        table_radius: The radius around the origin within which nearly all points of the table lie, which is the plane z = 0;
            0 where there is no table.
        object_points: [m] bool, the sparse points that belong to the object.
    """

    scene: Reconstruction
    table_radius: float
    object_points: np.ndarray

    @property
    def table(self) -> bool:
        """Whether a table was found."""
        return self.table_radius > 0


def settle(found: Reconstruction, seed: int) -> World:
    """Turns, moves and scales a reconstruction in any frame, and tells the object's points from the others.

    The centre is where the cameras' axes meet. Up is the normal of the plane on which most points near it lie, below it
    (the table), or the mean of the cameras' upward axes where there is none.
    """
    centre, up = meeting_point(found.poses), found.poses[:, :3, 1].mean(0)
    up = up / np.linalg.norm(up)
    distance = np.median(np.linalg.norm(found.poses[:, :3, 3] - centre, axis=1))
    near = np.linalg.norm(found.points - centre, axis=1) < 0.6 * distance
    plane = find_table(found.points[near], centre, up, distance, np.random.default_rng(seed))
    origin = centre
    if plane is not None:
        up, offset = plane
        origin = centre - (centre @ up - offset) * up
    forward = found.poses[0, :3, 3] - origin
    x = forward - (forward @ up) * up
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(up, x), up])
    scale = CAMERA_DISTANCE / distance
    moved = lambda points: scale * (points - origin) @ rotation.T  # noqa: E731
    poses = found.poses.copy()
    poses[:, :3, :3], poses[:, :3, 3] = rotation @ found.poses[:, :3, :3], moved(found.poses[:, :3, 3])
    scene = replace(found, poses=poses, points=moved(found.points))
    radius = 0.0
    if plane is not None:
        flat = np.abs(scene.points[:, 2]) < TABLE_TOLERANCE * CAMERA_DISTANCE
        radius = float(np.quantile(np.linalg.norm(scene.points[flat, :2], axis=1), NEARLY_ALL))
    return World(scene, radius, object_points(scene.points, moved(centre), plane is not None))


def meeting_point(poses: np.ndarray) -> np.ndarray:
    """[3] the point nearest to the optical axes of poses [n, 4, 4], OpenGL axes; axes far from it count less."""
    origins, axes = poses[:, :3, 3], -poses[:, :3, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    weights = np.ones(len(poses))
    for _ in range(10):
        total = (across * weights[:, None, None]).sum(0)
        point = np.linalg.lstsq(total, (across @ origins[..., None])[..., 0].T @ weights, rcond=None)[0]
        misses = np.linalg.norm((across @ (point - origins)[..., None])[..., 0], axis=1)
        weights = 1 / (misses + 0.1 * np.median(misses) + 1e-12)
    return point


def object_points(points: np.ndarray, centre: np.ndarray, table: bool) -> np.ndarray:
    """[m] bool, points [m, 3] near the centre [3], above a table z = 0: the largest connected group, others over or under it."""
    chosen = np.linalg.norm(points - centre, axis=1) < 0.5 * CAMERA_DISTANCE
    if table:
        chosen &= points[:, 2] > 1.5 * TABLE_TOLERANCE * CAMERA_DISTANCE
    index = np.flatnonzero(chosen)
    if len(index) <= NEAREST:
        return chosen
    tree = cKDTree(points[index])
    spacing = np.median(tree.query(points[index], NEAREST + 1)[0][:, -1])
    pairs = tree.query_pairs(LINK * spacing, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(index), len(index)))
    groups = connected_components(graph, directed=False)[1]
    sizes = np.bincount(groups)
    largest = points[index[groups == sizes.argmax()], :2]
    middle = np.median(largest, axis=0)
    reach = STANDS_OVER * np.quantile(np.linalg.norm(largest - middle, axis=1), 0.9)
    result = np.zeros(len(points), bool)
    for group in np.flatnonzero(sizes >= SMALLEST_GROUP * len(index)):
        members = index[groups == group]
        if np.linalg.norm(np.median(points[members, :2], axis=0) - middle) < reach:
            result[members] = True
    return result
