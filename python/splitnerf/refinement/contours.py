"""The contours of a mesh in photos: where its outline runs, and how the coverage of pixels changes as vertices move.

The coverage of a pixel is the share of its filter that the mesh fills. Where a piece of the outline moves outward by d,
it grows by d times the filter's integral along the piece. Source: Li, Aittala, Durand and Lehtinen 2018 (edge
sampling).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from splitnerf.ops import MeshScene
from splitnerf.refinement.pixels import PixelFilter, Pixels

PIECE = 0.5  # pixels, the greatest length of a piece of a contour
LONGEST = 50.0  # heights and widths of the photo; a longer edge comes close to the plane of the camera
BESIDE = 0.02  # pixels from a piece to the point at which a ray checks that the mesh ends there


class Edges(NamedTuple):
    """The edges of a mesh that two triangles share, k of them."""

    ends: np.ndarray  # [k, 2] vertices
    triangles: np.ndarray  # [k, 2] the two triangles at each
    opposite: np.ndarray  # [k, 2] the third vertex of each triangle


class Mesh:
    """A mesh whose outline is computed: `vertices` [m, 3] world, each place once; `faces` [t, 3] int64, each with three corners
    that differ; and their `edges`, from :func:`edges_of`."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, edges: Edges):
        self.vertices, self.edges = vertices, edges
        self.scene = MeshScene(vertices.astype(np.float32), faces.astype(np.int32))
        corners = vertices[faces]
        self.points = corners[:, 0]  # one of each face
        self.normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


class Pieces(NamedTuple):
    """Short pieces of the outline in one photo, n of them."""

    points: np.ndarray  # [n, 2] their middles in the image, in pixels
    lengths: np.ndarray  # [n] in pixels
    ends: np.ndarray  # [n, 2] the vertices that move a piece
    moves: np.ndarray  # [n, 2, 3] pixels that a piece moves outward per unit move of either vertex along each axis


def edges_of(triangles: np.ndarray) -> Edges:
    """The edges of triangles [t, 3]. Those of one triangle, or of more than two, are left out: the rims of an open
    mesh."""
    ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    opposite = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    _, first, of_edge, count = np.unique(ends, axis=0, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(of_edge.reshape(-1), kind="stable")
    start = (np.cumsum(count) - count)[count == 2]
    two = np.stack([order[start], order[start + 1]], axis=1)
    return Edges(ends[first[count == 2]], two % len(triangles), opposite[two])


def projected(points: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
    """[n, 2] the images, in pixels, of points [n, 3] in a camera's frame (OpenGL axes) with fx, fy, cx, cy."""
    fx, fy, cx, cy = intrinsics
    return np.stack([cx - fx * points[:, 0] / points[:, 2], cy + fy * points[:, 1] / points[:, 2]], axis=1)


def outline_pieces(mesh: Mesh, pixels: Pixels, view: int, shape: tuple[int, int]) -> Pieces:
    """The pieces of edges that bound the mesh's image in the photo `view`, whose height and width are `shape`; `pixels`
    holds the cameras."""
    pose, intrinsics = pixels.poses[view].astype(np.float64), pixels.intrinsics[view].astype(np.float64)
    edges, front = mesh.edges, (mesh.normals * (pose[:, 3] - mesh.points)).sum(axis=1) > 0
    turns = front[edges.triangles[:, 0]] != front[edges.triangles[:, 1]]
    ends = edges.ends[turns]
    inner = np.where(front[edges.triangles[turns, 0]], edges.opposite[turns, 0], edges.opposite[turns, 1])
    local = (mesh.vertices - pose[:, 3]) @ pose[:, :3]
    ahead = np.maximum(local[ends].max(axis=1), local[inner])[:, 2] < 0
    ends, inner = ends[ahead], inner[ahead]
    a, b, inside = (projected(local[i], intrinsics) for i in (*ends.T, inner))
    along = b - a
    length = np.linalg.norm(along, axis=1)
    margin = PixelFilter.WIDTH / 2  # outside of the photo, within which an edge changes the pixels at its border
    in_photo = (np.maximum(a, b) > -margin).all(axis=1) & (np.minimum(a, b) < np.add(shape[::-1], margin)).all(axis=1)
    seen = in_photo & (length > 1e-6) & (length < LONGEST * sum(shape))
    ends, a, along, length, inside = (x[seen] for x in (ends, a, along, length, inside))
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
    outward *= -np.sign(((inside - a) * outward).sum(axis=1, keepdims=True))

    count = np.maximum(1, np.ceil(length / PIECE)).astype(np.int64)
    edge = np.repeat(np.arange(len(count)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
    points = a[edge] + along[edge] * share[:, None]

    def meets(side: float) -> np.ndarray:
        rays = pixels.rays_through(np.array([view]), (points + side * outward[edge])[None])
        return mesh.scene.trace_closest(*(part[0] for part in rays))[0] >= 0

    free = ~meets(BESIDE) & meets(-BESIDE)
    edge, share, points = edge[free], share[free], points[free]
    ends, outward = ends[edge], outward[edge]
    depths = -local[ends][:, :, 2]
    # linear in space, not in the image
    share = share * depths[:, 0] / (share * depths[:, 0] + (1 - share) * depths[:, 1])
    x, y, z = (local[ends] * np.stack([1 - share, share], axis=1)[..., None]).sum(axis=1).T
    fx, fy = intrinsics[:2]
    right, down = outward.T
    slopes = np.stack([-fx * right / z, fy * down / z, (fx * x * right - fy * y * down) / z**2], axis=1) @ pose[:, :3].T
    moves = np.stack([1 - share, share], axis=1)[..., None] * slopes[:, None]
    return Pieces(points, (length / count)[edge], ends, moves)


def coverage_slopes(pieces: Pieces, number: np.ndarray, n_vertices: int, window: PixelFilter) -> csr_matrix:
    """The derivatives [pixels, 3 m] of the coverage of a photo's pixels by the coordinates of `n_vertices` m, from the outline in
    the photo. `number` [H, W] int64 is the row of each pixel, -1 where there is none; the rows are 0 to number.max()."""
    height, width = number.shape
    around = np.arange(window.WIDTH) - window.WIDTH // 2  # from its own pixel to those whose windows hold a piece
    column, row = (np.floor(pieces.points[:, i, None]).astype(np.int64) + around for i in range(2))
    column, row = np.broadcast_arrays(column[:, None, :], row[:, :, None])
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    of_pixel = np.where(inside, number[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)], -1)
    piece, y, x = np.nonzero(of_pixel >= 0)
    centres = np.stack([column[piece, y, x], row[piece, y, x]], axis=1) + 0.5
    weights = window.density(pieces.points[piece] - centres) * pieces.lengths[piece]
    values = (weights[:, None, None] * pieces.moves[piece]).reshape(-1)
    columns = (3 * pieces.ends[piece][..., None] + np.arange(3)).reshape(-1)
    rows = np.repeat(of_pixel[piece, y, x], 6)
    return csr_matrix((values, (rows, columns)), shape=(int(number.max()) + 1, 3 * n_vertices))
