"""Moves the vertices of an asset until its outline covers the pixels as the photos say: their masks and, before a known background, their
colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt, uniform_filter
from scipy.sparse import csr_matrix, identity, kron, vstack
from scipy.sparse.csgraph import laplacian
from scipy.sparse.linalg import cg
from trimesh.geometry import faces_to_edges

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.data.images import linear_to_srgb, srgb_to_linear
from splitnerf.data.lens import pixel_width
from splitnerf.data.pixels import per_channel
from splitnerf.ops import MeshScene
from splitnerf.refinement.contours import Mesh, coverage_slopes, edges_of, outline_pieces
from splitnerf.refinement.pixels import PixelFilter, Pixels, pixels_of

ROUNDS = 3
RAYS = 32  # of a pixel
LARGEST = 1.0  # pixels that a vertex may move in a round
# weights of the differences of neighbours' moves and of the moves, in units of the mean curvature
SMOOTH, ANCHOR = 0.3, 0.02
BATCH = 4096  # pixels
# pixels inside a mask's edge from which on a photo shows the object alone, and over which its colour is a mean
INNER, WINDOW = 3, 5
# standard errors of sRGB colours, of a mask's coverage, and of that by colours at least
NOISE, BY_MASK, BY_COLOUR = 0.05, 0.1, 0.05
MOST = 1 << 22  # pixels near the edges, about; each needs rays and rows of a matrix


def outline_pixels(dataset: Dataset) -> tuple[Pixels, np.ndarray]:
    """The known pixels near the edges of the masks, or a random share of them, and their coverage [n] in the photos."""

    def near_edge(i: int) -> np.ndarray:
        alpha = dataset.images[i, ..., 3]
        partly = (alpha > 0.01) & (alpha < 0.99)
        inside = alpha > 0.5  # a mask without partly covered pixels has edges too
        edge = np.diff(inside, axis=0, append=inside[-1:]) | np.diff(inside, axis=1, append=inside[:, -1:])
        near = binary_dilation(partly | edge, np.ones((3, 3), bool))
        return near if dataset.known is None else near & dataset.known[i]

    pixels = pixels_of(dataset, near_edge, MOST)
    column, row = pixels.centre.astype(np.int64).T
    shares = dataset.images[pixels.view, row, column, 3]
    for i in np.unique(pixels.view):
        behind, here = dataset.behind(i) if dataset.whole else None, np.flatnonzero(pixels.view == i)
        if behind is not None:
            told = by_colours(dataset.images[i], behind, per_channel(dataset.exposures)[i])
            shares[here] = told[row[here], column[here]]
    return pixels, shares


def by_colours(photo: np.ndarray, behind: np.ndarray, exposure: np.ndarray) -> np.ndarray:
    """[H, W] the object's coverage of the pixels of a photo [H, W, 4] (sRGB at the common exposure, and the mask): that of the mask
    and, where the background is known, that by which the pixel mixes, in linear light, the object's colour farther inside and the
    background's; each counts by the square of its error. For `behind` see :meth:`splitnerf.data.dataset.Dataset.behind`; `exposure`
    [3] is the photo's."""
    colour, mask = photo[..., :3], photo[..., 3]
    core = distance_transform_edt(mask > 0.5) > INNER
    if not core.any():
        return mask
    nearest = tuple(distance_transform_edt(~core, return_distances=False, return_indices=True))
    sums = uniform_filter(np.dstack([colour, np.ones_like(mask)]) * core[..., None], (WINDOW, WINDOW, 1))[nearest]
    shown, inner, outer = (srgb_to_linear(x) for x in (colour, sums[..., :3] / sums[..., 3:], behind[..., :3]))
    change, outer = 0.02 * shown + 1e-3, outer / np.float32(exposure)
    weights = ((linear_to_srgb(shown + change) - linear_to_srgb(shown)) / change) ** 2  # errors are of sRGB
    size = (weights * (inner - outer) ** 2).sum(-1).clip(1e-12)
    share = ((weights * (inner - outer) * (shown - outer)).sum(-1) / size).clip(0, 1)
    misfit = (weights * (shown - outer - share[..., None] * (inner - outer)) ** 2).sum(-1)
    weight = np.where(behind[..., 3] > 0, BY_MASK**2 / np.maximum((NOISE**2 + misfit) / size, BY_COLOUR**2), 0)
    return (mask + weight * share) / (1 + weight)


def weld(vertices: np.ndarray) -> np.ndarray:
    """[n] the number of the place of each vertex; vertices that the charts' seams doubled share one."""
    _, number = np.unique(vertices, axis=0, return_inverse=True)
    return number.reshape(-1)


