"""The swap table: what limits a reconstructed asset. Its parts are replaced by the truth, and each variant is scored.

    python tests/bench/limits.py RUN SCENE [--views 2] [--spp 32] [--texture 2048] [--downscale 1] [--out table.md]

RUN is a run's folder or a GLB file with the recovered light beside it; SCENE a dataset with the truth as asset.glb and
relit test views. With --out the scene's table is appended to a page, which is made where it is missing.

A part's value comes from the nearest point of the other surface, among sheets that face the same way, and is baked
into textures: of the asset itself where its charts do not overlap, else of new charts. Normals are shading normals
(interpolated and with the normal texture) and replace the receiving mesh's through its normal texture. The first and
the last row are the files as they are; `all true` is what noise and storage leave of the truth itself.
"""

from __future__ import annotations

import argparse
import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from splitnerf.bench.provenance import header, provenance
from splitnerf.data.asset import Asset, Material
from splitnerf.data.dataset import Dataset, load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.data.images import srgb_to_linear
from splitnerf.data.tangents import vertex_tangents
from splitnerf.data.truth import OPAQUE, ViewTruth, load_scene_truth, load_view_truths
from splitnerf.evaluate import metrics
from splitnerf.evaluate.asset import asset_predictions, environment_beside
from splitnerf.evaluate.jobs import Protocol, choose_views, relit_scores
from splitnerf.evaluate.protocol import evaluate_maps
from splitnerf.evaluate.relight import RelitViews, relight
from splitnerf.evaluate.similarity import ScaledView, on_white, scaled_scores
from splitnerf.export.bake import Spread, Texels, rasterise, to_tangent_space
from splitnerf.export.unwrap import unwrap
from splitnerf.relight.job import asset_of
from splitnerf.render.path_traced import AssetRenderer

MATERIALS = ("albedo", "roughness", "metallic")
PARTS = (*MATERIALS, "normals")
ROWS = (
    ("ours", ()),
    *((f"true {part}", (part,)) for part in (*PARTS, "mesh")),
    ("true materials", MATERIALS),
    ("true mesh, normals", ("mesh", "normals")),
    *((f"all true but {part}", {*PARTS, "mesh"} - {part}) for part in (*PARTS, "mesh")),
    ("all true", (*PARTS, "mesh")),
)
SAMPLES = 400_000  # points on a surface, in which the nearest triangle is looked for
CANDIDATES = 4  # samples whose triangles are tried
FACING = 0.01  # in half diagonals: a unit difference of normals counts as much as this distance
CHUNK = 200_000  # points at a time
QUIET_FLOOR = 1e-5  # least squared error that is told from noise
COLUMNS = (
    ("relit", "relit, dB"), ("relit_quiet", "without noise"), ("relit_raw", "without scale"),
    ("novel", "novel, our light"), ("novel_true", "true light"),
    ("albedo", "albedo, dB"), ("roughness", "roughness"), ("metallic", "metal"), ("shading", "shading normals, deg"),
    ("smooth", "mesh's normals, deg"),
)  # fmt: skip
INTRODUCTION = """# What limits the relit images

Parts of reconstructed assets are replaced by the truth at the nearest surface point, and every variant is path traced
again. Relit: PSNR of the test views under the data's maps with one factor per channel, as `splitnerf evaluate` scores
it; the same without the noise of the paths, estimated from two renderings (at most 50 dB); and without the factor.
Novel: PSNR of the photos under our light and under the true one, with one factor per
channel too, since light and albedo share a scale. Then the errors of the maps against the truth: albedo in dB with one
factor per channel, roughness as the mean absolute error, metal as the balanced accuracy, normals with and without the
normal texture in degrees.
"""


