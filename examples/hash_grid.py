"""Fits the signed distance of a torus with a hash grid and one hidden layer.

The normal comes from the grid's Jacobian, so the eikonal loss needs a single backward pass.
Prints the mean and the largest distance error, and the mean angle of the normals, near the surface.
"""

import math

import torch
from torch import nn

from splitnerf.ops import HashGrid, HashGridSpec

BOX = 1.2


def torus(x: torch.Tensor) -> torch.Tensor:
    """Signed distance to a torus of radii 0.7 and 0.3 about z."""
    ring = torch.hypot(x[:, 0], x[:, 1]) - 0.7
    return torch.hypot(ring, x[:, 2]) - 0.3


def main(steps: int = 300) -> None:
    torch.manual_seed(0)
    grid = HashGrid(HashGridSpec(n_levels=8, base_resolution=8, growth=1.4, log2_table_size=14))
    hidden, out = nn.Linear(3 + grid.spec.n_outputs, 32), nn.Linear(32, 1)
    parameters = [*grid.parameters(), *hidden.parameters(), *out.parameters()]
    optimiser = torch.optim.Adam(parameters, lr=5e-3)

    def field(x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Distance [n] and its gradient [n, 3]."""
        features, jacobian = grid.jacobian(x / (2 * BOX) + 0.5)
        pre = hidden(torch.cat([x, features], dim=1))
        slope = (torch.sigmoid(100 * pre) * out.weight) @ hidden.weight  # d distance / d input
        gradient = slope[:, :3] + (jacobian * slope[:, None, 3:]).sum(-1) / (2 * BOX)
        return out(nn.functional.softplus(pre, 100))[:, 0], gradient

    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = 5e-3 * 0.05 ** (step / steps)
        x = (torch.rand(2048, 3) * 2 - 1) * BOX
        distance, gradient = field(x)
        loss = (distance - torus(x)).abs().mean() + 0.01 * (gradient.norm(dim=1) - 1).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    x = ((torch.rand(100000, 3) * 2 - 1) * BOX).requires_grad_()
    near = x[torus(x).abs() < 0.05]
    (normals,) = torch.autograd.grad(torus(near).sum(), near)
    distance, gradient = field(near.detach())
    error = (distance - torus(near)).abs()
    cosine = nn.functional.cosine_similarity(gradient, normals).clamp(-1, 1)
    angle = torch.acos(cosine).mean().item() * 180 / math.pi
    print(f"distance error: mean {error.mean():.5f}, largest {error.max():.5f}; normals: {angle:.2f} degrees")


if __name__ == "__main__":
    main()
