"""Shades spheres by the split sum under a two-colour sky and writes them as a PNG: shading.py [FILE].

Three spheres a row, with roughness 0.1, 0.4 and 0.8; gold above, red plastic below.
"""

import sys

import torch
from PIL import Image
from splitnerf.ops import fibonacci_directions, light_queries, linear_to_srgb, prefilter_light, split_sum_shade

SIZE = 128


def sky(w: torch.Tensor) -> torch.Tensor:
    """Radiance of a blue sky over brown ground, with a soft warm lamp."""
    up = torch.sigmoid(8 * w[:, 2:])
    lamp = 15 * torch.exp(40 * (w @ torch.tensor([[-0.6], [-0.5], [0.62]]) - 1))
    return (
        up * torch.tensor([0.4, 0.6, 1.0])
        + (1 - up) * torch.tensor([0.25, 0.2, 0.15])
        + lamp * torch.tensor([1.0, 0.9, 0.7])
    )


def shade(albedo: list[float], roughness: float, metallic: float) -> torch.Tensor:
    """[SIZE, SIZE, 3] linear radiance of a unit sphere seen from -y, white background."""
    axis = (torch.arange(SIZE) + 0.5) / SIZE * 2.2 - 1.1
    z, x = torch.meshgrid(-axis, axis, indexing="ij")
    hit = x * x + z * z < 1
    normals = torch.stack([x, -torch.sqrt((1 - x * x - z * z).clamp(min=0)), z], dim=-1)[hit]
    views = torch.tensor([[0.0, -1.0, 0.0]]).expand(len(normals), 3)
    one = torch.ones(len(normals), 1)
    lights = fibonacci_directions(8192, torch.Generator().manual_seed(0))
    light = {"light_dirs": lights, "light": sky(lights)}
    d = light_queries(normals, views, roughness * one)[0][: len(normals)]
    specular = prefilter_light(d, roughness * one, **light)
    diffuse = prefilter_light(normals, one, **light)
    image = torch.ones(SIZE, SIZE, 3)
    image[hit] = split_sum_shade(
        normals,
        views,
        albedo=torch.tensor([albedo]).expand(len(normals), 3),
        roughness=roughness * one,
        metallic=metallic * one,
        specular=specular,
        diffuse=diffuse,
    )
    return image


def main(path: str = "shading.png") -> None:
    rows = [([1.0, 0.77, 0.34], 1.0), ([0.6, 0.05, 0.04], 0.0)]
    image = torch.cat([torch.cat([shade(a, rho, m) for rho in (0.1, 0.4, 0.8)], dim=1) for a, m in rows])
    Image.fromarray((255 * linear_to_srgb(image.clamp(0, 1)) + 0.5).byte().numpy()).save(path)
    print(f"wrote {path}, mean radiance {image.mean():.4f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
