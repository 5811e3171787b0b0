"""The textures of an asset: which texels its charts cover, and what points of the surface read from them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from torch import Tensor
from torch.nn import functional as F
from trimesh.graph import connected_component_labels

from splitnerf.data.asset import Asset, unit
from splitnerf.data.dataset import Dataset
from splitnerf.data.lens import pixel_width
from splitnerf.export.bake import Texels, nearest_rows, rasterise

PATCH_PIXELS = 2.0  # width of a patch, in pixels of the photos
# Of a texel across a seam, in widths of a texel; texels among which it is searched.
SEAM_REACH, SEAM_CANDIDATES = 2.0, 12
SEAM_COSINE = 0.7  # least cosine of the normals on both sides of a seam: the two sides of a sheet are no neighbours
MIN_COSINE = 1e-3  # of a shading normal and the direction to the viewer
N_CHANNELS = 8  # albedo 3, roughness, metallic, tangent-space normal 3


class Footprints(NamedTuple):
    """Where points read the texture."""

    texels: Tensor  # [n, 4] int64 row * size + column
    weights: Tensor  # [n, 4] float32 bilinear


class SurfaceSamples(NamedTuple):
    """Points of the mesh seen by camera rays.

    Attributes:
        positions, view_dirs: [n, 3].
        geometric: [n, 3] unit normals of the triangles, on the viewer's side.
        smooth, tangents, bitangents: [n, 3] the frame of the normal texture, interpolated and not normalised.
        footprints: Where the textures are read.
    """

    positions: Tensor
    view_dirs: Tensor
    geometric: Tensor
    smooth: Tensor
    tangents: Tensor
    bitangents: Tensor
    footprints: Footprints


def bilinear_footprints(uv: np.ndarray, size: int) -> Footprints:
    """The four texels around uv [n, 2], (0, 0) the top left corner of a square texture that repeats."""
    x, y = (uv.T % 1.0) * size - 0.5
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    x0, y0 = left.astype(np.int64) % size, top.astype(np.int64) % size
    x1, y1 = (x0 + 1) % size, (y0 + 1) % size
    texels = np.stack([y0 * size + x0, y0 * size + x1, y1 * size + x0, y1 * size + x1], axis=1)
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=1)
    return Footprints(torch.from_numpy(texels), torch.from_numpy(weights.astype(np.float32)))


class TexelPairs:
    """Pairs of neighbours among m texels, [k, 2], with the differences of their values as a linear map. `frames` [q, 2, 2] of the
    last q pairs take x and y of a tangent-space normal at the second into the frame of the first; the two texels of other pairs
    have one frame."""

    def __init__(self, m: int, pairs: np.ndarray, frames: Tensor):
        k = len(pairs)
        self.ends, self.frames, self._turned = torch.from_numpy(pairs), frames, slice(k - len(frames), k)
        entries = np.tile(np.float32([1, -1]), k), pairs.astype(np.int32).ravel(), np.arange(0, 2 * k + 1, 2, np.int32)
        self._apart = csr_array(entries, (k, m))
        self._back = self._apart.T.tocsr()
        self._sum = abs(self._back)

    def differences(self, values: Tensor) -> Tensor:
        """[k, n] the first's values [m, n] minus the second's in the frame of the first; the last two are a normal's x and y."""
        apart = torch.from_numpy(self._apart @ values.numpy())
        tilts = values[self.ends[self._turned, 1], -2:]
        apart[self._turned, -2:] += tilts - torch.einsum("kab,kb->ka", self.frames, tilts)
        return apart

    def adjoint(self, values: Tensor) -> Tensor:
        """[m, n] the transpose of :meth:`differences`, of values [k, n]."""
        back, tilts = torch.from_numpy(self._back @ values.numpy()), values[self._turned, -2:]
        change = tilts - torch.einsum("kab,ka->kb", self.frames, tilts)
        back[:, -2:] = back[:, -2:].index_add(0, self.ends[self._turned, 1], change)
        return back

    def sums(self, values: Tensor) -> Tensor:
        """[m, n] the sums of values [k, n] of the pairs that a texel is in."""
        return torch.from_numpy(self._sum @ values.numpy())


