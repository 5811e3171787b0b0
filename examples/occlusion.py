"""Occlusion factor o_d along a ground plane under a sphere, against the closed form right below it.

A sphere straight above, of half angle theta, hides a share sin^2(theta) of the cosine-weighted hemisphere.
"""

import numpy as np
import torch
import trimesh
from splitnerf.ops import MeshScene, occlusion_factors

HEIGHT = 2.0  # the sphere's centre above the plane
OFFSET = 0.0125  # the start of the rays above the plane


def main() -> None:
    sphere = trimesh.creation.icosphere(5).apply_translation((0, 0, HEIGHT))
    plane = trimesh.creation.box((50, 50, 0.1)).apply_translation((0, 0, -0.05))
    mesh = trimesh.util.concatenate([sphere, plane])
    scene = MeshScene(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    x = torch.linspace(0, 6, 13)
    positions = torch.stack([x, 0 * x, 0 * x], dim=1)
    up = torch.tensor([[0.0, 0.0, 1.0]]).expand(len(x), 3)
    white = torch.ones(16, 32, 3)
    o_d, _ = occlusion_factors(
        scene,
        positions,
        up,
        lobe_dirs=up,
        roughness=torch.ones(len(x), 1),
        environment=white,
        n_diffuse_rays=8192,
        n_specular_rays=1,
        offset=OFFSET,
    )
    for distance, o in zip(x.tolist(), o_d[:, 0].tolist()):
        print(f"x = {distance:4.1f}   o_d = {o:.4f}  " + "#" * round(40 * o))
    exact = 1 - 1 / (HEIGHT - OFFSET) ** 2
    print(f"below the sphere: o_d {o_d[0].item():.4f}, closed form {exact:.4f}, error {abs(o_d[0].item() - exact):.4f}")


if __name__ == "__main__":
    main()
