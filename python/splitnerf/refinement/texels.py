"""The asset's textures as unknowns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from torch import Tensor
from torch.nn import functional as F

from splitnerf.data.asset import Asset
from splitnerf.export.bake import Spread, rasterise

CHANNELS = 8  # albedo 3, roughness, metallic, tangent-space normal 3


class Footprints(NamedTuple):
    """Where points read the texture.

    Attributes:
        texels: [n, 4] int64 row * size + column.
        weights: [n, 4] float32 bilinear.
    """

    texels: Tensor
    weights: Tensor


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


def bilinear_footprints(uv: np.ndarray, height: int, width: int) -> Footprints:
    """The four texels around uv [n, 2], (0, 0) the top left corner; the texture repeats."""
    x, y = (uv[:, 0] % 1.0) * width - 0.5, (uv[:, 1] % 1.0) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    x0, y0 = left.astype(np.int64) % width, top.astype(np.int64) % height
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    texels = np.stack([y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1], axis=1)
    weights = np.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], axis=1)
    return Footprints(torch.from_numpy(texels), torch.from_numpy(weights.astype(np.float32)))


class AssetTexels:
    """The textures of an asset with one material as a table of texels, and the mesh that they lie on.

    Args:
        asset: An asset with albedo, roughness-metallic and normal textures of one size, factors of 1.
    """

    def __init__(self, asset: Asset):
        self.asset = asset
        m = asset.materials[0]
        self.height, self.width = m.albedo_texture.shape[:2]
        maps = [m.albedo_texture, m.roughness_metallic_texture, m.normal_texture]
        self.values = torch.from_numpy(np.concatenate(maps, axis=2).reshape(-1, CHANNELS).astype(np.float32))

    def maps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """albedo [h, w, 3], roughness and metallic [h, w, 2], normals [h, w, 3], contiguous float32."""
        image = self.values.view(self.height, self.width, CHANNELS)
        return tuple(part.contiguous() for part in image.split([3, 2, 3], dim=2))

    def sample(self, triangle: np.ndarray, u: np.ndarray, v: np.ndarray, view_dirs: np.ndarray) -> SurfaceSamples:
        """The points of hits: triangle [n] with barycentric u, v [n] of its second and third corner."""
        a = self.asset
        corners = a.triangles[triangle]
        weights = np.stack([1 - u - v, u, v], axis=1)[..., None]
        mean = lambda values: (values[corners] * weights).sum(axis=1)  # noqa: E731
        p0, p1, p2 = (a.vertices[corners[:, i]] for i in range(3))
        geometric = np.cross(p1 - p0, p2 - p0)
        geometric /= np.maximum(np.linalg.norm(geometric, axis=1, keepdims=True), 1e-20)
        geometric *= np.where((geometric * view_dirs).sum(axis=1, keepdims=True) < 0, -1, 1)
        smooth, tangents = mean(a.normals), mean(a.tangents[:, :3])
        bitangents = np.cross(smooth, tangents) * a.tangents[corners[:, 0], 3:]
        numbers = (mean(a.vertices), view_dirs, geometric, smooth, tangents, bitangents)
        tensors = (torch.from_numpy(np.ascontiguousarray(x, np.float32)) for x in numbers)
        return SurfaceSamples(*tensors, bilinear_footprints(mean(a.uv), self.height, self.width))


class Materials(NamedTuple):
    """Materials of points: albedo [n, 3], roughness and metallic [n, 1], unit shading normals [n, 3] that face the viewer."""

    albedo: Tensor
    roughness: Tensor
    metallic: Tensor
    normals: Tensor


def materials_of(values: Tensor, samples: SurfaceSamples) -> Materials:
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
    bent = F.normalize(across + samples.view_dirs * 1e-3, dim=1)
    return Materials(albedo.clamp(0, 1), roughness.clamp(0, 1), metallic.clamp(0, 1), torch.where(cosine >= 1e-3, normals, bent))


class TexelGraph(NamedTuple):
    """The texels that charts cover.

    Attributes:
        index: [m] int64 row * size + column.
        pairs: [k, 2] int64 numbers (of `index`) of neighbours in one chart.
        spread: Makes a map of values at these texels.
    """

    index: Tensor
    pairs: Tensor
    spread: Spread


def texel_graph(asset: Asset, size: int) -> TexelGraph:
    """The covered texels of an asset's square textures and who is whose neighbour."""
    faces, n = asset.triangles, len(asset.vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    _, label = connected_components(coo_matrix((np.ones(len(edges)), edges.T), shape=(n, n)), directed=False)
    texels = rasterise(asset.uv, faces, size)
    chart, number = (np.full(size * size, -1, np.int64) for _ in range(2))
    chart[texels.index] = label[faces[texels.triangle, 0]]
    number[texels.index] = np.arange(len(texels.index))
    chart, number = chart.reshape(size, size), number.reshape(size, size)
    pairs = []
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        same = (chart[a] == chart[b]) & (chart[a] >= 0)
        pairs.append(np.stack([number[a][same], number[b][same]], axis=1))
    return TexelGraph(torch.from_numpy(texels.index), torch.from_numpy(np.concatenate(pairs)), Spread(texels.index, size))