class AssetTexels:
    """The covered texels of an asset's textures, m of them, and the mesh that they lie on. The asset has one material with factors
    of 1, square albedo, roughness-metallic and normal textures of one size, and no vertex colours or emission; raises ValueError
    where it has another form.

    Attributes:
        index: [m] int64 row * size + column, ascending.
        chart: [m] the number of each texel's chart.
        positions: [m, 3] the texels' points on the mesh.
        start: [m, 8] the texture's values.
        pairs: Neighbours within a chart, and then the nearest texels of two charts along their seams.
    """

    def __init__(self, asset: Asset):
        check_form(asset)
        self.asset, m = asset, asset.materials[0]
        self.size = m.albedo_texture.shape[0]
        covered = rasterise(asset.uv, asset.triangles, self.size)
        self._nearest = nearest_rows(covered.index, self.size)
        self._row_of = torch.from_numpy(self._nearest.reshape(-1).astype(np.int64))
        maps = [m.albedo_texture, m.roughness_metallic_texture, m.normal_texture]
        values = np.concatenate(maps, axis=2).reshape(-1, N_CHANNELS).astype(np.float32)
        self.index, self.chart = covered.index, charts(asset)[asset.triangles[covered.triangle, 0]]
        self.positions = covered.interpolate(asset.vertices, asset.triangles)
        self.start = torch.from_numpy(values[covered.index])
        normals, tangents = (covered.interpolate(x, asset.triangles) for x in (asset.normals, asset.tangents))
        inside = neighbours(covered, self.chart, self.size)
        across = across_seams(inside, self.chart, self.positions, normals)
        frames = frames_of(normals, tangents)
        turns = np.einsum("kax,kbx->kab", *(frames[end] for end in across.T))
        self.pairs = TexelPairs(len(self.index), np.concatenate([inside, across]), torch.from_numpy(turns).float())

    def rows(self, footprints: Footprints) -> Tensor:
        """[n, 4] the covered texels that points read; texels outside the charts have the value of the nearest
        inside."""
        return self._row_of[footprints.texels]

    def spread(self, values: Tensor) -> Tensor:
        """The image [h, w, c] of texels' values [m, c]; outside the charts that of the nearest inside."""
        return torch.from_numpy(values.numpy()[self._nearest])

    def maps(self, values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Textures of values [m, 8]: albedo [h, w, 3], roughness and metallic [h, w, 2], normals [h, w, 3]."""
        return tuple(part.contiguous() for part in self.spread(values).split([3, 2, 3], dim=2))

    def asset_with(self, maps: tuple[Tensor, Tensor, Tensor]) -> Asset:
        """The asset with other textures, see :meth:`maps`."""
        names = ("albedo_texture", "roughness_metallic_texture", "normal_texture")
        textures = {name: part.numpy() for name, part in zip(names, maps)}
        return replace(self.asset, materials=[replace(self.asset.materials[0], **textures)])

    def sample(self, triangle: np.ndarray, u: np.ndarray, v: np.ndarray, view_dirs: np.ndarray) -> SurfaceSamples:
        """The points of hits: triangle [n] with barycentric u, v [n] of its second and third corner."""
        a = self.asset
        corners = a.triangles[triangle]
        weights = np.stack([1 - u - v, u, v], axis=1)[..., None]
        mean = lambda values: (values[corners] * weights).sum(axis=1)  # noqa: E731
        p0, p1, p2 = (a.vertices[corners[:, i]] for i in range(3))
        geometric = unit(np.cross(p1 - p0, p2 - p0))
        geometric *= np.where((geometric * view_dirs).sum(axis=1, keepdims=True) < 0, -1, 1)
        smooth, tangents = mean(a.normals), mean(a.tangents[:, :3])
        bitangents = np.cross(smooth, tangents) * a.tangents[corners[:, 0], 3:]
        numbers = (mean(a.vertices), view_dirs, geometric, smooth, tangents, bitangents)
        tensors = (torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in numbers)
        return SurfaceSamples(*tensors, bilinear_footprints(mean(a.uv), self.size))


class TexelMaterials(NamedTuple):
    """Materials of points: albedo [n, 3], roughness and metallic [n, 1], unit shading normals [n, 3] that face the
    viewer."""

    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    normals: Tensor


def materials_of(values: Tensor, samples: SurfaceSamples) -> TexelMaterials:
    """The materials of samples from texture values [n, 8] at them."""
    albedo, roughness, metallic, local = values.split([3, 1, 1, 3], dim=1)
    x, y, z = local.unbind(1)
    world = x[:, None] * samples.tangents + y[:, None] * samples.bitangents + z[:, None] * samples.smooth
    normals = F.normalize(world, dim=1)
    side = torch.where((normals.detach() * samples.geometric).sum(1, keepdim=True) < 0, -1.0, 1.0)
    normals = normals * side
    # Where a normal turns away from the viewer it is bent back, as the path tracer does.
    cosine = (normals * samples.view_dirs).sum(1, keepdim=True)
    across = F.normalize(normals - samples.view_dirs * cosine, dim=1)
    bent = F.normalize(across + samples.view_dirs * MIN_COSINE, dim=1)
    return TexelMaterials(albedo, roughness, metallic, torch.where(cosine >= MIN_COSINE, normals, bent))


def check_form(asset: Asset) -> None:
    """Raises ValueError where an asset is not of the form that :class:`AssetTexels` takes."""
    m = asset.materials[0]
    textures = (m.albedo_texture, m.roughness_metallic_texture, m.normal_texture)
    if len(asset.materials) > 1 or asset.uv is None or asset.tangents is None or any(t is None for t in textures):
        raise ValueError("the asset must have one material with albedo, roughness-metallic and normal textures")
    sizes = {t.shape[:2] for t in textures}
    if len(sizes) > 1 or len(set(*sizes)) > 1:
        raise ValueError("the asset's textures must be square and of one size")
    factors = np.array([*m.albedo, m.roughness, m.metallic])
    if asset.colors is not None or np.abs(factors - 1).max() > 1e-6 or np.any(m.emission):
        raise ValueError("the asset must have factors of 1, no vertex colours and no emission")


def charts(asset: Asset) -> np.ndarray:
    """[n] the number of the chart that each vertex belongs to; charts share no vertices."""
    edges = np.concatenate([asset.triangles[:, :2], asset.triangles[:, 1:]])
    return connected_component_labels(edges, len(asset.vertices))


def neighbours(covered: Texels, chart: np.ndarray, size: int, apart: int = 1) -> np.ndarray:
    """[k, 2] pairs of covered texels in one row or column and chart, `apart` texels from each other; chart [m] of each
    texel."""
    chart_map, number = (np.full(size * size, -1, np.int64) for _ in range(2))
    chart_map[covered.index], number[covered.index] = chart, np.arange(len(covered.index))
    chart_map, number = chart_map.reshape(size, size), number.reshape(size, size)
    pairs = []
    for a, b in ((np.s_[:, apart:], np.s_[:, :-apart]), (np.s_[apart:], np.s_[:-apart])):
        same = (chart_map[a] == chart_map[b]) & (chart_map[a] >= 0)
        pairs.append(np.stack([number[a][same], number[b][same]], axis=1))
    return np.concatenate(pairs)


def across_seams(inside: np.ndarray, chart: np.ndarray, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """[k, 2] pairs of texels of different charts, each at the border of its own and the other the nearest one; `inside` [n, 2] are
    neighbours within a chart, `positions` and `normals` [m, 3] the texels' points and normals of any length."""
    spacing = (
        np.median(np.linalg.norm(positions[inside[:, 0]] - positions[inside[:, 1]], axis=1)) if len(inside) else 0.0
    )
    border = np.flatnonzero(np.bincount(inside.ravel(), minlength=len(chart)) < 4)
    if len(border) == 0 or spacing == 0:
        return np.empty((0, 2), np.int64)
    distances, found = cKDTree(positions[border]).query(
        positions[border], SEAM_CANDIDATES, distance_upper_bound=SEAM_REACH * spacing
    )
    first, second = np.repeat(border, SEAM_CANDIDATES), np.append(border, -1)[found.ravel()]
    near = unit(normals)
    good = np.isfinite(distances.ravel()) & (chart[first] != chart[second])
    good &= (near[first] * near[second]).sum(axis=1) > SEAM_COSINE
    nearest = np.full(len(chart), -1)
    nearest[first[good][::-1]] = second[good][::-1]  # candidates stand by their distance: the first one stays
    ends = np.flatnonzero(nearest >= 0)
    return np.unique(np.sort(np.stack([ends, nearest[ends]], axis=1), axis=1), axis=0)


def frames_of(normals: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """[m, 2, 3] the axes x and y of tangent space at texels with normals [m, 3] and tangents [m, 4], of any length."""
    normals, x = unit(normals), unit(tangents[:, :3])
    return np.stack([x, np.cross(normals, x) * np.sign(tangents[:, 3:])], axis=1)


def texels_per_pixel(dataset: Dataset, asset: Asset) -> float:
    """The width of a photo's pixel in texels of the asset's albedo, in the middle of the asset."""
    size, corners = asset.materials[0].albedo_texture.shape[0], asset.vertices[asset.triangles].astype(np.float64)
    surface = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    flat = asset.uv[asset.triangles].astype(np.float64)
    (ux, uy), (vx, vy) = (flat[:, 1] - flat[:, 0]).T, (flat[:, 2] - flat[:, 0]).T
    texel = math.sqrt(surface / max(np.abs(ux * vy - uy * vx).sum(), 1e-12)) / size
    return pixel_width(dataset.world_poses, dataset.intrinsics, asset.vertices.mean(0)) / texel


def patch_width(pixel: float) -> int:
    """The edge in texels of a patch that is PATCH_PIXELS pixels of the photos wide, from the pixels' width in texels."""
    return max(1, round(PATCH_PIXELS * pixel))
