"""Simplifies an extracted mesh: removes floaters, cavities and what hangs where no photo looks, caps what no photo shows, reduces
the number of faces; a closed mesh stays closed."""

from __future__ import annotations

from itertools import product

import fast_simplification
import numpy as np
import trimesh
from scipy.sparse import coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import cg
from trimesh.graph import connected_component_labels

from splitnerf.errors import note_once

MIN_COMPONENT = 0.01  # share of the largest component's faces
LEAST_SEEN = 0.1  # share of a component's vertices that photos must show
FOLDED = 0.2  # share of its area that what no photo shows keeps at least on a membrane
# The quadric simplification sometimes pinches thin parts; then another aggressiveness or target is tried.
AGGRESSIVENESS, SHARES = (5, 3, 7), (1.0, 0.97, 0.94)
MANY = 1.1  # times the number of faces that is asked for


def drop_floaters_and_cavities(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Removes connected components with less than 1 % of the largest one's faces, and the walls of cavities, hollows that nothing
    outside can see: a wall faces inward, so that the volume that it encloses is negative. Returns vertices [n, 3], outward faces
    [m, 3] and the number of removed components."""
    label = connected_component_labels(np.concatenate([faces[:, :2], faces[:, 1:]]), len(vertices))
    count = np.bincount(label[faces[:, 0]], minlength=label.max() + 1)
    a, b, c = (vertices[faces[:, i], :3].astype(np.float64) for i in range(3))
    volume = np.bincount(label[faces[:, 0]], (a * np.cross(b, c)).sum(axis=1) / 6.0, minlength=len(count))
    dropped = ((count < MIN_COMPONENT * count.max()) | (volume < 0)) & (count > 0)
    vertices, faces = _compact(vertices, faces[~dropped[label[faces[:, 0]]]])
    return vertices, faces, int(dropped.sum())


def drop_unseen(
    vertices: np.ndarray, faces: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Removes connected components of whose vertices less than a tenth is `seen` [n], unless all are such. Returns vertices [n, 3],
    faces [m, 3], `seen` of these vertices, and the number of removed components."""
    label = connected_component_labels(trimesh.geometry.faces_to_edges(faces), len(vertices))
    shown = np.bincount(label, seen) >= LEAST_SEEN * np.bincount(label)
    kept = (shown | ~shown.any())[label]
    return *_compact(vertices, faces[kept[faces[:, 0]]]), seen[kept], len(np.unique(label[~kept]))


def capped(vertices: np.ndarray, faces: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Moves the vertices [n, 3] that are not `seen` [n] on to a membrane between those seen: each into the middle of its
    neighbours. A flat rim gets a flat cap. What would fold, as a labyrinth behind a crack does, is cut out, and its rims are
    filled. Without any seen vertex all stay as they are. Returns vertices [k, 3], faces [l, 3], and [k] bool, the vertices that
    were not moved."""
    n, edges = len(vertices), trimesh.geometry.faces_to_edges(faces)
    links = coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=(n, n)).tocsr()
    links = links.maximum(links.T)  # the rim of a mesh that is not closed
    free = ~seen
    if seen.all() or free.all():
        return vertices, faces, np.ones(n, bool)
    balance = (diags(np.asarray(links.sum(1)).ravel()) - links)[free]
    result, pull = vertices.copy(), -(balance[:, ~free] @ vertices[~free].astype(np.float64))
    for axis in range(3):
        result[free, axis] = cg(balance[:, free], pull[:, axis], x0=vertices[free, axis], rtol=1e-6, maxiter=5000)[0]
    part = np.full(n, -1)
    part[free] = connected_components(links[free][:, free])[1]
    part = part[faces].max(axis=1)  # of a face
    within = part >= 0
    before, after = (np.bincount(part[within], _areas(x, faces[within])) for x in (vertices, result))
    cut = within & (after < FOLDED * before)[part]
    return _filled(result, faces[~cut], seen) if cut.any() else (result, faces, seen)


def _filled(vertices: np.ndarray, faces: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What :func:`capped` returns of faces with holes: a fan of triangles fills each, and small parts that are now apart go."""
    points, faces = split_pinches(*_compact(np.column_stack([vertices, seen]), faces))
    start, end = trimesh.geometry.faces_to_edges(faces).astype(np.int64).T
    rim = ~np.isin(start * len(points) + end, end * len(points) + start)
    start, end = start[rim], end[rim]
    label = connected_component_labels(np.stack([start, end], axis=1), len(points))
    _, hole, count = np.unique(label[start], return_inverse=True, return_counts=True)
    middles = coo_matrix((1.0 / count[hole], (hole, np.arange(len(start))))).tocsr() @ points[start]
    middles[:, 3] = 0
    fans = np.stack([end, start, len(points) + hole], axis=1)
    points, faces, _ = drop_floaters_and_cavities(np.concatenate([points, middles]), np.concatenate([faces, fans]))
    return points[:, :3].astype(vertices.dtype), faces, points[:, 3] > 0


def _areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return trimesh.triangles.area(vertices[faces].astype(np.float64))


def is_closed(faces: np.ndarray) -> bool:
    """Whether each directed edge occurs exactly once, and its reverse exactly once."""
    return all(trimesh.graph.is_watertight(trimesh.geometry.faces_to_edges(faces)))


def decimate(vertices: np.ndarray, faces: np.ndarray, n_faces: int) -> tuple[np.ndarray, np.ndarray]:
    """Collapses edges by quadric error until about n_faces are left: vertices [k, 3] float32 and faces [l, 3] int32. Tries several
    ways to keep a closed mesh closed, and notes where folds leave many more. A number of 0, or not below that of the faces, keeps
    all. Source: Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics" (1997)."""
    vertices, faces = vertices.astype(np.float32), faces.astype(np.int32)
    if n_faces == 0 or n_faces >= len(faces):
        return vertices, faces
    closed, least = is_closed(faces), (True, True)
    for share, aggressiveness in product(SHARES, AGGRESSIVENESS):
        light = fast_simplification.simplify(vertices, faces, target_count=int(share * n_faces), agg=aggressiveness)
        _, group, count = np.unique(np.sort(light[1], axis=1), axis=0, return_inverse=True, return_counts=True)
        single = light[1][count[group.reshape(-1)] == 1]  # two faces of the same vertices are a sheet without volume
        found = split_pinches(*_compact(light[0].astype(np.float32), single))
        if (faults := (closed and not is_closed(found[1]), len(found[1]) > MANY * n_faces)) <= least:
            result, least = found, faults
        if not any(faults):
            break
    if least[1]:
        note_once(f"the mesh keeps {len(result[1])} faces where {n_faces} were asked for, as its folds let no more go")
    return result


def split_pinches(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gives each fan of faces its own copy of a vertex where parts of the surface touch in a vertex or an edge. Two faces belong to
    one fan of a vertex if they share an edge there that no third face shares."""
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()  # corners of each directed edge
    vertex = faces.ravel()
    keys = np.sort(np.stack([vertex[start], vertex[end]], axis=1), axis=1)
    _, edge, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    order = order[count[edge.reshape(-1)[order]] == 2]
    one, other = order[0::2], order[1::2]
    same_way = vertex[start[one]] == vertex[start[other]]
    joined = [
        (start[one], np.where(same_way, start[other], end[other])),
        (end[one], np.where(same_way, end[other], start[other])),
    ]
    links = np.concatenate([np.stack(pair, axis=1) for pair in joined])
    _, first, renumbered = np.unique(
        connected_component_labels(links, vertex.size), return_index=True, return_inverse=True
    )
    return vertices[vertex[first]], renumbered.reshape(-1, 3).astype(np.int32)


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3).astype(np.int32)
