"""What makes an extracted mesh light."""

from __future__ import annotations

import numpy as np

MIN_COMPONENT = 0.01  # of the faces of the largest one


def drop_floaters(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Removes connected components with less than 1 % of the largest one's faces."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(edges), bool), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    count = np.bincount(label[faces[:, 0]], minlength=label.max() + 1)
    keep = count[label[faces[:, 0]]] >= MIN_COMPONENT * count.max()
    used, new_faces = np.unique(faces[keep], return_inverse=True)
    return vertices[used], new_faces.reshape(-1, 3).astype(np.int32)
