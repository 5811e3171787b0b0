"""Moves the vertices of an asset along their normals until its outline covers the pixels as the photos' masks say."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.sparse import coo_matrix, diags, identity
from scipy.sparse.linalg import cg

from splitnerf.data.asset import Asset
from splitnerf.data.dataset import Dataset
from splitnerf.ops import MeshScene
from splitnerf.refinement.pixels import PixelFilter, Pixels, pixel_size, pixels_of

ROUNDS = 3
RAYS = 32  # of a pixel
PROBE = 0.25  # pixels by which the surface is raised and lowered
LARGEST = 1.0  # pixels that a vertex may move in a round
SMOOTH, ANCHOR = 3.0, 0.02  # weights of the differences of neighbours' moves and of the moves, in units of the mean curvature
MIN_SLOPE = 0.05  # of the coverage a pixel; below it a pixel's outline does not move with the surface
BATCH = 4096  # pixels


class Outline(NamedTuple):
    """What the masks say of the moves of welded vertices.

    Attributes:
        system: [m, m] sparse J^T J.
        right: [m] J^T (mask - coverage).
        error: Mean squared error of the coverage at the outline's pixels.
    """

    system: coo_matrix
    right: np.ndarray
    error: float


def outline_pixels(dataset: Dataset) -> tuple[Pixels, np.ndarray]:
    """The pixels near the edges of the masks, and their coverage [n] in the photos."""
    alpha = dataset.images[..., 3]
    partly = (alpha > 0.01) & (alpha < 0.99)
    inside = alpha > 0.5
    for axis in (1, 2):  # a mask without partly covered pixels has edges too
        change = np.diff(inside, axis=axis)
        pad = [(0, 0)] * 3
        pad[axis] = (0, 1)
        partly |= np.pad(change, pad)
    near = binary_dilation(partly, np.ones((1, 3, 3), bool))
    return pixels_of(dataset, near), alpha[near]


def weld(vertices: np.ndarray) -> np.ndarray:
    """[n] the number of the place of each vertex; vertices that the charts' seams doubled share one."""
    _, number = np.unique(vertices, axis=0, return_inverse=True)
    return number.reshape(-1)


def observe(asset: Asset, place: np.ndarray, dataset: Dataset, reach: float, seed: int) -> Outline:
    """Compares the outline with the masks, and finds how coverage changes where the surface moves along its normals.

    Args:
        asset: The asset.
        place: [n] from :func:`weld`.
        dataset: The photos.
        reach: Distance by which the surface is raised and lowered, in the asset's units.
        seed: The seed of the rays.
    """
    pixels, mask = outline_pixels(dataset)
    lower, middle, upper = (
        MeshScene(asset.vertices + shift * asset.normals, asset.triangles) for shift in (-reach, 0.0, reach)
    )
    random, filtered, m = np.random.default_rng(seed), PixelFilter(), int(place.max()) + 1
    rows, columns, values, rest = [], [], [], []
    for start in range(0, len(pixels), BATCH):
        index = np.arange(start, min(start + BATCH, len(pixels)))
        offsets = filtered.spread(len(index), RAYS, random)
        origins, directions = (part.reshape(-1, 3) for part in pixels.rays(index, offsets))
        inner, hit = (scene.trace_closest(origins, directions)[0] >= 0 for scene in (lower, middle))
        triangle, u, v = upper.trace_closest(origins, directions)
        outer = triangle >= 0
        coverage = [part.reshape(-1, RAYS).mean(1) for part in (inner, hit, outer)]
        slope = (coverage[2] - coverage[0]) / (2 * reach)
        rest.append(mask[index] - coverage[1])
        rim = np.flatnonzero(outer & ~inner)  # rays between the two outlines say which vertices make them
        pixel = rim // RAYS
        n_rim = np.bincount(pixel, minlength=len(index))
        keep = slope[pixel] * 2 * reach > MIN_SLOPE
        rim, pixel = rim[keep], pixel[keep]
        corners = np.column_stack([1 - u - v, u, v])[rim]
        columns.append(place[asset.triangles[triangle[rim]]].reshape(-1))
        rows.append(np.repeat(start + pixel, 3))
        values.append((corners * (slope[pixel] / n_rim[pixel])[:, None]).reshape(-1))
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    jacobian, rest = coo_matrix(entries, shape=(len(pixels), m)).tocsr(), np.concatenate(rest)
    return Outline(jacobian.T @ jacobian, jacobian.T @ rest, float((rest**2).mean()))


def smoothness(asset: Asset, place: np.ndarray) -> coo_matrix:
    """[m, m] the graph Laplacian of the welded mesh."""
    faces = place[asset.triangles]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    m = int(place.max()) + 1
    weights = coo_matrix((np.ones(len(edges)), edges.T), shape=(m, m)).tocsr()
    weights = ((weights + weights.T) > 0).astype(np.float64)
    return diags(np.asarray(weights.sum(1)).ravel()) - weights


def fit_outline(dataset: Dataset, asset: Asset, seed: int = 0) -> tuple[Asset, list[float]]:
    """Moves vertices along their normals so that the asset covers the pixels as the masks do; a smooth field of moves.

    Args:
        dataset: The photos, whose alpha is the mask.
        asset: An asset in the photos' world frame.
        seed: The seed of the rays.

    Returns:
        The asset, unchanged where that covers the pixels better, and the mean squared error of the coverage at the
        outline before each round and at the end; no errors, and the asset as it was, where the masks have no edges.
    """
    if len(outline_pixels(dataset)[0]) == 0:
        return asset, []
    place = weld(asset.vertices)
    laplacian = smoothness(asset, place)
    pixel = pixel_size(dataset, asset.vertices)
    errors, moved, start = [], np.zeros(int(place.max()) + 1), asset.vertices
    for turn in range(ROUNDS):
        seen = observe(asset, place, dataset, PROBE * pixel, seed + turn)
        errors.append(seen.error)
        typical = seen.system.diagonal()
        typical = typical[typical > 0].mean() if (typical > 0).any() else 1.0
        prior = typical * (SMOOTH * laplacian + ANCHOR * identity(len(moved)))
        step, _ = cg(seen.system + prior, seen.right - prior @ moved, rtol=1e-4, maxiter=500)
        moved += np.clip(step, -LARGEST * pixel, LARGEST * pixel)
        asset = replace(asset, vertices=(start + moved[place, None] * asset.normals).astype(np.float32))
    errors.append(observe(asset, place, dataset, PROBE * pixel, seed + ROUNDS).error)
    return (asset if errors[-1] < errors[0] else replace(asset, vertices=start)), errors
