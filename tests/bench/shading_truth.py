"""Training's shading with true geometry, materials and light against the path tracer.

    python tests/bench/shading_truth.py SCENE ... [--views 2] [--size 100] [--spp 256] [--spacing 0.032]

A SCENE is a folder with asset.glb, light.hdr and test views, or `spheres:LIGHT.hdr`: a grid of spheres over a plane,
roughness by rows and metallic by columns, or `spheres:sun`. The first hits of camera rays are shaded as in a training
with a mesh: by the split sum plus its correction. Two independent halves of samples on each side give the squared error
without their noise: the mean of (a1 - b1)(a2 - b2), in sRGB, over the pixels that the object fills with its outside.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from pathlib import Path

import numpy as np
import torch
import trimesh
from scipy.spatial import cKDTree
from swap import MATERIALS, surface_values
from torch import Tensor
from torch.nn import functional as F

from splitnerf import _core
from splitnerf.config import Config
from splitnerf.data.asset import Asset, Material
from splitnerf.data.dataset import load_dataset
from splitnerf.data.environment import read_environment
from splitnerf.data.gltf import read_asset
from splitnerf.fields.light_pyramid import LOG_LIMIT
from splitnerf.fields.sdf import SdfSample
from splitnerf.ops import MeshScene, linear_to_srgb
from splitnerf.relight.cameras import look_at
from splitnerf.render.model import SceneModel
from splitnerf.render.path_traced import AssetRenderer
from splitnerf.render.rays import image_rays

SPACING = 0.032  # edges of the mesh that visibility is cached on: those of marching cubes with 96 nodes
BINS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.01)
JITTERED, CHUNK = 4, 1 << 13  # shaded first hits of a pixel in each half; points shaded at a time


def sphere_scene() -> Asset:
    """Twelve spheres over a plane: a row of dielectrics, a row of metals, rougher from left to right."""
    plane = trimesh.creation.box((2.0, 1.3, 0.05)).apply_translation((0, 0, -0.025))
    parts, materials = [plane], [Material("plane", (0.5, 0.5, 0.5), 0.9, 0.0)]
    for j, metallic in enumerate((0.0, 1.0)):
        for i, roughness in enumerate((0.1, 0.2, 0.3, 0.4, 0.55, 0.8)):
            ball = trimesh.creation.icosphere(4, 0.13)
            parts.append(ball.apply_translation((0.32 * i - 0.8, 0.6 * j - 0.3, 0.15)))
            materials.append(Material(f"ball {i} {j}", (0.8, 0.5, 0.3), roughness, metallic))
    plane.unmerge_vertices()  # its faces have normals of their own
    mesh = trimesh.util.concatenate(parts)
    normals = np.concatenate([np.repeat(plane.face_normals, 3, 0), *(p.vertex_normals for p in parts[1:])])
    ids = np.repeat(np.arange(len(parts)), [len(p.faces) for p in parts])
    arrays = (mesh.vertices, np.float32), (mesh.faces, np.int32), (normals, np.float32), (ids, np.int32)
    return Asset("spheres", *(np.ascontiguousarray(x, kind) for x, kind in arrays), materials)


def sun_sky(height: int = 256, radius: float = 1.5) -> np.ndarray:
    """A dim blue sky with a sun of this angular radius, degrees, that has two thirds of the power on a facing plane."""
    w = _core.equirect_directions(height, 2 * height)
    sky = np.where(w[..., 2:] > 0, 0.25 * np.array([0.7, 0.9, 1.3]), 0.1)
    axis = np.array([0.5, -0.35, 0.7]) / np.linalg.norm([0.5, -0.35, 0.7])
    sun = w @ axis > math.cos(math.radians(radius))
    solid = 2 * math.pi * (1 - math.cos(math.radians(radius)))
    return (sky + sun[..., None] * np.array([1.1, 1.0, 0.8]) * 1.6 / solid).astype(np.float32)


def octahedral_texels(radiance: np.ndarray, n: int, parts: int = 4) -> np.ndarray:
    """[n^2, 3] mean radiance of an equirectangular map over the texels of an octahedral map."""
    h, w = radiance.shape[:2]
    direction = _core.equirect_directions(parts * h, 2 * parts * h).reshape(-1, 3)
    area = np.sqrt(np.clip(1 - direction[:, 2] ** 2, 0, 1))
    p = direction[:, :2] / np.abs(direction).sum(1, keepdims=True)
    uv = np.where(direction[:, 2:] >= 0, p, (1 - np.abs(p[:, ::-1])) * np.where(p < 0, -1, 1))
    at = np.clip(((uv + 1) * 0.5 * n).astype(int), 0, n - 1)
    texel = at[:, 1] * n + at[:, 0]
    values = radiance.repeat(parts, 0).repeat(parts * 2 * h // w, 1).reshape(-1, 3)
    sums = [np.bincount(texel, area * c, n * n) for c in (*values.T, np.ones(len(area)))]
    return np.stack(sums[:3], 1) / np.maximum(sums[3], 1e-12)[:, None]


def surface_points(asset: Asset, n: int = 300_000) -> Asset:
    """Random points of a surface as an asset of triangles without area."""
    mesh = trimesh.Trimesh(asset.vertices, asset.triangles, process=False)
    points, face = trimesh.sample.sample_surface(mesh, n, seed=0)
    shares = trimesh.triangles.points_to_barycentric(mesh.triangles[face], points)[..., None]
    at = lambda x: None if x is None else (x[asset.triangles[face]] * shares).sum(1)  # noqa: E731
    return dataclasses.replace(
        asset, vertices=points, triangles=np.arange(n)[:, None].repeat(3, 1), normals=at(asset.normals),
        uv=at(asset.uv), colors=at(asset.colors), material_ids=asset.material_ids[face],
    )  # fmt: skip


class TrueMaterials(torch.nn.Module):
    """Materials that are set for the next points, or those of the nearest point of the surface."""

    def __init__(self, asset: Asset):
        super().__init__()
        points = surface_points(asset)
        triangle = np.zeros(len(points.vertices), np.int64)
        triangle[points.triangles] = np.arange(len(points.triangles))[:, None]
        corner = points.triangles[triangle] == np.arange(len(triangle))[:, None]
        at_vertices = surface_values(points, triangle, (corner / corner.sum(1, keepdims=True)).astype(np.float32))
        values = [at_vertices[name] for name in MATERIALS]
        self.tree, self.normals = cKDTree(points.vertices), torch.from_numpy(points.normals).float()
        self.nearest = [torch.from_numpy(np.clip(x.reshape(len(x), -1), 0, 1)).float() for x in values]
        self.given: tuple[Tensor, ...] | None = None

    def at(self, positions: Tensor) -> Tensor:
        """The nearest point of the surface [n]."""
        return torch.from_numpy(self.tree.query(positions.numpy())[1])

    def forward(self, positions: Tensor) -> tuple[Tensor, ...]:
        if self.given is not None:
            return self.given
        at = self.at(positions)
        albedo, roughness, metallic = (x[at] for x in self.nearest)
        return albedo, roughness.clamp(min=0.05), metallic


class TrueScene(SceneModel):
    """The model with true materials, light and mesh; every point lies on the surface."""

    def __init__(self, asset: Asset, environment: np.ndarray, spacing: float):
        super().__init__(Config())
        self.material = TrueMaterials(asset)
        texels = np.log(octahedral_texels(environment, self.light.resolution).clip(math.exp(-LOG_LIMIT), None))
        with torch.no_grad():
            self.light.texels.zero_()[-len(texels) :] = torch.from_numpy(texels).float()
        mesh = trimesh.Trimesh(asset.vertices, asset.triangles, process=False)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        mesh = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, spacing, 20), process=True)
        vertices, triangles = torch.tensor(mesh.vertices).float(), torch.tensor(mesh.faces).int()
        self.occlusion.aim(self.evaluate_light())
        self.use_mesh(self.occlusion.trace(MeshScene(vertices.numpy(), triangles.numpy()), vertices, triangles))

    def surface(self, positions: Tensor) -> SdfSample:
        zeros = positions.new_zeros(len(positions), 13)
        return SdfSample(zeros, positions.new_zeros(len(positions), 0), positions)

    def head_inputs(self, positions: Tensor, outputs: Tensor, features: Tensor) -> list[Tensor]:
        return [positions]

    @torch.no_grad()
    def radiance(self, x: Tensor, n: Tensor, views: Tensor, materials: tuple[Tensor, ...]) -> Tensor:
        """[k, 3] radiance of points towards the camera."""
        light, rows = self.evaluate_light(), []
        for part in zip(*(t.split(CHUNK) for t in (x, n, views, *materials))):
            p, normals, toward, *self.material.given = part
            field = self.surface(p)
            points = self.shade(light, p, field.outputs, field.features, normals, toward)
            every = torch.arange(len(p))
            correction = self.quadrature_correction(light, toward, points, every)
            rows.append(points.radiance.index_add(0, *correction))
        self.material.given = None
        return torch.cat(rows)


def shaded_view(model: TrueScene, renderer: AssetRenderer, view: dict, seed: int) -> tuple[Tensor, Tensor]:
    """[H, W, 3] mean radiance of a pixel's first hits as training shades them, and [H, W, 3] mean roughness, metallic
    and share of hits from behind, which no closed surface has."""
    h, w = view["height"], view["width"]
    origins, directions = image_rays(torch.from_numpy(view["pose"]).float(), torch.tensor(view["intrinsics"]), h, w)
    total, maps, hits = torch.zeros(h * w, 3), torch.zeros(h * w, 3), torch.zeros(h * w, 1)
    for k in range(JITTERED):
        found = renderer.render(np.ones((4, 8, 3), np.float32), **view, spp=1, bounces=0, seed=seed + k)
        f = {key: torch.from_numpy(np.array(value)).reshape(h * w, -1).float() for key, value in found.items()}
        at = (f["alpha"][:, 0] > 0).nonzero()[:, 0]
        x = (origins + directions * f["depth"])[at]
        materials = f["albedo"][at].clamp(0, 1), f["roughness"][at].clamp(0.05, 1), f["metallic"][at].clamp(0, 1)
        out = model.radiance(x, F.normalize(f["normal"][at], dim=1), -directions[at], materials)
        total.index_add_(0, at, out), hits.index_add_(0, at, torch.ones(len(at), 1))
        outside = model.material.normals[model.material.at(x)]
        behind = (outside * f["smooth_normal"][at]).sum(1, keepdim=True) < 0
        maps.index_add_(0, at, torch.cat([f["roughness"][at], f["metallic"][at], behind.float()], 1))
    return tuple((x / hits.clamp(min=1)).view(h, w, 3) for x in (total, maps))


def srgb_slope(a: Tensor, b: Tensor) -> Tensor:
    """(sRGB(a) - sRGB(b)) / (a - b), clipped at 1; it turns differences of noisy values into sRGB without bias."""
    a = torch.where((a - b).abs() < 1e-4, b + 1e-4, a)
    return (linear_to_srgb(a.clamp(0, 1)) - linear_to_srgb(b.clamp(0, 1))) / (a - b)


def psnr(errors: Tensor) -> str:
    """The PSNR of products of errors; the product may be negative where noise is all there is."""
    mean = errors.mean().item()
    return f"{-10 * math.log10(mean):6.2f}" if mean > 0 else "   -  "


def compare(name: str, model: TrueScene, renderer: AssetRenderer, environment: np.ndarray, views: list[dict], spp: int):
    """Prints a row of PSNR: all pixels, then those of a bin of roughness, dielectric / metal."""
    products, bins = [], []
    for view in views:
        sides = []
        for half in (0, 1):
            got, maps = shaded_view(model, renderer, view, 100 * half + 7)
            true = renderer.render(environment, **view, spp=spp, seed=half + 1)
            inside = torch.from_numpy(np.array(true["alpha"]) > 0.999) & (maps[..., 2] == 0)
            sides.append((got, torch.from_numpy(np.array(true["radiance"])).float()))
        slope = srgb_slope(*(0.5 * (a + b) for a, b in zip(*sides)))
        errors = [(got - true) * slope for got, true in sides]
        products.append((errors[0] * errors[1])[inside]), bins.append(maps[inside])
    product, maps = torch.cat(products), torch.cat(bins)
    row = f"{name:24} {psnr(product)}"
    for metal in (False, True):
        row += " |"
        for low, high in zip(BINS, BINS[1:]):
            here = (maps[:, 0] >= low) & (maps[:, 0] < high) & ((maps[:, 1] > 0.5) == metal)
            row += " " + (psnr(product[here]) if here.float().mean() > 0.01 else "   .  ")
    print(row, flush=True)


def scene_of(argument: str, size: int, n_views: int) -> tuple[str, Asset, np.ndarray, list[dict]]:
    """The name, the asset, its light and the views of an argument."""
    kind, _, light = argument.partition(":")
    if kind == "spheres":
        name, asset = f"spheres {Path(light).parent.name or light}", sphere_scene()
        environment = sun_sky() if light == "sun" else read_environment(light)
        poses = [look_at(np.zeros(3), -1.1 - 1.2 * k, 0.7, 3.1) for k in range(n_views)]
        intrinsics = (1.2 * size, 1.2 * size, size / 2, size / 2)
    else:
        folder = Path(argument)
        name, asset, environment = folder.name, read_asset(folder / "asset.glb"), read_environment(folder / "light.hdr")
        bare = [dataclasses.replace(m, emission=(0.0, 0.0, 0.0), emission_texture=None) for m in asset.materials]
        asset = dataclasses.replace(asset, materials=bare)
        dataset = load_dataset(folder, "test", 1)
        poses = dataset.poses[:: len(dataset.poses) // n_views][:n_views]
        intrinsics = tuple(float(v) for v in dataset.intrinsics[0] * (size / dataset.images.shape[1]))
    views = [dict(pose=np.asarray(p), intrinsics=intrinsics, width=size, height=size) for p in poses]
    return name, asset, environment, views


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--views", type=int, default=2)
    parser.add_argument("--size", type=int, default=100)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--spacing", type=float, default=SPACING, help="longest edge of the mesh that caches visibility")
    args = parser.parse_args()
    heads = " ".join(f"<{high:4.2f} " for high in BINS[1:])
    print(f"{'sRGB PSNR, dB':24} {'all':6} | dielectric, roughness: {heads} | metal: {heads}")
    for argument in args.scenes:
        name, asset, environment, views = scene_of(argument, args.size, args.views)
        compare(name, TrueScene(asset, environment, args.spacing), AssetRenderer(asset), environment, views, args.spp)


if __name__ == "__main__":
    main()
