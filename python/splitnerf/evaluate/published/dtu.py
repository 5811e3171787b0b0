"""DTU in NeuS's form: accuracy and completeness in millimetres, inside the observed volume.

Source: Aanaes et al., Large-Scale Data for Multiple-View Stereopsis, 2016, as the usual Python evaluation has it: points of the
mesh .2 mm apart, those in the scan's ObsMask against the scan's points above its plane, distances from 20 mm left out.
--truth is the folder with `Points/stl/stl024_total.ply`, `ObsMask/ObsMask24_10.mat` and `ObsMask/Plane24.mat`.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import trimesh
from scipy.io import loadmat
from scipy.spatial import cKDTree

from splitnerf.data.layouts import neus as layout
from splitnerf.errors import InputError
from splitnerf.evaluate.published.common import Column, Delivered, Options, Scores, nearest

LAYOUT = layout
COLUMNS: tuple[Column, ...] = (
    ("chamfer", "chamfer, mm", "{:.2f}"), ("accuracy", "mesh to scan, mm", "{:.2f}"),
    ("completeness", "scan to mesh, mm", "{:.2f}"),
)  # fmt: skip
SPACING, FARTHEST, PATCH = 0.2, 20.0, 60.0  # mm
DENSITY = 4.0  # points a square of the spacing, before they are thinned
MOST_POINTS = 20_000_000
CHUNK = 100_000


def score(delivered: Delivered, root: Path, options: Options) -> Scores:
    """Scores the mesh.

    Raises:
        InputError: The truth is missing or cannot be used, or the folder's name has no scan's number.
    """
    number = re.search(r"(\d+)$", root.absolute().name)
    if options.truth is None or number is None:
        raise InputError(f"{root}: --protocol dtu needs --truth with DTU's Points and ObsMask, and a folder called like scan24")
    scan = int(number[1])
    observed, plane = (
        _load(options.truth / "ObsMask" / name) for name in (f"ObsMask{scan}_10.mat", f"Plane{scan}.mat")
    )
    path = options.truth / "Points" / "stl" / f"stl{scan:03d}_total.ply"
    if not path.is_file():
        raise InputError(f"{path}: no such file; give --truth the folder with DTU's Points")
    try:
        points = np.asarray(trimesh.load(path).vertices, np.float64)
    except Exception as error:  # trimesh's loaders raise whatever their parser meets
        raise InputError(f"{path}: cannot be read as points ({str(error)[:80]}); replace it") from None
    try:
        box, step, mask, normal = observed["BB"], float(observed["Res"].item()), observed["ObsMask"], plane["P"].ravel()
        if box.shape != (2, 3) or mask.ndim != 3 or normal.shape != (4,) or not step > 0:
            raise ValueError
    except (KeyError, ValueError, AttributeError):
        raise InputError(
            f"{options.truth / 'ObsMask'}: scan {scan}'s files need BB [2, 3], Res, ObsMask of 3 axes and P [4]; replace them"
        ) from None
    mesh = trimesh.Trimesh(delivered.vertices, delivered.asset.triangles, process=False)
    notes = []
    if DENSITY * mesh.area / SPACING**2 > MOST_POINTS:
        notes.append(f"the mesh is so large that its {MOST_POINTS} points lie further apart than {SPACING} mm")
    accuracy, completeness = distances(thinned(surface_points(mesh)), points, box, step, mask > 0, normal)
    return Scores({"chamfer": (accuracy + completeness) / 2, "accuracy": accuracy, "completeness": completeness}, notes=notes)


def distances(
    ours: np.ndarray, scan: np.ndarray, box: np.ndarray, step: float, observed: np.ndarray, plane: np.ndarray
) -> tuple[float, float]:
    """The mean distance of our points to the scan, and of the scan to ours.

    Args:
        ours: [n, 3] points of the mesh, mm.
        scan: [m, 3] points of the scan, mm.
        box: [2, 3] corners of the observed volume.
        step: mm a cell of it.
        observed: [a, b, c] bool, the cells that were observed.
        plane: [4]; a point x of the scan counts where plane . (x, 1) > 0.

    Raises:
        InputError: Nothing is left to compare.
    """
    box = np.asarray(box, np.float64)
    ours = ours[((ours >= box[0] - PATCH) & (ours < box[1] + 2 * PATCH)).all(axis=1)]
    cells = np.round((ours - box[0]) / step).astype(np.int64)
    inside = ((cells >= 0) & (cells < observed.shape)).all(axis=1)
    inside[inside] = observed[tuple(cells[inside].T)]
    accuracy = nearest(ours[inside], scan)
    above = scan @ plane[:3] + plane[3] > 0
    completeness = nearest(scan[above], ours)
    return tuple(float(d[d < FARTHEST].mean()) if (d < FARTHEST).any() else FARTHEST for d in (accuracy, completeness))


def surface_points(mesh: trimesh.Trimesh) -> np.ndarray:
    """[n, 3] points spread over a mesh, `DENSITY` a square of the spacing."""
    count = int(min(DENSITY * mesh.area / SPACING**2, MOST_POINTS))
    return np.asarray(trimesh.sample.sample_surface(mesh, max(count, 1), seed=0)[0])


def thinned(points: np.ndarray) -> np.ndarray:
    """[m, 3] points of which no two are nearer than the spacing: each in turn drops its neighbours."""
    tree, kept = cKDTree(points), np.ones(len(points), bool)
    for start in range(0, len(points), CHUNK):
        for i, near in enumerate(tree.query_ball_point(points[start : start + CHUNK], SPACING), start):
            if kept[i]:
                kept[near] = False
                kept[i] = True
    return points[kept]


def _load(path: Path) -> dict:
    if not path.is_file():
        raise InputError(f"{path}: no such file; give --truth the folder with DTU's ObsMask")
    try:
        return loadmat(path)
    except Exception as error:  # SciPy raises whatever it meets
        raise InputError(f"{path}: cannot be read ({str(error)[:80]}); replace it") from None
