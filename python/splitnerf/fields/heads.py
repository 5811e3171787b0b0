"""Small networks on top of the SDF's outputs: materials, and occlusion factors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from splitnerf.fields.occlusion import Occlusion


def relu_mlp(n_inputs: int, width: int, n_layers: int, n_outputs: int) -> nn.Sequential:
    """``n_layers`` hidden ReLU layers of ``width`` units and a linear output that starts near 0."""
    layers: list[nn.Module] = []
    for i in range(n_layers):
        layers += [nn.Linear(n_inputs if i == 0 else width, width), nn.ReLU(inplace=True)]
        nn.init.kaiming_uniform_(layers[-2].weight, nonlinearity="relu")
        nn.init.zeros_(layers[-2].bias)
    layers.append(nn.Linear(width, n_outputs))
    nn.init.normal_(layers[-1].weight, std=0.01)
    nn.init.zeros_(layers[-1].bias)
    return nn.Sequential(*layers)


class MaterialHead(nn.Module):
    """Predicts albedo (linear), roughness (perceptual) and metallic of a point, each in [0, 1] by a sigmoid.

    Roughness is rescaled to [``min_roughness``, 1]. The bias of metallic starts at -2, since most surfaces are not
    metal; this choice is ours, the paper does not give one.

    Source: SplitNeRF's material network; width and depth from its supplement.
    """

    def __init__(
        self,
        n_inputs: int,
        width: int = 256,
        n_layers: int = 2,
        initial_roughness: float = 0.5,
        min_roughness: float = 0.0,
    ):
        super().__init__()
        self.net = relu_mlp(n_inputs, width, n_layers, 5)
        self.min_roughness = min_roughness
        share = min(max((initial_roughness - min_roughness) / (1.0 - min_roughness), 1e-3), 1.0 - 1e-3)
        with torch.no_grad():
            self.net[-1].bias[3] = math.log(share / (1.0 - share))
            self.net[-1].bias[4] = -2.0

    def forward(self, *features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """features [n, columns], n_inputs columns together -> albedo [n, 3], roughness [n, 1], metallic [n, 1]."""
        albedo, roughness, metallic = torch.sigmoid(self.net(torch.cat(features, 1))).split([3, 1, 1], dim=1)
        return albedo, self.min_roughness + (1.0 - self.min_roughness) * roughness, metallic


class OcclusionHead(nn.Module):
    """Predicts the occlusion factors o_d and o_s of a point, 1 = open.

    With ``directional`` the specular factor also depends on the lobe's axis and width. Without it the head is the
    paper's, which depends on position alone. The output biases start at +2, mostly open; this choice is ours.

    Source: SplitNeRF Eq. (12)-(15).
    """

    def __init__(self, n_inputs: int, width: int, n_layers: int, n_channels: int, directional: bool):
        super().__init__()
        self.n_channels, self.directional = n_channels, directional
        self.net = relu_mlp(n_inputs + (10 if directional else 0), width, n_layers, 2 * n_channels)
        with torch.no_grad():
            self.net[-1].bias.fill_(2.0)

    def forward(self, features: Sequence[Tensor], lobe_dirs: Tensor, roughness: Tensor) -> Occlusion:
        """features [n, columns], n_inputs columns together -> factors [n, n_channels]. No gradient flows to the unit
        axes [n, 3] and the roughness [n, 1] of the lobes."""
        inputs = list(features)
        if self.directional:
            x, y, z = lobe_dirs.detach().unbind(-1)
            products = torch.stack([x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1, z * z * z], dim=-1)
            inputs += [lobe_dirs.detach(), products, roughness.detach()]
        out = torch.sigmoid(self.net(torch.cat(inputs, dim=-1)))
        return Occlusion(out[:, : self.n_channels], out[:, self.n_channels :])
