"""Bakes ambient occlusion into the colours of a mesh's vertices: occlusion_bake.py MESH OUT [RAYS].

MESH is whatever trimesh reads (.obj, .ply, .stl, .glb), OUT a .ply or .glb. Grey is the share of an even sky's light
that arrives at the vertex: 1 where nothing is in the way.
"""

import sys

import numpy as np
import torch
import trimesh
from splitnerf.ops import MeshScene, occlusion_factors


def bake(mesh: trimesh.Trimesh, rays: int) -> np.ndarray:
    """[n] open share of the cosine-weighted hemisphere above each vertex, from that many rays a vertex."""
    positions = torch.tensor(np.asarray(mesh.vertices), dtype=torch.float32)
    normals = torch.tensor(np.asarray(mesh.vertex_normals), dtype=torch.float32)
    scene, one = MeshScene(np.asarray(mesh.vertices), np.asarray(mesh.faces)), torch.ones(len(positions), 1)
    light = {"lobe_dirs": normals, "roughness": one, "environment": torch.ones(16, 32, 3)}
    offset = 0.01 * float(np.median(mesh.edges_unique_length))
    counts = {"n_diffuse_rays": rays, "n_specular_rays": 1}
    o_d, _ = occlusion_factors(scene, positions, normals, **light, offset=offset, **counts)
    return o_d[:, 0].numpy()


def main(source: str, target: str, rays: str = "1024") -> None:
    mesh = trimesh.load(source, force="mesh")
    occlusion = bake(mesh, int(rays))
    grey = np.round(255 * occlusion).astype(np.uint8)
    mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=np.column_stack([grey] * 3))
    mesh.export(target)
    low, mean, high = occlusion.min(), occlusion.mean(), occlusion.max()
    print(f"{len(grey)} vertices, {low:.3f} to {high:.3f}, mean {mean:.3f}; wrote {target}")


if __name__ == "__main__":
    main(*sys.argv[1:])
