"""Renders the signed distance field of a sphere with NeuS weights: march along rays, weigh the samples, composite.

Prints the depth's error against the exact intersection and writes the normals as a PNG: rays.py [FILE].
"""

import sys

import torch
from PIL import Image
from splitnerf.ops import composite, march_rays, surface_weights
from splitnerf.ops.rays import CELL_OCCUPIED

SIZE, BOX, RESOLUTION, STEP = 160, 1.5, 64, 0.01


def sdf(x: torch.Tensor) -> torch.Tensor:
    return x.norm(dim=-1) - 1


def main(path: str = "rays.png") -> None:
    # A cell is occupied if its centre is nearer to the surface than half a diagonal and a little more.
    centre = ((torch.arange(RESOLUTION) + 0.5) / RESOLUTION * 2 - 1) * BOX
    centres = torch.stack(torch.meshgrid(centre, centre, centre, indexing="ij"), dim=-1)
    cells = (sdf(centres).abs() < 3**0.5 * BOX / RESOLUTION + 0.03).to(torch.uint8) * CELL_OCCUPIED

    axis = (torch.arange(SIZE) + 0.5) / SIZE * 2.4 - 1.2
    z, x = (a.flatten() for a in torch.meshgrid(-axis, axis, indexing="ij"))
    rays_o = torch.stack([x, torch.full_like(x, -4.0), z], dim=1)  # parallel rays from outside the box
    rays_d = torch.tensor([[0.0, 1.0, 0.0]]).expand_as(rays_o)
    samples = march_rays(rays_o, rays_d, torch.full((len(x),), 0.5), cells, box=BOX, step=STEP)

    o, d = rays_o[samples.ray_indices], rays_d[samples.ray_indices]
    middle = samples.middles[:, None]
    points = o + d * middle  # on a sphere around the origin the gradient has their direction
    normals, weights, opacity = surface_weights(
        sdf(points), points / points.norm(dim=1, keepdim=True), rays_d, torch.tensor(2000.0), samples.offsets, step=STEP
    )
    depth, normals = composite(weights, torch.cat([middle, normals], dim=1), samples.offsets).split([1, 3], dim=1)

    inside = x * x + z * z < 0.9
    exact = 4 - torch.sqrt(1 - x * x - z * z)[inside]
    error = (depth[inside, 0] - exact).abs().mean().item()
    on_white = (normals * 0.5 + 0.5) * opacity[:, None] + 1 - opacity[:, None]
    Image.fromarray((255 * on_white.clamp(0, 1) + 0.5).byte().view(SIZE, SIZE, 3).numpy()).save(path)
    print(
        f"{len(weights)} samples on {len(x)} rays; depth error {error:.5f} (step {STEP}), opacity {opacity[inside].min():.4f}; wrote {path}"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
