"""What limits a reconstructed asset: its parts replaced by the truth, one at a time, each variant relit and scored.

    python tests/bench/limits.py RUN/mesh.glb SCENE [--views 4] [--spp 64] [--downscale 1]

SCENE holds the truth as asset.glb and relit test views. Both meshes are subdivided, and each vertex takes its albedo,
roughness and metallic from the asset itself or from the nearest vertex of the other one. `all true` is the bench's own
ceiling: the truth by vertices.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from splitnerf.data.asset import Asset, Material
from splitnerf.data.dataset import load_dataset
from splitnerf.data.gltf import read_asset
from splitnerf.evaluate.jobs import Protocol, choose_views, relit_scores
from splitnerf.render.path_traced import AssetRenderer

PARTS = ("albedo", "roughness", "metallic")


def bilinear(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """[n, c] values of a repeating texture."""
    h, w = texture.shape[:2]
    x, y = uv[:, 0] * w - 0.5, uv[:, 1] * h - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    at = lambda j, i: texture[(y0 + j) % h, (x0 + i) % w]  # noqa: E731
    return (at(0, 0) * (1 - fx) + at(0, 1) * fx) * (1 - fy) + (at(1, 0) * (1 - fx) + at(1, 1) * fx) * fy


def vertex_materials(asset: Asset, materials: list[Material]) -> dict[str, np.ndarray]:
    """Albedo, roughness and metallic at the vertices; a vertex belongs to one material."""
    n = len(asset.vertices)
    number = np.zeros(n, int)
    number[asset.triangles] = asset.material_ids[:, None]
    albedo = np.ones((n, 3)) if asset.colors is None else asset.colors.astype(np.float64)
    rough_metal = np.ones((n, 2))
    for i, m in enumerate(materials):
        here = number == i
        albedo[here] *= m.albedo
        rough_metal[here] *= (m.roughness, m.metallic)
        if m.albedo_texture is not None:
            albedo[here] *= bilinear(m.albedo_texture, asset.uv[here])
        if m.roughness_metallic_texture is not None:
            rough_metal[here] *= bilinear(m.roughness_metallic_texture, asset.uv[here])
    return {"albedo": albedo, "roughness": rough_metal[:, 0], "metallic": rough_metal[:, 1]}


def subdivided(asset: Asset, n_faces: int = 400_000) -> Asset:
    """The same surface with more vertices, its materials bare but for their normal textures."""
    vertices, faces, ids = asset.vertices, asset.triangles, asset.material_ids
    attributes = {
        k: getattr(asset, k) for k in ("normals", "uv", "tangents", "colors") if getattr(asset, k) is not None
    }
    while 4 * len(faces) <= n_faces:
        vertices, faces, attributes = trimesh.remesh.subdivide(vertices, faces, vertex_attributes=attributes)
        ids = np.concatenate([ids] * 4) if len(np.unique(ids)) == 1 else np.repeat(ids, 4)
    attributes["normals"] = trimesh.util.unitize(attributes["normals"])
    bare = [Material(m.name, metallic=1.0, normal_texture=m.normal_texture) for m in asset.materials]
    return dataclasses.replace(
        asset, vertices=vertices, triangles=faces, material_ids=ids, materials=bare, **attributes
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("asset", type=Path)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--downscale", type=int, default=1)
    args = parser.parse_args()
    ours, truth = read_asset(args.asset), read_asset(args.scene / "asset.glb")
    views, maps = choose_views(
        load_dataset(args.scene, "test", args.downscale), Protocol(args.downscale, args.views, args.spp)
    )
    shapes = {"ours": subdivided(ours), "true": subdivided(truth)}
    found = {
        (name, name): vertex_materials(shapes[name], asset.materials)
        for name, asset in (("ours", ours), ("true", truth))
    }
    for here, there in (("ours", "true"), ("true", "ours")):
        _, nearest = cKDTree(shapes[there].vertices).query(shapes[here].vertices, workers=-1)
        found[here, there] = {part: values[nearest] for part, values in found[there, there].items()}
    rows = {"ours": ("ours", ()), "true shape": ("true", ())}
    rows |= {f"true {part}": ("ours", (part,)) for part in PARTS}
    rows |= {
        "true materials": ("ours", PARTS),
        "true shape, albedo": ("true", ("albedo",)),
        "all true": ("true", PARTS),
    }
    print(f"{'':24}relight  raw")
    for name, (shape, from_truth) in rows.items():
        renderer = AssetRenderer(shapes[shape])
        for part in PARTS:
            values = found[shape, "true" if part in from_truth else "ours"][part]
            renderer._surface[part] = np.ascontiguousarray(np.clip(values, 0, 1), np.float32)
        _, scores = relit_scores(renderer, views, maps, args.spp)
        print(f"{name:24}{scores['psnr']:6.2f}  {scores['raw']['psnr']:6.2f}", flush=True)


if __name__ == "__main__":
    main()
