"""An asset with some of its parts taken from another asset, at the nearest points of the two surfaces.

Values are baked into textures: of the asset itself where its charts do not overlap, else of new charts. Normals are
shading normals (interpolated and with the normal texture) and replace the receiving mesh's through its normal texture.
"""

import dataclasses
from collections.abc import Collection

import numpy as np
import trimesh
from scipy.spatial import cKDTree
from splitnerf.data.asset import Asset, Material, vertex_tangents
from splitnerf.export.bake import Texels, nearest_rows, rasterise, to_tangent_space
from splitnerf.export.textured import unwrap

MATERIALS = ("albedo", "roughness", "metallic")
PARTS = (*MATERIALS, "normals")
SAMPLES = 400_000  # points on a surface, in which the nearest triangle is looked for
CANDIDATES = 4  # samples whose triangles are tried
FACING = 0.01  # in half diagonals: a unit difference of normals counts as much as this distance
CHUNK = 200_000  # points at a time


def bilinear(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """[n, c] values of a repeating texture."""
    h, w = texture.shape[:2]
    x, y = uv[:, 0] * w - 0.5, uv[:, 1] * h - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    at = lambda j, i: texture[(y0 + j) % h, (x0 + i) % w]
    return (at(0, 0) * (1 - fx) + at(0, 1) * fx) * (1 - fy) + (at(1, 0) * (1 - fx) + at(1, 1) * fx) * fy


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-20)


def surface_values(asset: Asset, triangles: np.ndarray, weights: np.ndarray) -> dict[str, np.ndarray]:
    """An asset at points of its triangles, as the path tracer sees it.

    Args:
        asset: The asset.
        triangles: [n] the points' triangles.
        weights: [n, 3] their barycentric coordinates.

    Returns:
        `albedo` [n, 3], `roughness` [n, 1], `metallic` [n, 1] and the unit shading `normals` [n, 3].
    """
    points = Texels(np.arange(len(triangles)), triangles, weights)
    at = lambda values: points.interpolate(values, asset.triangles)
    albedo = np.ones((len(triangles), 3)) if asset.colors is None else at(asset.colors)
    rough_metal, normals = np.ones((len(triangles), 2)), at(asset.normals)
    uv = None if asset.uv is None else at(asset.uv)
    for i, material in enumerate(asset.materials):
        here = asset.material_ids[triangles] == i
        albedo[here] *= material.albedo
        rough_metal[here] *= (material.roughness, material.metallic)
        if material.albedo_texture is not None:
            albedo[here] *= bilinear(material.albedo_texture, uv[here])
        if material.roughness_metallic_texture is not None:
            rough_metal[here] *= bilinear(material.roughness_metallic_texture, uv[here])
        if material.normal_texture is not None:
            mapped = bilinear(material.normal_texture, uv[here])
            tangent, normal = at(asset.tangents)[here], normals[here]
            bitangent = np.sign(tangent[:, 3:]) * np.cross(normal, tangent[:, :3])
            normals[here] = tangent[:, :3] * mapped[:, :1] + bitangent * mapped[:, 1:2] + normal * mapped[:, 2:]
    return {"albedo": albedo, "roughness": rough_metal[:, :1], "metallic": rough_metal[:, 1:], "normals": unit(normals)}