def bilinear(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """[n, c] values of a repeating texture."""
    h, w = texture.shape[:2]
    x, y = uv[:, 0] * w - 0.5, uv[:, 1] * h - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    at = lambda j, i: texture[(y0 + j) % h, (x0 + i) % w]  # noqa: E731
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
    at = lambda values: points.interpolate(values, asset.triangles)  # noqa: E731
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
            tangent, normal, mapped = at(asset.tangents)[here], normals[here], bilinear(material.normal_texture, uv[here])
            bitangent = np.sign(tangent[:, 3:]) * np.cross(normal, tangent[:, :3])
            normals[here] = tangent[:, :3] * mapped[:, :1] + bitangent * mapped[:, 1:2] + normal * mapped[:, 2:]
    return {
        "albedo": albedo, "roughness": rough_metal[:, :1], "metallic": rough_metal[:, 1:], "normals": unit(normals)
    }  # fmt: skip


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
        self._spread = Spread(texels.index, size)
        self._frames = [texels.interpolate(values, mesh.triangles) for values in (mesh.normals, mesh.tangents)]
        nearest = NearestPoints(other)
        facing = unit(self._frames[0])
        triangles, weights = nearest(texels.interpolate(mesh.vertices, mesh.triangles), facing)
        self.own = surface_values(asset, texels.triangle, texels.weights)
        self.others = surface_values(other, triangles, weights)
        turned = (nearest.flat_normals[triangles] * facing).sum(axis=1, keepdims=True) < 0
        self.others["normals"] = np.where(turned, -self.others["normals"], self.others["normals"])

    def painted(self, from_other: set[str]) -> Asset:
        """The mesh with its own values, but for those of `from_other`."""
        found = {part: (self.others if part in from_other else self.own)[part] for part in PARTS}
        maps = {part: self._spread(np.clip(found[part], 0, 1)) for part in MATERIALS}
        material = Material(
            metallic=1.0,
            albedo_texture=maps["albedo"],
            roughness_metallic_texture=np.dstack([maps["roughness"], maps["metallic"]]),
            normal_texture=self._spread(to_tangent_space(found["normals"], *self._frames)),
        )
        return dataclasses.replace(self.mesh, materials=[material])


def charts_are_apart(asset: Asset, size: int = 1024) -> bool:
    """Whether no two triangles share a part of the texture: their areas add up to no more than what they cover."""
    (a, b), (c, d) = np.moveaxis(np.diff(asset.uv[asset.triangles].astype(np.float64), axis=1), 0, -1)
    return 0.5 * np.abs(a * d - b * c).sum() * size**2 < 1.02 * len(rasterise(asset.uv, asset.triangles, size).index)


class Reseeded:
    """A renderer with other random numbers."""

    def __init__(self, renderer: AssetRenderer):
        self._renderer = renderer

    def render(self, *arguments: object, seed: int, **options: object) -> dict[str, np.ndarray]:
        return self._renderer.render(*arguments, seed=seed ^ (1 << 30), **options)


def quiet_psnr(first: RelitViews, second: RelitViews, scale: list[float]) -> float:
    """Mean PSNR of relit views without the noise of the paths.

    The squared error is estimated as the product of two renderings' errors, whose noise is independent.
    """
    scores = []
    for a, b in zip(first.views(), second.views()):
        truth = on_white(a.truth, a.truth_alpha)
        errors = [on_white(v.prediction, v.alpha, np.array(scale)) - truth for v in (a, b)]
        scores.append(-10 * np.log10(max(np.mean(errors[0] * errors[1]), QUIET_FLOOR)))
    return float(np.mean(scores))


@dataclass
class Scene:
    """What variants are scored against.

    Attributes:
        views: The test views.
        maps: The maps of the relit views.
        truths: The views' truth.
        lights: The recovered light (None where there is none) and the true one, [h, w, 3].
        shading_normals: Per view the true shading normals [H, W, 3] and where they count [H, W].
        spp: Paths a pixel.
    """

    views: Dataset
    maps: dict[str, Path]
    truths: list[ViewTruth]
    lights: dict[str, np.ndarray | None]
    shading_normals: list[tuple[np.ndarray, np.ndarray]]
    spp: int

    def scores(self, asset: Asset) -> dict[str, float | None]:
        """The columns of the table, None where the data have no truth."""
        renderer = AssetRenderer(asset)
        relit, relit_part = relit_scores(renderer, self.views, self.maps, self.spp)
        again = relit and relight(Reseeded(renderer), self.views, self.maps, max(1, self.spp // 2))
        seen = {
            name: asset_predictions(renderer, self.views, light, self.spp)
            for name, light in self.lights.items()
            if light is not None
        }
        predictions = seen["novel_true"]
        errors = evaluate_maps(predictions, self.views, self.truths)
        pairs = [
            (p["shading_normal"][mask & (p["alpha"] > OPAQUE)], normals[mask & (p["alpha"] > OPAQUE)])
            for p, (normals, mask) in zip(predictions, self.shading_normals)
        ]
        return {name: self.novel_psnr(maps) for name, maps in seen.items()} | {
            "relit": relit_part and relit_part["psnr"],
            "relit_quiet": relit_part and quiet_psnr(relit, again, relit_part["lsq"]["scale"]),
            "relit_raw": relit_part and relit_part["raw"]["psnr"],
            "albedo": errors["albedo"] and errors["albedo"]["psnr"],
            "roughness": errors["roughness_mae"],
            "metallic": errors["metallic_balanced_accuracy"],
            "shading": metrics.normal_mae_deg(*map(np.concatenate, zip(*pairs))),
            "smooth": errors["normal_mae_deg"],
        }

    def novel_psnr(self, predictions: list[dict[str, np.ndarray]]) -> float:
        """PSNR of rendered photos with one factor per channel."""
        pairs = list(zip(predictions, self.views.images))
        views = [
            ScaledView("", srgb_to_linear(p["rgb"]), p["alpha"], srgb_to_linear(image[..., :3]), image[..., 3])
            for p, image in pairs
        ]
        return scaled_scores(lambda: views)[0]["psnr"]


def load_scene(root: Path, light: Path | None, truth: Asset, protocol: Protocol) -> Scene:
    """The scene's views, maps and truth; the true shading normals are rendered."""
    views, maps = choose_views(load_dataset(root, "test", protocol.downscale), protocol)
    lights = {"novel": None if light is None else read_environment(light), "novel_true": load_scene_truth(root).light}
    rendered = asset_predictions(AssetRenderer(truth), views, None, protocol.spp)
    normals = [(p["shading_normal"], p["alpha"] > OPAQUE) for p in rendered]
    return Scene(views, maps, load_view_truths(views), lights, normals, protocol.spp)


def section(run: Path, root: Path, protocol: Protocol, texture: int) -> str:
    """The scene's table as markdown, its rows printed as they come."""
    ours, truth = asset_of(run), read_asset(root / "asset.glb")
    scene = load_scene(root, environment_beside(run / "mesh.glb" if run.is_dir() else run), truth, protocol)
    canvases = {"ours": Canvas(ours, truth, texture), "true": Canvas(truth, ours, texture)}
    light = scene.lights["novel"]
    light_error = "none" if light is None else f"{metrics.light_psnr(light, scene.lights['novel_true']):.1f} dB"
    lines = [
        f"## {root.name}: {'/'.join(run.resolve().parts[-2:])}",
        f"{len(scene.views)} test views, {len(scene.maps)} maps, {protocol.spp} paths a pixel, "
        f"textures of {texture} x {texture}; our light has {light_error}.",
        "| | " + " | ".join(title for _, title in COLUMNS) + " |\n|---" + "|--:" * len(COLUMNS) + "|",
    ]
    print("\n\n".join(lines), flush=True)
    for name, replaced in ROWS:
        replaced = set(replaced)
        if name in ("ours", "all true"):
            asset = ours if name == "ours" else truth
        elif "mesh" in replaced:
            asset = canvases["true"].painted(set(PARTS) - replaced)
        else:
            asset = canvases["ours"].painted(replaced)
        lines.append(row(name, scene.scores(asset)))
        print(lines[-1], flush=True)
    text = "\n\n".join(lines[:3]) + "\n" + "\n".join(lines[3:])
    return f"{text}\n\n{header(provenance(['tests/bench/limits.py', 'python/splitnerf/evaluate']))}\n"


def row(name: str, scores: dict[str, float | None]) -> str:
    """A line of the table."""
    digits = {"roughness": 3, "metallic": 3}
    cells = [
        "" if scores.get(key) is None else f"{scores[key]:.{digits.get(key, 2)}f}" for key, _ in COLUMNS
    ]
    return f"| {name} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--texture", type=int, default=2048, help="texels along an edge of the baked textures")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--out", type=Path, help="page that the table is appended to")
    args = parser.parse_args()
    text = section(args.run, args.scene, Protocol(args.downscale, args.views, args.spp), args.texture)
    if args.out is not None:
        before = args.out.read_text() if args.out.is_file() else INTRODUCTION
        args.out.write_text(f"{before}\n{text}")


if __name__ == "__main__":
    main()
