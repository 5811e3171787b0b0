"""NeRO's Glossy Synthetic: the distance between what 32 views see of the mesh and of the truth.

Source: Liu et al., NeRO, SIGGRAPH 2023; its repository's eval_synthetic_shape.py and the list of views in
configs/synthetic_split_128.pkl. Points are means of voxels, .01 wide.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf import _core
from splitnerf.data.layouts import glossy as layout
from splitnerf.data.layouts.frame import Frame
from splitnerf.data.lens import lens_intrinsics
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, nearest
from splitnerf.progress import tracked

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (("chamfer", "chamfer", "{:.5f}"),)
VIEWS = (
    0, 4, 19, 2, 127, 71, 73, 56, 75, 95, 93, 110, 91, 7, 5, 3, 68, 30, 66, 113, 111, 33, 120, 31, 29, 14, 49, 11, 109, 61, 59,
    57,
)  # fmt: skip
VOXEL = 0.01


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores the mesh."""
    frames, notes = layout.read(root), []
    kept = [frame for frame in frames if int(frame.name) in VIEWS]
    if len(kept) < len(VIEWS):
        notes.append(f"the data have {len(kept)} of the set's {len(VIEWS)} views")
    scene = _core.Scene(np.float32(delivered.asset.vertices), np.int32(delivered.asset.triangles))
    truth, ours = [], []
    for frame in tracked(kept, "views, depth"):
        origin, rays, axis = _rays(frame)
        depth = layout.read_depth(frame)
        known = np.isfinite(depth)
        truth.append(origin + rays[known] * (depth[known] / axis[known])[:, None])
        flat = np.ascontiguousarray(rays.reshape(-1, 3), np.float32)
        starts = np.broadcast_to(origin - delivered.origin, flat.shape).astype(np.float32)
        distance, triangle, _, _ = scene.trace_closest(starts, flat)
        hit = np.asarray(triangle) >= 0
        ours.append(origin + flat[hit] * np.asarray(distance)[hit, None])
    return Scores({"chamfer": chamfer(np.concatenate(ours), np.concatenate(truth))} if kept else {"chamfer": None}, notes=notes)


def chamfer(ours: np.ndarray, truth: np.ndarray) -> float:
    """The mean of both directions' mean nearest distance between points [n, 3] and [m, 3], both thinned by voxels."""
    ours, truth = thinned(ours), thinned(truth)
    return float((nearest(ours, truth).mean() + nearest(truth, ours).mean()) / 2)


def thinned(points: np.ndarray) -> np.ndarray:
    """[m, 3] the means of the points [n, 3] of each voxel."""
    if not len(points):
        return points
    cells = np.floor((points - points.min(axis=0) + VOXEL / 2) / VOXEL).astype(np.int64)
    _, index, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, index.ravel(), points)
    return sums / counts[:, None]


def _rays(frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The origin [3] and unit directions [H, W, 3] of the rays through the pixels' middles, and their cosines [H, W] to the
    camera's axis."""
    height, width = layout.read_depth(frame).shape
    fx, fy, cx, cy = lens_intrinsics(frame.lens, (height, width))
    rows, columns = np.indices((height, width)) + 0.5
    local = np.stack([(columns - cx) / fx, (cy - rows) / fy, -np.ones_like(rows)], axis=-1)
    length = np.linalg.norm(local, axis=-1)
    return frame.pose[:3, 3], local @ frame.pose[:3, :3].T / length[..., None], 1 / length