class NearestPoints:
    """Finds points of an asset near others.

    Args:
        asset: The asset.
        facing: The distance that a unit difference of normals counts as much as, in units of half the diagonal.
    """

    def __init__(self, asset: Asset, facing: float = FACING):
        mesh = trimesh.Trimesh(asset.vertices, asset.triangles, process=False)
        self.corners = np.asarray(mesh.triangles)
        self.flat_normals = unit(np.cross(*(self.corners[:, 1:] - self.corners[:, :1]).transpose(1, 0, 2)))
        self.facing = facing * np.linalg.norm(mesh.extents) / 2
        proper = np.flatnonzero(mesh.area_faces > 0)
        points, triangles = trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)
        self.triangles = np.concatenate([triangles, proper])  # each triangle has at least its centre
        points = np.concatenate([points, self.corners[proper].mean(axis=1)])
        self.tree = cKDTree(np.hstack([points, self.facing * self.flat_normals[self.triangles]]))

    def __call__(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles [n] and barycentric coordinates [n, 3] of the points nearest to points [n, 3] with normals."""
        parts = [self._nearest(points[i : i + CHUNK], normals[i : i + CHUNK]) for i in range(0, len(points), CHUNK)]
        return tuple(np.concatenate(part) for part in zip(*parts))

    def _nearest(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        _, samples = self.tree.query(np.hstack([points, self.facing * normals]), CANDIDATES, workers=-1)
        triangles = self.triangles[samples]
        closest = np.stack([trimesh.triangles.closest_point(self.corners[t], points) for t in triangles.T], axis=1)
        best = np.linalg.norm(closest - points[:, None], axis=2).argmin(axis=1)
        rows = np.arange(len(points))
        triangle = triangles[rows, best]
        weights = trimesh.triangles.points_to_barycentric(self.corners[triangle], closest[rows, best], method="cross")
        weights = np.clip(np.nan_to_num(weights, nan=1 / 3), 0, 1)
        return triangle, (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


class Canvas:
    """An asset's mesh with the texels that its own values and another asset's are baked into.

    Args:
        asset: The asset.
        other: The asset at whose nearest points the replaced values are taken.
        size: Texels along an edge of the textures.
    """

    def __init__(self, asset: Asset, other: Asset, size: int):
        mesh = dataclasses.replace(asset, colors=None, material_ids=np.zeros_like(asset.material_ids))
        if asset.uv is None or not charts_are_apart(asset):
            origins, triangles, uv = unwrap(asset.vertices, asset.triangles, size)  # keeps the order of the triangles
            mesh = Asset(
                asset.name, asset.vertices[origins], triangles, asset.normals[origins], mesh.material_ids, uv=uv
            )
        if mesh.tangents is None:
            mesh.tangents = vertex_tangents(mesh.vertices, mesh.triangles, mesh.normals, mesh.uv)
        self.mesh = mesh
        texels = rasterise(mesh.uv, mesh.triangles, size)
        self._nearest = nearest_rows(texels.index, size)
        self._frames = [texels.interpolate(values, mesh.triangles) for values in (mesh.normals, mesh.tangents)]
        nearest = NearestPoints(other)
        facing = unit(self._frames[0])
        triangles, weights = nearest(texels.interpolate(mesh.vertices, mesh.triangles), facing)
        self.own = surface_values(asset, texels.triangle, texels.weights)
        self.others = surface_values(other, triangles, weights)
        turned = (nearest.flat_normals[triangles] * facing).sum(axis=1, keepdims=True) < 0
        self.others["normals"] = np.where(turned, -self.others["normals"], self.others["normals"])

    def painted(self, from_other: Collection[str]) -> Asset:
        """The mesh with its own values, but for those of `from_other`."""
        found = {part: (self.others if part in from_other else self.own)[part] for part in PARTS}
        maps = {part: np.clip(found[part], 0, 1).astype(np.float32)[self._nearest] for part in MATERIALS}
        material = Material(
            metallic=1.0,
            albedo_texture=maps["albedo"],
            roughness_metallic_texture=np.dstack([maps["roughness"], maps["metallic"]]),
            normal_texture=to_tangent_space(found["normals"], *self._frames)[self._nearest],
        )
        return dataclasses.replace(self.mesh, materials=[material])


def charts_are_apart(asset: Asset, size: int = 1024) -> bool:
    """Whether no two triangles share a part of the texture: their areas add up to no more than what they cover."""
    (a, b), (c, d) = np.moveaxis(np.diff(asset.uv[asset.triangles].astype(np.float64), axis=1), 0, -1)
    return 0.5 * np.abs(a * d - b * c).sum() * size**2 < 1.02 * len(rasterise(asset.uv, asset.triangles, size).index)