def raised(points: np.ndarray, ground: np.ndarray | None) -> np.ndarray:
    """Points [n, 3] with those below a plane, see `Dataset.ground`, moved up on to it."""
    if ground is None:
        return points
    return points - np.minimum(points @ ground[:3] - ground[3], 0)[:, None] * ground[:3]


def coverage(scene: MeshScene, pixels: Pixels, generator: np.random.Generator) -> np.ndarray:
    """[n] the share of each pixel's filter that a mesh fills, by rays."""
    window, shares = PixelFilter(), []
    for start in range(0, len(pixels), BATCH):
        index = np.arange(start, min(start + BATCH, len(pixels)))
        rays = pixels.rays(index, window.spread(len(index), RAYS, generator))
        hit = scene.trace_closest(*(part.reshape(-1, 3) for part in rays))[0] >= 0
        shares.append(hit.reshape(-1, RAYS).mean(axis=1))
    return np.concatenate(shares)


def slopes(mesh: Mesh, pixels: Pixels, shape: tuple[int, int]) -> csr_matrix:
    """The derivatives [n, 3 m] of the coverage of n pixels, in the order of their photos of height and width `shape`, by the
    coordinates of m vertices."""
    window, parts = PixelFilter(), []
    column, row = pixels.centre.astype(np.int64).T
    for view in np.unique(pixels.view):
        here = pixels.view == view
        number = np.full(shape, -1, np.int64)
        number[row[here], column[here]] = np.arange(here.sum())
        pieces = outline_pieces(mesh, pixels, view, shape)
        parts.append(coverage_slopes(pieces, number, len(mesh.vertices), window))
    return vstack(parts).tocsr()


def smoothness(faces: np.ndarray, n_vertices: int) -> csr_matrix:
    """[m, m] the graph Laplacian of a mesh."""
    edges = faces_to_edges(faces)
    joined = csr_matrix((np.ones(len(edges)), edges.T), shape=(n_vertices, n_vertices))
    return laplacian(((joined + joined.T) > 0).astype(np.float64)).tocsr()


def fit_outline(
    dataset: Dataset, asset: Asset, seed: int = 0, begins: Callable[[int], bool] = lambda turn: True
) -> tuple[Asset, list[float]]:
    """Moves vertices so that the asset covers the pixels as the masks do; the moves are a smooth field on the mesh.

    Normals, tangents and texture coordinates stay: a texture goes where its triangles go.

    Args:
        dataset: The photos, whose alpha is the mask.
        asset: A closed asset in the photos' world frame.
        begins: Called before each round with its number, 0 to ROUNDS - 1; returns whether to make it.

    Returns:
        The moved asset, or the given one where moving it did not lower the error, and the mean squared error of the
        coverage at the outline before each round and at the end; no errors where the masks have no edges.
    """
    pixels, mask = outline_pixels(dataset)
    if len(pixels) == 0:
        return asset, []
    place = weld(asset.vertices)
    faces, m = place[asset.triangles], int(place.max()) + 1
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = edges_of(faces)
    start = np.zeros((m, 3))
    start[place] = raised(asset.vertices, dataset.ground)
    smooth = kron(SMOOTH * smoothness(faces, m) + ANCHOR * identity(m), identity(3)).tocsr()
    pixel = pixel_width(dataset.world_poses, dataset.intrinsics, asset.vertices.mean(0))
    largest, random = LARGEST * pixel, np.random.default_rng(seed)
    errors, moved = [], np.zeros(3 * m)
    for turn in range(ROUNDS + 1):
        mesh = Mesh(start + moved.reshape(-1, 3), faces, edges)
        rest = mask - coverage(mesh.scene, pixels, random)
        errors.append(float((rest**2).mean()))
        if turn == ROUNDS or not begins(turn):
            break
        jacobian = slopes(mesh, pixels, dataset.images.shape[1:3])
        curvature = (jacobian.T @ jacobian).tocsr()
        typical = curvature.diagonal()
        prior = (typical[typical > 0].mean() if (typical > 0).any() else 1.0) * smooth
        step, _ = cg(curvature + prior, jacobian.T @ rest - prior @ moved, rtol=1e-4, maxiter=500)
        length = np.linalg.norm(step.reshape(-1, 3), axis=1).repeat(3)
        moved += step * np.minimum(1, largest / np.maximum(length, 1e-20))
        moved = (raised(start + moved.reshape(-1, 3), dataset.ground) - start).ravel()
    better = errors[-1] < errors[0]
    return (replace(asset, vertices=mesh.vertices[place].astype(np.float32)) if better else asset), errors
