"""Fits the signed distance of a torus with a hash grid and one hidden layer (`SdfField`).

The operator `sdf_field` gives the gradient by the position beside the distance, so the eikonal loss needs a single backward pass.
Prints the mean and the largest distance error, and the mean angle of the normals, near the surface.
"""

import math

import torch
from splitnerf.fields import SdfField
from splitnerf.ops import HashGridSpec

BOX = 1.2


def torus(x: torch.Tensor) -> torch.Tensor:
    """Signed distance to a torus of radii 0.7 and 0.3 about z."""
    ring = torch.hypot(x[:, 0], x[:, 1]) - 0.7
    return torch.hypot(ring, x[:, 2]) - 0.3


def main(steps: int = 300) -> None:
    torch.manual_seed(0)
    field = SdfField(
        HashGridSpec(n_levels=8, base_resolution=8, growth=1.4, log2_table_size=14), BOX, width=32, n_outputs=1
    )
    optimiser = torch.optim.Adam(field.parameters(), lr=5e-3)

    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = 5e-3 * 0.05 ** (step / steps)
        x = (torch.rand(2048, 3) * 2 - 1) * BOX
        at = field.sample(x)
        loss = (at.sdf - torus(x)).abs().mean() + 0.01 * (at.gradient.norm(dim=1) - 1).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    x = ((torch.rand(100000, 3) * 2 - 1) * BOX).requires_grad_()
    near = x[torus(x).abs() < 0.05]
    (normals,) = torch.autograd.grad(torus(near).sum(), near)
    at = field.sample(near.detach())
    error = (at.sdf - torus(near)).abs()
    cosine = torch.cosine_similarity(at.gradient, normals).clamp(-1, 1)
    angle = torch.acos(cosine).mean().item() * 180 / math.pi
    print(f"distance error: mean {error.mean():.5f}, largest {error.max():.5f}; normals: {angle:.2f} degrees")


if __name__ == "__main__":
    main()
